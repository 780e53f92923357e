"""Simulate the E1 measurements of all satellites, epoch by epoch.

A pseudorange contains geometry and receiver clock, noise, multipath and the error of the loop under attack. Under a sky
the pseudorange also contains the atmosphere of the scenario and the residual of the ionosphere. The residual on E1 is
e/(γ − 1), where e is the residual of the ionospheric delay of E6 minus E1. Both bands contain e/(γ − 1), so this term
cancels in the range check.

The C/N0 is an estimate over a second (`cn0_estimate`). If the reflections also disturb E1, the C/N0 fades with the
reflections in the same second. C/N0, correlators and power are in single precision, as in stored results.

A satellite has no measurement if it is out of view, too weak for the loop, or being acquired.

Under a sky, pseudoranges are usable even if all have the same error of 0.6 million kilometres. From these pseudoranges
the fix finds a clock error of 2 s, which the clock monitor reports. On a single line of sight the signal is the
receiver's only clock, so the receiver's clock follows a pseudorange whose error exceeds 0.1 s times c.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Complex128, Float

from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.e1_loop import LOCK_DBHZ
from vestige.receiver.correlators.e1_taps import (
    TAP_CHIPS,
    band_power_rise_db,
    e1_signals,
    e1_taps,
    power_noise_db,
    power_with_rays,
    receiver_noise,
)
from vestige.receiver.correlators.sky_e1_model import (
    code_noise,
    folding_rate_hz,
    sky_power,
    sky_power_rise_db,
    strangers_hz,
)
from vestige.receiver.samples.e1_samples import sampled_e1_taps, sampled_power_rise_db
from vestige.receiver.simulation import CLOCK_FOLLOWS_S, Fidelity, Simulation
from vestige.receiver.snapshots.cn0_estimate import CN0_INTEGRATION_S, PROMPTS, estimated_cn0_dbhz
from vestige.receiver.snapshots.receiver_truth import ReceiverTruth
from vestige.receiver.snapshots.sky_e1 import sky_e1
from vestige.receiver.snapshots.sky_samples import SkySamples
from vestige.receiver.truth import TruthBlock
from vestige.records import Band
from vestige.records.snapshot_block import E1Block, FrontEndBlock
from vestige.signals.definitions import E1C

_LEAST_POWER = 1e-6  # lower limit of the power of a prompt correlator in a deep fade


def single(values: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return values rounded to single precision."""
    return values.astype(np.float32).astype(np.float64)


def tracked_cn0_dbhz(simulation: Simulation, truth: TruthBlock) -> Float[np.ndarray, " n"]:
    """Return the true C/N0 in dBHz of the signal that E1 tracks, with the noise of attacks included."""
    return simulation.cn0_e1_dbhz + 10 * np.log10(truth.e1.gain) + 20 * np.log10(truth.geometry.amplitude)


def clock_follows_m(simulation: Simulation, truth: TruthBlock) -> Float[np.ndarray, " n"]:
    """Return the shift of the receiver's clock by an attacker in m, which also shifts every time tag.

    Under a sky the shift is 0.
    """
    return simulation.seconds_late_m(truth) if simulation.elevation is None else np.zeros(truth.time_s.size)


def _clock_error_m(simulation: Simulation, truth: TruthBlock) -> Float[np.ndarray, " n"]:
    """Return the constant error of the receiver's clock minus the shift by an attacker, in m."""
    return simulation.clock_offset_m - clock_follows_m(simulation, truth)


def is_tracked(simulation: Simulation, truth: TruthBlock) -> Bool[np.ndarray, " n"]:
    """Return whether E1 has measurements.

    E1 measures a satellite that is in view, is not being acquired, and has a C/N0 above `LOCK_DBHZ`.
    """
    return truth.geometry.in_view & ~truth.e1.acquiring & (tracked_cn0_dbhz(simulation, truth) > LOCK_DBHZ)


