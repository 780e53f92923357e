"""Simulate the reception of I/NAV pages on E1-B, and of the OSNMA data and keys in these pages.

Theory of operation
-------------------
Half a page, 114 bits and 6 zero bits of tail, is sent as 240 symbols in a second. The convolutional code has rate 1/2
and constraint length 7 (171, 133 octal) [OS-ICD, 4.1.4]. E1-B and E1-C have the same power and thus the same C/N0, so

    Es/N0 = C/N0 / 250 Hz · e^{−σφ²},    σφ² = B_φ/(C/N0) (1 + 1/(2T C/N0))

Here σφ is the rms phase error of the carrier loop, whose noise bandwidth is B_φ and whose integration time is T. The
phase error changes within a page, and the interleaver spreads the affected symbols. A soft-decision Viterbi decoder
loses half a page with the probability in the table `_HALF_LOST`. The table comes from a simulation of the code, which
`tests/unit/receiver/test_osnma_reception.py` repeats. Above the highest Es/N0 of the table, error events of the free
distance 10 dominate, so the logarithm of the probability is extrapolated linearly in dB. Below the lowest Es/N0 of the
table, −4 dB, every page is lost. A page is lost if one of its halves is lost. The probability of a lost page is

    C/N0     22 dBHz  23 dBHz  24 dBHz  25 dBHz  26 dBHz
    lost     0.52     0.12     0.013    0.0007   0.00004     without phase error

If the C/N0 falls from 25 to 22 dBHz, the share of pages that an ideal receiver loses thus rises from 0.07 % to 52 %.
Fading, a worse decoder or soft decisions of few bits increase the loss.

Pages 10 to 14 of a subframe together carry the key [OSNMA-ICD]. All satellites send the same key, so a receiver needs
these pages from only one satellite.

Pages are numbered from the start of the week. Page j is page j mod 15 of its subframe, and ends 3 + 2j s after the
start of the week.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int16, Int64

from vestige.constants import PAGES_A_SUBFRAME, SUBFRAME_S, SYMBOLS_PER_S
from vestige.navigation.inav.page import FIRST_PAGE_OFFSET_S, PAGE_S
from vestige.receiver.errors.error_process import TrackingModel
from vestige.streams import stream

KEY_PAGES = range(10, 15)  # pages of a subframe with the bits of a key of 128 bits [OSNMA-ICD]
TAG_PAGES = range(2)  # pages with the tag of a satellite's own data, 40 bits at the start of MACK [OSNMA-ICD]

_ES_N0_DB = np.arange(-4.0, 1.6, 0.5)
_HALF_LOST = np.array([0.956, 0.861, 0.716, 0.516, 0.313, 0.156, 0.0663, 0.0235, 0.00712, 0.00174, 3.9e-4, 9.0e-5])
_LOG_LOST = np.log(-np.log1p(-_HALF_LOST))
_DRAW_BLOCK = 500  # number of pages that share a stream of draws
_DECI = 10  # times are counted in tenths of a second, which are exact as integers


def page_loss(cn0_dbhz: Float[np.ndarray, "*n"], tracking: TrackingModel | None = None) -> Float[np.ndarray, "*n"]:
    """Return the probability that a page is lost.

    `cn0_dbhz` is the C/N0 of E1-B, which is equal to the C/N0 of E1-C. If `cn0_dbhz` is not finite, every page is lost.
    Without `tracking` the phase has no error.
    """
    cn0 = 10 ** (np.where(np.isfinite(cn0_dbhz), cn0_dbhz, 0.0) / 10)
    phase_loss = np.zeros_like(cn0) if tracking is None else tracking.phase_variance_rad2(cn0)
    es_n0_db = 10 * np.log10(cn0 / SYMBOLS_PER_S) - 10 / np.log(10) * phase_loss
    slope = (_LOG_LOST[-1] - _LOG_LOST[-2]) / (_ES_N0_DB[-1] - _ES_N0_DB[-2])
    beyond_db = np.maximum(es_n0_db - _ES_N0_DB[-1], 0.0)
    half = np.exp(np.interp(es_n0_db, _ES_N0_DB, _LOG_LOST) + slope * beyond_db)
    lost = -np.expm1(-2 * half)
    return np.where(np.isfinite(cn0_dbhz) & (es_n0_db >= _ES_N0_DB[0]), lost, 1.0)


def page_end_s(page: Int64[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return the end of pages, in s after the start of the week in which the pages are numbered."""
    return (FIRST_PAGE_OFFSET_S + PAGE_S * (page + 1)).astype(np.float64)


