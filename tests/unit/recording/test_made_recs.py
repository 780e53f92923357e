from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import START, validated_key
from vestige.crypto.recs.recs_segment import LENGTHS, CipherMode, decrypt
from vestige.recording.assistance.made_recs import make_segments, transmit_times
from vestige.signals.codes import tiered_code
from vestige.signals.definitions import E6C


@given(
    st.floats(0, 0.999), st.floats(0.05, 3.0), st.lists(st.floats(0.05, 0.1), min_size=1, max_size=5), st.integers(1, 4)
)
def test_every_segment_reaches_every_satellite_inside_the_samples(
    fraction: float, span_s: float, travel_s: list[float], step: int
) -> None:
    first = START + fraction
    times = transmit_times(first, first + span_s, travel_s=travel_s, duration_s=0.016, interval_s=step / 10)
    for time in times:
        assert (time.fraction * 10) % 1 == pytest.approx(0.0, abs=1e-9)
        for travel in travel_s:
            assert (time - first) + travel >= -1e-9
            assert (time - first) + travel + 0.016 <= span_s + 1e-9
    # none is forgotten: the first decisecond that fits is taken
    room = span_s - 0.016 - (max(travel_s) - min(travel_s))
    if room > 0.1 + 1e-9:
        assert times
    for before, after in itertools.pairwise(times):
        assert after - before == pytest.approx(step / 10)


@pytest.mark.parametrize("interval_s", [0.0, -1.0, 0.05, 0.25])
def test_the_interval_is_in_deciseconds(interval_s: float) -> None:
    with pytest.raises(ValueError, match="multiple of"):
        transmit_times(START, START + 1, travel_s=[0.08], duration_s=0.016, interval_s=interval_s)


@pytest.mark.parametrize("length", LENGTHS, ids=lambda length: f"{length.duration_ms} ms")
@pytest.mark.parametrize("key_delay", [0, 1])
@pytest.mark.parametrize("mode", CipherMode)
def test_segments_decrypt_to_what_was_transmitted(length, key_delay: int, mode: CipherMode) -> None:  # type: ignore[no-untyped-def]
    keys = [validated_key(START.subframe), validated_key(START.subframe + 30)]
    segments = make_segments([4, 9], [START], keys, length=length, key_delay=key_delay, cipher_mode=mode)
    assert [segment.svid for segment in segments] == [4, 9]
    for segment in segments:
        chips = decrypt(segment, keys[key_delay], mode=mode).chips
        assert np.array_equal(chips, tiered_code(E6C, segment.svid)[: length.n_chips])


def test_no_key_no_segment() -> None:
    assert make_segments([4], [START], [validated_key(START.subframe + 60)], length=LENGTHS[0]) == ()