def e1_block(of: ReceiverTruth, *, fidelity: Fidelity, with_taps: bool) -> tuple[E1Block, FrontEndBlock | None]:
    """Return the data of E1 tracking, and the data of the E1 front end, which are None without correlators.

    If `with_taps` is true, E1 is tracked between two RECS, and the data include correlators.
    """
    shown = np.stack([is_tracked(*one) for one in zip(of.simulations, of.truth, strict=True)], axis=1)
    taps, front_end = _taps_and_power(of, fidelity, shown) if with_taps else (None, None)
    to_hz = -E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS

    cn0_dbhz = [
        reported_cn0_dbhz(simulation, truth, multipath_m, first=of.first)
        for simulation, truth, multipath_m in zip(of.simulations, of.truth, of.e1_multipath_m.T, strict=True)
    ]

    def seen(values: Float[np.ndarray, "n m"]) -> Float[np.ndarray, "n m"]:
        return np.where(shown, values, np.nan)

    return E1Block(
        pseudorange_m=seen(pseudorange_m(of)),
        carrier_phase_cycles=seen(-to_hz * of.each(_carrier_m)),
        doppler_hz=seen(to_hz * of.each(range_rate_mps)),
        doppler_rate_hz_per_s=seen(to_hz * of.each(range_acceleration_mps2)),
        cn0_dbhz=seen(single(np.stack(cn0_dbhz, axis=1))),
        taps=None
        if taps is None
        else np.where(shown[..., None], taps.astype(np.complex64), np.nan).astype(np.complex128),
        tap_chips=() if taps is None else TAP_CHIPS,
    ), front_end


def pseudorange_m(of: ReceiverTruth) -> Float[np.ndarray, "n m"]:
    """Return the E1 pseudoranges in m."""
    error_m = of.e1_error_m + of.each(_clock_error_m)
    return (
        of.each(lambda _, truth: truth.range_m + truth.clock_m)
        + of.each(lambda _, truth: truth.ionosphere_m(Band.E1))
        + error_m
    )


def _carrier_m(simulation: Simulation, truth: TruthBlock) -> Float[np.ndarray, " n"]:
    error_m = truth.e1.error_m + _clock_error_m(simulation, truth) + truth.e1_phase_noise_m
    return truth.range_m + truth.clock_m - truth.carrier_advance_m(Band.E1) + error_m


def range_rate_mps(simulation: Simulation, truth: TruthBlock) -> Float[np.ndarray, " n"]:  # noqa: ARG001  (as the others)
    """Return the range rate that follows from the E1 Doppler, in m/s."""
    return truth.rate_mps + truth.clock_drift_mps + truth.e1_rate_noise_mps + truth.e1.rate_error_mps


def range_acceleration_mps2(simulation: Simulation, truth: TruthBlock) -> Float[np.ndarray, " n"]:
    """Return the range acceleration that follows from the Doppler rate of the tracked E1 signal, in m/s²."""
    later_s = np.where(truth.e1.captured, simulation.repeated_later_m(truth), 0.0) / SPEED_OF_LIGHT_MPS
    rows = np.flatnonzero(np.abs(later_s) > CLOCK_FOLLOWS_S)
    if simulation.elevation is None or not rows.size:
        return truth.acceleration_mps2
    found_mps2 = truth.acceleration_mps2.copy()
    sent_s = truth.time_s[rows] - simulation.clock_offset_s - later_s[rows]
    found_mps2[rows] = simulation.elevation.path.acceleration_mps2(sent_s)
    return found_mps2


def reported_cn0_dbhz(
    simulation: Simulation, truth: TruthBlock, multipath_m: Float[np.ndarray, " n"], *, first: int
) -> Float[np.ndarray, " n"]:
    """Return the C/N0 in dBHz that E1 tracking estimates over the second of each epoch, with any fading by reflections.

    Parameters
    ----------
    simulation, truth, multipath_m
        Simulation and truth of the satellite, and the pseudorange error in m that reflections cause.
    first
        Number of the first epoch.
    """
    cn0_dbhz = tracked_cn0_dbhz(simulation, truth)
    if simulation.models.e1_multipath:
        power = power_with_rays(truth, multipath_m, averaging_s=PROMPTS * CN0_INTEGRATION_S)
        cn0_dbhz = cn0_dbhz + 10 * np.log10(np.maximum(power, _LEAST_POWER) / truth.e1.gain)
    return estimated_cn0_dbhz(cn0_dbhz, seed=simulation.seed, svid=simulation.svid, first=first)


