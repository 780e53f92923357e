"""Search E6 at every position that is possible for one signal on E1: the hand-over search [WFO, Sec. III-E].

Theory of operation
-------------------
A signal on E1 gives code phase and Doppler. The time of transmission remains unknown by a multiple of a period. The
period is 4 ms, or 100 ms if the phase of the secondary code is known. So the first chip of a RECS can arrive at τ_m
after a known moment, where

    u(τ) = R_c (1 + f_d/f_c) τ + ½ R_c (ḟ_d/f_c) τ²        u(τ_m) = m · period · R_c

m is a whole number, R_c the chip rate, and f_c the carrier frequency of E6. f_d and ḟ_d are Doppler and Doppler rate.
The possible arrivals are thus one *received* period apart. At a Doppler of 1 kHz, arrivals at steps of the nominal
period of 4 ms would be wrong by 120 chips after 30 s.

The carrier is removed from the samples. The samples are then summed into chips along u (`half_chip_kernel`), on two
grids half a chip apart. A row has 4 ms of chips. A RECS of 16 ms has four rows. With a period of 4 ms, hypothesis m + 1
shares three rows with hypothesis m. So the products of a row with all quarters of the RECS at all taps serve several
hypotheses (`row_kernel`). Each tap uses one of the two grids of chips:

    Y[row, quarter, tap] = Σ_j row[j] · chip[quarter, j − tap]        S[m, tap] = Σ_q Y[m + q, q, tap]

Carrier and code phase are continuous through all rows, so no phases have to be joined. At a tap k half chips from the
middle, up to (k + 1)/2 chips at an end of the RECS are left out. Each of these chips costs 0.0001 dB if the RECS lasts
16 ms. The noise of each hypothesis is Σ|chip sum|² of its rows, see `vestige.sample_processor.correlator`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int64

from vestige.constants import E1_CODE_PERIOD_S
from vestige.records import ChipSequence, Handover, SampleSource
from vestige.sample_processor.search.peak import Peak, peak_at, separated
from vestige.sample_processor.search.row_kernel import OFFSETS_AT_ONCE, row_products, time_of
from vestige.signals.definitions import CARRIER_HZ
from vestige.time import GalileoTime

_CHUNK = 960  # number of positions whose rows are computed together
_ROWS = 32  # number of rows whose samples are read at once


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateEpochs:
    """Possible arrival times of the chips from one signal on E1: a known time, and steps of a period from this time.

    Attributes
    ----------
    chips
        Decrypted RECS.
    anchor
        Receiver-clock time at which the first chip may arrive.
    period_s
        Period of 4 ms, or a multiple of 4 ms, on the satellite's clock.
    doppler_hz, doppler_rate_hz_per_s
        Doppler in Hz and Doppler rate in Hz/s on the E6 carrier at `anchor`.
    """

    svid: int
    chips: ChipSequence
    anchor: GalileoTime
    period_s: float
    doppler_hz: float
    doppler_rate_hz_per_s: float = 0.0

    def __post_init__(self) -> None:
        rows = self.period_s / E1_CODE_PERIOD_S
        if rows < 0.5 or abs(rows - round(rows)) > 1e-6:
            raise ValueError(f"the period must be a multiple of 4 ms, not {self.period_s} s")


@dataclass(frozen=True, slots=True)
class _Scale:
    """Conversion of received chips to seconds and back, both counted from `CandidateEpochs.anchor`."""

    code_rate: float
    code_rate_rate: float

    def chips_at(self, t_s: float) -> float:
        return self.code_rate * t_s + 0.5 * self.code_rate_rate * t_s**2

    def time_of(self, chips: float) -> float:
        return float(time_of(chips, self.code_rate, self.code_rate_rate))


def search_handover(
    source: SampleSource,
    line: CandidateEpochs,
    first_start: GalileoTime,
    last_start: GalileoTime,
    threshold: float,
    *,
    taps: int = 5,
    trace: Callable[[GalileoTime, float], None] | None = None,
) -> tuple[Peak, ...]:
    """Return the signals at the possible arrival times of `line`, in order of time.

    Parameters
    ----------
    source
        E6 samples. A position is searched only if the samples contain all chips at this position.
    line
        Possible arrival times of the chips, from one signal on E1.
    first_start, last_start
        Time uncertainty: earliest and latest arrival of the first chip.
    threshold
        Threshold on the magnitude, in standard deviations of the noise per dimension.
    taps
        Number of code offsets, half a chip apart, that are tested at each possible arrival; an odd number.
    trace
        Function that is called for each position with its time and the magnitude of its strongest tap, in standard
        deviations of the noise per dimension.
    """
    if taps < 1 or taps % 2 == 0:
        raise ValueError(f"the number of correlators must be odd, not {taps}")
    places = handover_positions(source, line, first_start, last_start)
    found: list[Peak] = []
    for chunk, squares in _squares(source, line, places, taps):
        best = np.max(squares, axis=1)
        for row in np.flatnonzero(best > threshold**2):
            tap = int(np.argmax(squares[row])) - taps // 2
            peak = peak_at(source, _handover(source, line, int(chunk[row]), tap), threshold)
            if peak is not None:
                found.append(peak)
        if trace is not None:
            for place, square in zip(chunk, best, strict=True):
                trace(_handover(source, line, int(place), 0).start_time, float(np.sqrt(square)))
    return separated(found)


def handover_positions(
    source: SampleSource, line: CandidateEpochs, first_start: GalileoTime, last_start: GalileoTime
) -> Int64[np.ndarray, " places"]:
    """Return the numbers m of the positions in the time uncertainty whose rows are all in the samples."""
    scale, rows = _scale(source, line), _rows(line.chips)
    head = source.read(source.first_sample, 1)
    begin_s = head.start - line.anchor
    end_s = begin_s + (source.end_sample - source.first_sample) / head.sample_rate_hz
    row_chips = _row_chips(line.chips)
    period_chips = line.period_s * line.chips.chip_rate_hz
    low = max(scale.chips_at(first_start - line.anchor), scale.chips_at(begin_s))
    high = min(scale.chips_at(last_start - line.anchor), scale.chips_at(end_s) - rows * row_chips)
    return np.arange(int(np.ceil(low / period_chips)), int(np.floor(high / period_chips)) + 1)


def _squares(
    source: SampleSource, line: CandidateEpochs, places: Int64[np.ndarray, " places"], taps: int
) -> Iterator[tuple[Int64[np.ndarray, " places"], Float64[np.ndarray, "places taps"]]]:
    """Yield groups of positions, and the squared magnitudes of the positions at all taps over the noise variance."""
    n_rows = _rows(line.chips)
    stride = round(line.period_s / E1_CODE_PERIOD_S)
    size = _CHUNK if stride < n_rows else 1  # distant positions share no rows
    replica = _Replica.of(line.chips, taps)
    for begin in range(0, places.size, size):
        chunk = places[begin : begin + size]
        products, noise = replica.products(source, line, int(chunk[0]) * stride, (chunk.size - 1) * stride + n_rows)
        first = np.arange(chunk.size) * stride
        sums = sum(products[:, first + quarter, quarter] for quarter in range(n_rows))
        power = sum(noise[first + quarter] for quarter in range(n_rows))
        yield chunk, np.sum(np.square(sums), axis=0) / np.maximum(power / 2, 1e-30)[:, None]


@dataclass(frozen=True, slots=True)
class _Replica:
    """Chips of a RECS between zeros, and the start of each quarter at each tap, on each of the two grids of chips.

    At a tap that is later by a chip, the quarters begin a chip earlier in the code.
    """

    code: Float32[np.ndarray, " _"]
    n_quarters: int
    tap_of: tuple[Int64[np.ndarray, " _"], Int64[np.ndarray, " _"]]
    offsets: tuple[Int64[np.ndarray, " _"], Int64[np.ndarray, " _"]]

    @classmethod
    def of(cls, chips: ChipSequence, taps: int) -> _Replica:
        """Return the replica for `taps` taps half a chip apart."""
        row_chips, n_quarters = _row_chips(chips), _rows(chips)
        code = np.zeros(n_quarters * row_chips + 2 * taps, np.float32)
        code[taps : taps + chips.n_chips] = chips.chips
        late = np.arange(taps) - taps // 2
        tap_of = (np.flatnonzero(late % 2 == 0), np.flatnonzero(late % 2 == 1))
        quarters = taps + row_chips * np.arange(n_quarters)[:, None]
        even, odd = ((quarters - late[which] // 2).ravel() for which in tap_of)
        return cls(code, n_quarters, tap_of, (even, odd))

    def products(
        self, source: SampleSource, line: CandidateEpochs, first_row: int, n: int
    ) -> tuple[Float32[np.ndarray, "parts rows quarters taps"], Float64[np.ndarray, " rows"]]:
        """Return real and imaginary part of each of `n` rows times each quarter and tap, and Σ|chip|² of each row."""
        products = np.empty((2, n, self.n_quarters, self.tap_of[0].size + self.tap_of[1].size), np.float32)
        noise = np.empty(n)
        # some offsets are computed twice if the number of offsets is not a multiple of OFFSETS_AT_ONCE
        padded = [np.resize(one, -(-one.size // OFFSETS_AT_ONCE) * OFFSETS_AT_ONCE) for one in self.offsets]
        for begin in range(0, n, _ROWS):
            end = min(begin + _ROWS, n)
            found = [np.empty((2, end - begin, one.size), np.float32) for one in padded]
            _fill(source, line, first_row + begin, (self.code, *padded), (*found, noise[begin:end]))
            for one, which in zip(found, self.tap_of, strict=True):
                columns = one[:, :, : self.n_quarters * which.size]
                products[:, begin:end, :, which] = columns.reshape(2, end - begin, self.n_quarters, which.size)
        return products, noise


def _fill(
    source: SampleSource,
    line: CandidateEpochs,
    first_row: int,
    replica: tuple[np.ndarray, ...],
    out: tuple[np.ndarray, ...],
) -> None:
    """Fill the outputs of `row_products` for rows from `first_row` on."""
    scale, row_chips = _scale(source, line), _row_chips(line.chips)
    head = source.read(source.first_sample, 1)
    rate = head.sample_rate_hz
    begin_s, end_s = (
        line.anchor - head.start + scale.time_of(row * row_chips) for row in (first_row, first_row + out[-1].size)
    )
    first = max(int(begin_s * rate) - 1, 0) + source.first_sample
    end = int((end_s + 0.5 / line.chips.chip_rate_hz) * rate) + 3 + source.first_sample
    batch = source.read(first, min(end, source.end_sample) - first)
    row_products(
        batch.samples.view(np.float32),
        batch.start - line.anchor,
        1.0 / rate,
        scale.code_rate,
        scale.code_rate_rate,
        CARRIER_HZ[batch.band] - batch.center_frequency_hz + line.doppler_hz,
        line.doppler_rate_hz_per_s,
        first_row,
        row_chips,
        *replica,
        *out,
    )


def _handover(source: SampleSource, line: CandidateEpochs, place: int, tap: int) -> Handover:
    """Return the hand-over of the hypothesis at a position and tap."""
    scale = _scale(source, line)
    chips = place * line.period_s * line.chips.chip_rate_hz + tap / 2
    at_s = scale.time_of(chips)
    return Handover(
        svid=line.svid,
        chips=line.chips,
        start_time=line.anchor + at_s,
        doppler_hz=line.doppler_hz + line.doppler_rate_hz_per_s * at_s,
        doppler_rate_hz_per_s=line.doppler_rate_hz_per_s,
    )


def _scale(source: SampleSource, line: CandidateEpochs) -> _Scale:
    carrier_hz = CARRIER_HZ[source.read(source.first_sample, 1).band]
    rate = line.chips.chip_rate_hz
    return _Scale(rate * (1 + line.doppler_hz / carrier_hz), rate * line.doppler_rate_hz_per_s / carrier_hz)


def _row_chips(chips: ChipSequence) -> int:
    return round(E1_CODE_PERIOD_S * chips.chip_rate_hz)


def _rows(chips: ChipSequence) -> int:
    return -(-chips.n_chips // _row_chips(chips))
