"""E1 correlators and received power of a sky, out of the samples that all its satellites share.

Theory of operation
-------------------
**Correlators.** The recorder makes the samples around each epoch (`sky_samples`): E1-B and E1-C of all satellites,
multipath, spoofing signals, jammers and noise, behind one front end. The correlator of the processor takes 0.1 s of
them with the E1-C code as BOC(1,1), as most receivers do. The replica begins where the code loop has settled: at the
arrival of the chip that is sent at the epoch, and later by what noise, multipath and an attack make of the loop. So ξ
has the meaning that it has in `e1_taps`: noise of the receiver has σ = 1 per dimension, and phases are relative to that
of the line of sight when it brings that chip.

A signal on air is not the ideal one of `e1_taps`. It is CBOC(6,1,1/11), of which BOC(1,1) correlates √(10/11), 0.4 dB
less. All other components add their noise, as on E6.

**Power.** It is measured in W = 2 MHz about the carrier over the 10 ms that hold the arrival at the epoch. Without an
attack it is 1 + Σ 2 p C/N0_i / W times the noise, where each of two components has the part p of its power within W.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Bool, Complex128, Float

from vestige.constants import E1_CARRIER_HZ, MEDIAN_TRAVEL_TIME_S, SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.e1_taps import INTEGRATION_S, POWER_BANDWIDTH_HZ, TAP_CHIPS, arriving
from vestige.receiver.samples.e1_samples import e1c_replica
from vestige.receiver.snapshots.sky_samples import SkySamples
from vestige.records import Band, Handover
from vestige.sample_processor.correlator import correlate
from vestige.signals.definitions import E1B, E1C
from vestige.signals.pulse import band_limited_autocorrelation

_MARGIN_S = 5e-6  # of samples on both sides: the taps, and a Doppler that makes the code longer
_OFFSETS_M = np.array(TAP_CHIPS) / E1C.chip_rate_hz * SPEED_OF_LIGHT_MPS


def sky_e1_taps(sky: SkySamples, wanted: Bool[np.ndarray, "n m"]) -> Complex128[np.ndarray, "n m n_taps"]:
    """Return ξ of all satellites before the gain control, NaN where it is not wanted.

    Parameters
    ----------
    sky
        The samples of E1.
    wanted
        Which satellites at which epochs.
    """
    of, start = sky.of, sky.of.simulations[0].start
    taps = np.full((*of.shape, len(TAP_CHIPS)), np.nan + 0j)
    start_s, phase_cycles, doppler_hz, doppler_rate_hz_per_s = _replicas(sky)
    front_end = of.simulations[0].front_end
    density = front_end.power_bandwidth_hz / front_end.sample_rate_hz  # the noise is 1 in the bandwidth of the filter
    for row, column in np.argwhere(wanted).tolist():  # the satellites of an epoch one after the other
        begin_s, here = float(start_s[row, column]), (row, column)
        batch = sky.between(begin_s - _MARGIN_S, begin_s + INTEGRATION_S + _MARGIN_S)
        handover = Handover(
            svid=of.svids[column],
            chips=e1c_replica(of.svids[column]),
            start_time=start + begin_s,
            doppler_hz=float(doppler_hz[here]),
            doppler_rate_hz_per_s=float(doppler_rate_hz_per_s[here]),
            expected_cn0_dbhz=of.simulations[column].cn0_e1_dbhz,
        )
        bank = correlate(batch, handover, _OFFSETS_M)
        assert bank is not None  # noqa: S101  (the margin is ours)
        turn = E1C.polarity * np.exp(2j * np.pi * (phase_cycles[here] % 1.0))
        taps[here] = bank.taps * turn * math.sqrt(2 * batch.sample_rate_hz * bank.integration_s * density)
    return taps


def _replicas(sky: SkySamples) -> tuple[Float[np.ndarray, "n m"], ...]:
    """Return where the replicas begin, in s after the start, with cycles of the line of sight, Doppler and its rate."""
    found = []
    to_hz = -E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS
    for path, truth, multipath_m in zip(sky.paths, sky.of.truth, sky.of.e1_multipath_m.T, strict=True):
        rows = np.searchsorted(path.truth.time_s, truth.time_s)  # of the epochs, among those around them
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


def sky_power_rise_db(
    sky: SkySamples, cn0_dbhz: Float[np.ndarray, "n m"]
) -> tuple[Float[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """Return by how much the power of E1 is above that without attack, in dB, and where the front end clips.

    Parameters
    ----------
    sky
        The samples of E1.
    cn0_dbhz
        C/N0 of each component of the true signals without interference.
    """
    of = sky.of
    width_hz = min(POWER_BANDWIDTH_HZ, of.simulations[0].front_end.power_bandwidth_hz)
    passed = sum(
        band_limited_autocorrelation(one.pulse, np.zeros(1), chip_rate_hz=one.chip_rate_hz, bandwidth_hz=width_hz)[0]
        for one in (E1B, E1C)
    )
    nominal = 1 + passed * np.sum(10 ** (cn0_dbhz / 10), axis=1) / width_hz
    read = [sky.power_near(sent_s + MEDIAN_TRAVEL_TIME_S, width_hz) for sent_s in of.truth[0].time_s.tolist()]
    power, saturated = (np.array(values) for values in zip(*read, strict=True))
    return 10 * np.log10(power / nominal), saturated