def _taps_and_power(
    of: ReceiverTruth, fidelity: Fidelity, shown: Bool[np.ndarray, "n m"]
) -> tuple[Complex128[np.ndarray, "n m n_taps"], FrontEndBlock]:
    """Return correlators behind the gain control, and the power and gain of the front end."""
    nominal_dbhz = of.each(lambda simulation, truth: simulation.cn0_e1_dbhz + 20 * np.log10(truth.geometry.amplitude))
    saturated = np.zeros(of.n, np.bool_)
    if of.simulations[0].elevation is None:
        taps, rise_db, read_db = _each_alone(of, fidelity, nominal_dbhz)
    elif fidelity == "samples":
        taps, rise_db, saturated = sky_e1(SkySamples(of=of, band=Band.E1), shown, nominal_dbhz)
        read_db = rise_db
    else:
        taps, rise_db = _drawn_sky(of, nominal_dbhz)
        read_db = rise_db + power_noise_db(of.seed, of.first, of.n)
    read_db = single(read_db)
    front_end = FrontEndBlock(agc_gain_db=-read_db, total_power_db=read_db, saturated=saturated)
    return taps * 10 ** (-rise_db / 20)[:, None, None], front_end


def _each_alone(
    of: ReceiverTruth, fidelity: Fidelity, nominal_dbhz: Float[np.ndarray, "n m"]
) -> tuple[Complex128[np.ndarray, "n m n_taps"], Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return correlators of a single line of sight before the gain control, drawn at random or made from samples.

    The second result is the ratio in dB of the band's power to the power without an attack. The third result is the
    receiver's measurement of this ratio in dB.
    """
    received_dbhz = np.where(of.in_view, nominal_dbhz, np.nan)
    if fidelity == "samples":
        rise_db = read_db = sampled_power_rise_db(of.truth, received_dbhz, of.svids, seed=of.seed, first=of.first)
    else:
        rise_db = band_power_rise_db(of.truth, received_dbhz)
        read_db = rise_db + power_noise_db(of.seed, of.first, rise_db.size)
    taps = [
        (sampled_e1_taps if fidelity == "samples" else e1_taps)(
            truth,
            nominal_dbhz[:, column],
            of.e1_multipath_m[:, column],
            with_rays=simulation.models.e1_multipath,
            seed=of.seed,
            svid=simulation.svid,
            first=of.first,
        )
        for column, (simulation, truth) in enumerate(zip(of.simulations, of.truth, strict=True))
    ]
    return np.stack(taps, axis=1), rise_db, read_db


def _drawn_sky(
    of: ReceiverTruth, nominal_dbhz: Float[np.ndarray, "n m"]
) -> tuple[Complex128[np.ndarray, "n m n_taps"], Float[np.ndarray, " n"]]:
    """Return drawn correlators of a sky before the gain control, and the rise of the received power.

    The rise is the ratio in dB of the power to the power without an attack.
    """
    with_rays, rate_hz = of.simulations[0].models.e1_multipath, folding_rate_hz(of.simulations[0].front_end)
    received_dbhz = np.where(of.in_view, nominal_dbhz, np.nan)
    relative_power = of.each(lambda _, truth: sky_power(truth, with_rays=with_rays, sample_rate_hz=rate_hz))
    strangers = strangers_hz(of.truth, received_dbhz, of.e1_multipath_m, relative_power, with_rays=with_rays)
    taps = []
    for column, (simulation, truth) in enumerate(zip(of.simulations, of.truth, strict=True)):
        signals = e1_signals(
            truth, nominal_dbhz[:, column], of.e1_multipath_m[:, column], with_rays=with_rays, pulse=E1C.pulse
        )
        drawn = {"seed": of.seed, "svid": simulation.svid, "first": of.first}
        noise = receiver_noise(truth, **drawn) + code_noise(
            signals, strangers[:, column], sample_rate_hz=rate_hz, **drawn
        )
        taps.append(signals + noise)
    rise_db = sky_power_rise_db(of.truth, received_dbhz, relative_power, sample_rate_hz=rate_hz)
    return np.stack(taps, axis=1), rise_db
