"""Define the settings of E1 tracking, with the usual names and values of the field."""

from __future__ import annotations

import math
from dataclasses import dataclass

from vestige.errors import VestigeError

PERIODS_PER_SECONDARY = 25  # number of code periods of E1-C in a period of its secondary code [OS-ICD, 3.5]
REPLICAS = ("BOC(1,1)", "CBOC")
PLL_DISCRIMINATORS = ("normalized quadrature", "arctan2", "arctan")
DLL_DISCRIMINATORS = ("early-minus-late power", "dot product")


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingSettings:
    """Loop bandwidths, integration time, correlators and thresholds of every E1 channel.

    Attributes
    ----------
    pll_bandwidth_hz
        One-sided noise bandwidth of the phase-locked loop in Hz.
    pll_order
        Order of the phase-locked loop, 2 or 3. In the steady state, a loop of order 3 follows a constant acceleration
        without a phase error.
    fll_bandwidth_hz
        Initial noise bandwidth in Hz of the frequency-locked loop for the pull-in of the carrier. The bandwidth
        decreases during the pull-in.
    dll_bandwidth_hz
        One-sided noise bandwidth of the delay-locked loop in Hz. The carrier aids this loop, so the loop only follows
        differences between code and carrier: ionosphere, multipath, noise.
    pll_discriminator
        Measure of the phase error, from the in-phase part I and the quadrature part Q of the prompt. `normalized
        quadrature` is Q/A with the smoothed amplitude A, linear in the noise up to a limit of a quarter of a cycle.
        `arctan2` is the angle of the prompt, linear up to half a cycle. `arctan` is arctan(Q/I), which ignores a phase
        error of half a cycle.
    dll_discriminator
        Measure of the code error, from the early, prompt and late correlators. `early-minus-late power` is |L|² − |E|².
        `dot product` is Re((L − E) P*), which is less noisy than `early-minus-late power` because the prompt is
        stronger.
    integration_periods
        Number of code periods of 4 ms that are added coherently before the loops are updated, 1 or 5.
    early_late_chips
        Requested distance from the early to the late correlator in chips. The distance of a correlator from the prompt
        is a whole number of samples, so the nearest possible distance is used.
    n_correlators
        Number of correlators in the bank, 5 to 11 and odd. The correlators are spaced around the prompt by half of the
        early-late distance.
    replica
        Replica of the correlators: `BOC(1,1)` for narrow front ends, or `CBOC` (with BOC(6,1)) for front ends wider
        than 14 MHz.
    pull_in_s
        Time in s for which the frequency-locked loop runs before the phase-locked loop starts.
    min_cn0_dbhz, min_phase_lock
        Lower limits of C/N0 in dBHz and of the phase lock. The phase lock is the mean of cos 2φ over about 0.3 s, with
        the phase error φ. A channel that stays below at least one of the two limits for longer than `patience_s` is
        lost.
    slip_phase_lock
        Limit of the phase lock over 100 ms and of its mean over about 0.3 s, below which a channel gives no
        observations. The first carrier phase after a lower value is flagged as slipped.
    """

    pll_bandwidth_hz: float = 15.0
    pll_order: int = 3
    fll_bandwidth_hz: float = 10.0
    dll_bandwidth_hz: float = 1.0
    pll_discriminator: str = "normalized quadrature"
    dll_discriminator: str = "early-minus-late power"
    integration_periods: int = 1
    early_late_chips: float = 0.16
    n_correlators: int = 5
    replica: str = "BOC(1,1)"
    pull_in_s: float = 0.2
    min_cn0_dbhz: float = 24.0
    min_phase_lock: float = 0.2
    patience_s: float = 0.5
    slip_phase_lock: float = 0.5

    def __post_init__(self) -> None:
        for name in ("pll_bandwidth_hz", "fll_bandwidth_hz", "dll_bandwidth_hz", "early_late_chips", "pull_in_s"):
            value = getattr(self, name)
            if not (value > 0 and math.isfinite(value)):
                raise VestigeError(f"tracking: {name} = {value}, expected a positive number")
        for name, allowed in (
            ("pll_order", (2, 3)),
            ("integration_periods", (1, 5)),
            ("n_correlators", (5, 7, 9, 11)),
            ("replica", REPLICAS),
            ("pll_discriminator", PLL_DISCRIMINATORS),
            ("dll_discriminator", DLL_DISCRIMINATORS),
        ):
            if getattr(self, name) not in allowed:
                expected = ", ".join(str(one) for one in allowed)
                raise VestigeError(f"tracking: {name} = {getattr(self, name)}, expected one of {expected}")
