from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from report_builder import unpacked
from vestige.report.drawing import chosen_rows, outermost, packed, scaled, stretches

SIZES = st.integers(1, 500)


@pytest.mark.parametrize("kind", ["uint8", "uint16", "int8", "float32", "float64"])
def test_packed_is_read_back(kind: str) -> None:
    values = np.arange(7).astype(kind)
    assert packed(values)["type"] == kind
    assert unpacked(packed(values)).tolist() == values.tolist()


@pytest.mark.parametrize("bits", [8, 16])
def test_scaled_is_right_to_half_a_step(bits: int) -> None:
    values = np.append(np.linspace(0, 20, 1000), np.nan)
    nothing = 2**bits - 1
    found = unpacked(scaled(values, 20.0, bits=bits)).astype(np.float64)
    assert found[-1] == nothing
    assert found[:-1].max() == nothing - 1
    np.testing.assert_allclose(found[:-1] * 20 / (nothing - 1), values[:-1], atol=10.001 / (nothing - 1))


@given(n=SIZES, limit=st.integers(1, 100))
def test_stretches_hold_every_epoch_once(n: int, limit: int) -> None:
    time_s = np.arange(n) * 2.0
    parts = stretches(time_s, 2.0, limit)
    assert parts.starts.size <= limit
    np.testing.assert_array_equal(np.diff(parts.starts), parts.length)
    np.testing.assert_array_equal(parts.begin_s[1:], parts.end_s[:-1])
    assert (parts.begin_s[0], parts.end_s[-1]) == (0.0, 2.0 * n)


@given(data=st.data(), n=SIZES, limit=st.integers(1, 50))
def test_what_stretches_say(data: st.DataObject, n: int, limit: int) -> None:
    places = data.draw(arrays(np.int64, n, elements=st.integers(0, 4)))
    values = data.draw(arrays(np.float64, n, elements=st.one_of(st.just(np.nan), st.floats(-1e3, 1e3))))
    where = data.draw(arrays(np.bool_, n))
    parts = stretches(np.arange(n, dtype=float), 1.0, limit)
    bits, largest, mean = parts.occurring(places, where), parts.largest(values), parts.mean(values)
    for i, start in enumerate(parts.starts):
        inside = slice(start, start + parts.length)
        assert {b for b in range(8) if bits[i] >> b & 1} == set(places[inside][where[inside]].tolist())
        known = values[inside][np.isfinite(values[inside])]
        assert np.isnan(largest[i]) if not known.size else largest[i] == known.max()
        assert np.isnan(mean[i]) if not known.size else mean[i] == pytest.approx(known.mean(), abs=1e-9)


def test_a_gap_in_time_is_no_part_of_a_stretch() -> None:
    time_s = np.array([0.0, 1, 2, 3, 100, 101, 102, 103])
    parts = stretches(time_s, 1.0, 2)
    assert parts.end_s.tolist() == [4.0, 104.0]


def test_no_epoch_is_our_mistake() -> None:
    with pytest.raises(ValueError, match="no epoch"):
        stretches(np.zeros(0), 1.0, 5)


@given(data=st.data(), n=SIZES, limit=st.integers(4, 300))
def test_chosen_rows_are_what_is_said_of_them(data: st.DataObject, n: int, limit: int) -> None:
    kinds = {name: data.draw(arrays(np.bool_, n)) for name in ("misses", "alarms")}
    everything = data.draw(arrays(np.bool_, n))
    rows = chosen_rows(kinds, everything, limit)
    chosen = set(rows.places.tolist())
    assert len(chosen) <= limit
    assert np.all(np.diff(rows.places) > 0)
    assert everything[rows.places].all()
    if everything.sum() <= limit:
        assert chosen == set(np.flatnonzero(everything).tolist())
        assert rows.every == {"epochs": 1}
        return
    for name, mask in ({"epochs": everything} | kinds).items():
        assert set(np.flatnonzero(mask & everything)[:: rows.every[name]].tolist()) <= chosen


def test_rare_epochs_of_interest_are_all_there() -> None:
    misses = np.zeros(100_000, dtype=bool)
    misses[[5, 17, 99_999]] = True
    rows = chosen_rows({"misses": misses, "alarms": np.zeros_like(misses)}, np.ones_like(misses), 1000)
    assert rows.every == {"epochs": 200, "misses": 1, "alarms": 1}
    assert {5, 17, 99_999} <= set(rows.places.tolist())


@given(
    values=arrays(np.float64, SIZES, elements=st.one_of(st.just(np.nan), st.floats(-1e3, 1e3))),
    count=st.integers(1, 40),
)
def test_the_outermost_values_are_among_the_outermost(values: np.ndarray, count: int) -> None:
    found = outermost(values, count)
    assert found.sum() <= 2 * count
    if np.isfinite(values).any():
        assert np.nanmin(values) in values[found]
        assert np.nanmax(values) in values[found]
    assert np.isfinite(values[found]).all()
