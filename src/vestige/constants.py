"""Define physical constants, units of time, and constants of the Galileo system."""

from __future__ import annotations

SPEED_OF_LIGHT_MPS = 299_792_458.0  # exact by the definition of the SI
FUNDAMENTAL_FREQUENCY_HZ = 10.23e6  # reference frequency f0 of Galileo [OS-ICD, 2.1]
E1_CARRIER_HZ = 154 * FUNDAMENTAL_FREQUENCY_HZ  # [OS-ICD, 2.1]
E6_CARRIER_HZ = 125 * FUNDAMENTAL_FREQUENCY_HZ  # [E6-CODES]

GAMMA_E1_E6 = (154 / 125) ** 2  # (f1/f6)^2 = 1.517824 exactly: ratio of the ionospheric delays on E6 and E1

SECONDS_PER_WEEK = 604_800
DAY_S = 86_400
HOUR_S = 3_600
SUBFRAME_S = 30  # duration of an I/NAV subframe, equal to the OSNMA key interval [OSNMA-ICD]
SYMBOLS_PER_S = 250  # number of E1-B symbols in a second; a symbol is as long as a code period [OS-ICD, 4.3.2]
PAGES_A_SUBFRAME = 15  # number of I/NAV pages of 2 s in a subframe [OS-ICD, 4.3]
E1_CODE_PERIOD_S = 4e-3  # duration of 4092 chips at 1.023 Mcps [OS-ICD, 2.3.3]
SECONDARY_PERIOD_S = 0.1  # duration of the 25 code periods in a secondary code of E1-C [OS-ICD, 2.3.3]
MAX_SVID = 36  # Galileo space vehicle identifiers run from 1 to 36 [OS-ICD, 5.1.9.1]
# For an orbit radius of 29,600 km the travel time is 77.5 ms at the zenith and 95 ms at 5° elevation.
MEDIAN_TRAVEL_TIME_S = 0.086
# power of E6 B+C over power of E1 B+C at minimum received power [OS-ICD, Table 12]; half of each power is in the pilot
NOMINAL_E6_OVER_E1_DB = 2.0
