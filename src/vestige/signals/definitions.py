"""Define the four Galileo signal components that vestige uses.

| signal | carrier | chips/s | primary code | secondary code | symbols/s |
|---|---|---|---|---|---|
| E1-B | 154 f0 | 1.023 M | 4092 chips, 4 ms | none | 250 (I/NAV, carries OSNMA) |
| E1-C | 154 f0 | 1.023 M | 4092 chips, 4 ms | CS25_1, 100 ms | pilot |
| E6-B | 125 f0 | 5.115 M | 5115 chips, 1 ms | none | 1000 (C/NAV, HAS) |
| E6-C | 125 f0 | 5.115 M | 5115 chips, 1 ms | CS100_svid, 100 ms | pilot; encrypted under ACAS |

The fundamental frequency f0 is 10.23 MHz. A period of every primary and secondary code begins at each whole second of
GST. Let e_B and e_C be the components B and C of a band. A satellite sends (e_B − e_C)/√2, so the pilot e_C has a minus
sign (`SignalDefinition.polarity`). Sources: [OS-ICD, 2.3], [E6-CODES].

The table leaves out E1-A and E6-A, whose codes are not public, and E5, which is not part of ACAS.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, FUNDAMENTAL_FREQUENCY_HZ
from vestige.records import Band
from vestige.signals.pulse import BPSK, CBOC_MINUS, CBOC_PLUS, Pulse


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalDefinition:
    """Definition of one signal component.

    Attributes
    ----------
    name
        Name in the ICD, such as `E6-C`.
    code_length
        Number of chips of the primary code.
    secondary_length
        Number of chips of the secondary code, each as long as a period of the primary code; 1 without secondary code.
    symbol_rate_hz
        Number of navigation symbols per second; 0 for a pilot.
    """

    name: str
    band: Band
    carrier_hz: float
    chip_rate_hz: float
    code_length: int
    secondary_length: int
    symbol_rate_hz: float
    pulse: Pulse

    @property
    def period_s(self) -> float:
        """Duration of one period of the primary code in s."""
        return self.code_length / self.chip_rate_hz

    @property
    def polarity(self) -> int:
        """Sign with which a satellite adds the component to its band: −1 for a pilot [OS-ICD, 2.3.3].

        A receiver does not need the sign. The receiver measures the phase of a pilot, and the synchronisation pattern
        gives the sign of a message.
        """
        return 1 if self.symbol_rate_hz else -1


# E1-B adds the BOC(6,1) part, and E1-C subtracts the BOC(6,1) part [OS-ICD, 2.3.3].
E1B = SignalDefinition(
    name="E1-B",
    band=Band.E1,
    carrier_hz=E1_CARRIER_HZ,
    chip_rate_hz=FUNDAMENTAL_FREQUENCY_HZ / 10,  # [OS-ICD, 2.3.3]
    code_length=4092,
    secondary_length=1,
    symbol_rate_hz=250.0,
    pulse=CBOC_PLUS,
)
E1C = replace(E1B, name="E1-C", secondary_length=25, symbol_rate_hz=0.0, pulse=CBOC_MINUS)
E6B = SignalDefinition(
    name="E6-B",
    band=Band.E6,
    carrier_hz=E6_CARRIER_HZ,
    chip_rate_hz=FUNDAMENTAL_FREQUENCY_HZ / 2,  # [E6-CODES]
    code_length=5115,
    secondary_length=1,
    symbol_rate_hz=1000.0,
    pulse=BPSK,
)
E6C = replace(E6B, name="E6-C", secondary_length=100, symbol_rate_hz=0.0)

ALL_SIGNALS = (E1B, E1C, E6B, E6C)
CARRIER_HZ = {Band.E1: E1_CARRIER_HZ, Band.E6: E6_CARRIER_HZ}
