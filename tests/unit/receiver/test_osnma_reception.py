"""Which pages are received: the table against the code itself, page numbers against the layout of a subframe."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.campaign.statistics import binomial_test
from vestige.receiver.errors.tracking_noise import BetzTrackingNoise
from vestige.receiver.osnma_reception import (
    as_mask,
    data_pages,
    demodulated,
    key_pages,
    of_mask,
    page_end_s,
    page_loss,
    pages_due,
)
from vestige.streams import stream

GENERATORS, STATES, HALF_PAGE = (0o171, 0o133), 64, 120


def lost_halves(es_n0_db: float, trials: int, rng: np.random.Generator) -> int:
    """Decode the all-zero half page so many times with a soft-decision Viterbi decoder, and count what goes wrong.

    The survivor of state 0 is wrong if it ever left it: a path needs no longer memory than that.
    """
    source = np.array([[(2 * state) % STATES, (2 * state + 1) % STATES] for state in range(STATES)])
    register = source | (np.arange(STATES)[:, None] // 32 << 6)  # six bits of state and the new one in front
    parity = np.array([[[(bits & one).bit_count() % 2 for one in GENERATORS] for bits in row] for row in register])
    sign = (1.0 - 2.0 * parity).astype(np.float32)
    level = np.float32(np.sqrt(2 * 10 ** (es_n0_db / 10)))
    metric = np.full((trials, STATES), -1e9, np.float32)
    metric[:, 0] = 0.0
    left = np.zeros((trials, STATES), bool)
    for step in range(HALF_PAGE):
        received = level + rng.standard_normal((trials, 2)).astype(np.float32)
        paths = [metric[:, source[:, k]] + received @ sign[:, k].T for k in (0, 1)]
        second = paths[1] > paths[0]
        left = np.where(second, left[:, source[:, 1]], left[:, source[:, 0]])
        left[:, 1:] = True
        metric = np.where(second, paths[1], paths[0])
        if step >= HALF_PAGE - 6:
            metric[:, STATES // 2 :] = -1e9  # the tail holds zeros
    return int(np.count_nonzero(left[:, 0]))


@pytest.mark.parametrize(("cn0_dbhz", "trials"), [(21.48, 2000), (22.48, 4000), (23.48, 12000)])
def test_the_table_is_that_of_the_code(cn0_dbhz: float, trials: int) -> None:
    rng = stream(3, "half pages", str(cn0_dbhz))
    lost = lost_halves(cn0_dbhz - 10 * np.log10(250.0), trials, rng)
    half = 1 - np.sqrt(1 - float(page_loss(np.array([cn0_dbhz]))[0]))
    assert binomial_test(lost, trials, half) > 1e-4
    assert binomial_test(lost, trials, 1.25 * half) < 1e-4  # and it is sharp


def test_loss_against_cn0() -> None:
    cn0_dbhz = np.linspace(0.0, 60.0, 601)
    loss = page_loss(cn0_dbhz)
    assert np.all(np.diff(loss) <= 0)
    assert loss[0] == 1.0
    assert np.all(loss[450:] < 1e-12)
    with_loop = page_loss(cn0_dbhz, BetzTrackingNoise())
    assert np.all(with_loop >= loss)
    # at 24 dBHz an 18 Hz loop has 0.079 rad2 of phase error: 0.34 dB
    assert float(page_loss(np.array([24.0]), BetzTrackingNoise())[0]) == pytest.approx(
        float(page_loss(np.array([24.0 - 0.341]))[0]), rel=0.01
    )
    assert np.array_equal(page_loss(np.array([np.nan, -np.inf])), [1.0, 1.0])
    # union bound of the free distance 10: 11 events in each of 228 bits, Q(sqrt(2 * 10 * Es/N0))
    assert float(page_loss(np.array([25.0]))[0]) == pytest.approx(8e-4, rel=0.2)


@given(
    tenths=st.integers(min_value=0, max_value=6_047_999),
    interval=st.integers(min_value=1, max_value=299),
    count=st.integers(min_value=1, max_value=40),
)
def test_every_page_is_due_once(tenths: int, interval: int, count: int) -> None:
    week_s = (tenths + interval * np.arange(count)) / 10
    page = pages_due(week_s, interval / 10)
    numbers = page[page >= 0]
    assert np.array_equal(np.sort(numbers), np.arange(numbers.min(), numbers.max() + 1)) if numbers.size else True
    row, place = np.nonzero(page >= 0)
    assert np.array_equal(numbers % 15, place)
    end_s = page_end_s(numbers)
    assert np.all(end_s <= week_s[row] + 1e-6)
    assert np.all(end_s > week_s[row] - interval / 10 - 1e-6)
    assert np.array_equal(of_mask(as_mask(page >= 0)), page >= 0)


def test_long_intervals_have_the_last_whole_subframe() -> None:
    page = pages_due(np.array([60.0, 61.0, 120.0, 121.0]), 60.0)
    assert page[:, 0].tolist() == [0, 15, 30, 45]
    assert page_end_s(page[:, -1]).tolist() == [31.0, 61.0, 91.0, 121.0]


def test_the_key_is_on_air_from_the_21st_to_the_31st_second() -> None:
    for delay in (0, 1):
        pages = key_pages(np.array([36.0]), delay)
        assert page_end_s(pages).tolist() == [[30.0 * (1 + delay) + 23 + 2 * k for k in range(5)]]


def test_a_key_authenticates_the_data_of_two_subframes_before() -> None:
    pages = data_pages(np.array([96.0]), 1)  # RECS in the subframe of 90 s, key in that of 120 s
    assert pages[0, :15].tolist() == list(range(30, 45))  # data from 60 s on
    assert page_end_s(pages[0, 15:]).tolist() == [93.0, 95.0]  # tag from 90 s on


def test_draws_belong_to_pages() -> None:
    page = np.arange(3000).reshape(200, 15)
    loss = np.full(page.shape, 0.3)
    found = demodulated(page, loss, seed=1, svid=4)
    assert binomial_test(int(np.count_nonzero(~found)), page.size, 0.3) > 1e-4
    assert np.array_equal(demodulated(page[70:90], loss[70:90], seed=1, svid=4), found[70:90])
    assert not np.array_equal(demodulated(page, loss, seed=1, svid=5), found)
    assert not demodulated(np.full((1, 15), -1), np.zeros((1, 15)), seed=1, svid=4).any()
    assert demodulated(page, np.zeros(page.shape), seed=1, svid=4).all()
