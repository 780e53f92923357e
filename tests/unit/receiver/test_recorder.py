from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from builders import START
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.samples.recorder import Propagation, ReceivedSatellite, record_band, straight, stretch_samples
from vestige.records import Band
from vestige.signal_generator.keystream import encrypted_component
from vestige.signal_generator.noise_kernel import noise_key
from vestige.signal_generator.range_model import RangeModel
from vestige.signal_generator.synthesis import amplitude
from vestige.signal_generator.waveform import open_component
from vestige.signals.definitions import ALL_SIGNALS, CARRIER_HZ, E6B
from vestige.time import GalileoTime

PATH = RangeModel(s0_m=2.5e7, v_mps=51.023, a_mps2=0.3, amplitude_m=0.5012, omega_radps=3.149)
CN0 = 45.0
# Of a component's amplitude. The parabola of a stretch misses j x³/6 of the range, 16 m/s³ over 5 ms: 1.1e-5 rad on E1;
# two CBOC components of up to 1.26 make 2.7e-5; float32 adds 2e-6.
TOLERANCE = 3e-5


def satellite(
    band: Band, path: RangeModel = PATH, svid: int = 11, held: Propagation | None = None
) -> ReceivedSatellite:
    components = tuple(open_component(signal, svid, seed=1) for signal in ALL_SIGNALS if signal.band is band)
    if band is Band.E6:
        components = components[0], encrypted_component(b"secret", svid, START)
    what = held or straight()
    return ReceivedSatellite(
        svid=svid, components=components, cn0_dbhz=CN0, pseudorange=path, propagation=lambda _: what
    )


def recorded(band: Band, sky: list[ReceivedSatellite], first: int, n: int, fs: float, key: object = None) -> np.ndarray:
    batches = list(
        record_band(
            band,
            tuple(sky),
            reference=START,
            front_end=FrontEnd(sample_rate_hz=fs),
            first_sample=first,
            n_samples=n,
            noise_key=key,
        )
    )
    assert [batch.first_sample for batch in batches[1:]] == [
        batch.first_sample + batch.samples.size for batch in batches[:-1]
    ]
    for batch in batches:
        assert batch.start - START == pytest.approx(batch.first_sample / fs, abs=1e-9)
    return np.concatenate([batch.samples for batch in batches])


def plain(one: ReceivedSatellite, band: Band, t: np.ndarray, fs: float) -> np.ndarray:
    """The definition in float64, sample by sample."""
    pseudorange_m = one.pseudorange.range_m(t)
    return amplitude(CN0, fs) * sum(x.received(t, pseudorange_m, CARRIER_HZ[band]) for x in one.components)


def disagreeing(x: np.ndarray, expected: np.ndarray, fs: float) -> tuple[int, float]:
    """How many samples met another chip, and the largest error of the others over the amplitude."""
    error = np.abs(x - expected) / amplitude(CN0, fs)
    other = error > 0.1
    return int(other.sum()), float(error[~other].max())


@settings(max_examples=12)
@given(
    band=st.sampled_from(list(Band)),
    fs=st.sampled_from([4e6, 12.5e6, 12e6, 16.3676e6]),
    first=st.sampled_from([0, 131_071, 12_499_000]),
    v=st.floats(-800, 800),
    a=st.floats(-10, 10),
)
def test_without_noise_equals_the_plain_waveform(band: Band, fs: float, first: int, v: float, a: float) -> None:
    one = satellite(band, replace(PATH, v_mps=v, a_mps2=a))
    n = int(0.021 * fs)
    x = recorded(band, [one], first, n, fs)
    others, error = disagreeing(x, plain(one, band, (first + np.arange(n)) / fs, fs), fs)
    assert error < TOLERANCE
    assert others <= 6  # within 1e-7 chip of an edge, where float64 at 1 s may choose either chip


def test_a_day_after_the_start() -> None:
    """On the counter of the scenario as near to it: float64 seconds after a day would be off by 4 mm."""
    fs, day = 12.5e6, 86_400
    late = replace(PATH, s0_m=PATH.s0_m - PATH.v_mps * day, a_mps2=0.0, amplitude_m=0.0)
    near = replace(late, s0_m=PATH.s0_m)
    pair = [satellite(Band.E1, path) for path in (near, late)]
    code = pair[0].components[1]  # a pilot: the same chips in every second
    pair = [replace(one, components=(code,)) for one in pair]
    a = recorded(Band.E1, pair[:1], 0, 200_000, fs)
    b = recorded(Band.E1, pair[1:], day * 12_500_000, 200_000, fs)
    others, error = disagreeing(b, a, fs)
    # both ranges are 2.5e7 m, in steps of 4 nm; v t has t to 15 ps, 1 nm: 3e-8 rad each, times a few
    assert (others, error) == (0, pytest.approx(0, abs=1e-4))


@settings(max_examples=10)
@given(cut=st.integers(1, 399_999), first=st.sampled_from([0, 5, 1_250_000]))
def test_same_bits_wherever_the_recording_begins(cut: int, first: int) -> None:
    fs, n, key = 12.5e6, 400_000, noise_key(1, 0, 61)
    sky = [satellite(Band.E6), satellite(Band.E6, replace(PATH, s0_m=2.6e7, v_mps=-400.0), svid=3)]
    whole = recorded(Band.E6, sky, first, n, fs, key)
    assert np.array_equal(recorded(Band.E6, sky, first + cut, n - cut, fs, key), whole[cut:])
    assert np.array_equal(recorded(Band.E6, sky, first, cut, fs, key), whole[:cut])


