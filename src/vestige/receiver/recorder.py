"""A capture of a scenario: E1 and E6 samples of all its satellites, as a recorder would write them."""

from __future__ import annotations

from collections.abc import Iterator

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.front_end import ReceivedComponent, sample_band
from vestige.records import Band, SampleBatch
from vestige.signal_generator.range_model import RangeModel
from vestige.signal_generator.waveform import open_component
from vestige.signals.definitions import ALL_SIGNALS, CARRIER_HZ
from vestige.time import GalileoTime


def record_band(
    band: Band,
    sky: tuple[tuple[int, RangeModel, float], ...],
    *,
    start: GalileoTime,
    duration_s: float,
    sample_rate_hz: float,
    clock_offset_s: float = 0.0,
    delay_m: float = 0.0,
    seed: int = 0,
) -> Iterator[SampleBatch]:
    """Yield the samples of one band, data and pilot of every satellite, as batches in time order.

    Parameters
    ----------
    sky
        For each satellite its SVID, its range against time after `start`, and its C/N0 per component in this band,
        dBHz.
    start
        Receiver-clock time of the first sample, a whole second.
    clock_offset_s
        Receiver clock minus Galileo System Time, in s; part of every pseudorange.
    delay_m
        Delay of this band's front end in m.
    """
    received = []
    for svid, true_range, cn0_dbhz in sky:
        pseudorange = RangeModel(
            s0_m=true_range.s0_m + clock_offset_s * SPEED_OF_LIGHT_MPS + delay_m,
            v_mps=true_range.v_mps,
            a_mps2=true_range.a_mps2,
            amplitude_m=true_range.amplitude_m,
            omega_radps=true_range.omega_radps,
        )
        for signal in ALL_SIGNALS:
            if signal.band is band:
                component = open_component(signal, svid, seed=seed)
                received.append(ReceivedComponent(component=component, cn0_dbhz=cn0_dbhz, pseudorange=pseudorange))
    first = 0
    n_samples = round(duration_s * sample_rate_hz)
    for samples in sample_band(band, tuple(received), sample_rate_hz=sample_rate_hz, n_samples=n_samples, seed=seed):
        yield SampleBatch(
            band=band,
            samples=samples,
            sample_rate_hz=sample_rate_hz,
            center_frequency_hz=CARRIER_HZ[band],
            first_sample=first,
            start=start + first / sample_rate_hz,
        )
        first += samples.size
