"""Check a campaign for combinations of values that the simulation cannot represent."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vestige.constants import SPEED_OF_LIGHT_MPS, SUBFRAME_S
from vestige.receiver.errors.clock import TwoStateClock
from vestige.receiver.errors.error_process import ClockModel
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.front_end.front_end_correlation import LARGEST_SIGNAL_DB
from vestige.receiver.simulation import KEY_ON_AIR
from vestige.records import Band
from vestige.scenario.toml.toml_file import InconsistentSettingsError
from vestige.signal_generator.range_model import RangeModel
from vestige.signals.definitions import E1C, E6C
from vestige.spoofer.after_disclosure import ForgeryAfterDisclosure
from vestige.spoofer.attack import Attack
from vestige.spoofer.profiles import extremes
from vestige.spoofer.spoofer import Spoofer

MAX_EPOCHS = 100_000_000  # largest number of epochs of a campaign
# longest run in s by fidelity, which is 333,333 subframes for `samples`, and 32 years for `correlators`
LONGEST_S = {"samples": 1e7, "correlators": 1e9}
_LONGEST_DELAY_S = 0.4  # longest travel time in s, less than the 0.5 s within which a snapshot is matched with a RECS
LARGEST_CLOCK_ERROR_S = 1e6  # largest clock error in s for `correlators`; an oscillator drifts less in 32 years
# largest range rate in m/s, acceleration in m/s² and angular rate in rad/s that the compiled kernels permit
_LARGEST_RATE_MPS, _LARGEST_ACCELERATION_MPS2, _LARGEST_OMEGA_RADPS = 1e4, 1e3, 100.0
_SIGMAS = 6.0
# The narrowest two-sided band on E1 contains both main lobes of BOC(1,1). The narrowest two-sided band on E6 contains
# the middle half of the main lobe of BPSK(5), which has 77 % of the signal's power.
_NARROWEST_HZ = {E1C.name: 4 * E1C.chip_rate_hz, E6C.name: E6C.chip_rate_hz}
_WAY_S = 0.2  # margin in s for the travel time of a signal and the clock error


def check_length(fidelity: str, duration_s: float) -> None:
    """Raise `InconsistentSettingsError` if a run is longer than its fidelity permits."""
    if duration_s > LONGEST_S[fidelity]:
        raise InconsistentSettingsError(
            "epochs", f"{duration_s:g} s with this interval_s", f"at most {LONGEST_S[fidelity]:g} s ({fidelity})"
        )


def check_motion(model: RangeModel, duration_s: float) -> None:
    """Raise `InconsistentSettingsError` if the range is too long or changes too fast for a simulation of samples."""
    v_mps, a_mps2, swing_m = abs(model.v_mps), abs(model.a_mps2), abs(model.amplitude_m)
    swing_mps = swing_m * abs(model.omega_radps)
    range_m = abs(model.s0_m) + v_mps * duration_s + a_mps2 * duration_s**2 / 2 + swing_m
    values = {
        "range in m": (range_m, _LONGEST_DELAY_S * SPEED_OF_LIGHT_MPS),
        "rate in m/s": (v_mps + a_mps2 * duration_s + swing_mps, _LARGEST_RATE_MPS),
        "acceleration in m/s²": (a_mps2 + swing_mps * abs(model.omega_radps), _LARGEST_ACCELERATION_MPS2),
        "omega_radps": (abs(model.omega_radps), _LARGEST_OMEGA_RADPS),
    }
    for name, (value, limit) in values.items():
        if value > limit:
            raise InconsistentSettingsError(
                "line_of_sight", f"{name} of {value:.4g} within the run", f"at most {limit:.4g}"
            )


def check_clock(clock: ClockModel | None, duration_s: float, largest_error_s: float = _LONGEST_DELAY_S) -> None:
    """Raise `InconsistentSettingsError` if the error of a free-running clock may exceed `largest_error_s`.

    The default limit is 0.4 s, because samples are matched with a RECS only within 0.5 s. On a single line of sight the
    limit of the fidelity `correlators` is `LARGEST_CLOCK_ERROR_S`, because there are no samples. A clock model that the
    user wrote is not checked.
    """
    if not isinstance(clock, TwoStateClock):
        return
    sigma_s = math.sqrt(clock.covariance(duration_s)[0, 0])
    if _SIGMAS * sigma_s > largest_error_s:
        raise InconsistentSettingsError(
            "receiver.clock",
            f"an error of {sigma_s:.3g} s (1σ) at the end of the run",
            f"at most {largest_error_s / _SIGMAS:.3g} s; a shorter run or a better clock",
        )


def check_jammers(input_rate_hz: float, attacks: Sequence[Attack]) -> None:
    """Raise `InconsistentSettingsError` if a jammer would cause aliasing in the E6 front end.

    A jammer causes aliasing if its largest distance from the carrier exceeds half the front end's input rate.
    """
    for number, attack in enumerate(attacks):
        jamming = attack.jamming(Band.E6, np.zeros(1))
        if jamming is not None and jamming.waveform.reach_hz > input_rate_hz / 2:
            raise InconsistentSettingsError(
                f"attack.{number}.waveform",
                f"{jamming.waveform.reach_hz / 1e6:g} MHz from the carrier of E6",
                f"at most {input_rate_hz / 2e6:g} MHz, half the rate of the samples",
            )


def check_recorded_band(front_end: FrontEnd) -> None:
    """Raise `InconsistentSettingsError` if sampling rate or filter bandwidth is too low for the recorded signals."""
    name, narrowest_hz = max(_NARROWEST_HZ.items(), key=lambda item: item[1])
    for place, found_hz in (
        ("receiver.sample_rate_hz", front_end.sample_rate_hz),
        ("receiver.front_end.bandwidth_hz", front_end.bandwidth_hz),
    ):
        if found_hz is not None and found_hz < narrowest_hz:
            raise InconsistentSettingsError(
                place, f"{found_hz / 1e6:g} MHz", f"at least {narrowest_hz / 1e6:g} MHz, the band of {name}"
            )


def check_attacks(front_end: FrontEnd, spoofer: Spoofer) -> None:
    """Raise `InconsistentSettingsError` if `correlators` cannot simulate the effect of the front end on an attack."""
    if not spoofer.attacks or front_end.transparent:
        return
    samples = 'fidelity = "samples", which simulates both'
    if front_end.bits is not None:
        raise InconsistentSettingsError("receiver.front_end.bits", f"{front_end.bits} under attack", samples)
    if spoofer.effects(Band.E6, 0, np.zeros(1)).jammers:
        raise InconsistentSettingsError("receiver.front_end", "a filter before a jamming waveform", samples)


def check_weak_signal(front_end: FrontEnd, cn0_dbhz: float) -> None:
    """Raise `InconsistentSettingsError` if a quantised signal is too strong for the fidelity `correlators`."""
    largest_dbhz = 10 * math.log10(front_end.sample_rate_hz) + LARGEST_SIGNAL_DB
    if front_end.bits is not None and cn0_dbhz > largest_dbhz:
        raise InconsistentSettingsError(
            "receiver.cn0_dbhz",
            cn0_dbhz,
            f'at most {largest_dbhz:.1f} dBHz behind a quantiser; fidelity = "samples" has no such limit',
        )


def check_no_clock_offset(clock_offset_s: float) -> None:
    """Raise `InconsistentSettingsError` for a constant clock error, which a simulation of samples does not support."""
    if clock_offset_s:
        raise InconsistentSettingsError(
            "receiver.clock_offset_s", f"{clock_offset_s:g} with samples", '0, or fidelity = "correlators"'
        )


def check_disclosed(attacks: Sequence[Attack], sent_s: Sequence[float], key_delay: int) -> None:
    """Raise `InconsistentSettingsError` if a forger would send the chips of a RECS before its key is complete.

    `sent_s` has the times of transmission of the RECS in s after the start of a week. `key_delay` is the KDI.
    """
    known_s = max(key_delay * SUBFRAME_S + KEY_ON_AIR.disclosure_end_s - one % SUBFRAME_S for one in sent_s)
    for number, attack in enumerate(attacks):
        if isinstance(attack, ForgeryAfterDisclosure) and attack.delay_s < known_s:
            raise InconsistentSettingsError(
                f"attack.{number}.delay_s",
                f"{attack.delay_s:g} s",
                f"at least {known_s:g} s: the key of a RECS is complete then, and nobody can make its chips before",
            )


def longest_delay_s(attacks: Sequence[Attack]) -> float:
    """Return the longest delay in s of any spoofing signal, plus a margin; 0 without attacks.

    The margin is for the travel time of the signal and the clock error.
    """
    delays_s = [
        getattr(attack, "delay_s", 0.0) + extremes(getattr(attack, "range_offset_m", 0.0))[1] / SPEED_OF_LIGHT_MPS
        for attack in attacks
    ]
    delays_s += [
        (extremes(attack.delay_m)[1] + getattr(attack, "e6_lag_m", 0.0)) / SPEED_OF_LIGHT_MPS
        for attack in attacks
        if hasattr(attack, "delay_m")
    ]
    return max(delays_s, default=-_WAY_S) + _WAY_S
