"""Compute E1 correlators and received power of a sky from samples that all satellites share.

Theory of operation
-------------------
**Correlators.** The recorder makes the samples around each epoch (`sky_samples`). The samples contain E1-B and E1-C of
all satellites, multipath, spoofing signals, jammers and noise, which pass one front end. The function `correlate` of
the processor correlates 0.1 s of samples with the E1-C code as BOC(1,1), as most receivers do. The replica begins at
the arrival of the chip that is sent at the epoch, plus the error of the code loop by noise, multipath and an attack. So
the correlator ξ has the same meaning as in `e1_taps`. The noise of the receiver has σ = 1 per dimension, and phases are
relative to the line of sight at the arrival of the chip that is sent at the epoch.

The satellites send CBOC(6,1,1/11). The output of a BOC(1,1) replica has √(10/11) of the signal's amplitude, a loss of
0.4 dB. All other components add noise to a correlator, as on E6. The model of the fidelity `correlators` is
`sky_e1_model`.

**Power.** The power is measured in W = 2 MHz around the carrier, or in the bandwidth of a narrower front end. The
average covers the stretch of about 10 ms in which a signal with the median travel time arrives. Without an attack the
power is 1 + Σ P(0) C/N0_i / W times the noise power in W. P(0) is the power of both components of a satellite within W,
divided by the power of one component.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Complex128, Float

from vestige.constants import E1_CARRIER_HZ, MEDIAN_TRAVEL_TIME_S, SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.e1_taps import INTEGRATION_S, POWER_BANDWIDTH_HZ, TAP_CHIPS, arriving
from vestige.receiver.correlators.sky_e1_model import folding_rate_hz, passed_components
from vestige.receiver.samples.e1_samples import e1c_replica
from vestige.receiver.snapshots.sky_samples import SkySamples
from vestige.records import Band, Handover
from vestige.sample_processor.correlator import correlate
from vestige.signals.definitions import E1C

# margin of samples in s on either side of the replica, for the taps and for a code that the Doppler makes longer
_MARGIN_S = 5e-6
_OFFSETS_M = np.array(TAP_CHIPS) / E1C.chip_rate_hz * SPEED_OF_LIGHT_MPS


class SkyE1(NamedTuple):
    """E1 of a sky in n epochs of m satellites: correlators, power and saturation."""

    taps: Complex128[np.ndarray, "n m n_taps"]  # ξ before the gain control; NaN if no correlation was requested
    rise_db: Float[np.ndarray, " n"]  # power over the power without attack, in dB
    saturated: Bool[np.ndarray, " n"]  # whether the front end clips


def sky_e1(sky: SkySamples, wanted: Bool[np.ndarray, "n m"], cn0_dbhz: Float[np.ndarray, "n m"]) -> SkyE1:
    """Return correlators and power of E1, which are computed epoch by epoch from shared stretches of samples.

    Parameters
    ----------
    sky
        The samples of E1.
    wanted
        Satellites that are correlated at each epoch.
    cn0_dbhz
        C/N0 of each component of the true signals without interference, in dBHz.
    """
    of, width_hz = sky.of, min(POWER_BANDWIDTH_HZ, sky.of.simulations[0].front_end.power_bandwidth_hz)
    taps = np.full((*of.shape, len(TAP_CHIPS)), np.nan + 0j)
    power, saturated = np.empty(of.n), np.empty(of.n, np.bool_)
    replicas = _replicas(sky)
    for row, sent_s in enumerate(of.truth[0].time_s.tolist()):
        power[row], saturated[row] = sky.power_near(sent_s + MEDIAN_TRAVEL_TIME_S, width_hz)
        for column in np.flatnonzero(wanted[row]).tolist():
            begin_s, cycles, doppler_hz, doppler_rate_hz_per_s = (float(values[row, column]) for values in replicas)
            handover = Handover(
                svid=of.svids[column],
                chips=e1c_replica(of.svids[column]),
                start_time=of.simulations[column].start + begin_s,
                doppler_hz=doppler_hz,
                doppler_rate_hz_per_s=doppler_rate_hz_per_s,
            )
            taps[row, column] = _correlated(sky, begin_s, handover) * np.exp(2j * np.pi * (cycles % 1.0))
    return SkyE1(taps=taps, rise_db=10 * np.log10(power / _nominal_power(sky, cn0_dbhz, width_hz)), saturated=saturated)


def _correlated(sky: SkySamples, begin_s: float, handover: Handover) -> Complex128[np.ndarray, " n_taps"]:
    """Return the correlators of a replica, in standard deviations of the noise per dimension.

    The replica begins at the time `begin_s` in s after the scenario's start.
    """
    front_end = sky.of.simulations[0].front_end
    batch = sky.between(begin_s - _MARGIN_S, begin_s + INTEGRATION_S + _MARGIN_S)
    bank = correlate(batch, handover, _OFFSETS_M)
    assert bank is not None  # noqa: S101  (the margin is ours)
    # behind a filter the noise has the power 1 in a narrower band, so the noise density is higher
    n_noise = batch.sample_rate_hz * bank.integration_s * front_end.power_bandwidth_hz / front_end.sample_rate_hz
    return bank.taps * (E1C.polarity * math.sqrt(2 * n_noise))


def _replicas(sky: SkySamples) -> tuple[Float[np.ndarray, "n m"], ...]:
    """Return start of the replica in s, carrier range of the line of sight in cycles, Doppler and Doppler rate."""
    found = []
    to_hz = -E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS
    for path, truth, multipath_m in zip(sky.paths, sky.of.truth, sky.of.e1_multipath_m.T, strict=True):
        # rows of the block's epochs in the longer truth around the block
        rows = np.searchsorted(path.truth.time_s, truth.time_s)
        settled = arriving(truth, multipath_m, with_rays=path.e1_multipath)
        direct_s = path.received_s(Band.E1)[rows]
        late_s = settled.settled_m / SPEED_OF_LIGHT_MPS
        clock_s = (path.clock_m(direct_s + late_s) - path.clock_m(direct_s)) / SPEED_OF_LIGHT_MPS
        begin_s = direct_s + late_s + clock_s
        found.append(
            (
                begin_s,
                -to_hz * (path.range_m(direct_s) - path.carrier_advance_m(Band.E1)[rows]),
                to_hz * path.rate_mps(begin_s) + settled.followed_hz,
                to_hz * path.acceleration_mps2(begin_s),
            )
        )
    return tuple(np.stack(values, axis=1) for values in zip(*found, strict=True))


def _nominal_power(sky: SkySamples, cn0_dbhz: Float[np.ndarray, "n m"], width_hz: float) -> Float[np.ndarray, " n"]:
    """Return the power without attack within a bandwidth around the carrier, divided by the noise in this bandwidth."""
    rate_hz = folding_rate_hz(sky.of.simulations[0].front_end)
    passed = passed_components(np.zeros(1), bandwidth_hz=width_hz, sample_rate_hz=rate_hz)
    return 1 + passed * np.sum(10 ** (cn0_dbhz / 10), axis=1) / width_hz