def test_group_delay_moves_the_code_and_not_the_carrier() -> None:
    fs, n = 12.5e6, 250_000
    one = satellite(Band.E6, held=straight(40.0))
    x = recorded(Band.E6, [one], 0, n, fs)
    t = np.arange(n) / fs
    p = PATH.range_m(t)
    code = sum(c.modulation(t - (p + 40.0) / SPEED_OF_LIGHT_MPS) for c in one.components)
    cycles = p / SPEED_OF_LIGHT_MPS * CARRIER_HZ[Band.E6]
    expected = amplitude(CN0, fs) * code * np.exp(-2j * np.pi * (cycles - np.floor(cycles)))
    others, error = disagreeing(x, expected, fs)
    assert others <= 4
    assert error < TOLERANCE


def test_a_ray_is_a_later_weaker_and_turning_copy() -> None:
    fs, n, at_s = 12.5e6, 250_000, 0.013
    held = Propagation(
        delay_m=0.0,
        at_s=at_s,
        ray_delay_m=np.array([70.0]),
        ray_amplitude=np.array([0.3j]),
        ray_doppler_hz=np.array([4.0]),
    )
    for band in Band:
        line, both = satellite(band), satellite(band, held=held)
        ray = recorded(band, [both], 0, n, fs) - recorded(band, [line], 0, n, fs)
        t = np.arange(n) / fs
        p = PATH.range_m(t)
        code = sum(c.modulation(t - (p + 70.0) / SPEED_OF_LIGHT_MPS) for c in line.components)
        cycles = p / SPEED_OF_LIGHT_MPS * CARRIER_HZ[band]
        turning = 0.3j * np.exp(2j * np.pi * 4.0 * (t - at_s))
        expected = amplitude(CN0, fs) * turning * code * np.exp(-2j * np.pi * (cycles - np.floor(cycles)))
        others, error = disagreeing(ray, expected, fs)
        assert others <= 4
        assert error < TOLERANCE


def test_what_holds_is_asked_for_once_a_stretch() -> None:
    asked: list[float] = []

    def held(t_s: float) -> Propagation:
        asked.append(t_s)
        return straight()

    fs = 12.5e6
    length = stretch_samples(fs)
    one = replace(satellite(Band.E6), propagation=held)
    recorded(Band.E6, [one], length // 3, 2 * length, fs)
    assert asked == pytest.approx([(k + 0.5) * length / fs for k in range(3)])


def test_the_reference_is_a_whole_second() -> None:
    one = replace(satellite(Band.E6), components=(open_component(E6B, 11),))
    with pytest.raises(ValueError, match="whole second"):
        next(
            record_band(
                Band.E6,
                (one,),
                reference=GalileoTime(1, 2, 0.5),
                front_end=FrontEnd(sample_rate_hz=5e6),
                n_samples=10,
                noise_key=None,
            )
        )


FRONT_ENDS = (
    FrontEnd(sample_rate_hz=6.2e6, bandwidth_hz=5e6),
    FrontEnd(sample_rate_hz=6.2e6, bandwidth_hz=5e6, oversampling=2),
    FrontEnd(sample_rate_hz=6.2e6, bits=2),
    FrontEnd(sample_rate_hz=6.2e6, bandwidth_hz=4e6, bits=3, oversampling=2),
)


@pytest.mark.parametrize("front_end", FRONT_ENDS)
def test_a_front_end_filters_once_what_all_satellites_make(front_end: FrontEnd) -> None:
    """The stretch as it would be at once: samples at the input's rate, and the front end over them."""
    sky = (satellite(Band.E6), satellite(Band.E6, replace(PATH, s0_m=2.6e7, v_mps=-400.0), svid=3))
    length, key = stretch_samples(front_end.sample_rate_hz), noise_key(1, 0, 61)
    options = {"reference": START, "noise_key": key}
    found = next(iter(record_band(Band.E6, sky, front_end=front_end, n_samples=length, **options)))
    at_antenna = FrontEnd(sample_rate_hz=front_end.input_rate_hz)
    margin, begin = front_end.margin_samples, 0
    n = front_end.input_samples(length)
    before = n - margin  # a recording may begin before its reference: the filter needs it
    parts = list(record_band(Band.E6, sky, front_end=at_antenna, first_sample=begin - margin, n_samples=n, **options))
    x = np.concatenate([part.samples for part in parts])
    assert x.size == before + margin
    expected, _ = front_end.process(x)
    if front_end.bits is None:
        assert found.samples == pytest.approx(expected, abs=3e-4)  # another stretch: other rounding
    else:
        assert np.mean(found.samples != expected) < 1e-3


def test_a_front_end_gives_the_same_bits_wherever_it_is_cut() -> None:
    front_end, key = FRONT_ENDS[3], noise_key(1, 0, 61)
    options = {"reference": START, "noise_key": key, "front_end": front_end}
    sky = (satellite(Band.E6),)
    n = 150_000
    whole = np.concatenate([b.samples for b in record_band(Band.E6, sky, n_samples=n, **options)])
    part = record_band(Band.E6, sky, first_sample=40_001, n_samples=n - 40_001, **options)
    assert np.array_equal(np.concatenate([b.samples for b in part]), whole[40_001:])
    with ThreadPoolExecutor(3) as pool:
        threads = record_band(Band.E6, sky, n_samples=n, pool=pool, **options)
        assert np.array_equal(np.concatenate([b.samples for b in threads]), whole)