def pages_due(week_s: Float[np.ndarray, " n"], interval_s: float) -> Int64[np.ndarray, "n 15"]:
    """Return the page that ended since the previous epoch for each of the 15 positions in a subframe; −1 for no page.

    If epochs are 30 s apart or more, the pages are those of the last subframe that has ended.
    """
    now = np.round(_DECI * week_s).astype(np.int64)[:, None]
    place = np.arange(PAGES_A_SUBFRAME)
    first_end, page_length = _DECI * (FIRST_PAGE_OFFSET_S + PAGE_S), _DECI * PAGE_S
    if interval_s >= SUBFRAME_S:
        ended = (now - _DECI * FIRST_PAGE_OFFSET_S) // (_DECI * SUBFRAME_S) - 1
        return ended * PAGES_A_SUBFRAME + place
    last = (now - first_end) // page_length
    page = last - (last - place) % PAGES_A_SUBFRAME
    return np.where(first_end + page_length * page > now - round(_DECI * interval_s), page, -1)


def key_pages(week_s: Float[np.ndarray, " n"], key_delay: int) -> Int64[np.ndarray, "n 5"]:
    """Return the pages with the key of a RECS that is sent at each epoch; the key is `key_delay` subframes later."""
    subframe = np.round(_DECI * week_s).astype(np.int64) // (_DECI * SUBFRAME_S) + key_delay
    return subframe[:, None] * PAGES_A_SUBFRAME + np.array(KEY_PAGES)


def data_pages(week_s: Float[np.ndarray, " n"], key_delay: int) -> Int64[np.ndarray, "n 17"]:
    """Return the pages with the words that the key of a RECS authenticates, and the pages with the tag of these words.

    The key of subframe k belongs to the tags of subframe k − 1, which cover the data of subframe k − 2 [OSNMA-ICD].
    """
    of_key = key_pages(week_s, key_delay)[:, :1] // PAGES_A_SUBFRAME
    return np.concatenate(
        [
            (of_key - 2) * PAGES_A_SUBFRAME + np.arange(PAGES_A_SUBFRAME),
            (of_key - 1) * PAGES_A_SUBFRAME + np.array(TAG_PAGES),
        ],
        axis=1,
    )


def demodulated(
    page: Int64[np.ndarray, "*n"], loss: Float[np.ndarray, "*n"], *, seed: int, svid: int
) -> Bool[np.ndarray, "*n"]:
    """Return whether each page of a satellite is received; a page has the same random draw in every call.

    A negative number means no page, and gives False.
    """
    due = page >= 0
    if not due.any():
        return due
    blocks = range(int(page[due].min()) // _DRAW_BLOCK, int(page.max()) // _DRAW_BLOCK + 1)
    drawn = np.concatenate([stream(seed, "I/NAV pages", one, svid).random(_DRAW_BLOCK) for one in blocks])
    first = blocks.start * _DRAW_BLOCK
    return due & (drawn[np.maximum(page, first) - first] >= loss)


def as_mask(places: Bool[np.ndarray, "*n 15"]) -> Int16[np.ndarray, "*n"]:
    """Return the selected pages of a subframe as the bits of an integer; bit 0 is the first page."""
    return (places @ (1 << np.arange(PAGES_A_SUBFRAME))).astype(np.int16)


def of_mask(mask: Int16[np.ndarray, "*n"]) -> Bool[np.ndarray, "*n 15"]:
    """Return whether each page of a subframe is set in `mask`; bit 0 is the first page."""
    return (mask[..., None].astype(np.int64) >> np.arange(PAGES_A_SUBFRAME) & 1).astype(bool)
