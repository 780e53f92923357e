"""Hand over from E1 to E6: predict time and Doppler of the encrypted chips in the E6 samples [WFO, Sec. II-B].

The E1 pseudorange contains all delays common to both bands (geometry, clocks, troposphere). With the convention of
[OS-ICD] for group delays, the remaining difference is

    P6 − P1 = (γ − 1)(I1 + c·BGD(E1,E6)) + (HW6 − HW1)        γ = (f1/f6)²; positive if E6 is later
    f_d6    = f_d1 · f6/f1                                     f6/f1 = 125/154

P is a pseudorange, f is a carrier frequency, f_d is a Doppler, and HW is the delay of a front end in m. I1 is the
ionospheric delay on E1. The time t_tx of a RECS is a time of transmission on the satellite's clock, so the satellite
clock needs no correction. The expected time of reception t solves t = t_tx + P6(t)/c. The pseudorange at Δt after the
observation is P1(t) = P1 − λ1 (f_d1 Δt + ½ ḟ_d1 Δt²), with the wavelength λ1 and the Doppler rate ḟ_d1 of E1.

One oscillator drives both front ends, so the carrier phase of E6 follows the phase of E1 apart from the ionosphere and
a constant. The carrier phase φ1 of E1 is in cycles and grows with the range. The E6 correlator has the phase

    −2π (f6/f1) (φ1 − f_d1 Δt − ½ ḟ_d1 Δt²) + constant + slow change of the ionosphere
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from vestige.constants import (
    E1_CARRIER_HZ,
    E6_CARRIER_HZ,
    GAMMA_E1_E6,
    SPEED_OF_LIGHT_MPS,
)
from vestige.crypto.recs.group_delay import OS_ICD_CONVENTION, GroupDelayConvention, inter_frequency_delay_s
from vestige.records import ChipSequence, E1Observation, Handover
from vestige.records.recs_block import Corrections
from vestige.records.snapshot_block import E1Block
from vestige.time import GalileoTime
from vestige.valid_numbers import require_finite

_LIGHT_TIME_STEPS = 4  # the range rate is below 1 km/s, so each step of the iteration adds five exact decimal digits


def predicted_delay_m(
    *,
    ionosphere_e1_m: float = 0.0,
    bgd_e1_e6_s: float = 0.0,
    hardware_bias_e1_e6_s: float = 0.0,
    convention: GroupDelayConvention = OS_ICD_CONVENTION,
) -> float:
    """Return P6 − P1 in m; the result is positive if E6 arrives later.

    `ionosphere_e1_m` is the slant delay on E1. `hardware_bias_e1_e6_s` is the receiver's delay of E6 minus the
    receiver's delay of E1. `vestige.crypto.recs.group_delay` explains the conventions.
    """
    group_s = inter_frequency_delay_s(bgd_e1_e6_s, convention)
    return (GAMMA_E1_E6 - 1) * ionosphere_e1_m + SPEED_OF_LIGHT_MPS * (group_s + hardware_bias_e1_e6_s)


def assisted_delay_m(
    assistance: Corrections, svid: int, time: GalileoTime, convention: GroupDelayConvention = OS_ICD_CONVENTION
) -> float:
    """Return P6 − P1 of a satellite in m from the assistance; missing terms count as 0."""
    valid = [delay for delay in assistance.group_delays if delay.svid == svid and delay.valid_from <= time]
    delay_m = predicted_delay_m(
        ionosphere_e1_m=assistance.ionosphere_e1_m.get(svid, 0.0),
        bgd_e1_e6_s=max(valid, key=lambda delay: delay.valid_from).bgd_e1_e6_s if valid else 0.0,
        hardware_bias_e1_e6_s=assistance.hardware_bias_e1_e6_s,
        convention=convention,
    )
    require_finite(f"assistance of E{svid:02d}", delay_m=delay_m)
    return delay_m


def hand_over(
    observation: E1Observation, observed_at: GalileoTime, chips: ChipSequence, *, delay_m: float = 0.0
) -> Handover:
    """Return the expected time and Doppler of the chips in the E6 samples.

    The observation refers to the receiver-clock time `observed_at`; `delay_m` is P6 − P1 from `predicted_delay_m`.
    """
    wavelength_m = SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ
    since_transmission_s = observed_at - chips.transmit_time
    dt = 0.0
    for _ in range(_LIGHT_TIME_STEPS):
        change_m = wavelength_m * (observation.doppler_hz * dt + 0.5 * observation.doppler_rate_hz_per_s * dt**2)
        pseudorange_m = observation.pseudorange_m - change_m + delay_m
        dt = pseudorange_m / SPEED_OF_LIGHT_MPS - since_transmission_s
    scale = E6_CARRIER_HZ / E1_CARRIER_HZ
    return Handover(
        svid=observation.svid,
        chips=chips,
        start_time=observed_at + dt,
        doppler_hz=scale * (observation.doppler_hz + observation.doppler_rate_hz_per_s * dt),
        doppler_rate_hz_per_s=scale * observation.doppler_rate_hz_per_s,
    )


def reception_s(e1: E1Block) -> Float[np.ndarray, "n m"]:
    """Return the reception time of a RECS that is sent at the time of the snapshot, in s after the snapshot."""
    wavelength_m = SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ
    dt = np.zeros(e1.pseudorange_m.shape)
    for _ in range(_LIGHT_TIME_STEPS):
        change_m = wavelength_m * (e1.doppler_hz * dt + 0.5 * e1.doppler_rate_hz_per_s * dt**2)
        dt = (e1.pseudorange_m - change_m) / SPEED_OF_LIGHT_MPS
    return dt


def predicted_phase_rad(e1: E1Block, after_s: Float[np.ndarray, "n m"]) -> Float[np.ndarray, "n m"]:
    """Return the phase of the E6 correlators that the E1 carrier phase predicts, up to a constant, from −π to π.

    `after_s` is the start of the RECS in s after the snapshot. The result is NaN where E1 has no carrier phase.
    """
    cycles = e1.carrier_phase_cycles - (e1.doppler_hz * after_s + 0.5 * e1.doppler_rate_hz_per_s * after_s**2)
    cycles = cycles * (E6_CARRIER_HZ / E1_CARRIER_HZ)
    return -2 * np.pi * (cycles - np.round(cycles))
