"""Search the samples for vestigial signals: count the signals of a satellite, and find the earliest signal.

The searches are step 4 of level 2 [WFO, Sec. IV-B] and step 5 of level 3 [WFO, Sec. IV-C].

`E1VestigialSearch` (levels 2 and 3) searches for all signals on E1, and hands signals over to E6. `E6ExhaustiveSearch`
(level 3) searches every half chip and Doppler bin of E6. Both searches take a snapshot and its assistance, and return
peaks and number of signals of each satellite. Both searches cover the possible clock error (`TimeUncertainty`). Before
the first authentic fix the possible clock error is the stated limit. After a fix the possible clock error is the
possible error at the fix plus the possible drift of the oscillator since the fix, but at most the stated limit.

`block_searches.py` uses both searches for a block of one epoch.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from vestige.acas_processor.checks.check import check_budget
from vestige.acas_processor.searches.handover import assisted_delay_m
from vestige.acas_processor.searches.vestigial import (
    VestigialDecision,
    arrival_window,
    decide_vestigial,
    handover_peaks,
    line_stretches,
    reception_proof,
)
from vestige.constants import E1_CARRIER_HZ, E1_CODE_PERIOD_S, SECONDARY_PERIOD_S
from vestige.crypto.osnma.disclosure import ReceptionProof
from vestige.crypto.recs.group_delay import OS_ICD_CONVENTION, GroupDelayConvention
from vestige.crypto.recs.recs_segment import CipherMode, decrypt
from vestige.records import Assistance, ChipSequence, SampleBatch, SampleSource, Snapshot
from vestige.records.snapshot_block import SEARCH_NOT_RUN
from vestige.records.time_uncertainty import TimeUncertainty
from vestige.sample_processor.acquisition import Acquisition
from vestige.sample_processor.e1_snapshot import E1_WINDOW_S, MIN_SECONDARY_MARGIN_DB, measure_e1
from vestige.sample_processor.search.e1_search import MAX_SIGNALS, search_e1
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch, searchable
from vestige.sample_processor.search.peak import Peak
from vestige.sample_processor.search.sample_source import BatchSource
from vestige.signals.definitions import E6C
from vestige.signals.open_e6c import is_open_e6c, repeated_after_s
from vestige.theory.search_budget import search_budget
from vestige.time import GalileoTime

_OPEN_CODE = next(why for why in SEARCH_NOT_RUN if "open E6-C" in why)

_SAME_S = 2e-6  # duration of 2 chips of E1 in s, which the search on E1 omits around a found signal

_Stretch = tuple[list[ChipSequence], GalileoTime, GalileoTime]  # codes, and their first and last time of arrival


@dataclass(frozen=True, slots=True, kw_only=True)
class SatelliteSearch:
    """Result of a search for one satellite."""

    svid: int
    signals: tuple[Acquisition, ...]  # signals on E1, the strongest signal first; empty for the exhaustive search
    # Peaks in E6, in order of time. The first peak is the earliest signal on E6. The tuple is empty if the first peak
    # may have arrived after the disclosure of the key of the RECS. The peaks then do not show which signal is true, but
    # `count` includes these peaks.
    peaks: tuple[Peak, ...]
    count: float  # number of signals; NaN if the search was not run
    carrying: int = 0  # number of signals that carry the encrypted chips
    # Whether the first peak of several signals is known to be the true signal. The value is False if E6 has only one
    # peak and a signal on E1 comes before this peak, because the true signal may be too weak on E6.
    true_is_known: bool = False
    not_run: int = 0  # 0 if the search was run, else 1 + the index of the reason in `SEARCH_NOT_RUN`
    sent: GalileoTime | None = None  # time of transmission of the RECS of the peaks; None without peaks


@dataclass(frozen=True, slots=True, kw_only=True)
class E1VestigialSearch:
    """Search for all signals on E1, with hand-over to E6."""

    # false-alarm probability in one snapshot: of the search on E1 for all satellites together, and of the search on E6
    # for each satellite
    p_fa: float = 1e-3
    # arguments of `search_e1`
    doppler_span_hz: float = 5000.0
    periods: int = 24
    taps: int = 5  # number of correlators at each possible arrival time
    # settings with the same meaning as in `AcasProcessor`
    cipher_mode: CipherMode = CipherMode.CBC
    group_delay_convention: GroupDelayConvention = OS_ICD_CONVENTION

    def __post_init__(self) -> None:
        check_budget(self.p_fa)

    def search(
        self, snapshot: Snapshot, assistance: Assistance, uncertainty: TimeUncertainty
    ) -> tuple[SatelliteSearch, ...]:
        """Return the result for every satellite with a RECS; if E6 or a key is missing, E1 alone decides.

        The signals of a satellite are handed over to E6 if the satellite has more than one signal on E1. Before the
        first authentic fix all signals are handed over, because without an authentic fix a single signal may be a
        replay.

        The snapshot has at least 8 ms of E1 (better 100 ms), and E6 if available.
        """
        svids = _satellites(assistance)
        if snapshot.e1 is None:
            return tuple(_not_run(svid, "no E1 samples") for svid in svids)
        n_searched = math.ceil(E1_WINDOW_S * snapshot.e1.sample_rate_hz)
        window = replace(snapshot.e1, samples=snapshot.e1.samples[:n_searched])
        signals = search_e1(
            window,
            svids,
            overall_pfa=self.p_fa,
            doppler_span_hz=self.doppler_span_hz,
            periods=self.periods,
        )
        results = []
        for svid in svids:
            own = tuple(one for one in signals if one.svid == svid)
            wanted = len(own) > 1 or uncertainty.fixed_at is None
            looked_for = own if wanted else ()
            decision, sent = self._handed_over(svid, looked_for, snapshot.e1, snapshot, assistance, uncertainty)
            if not own:
                results.append(_not_run(svid, "no signal of this satellite on E1"))
                continue
            results.append(
                SatelliteSearch(
                    svid=svid,
                    signals=own,
                    peaks=_proven(decision),
                    count=float(max(len(own), len(decision.peaks))),
                    carrying=len(decision.peaks),
                    true_is_known=len(own) < MAX_SIGNALS  # otherwise E1 may have more signals, even an earlier signal
                    and (
                        len(decision.peaks) > 1
                        or (len(decision.peaks) == 1 and not _preceded(decision.peaks[0], own, window, sent))
                    ),
                    sent=sent,
                )
            )
        return tuple(results)

    def _handed_over(
        self,
        svid: int,
        signals: tuple[Acquisition, ...],
        e1: SampleBatch,
        snapshot: Snapshot,
        assistance: Assistance,
        uncertainty: TimeUncertainty,
    ) -> tuple[VestigialDecision, GalileoTime | None]:
        """Return the decision on E6 from the times of all E1 signals, and the transmission time of the RECS.

        If there are several RECS, the decision with the highest rank (`_says`) is returned.
        """
        decision, sent = decide_vestigial(svid, ()), None
        e6 = _samples(snapshot)
        if e6 is None or not signals:
            return decision, sent
        codes = _codes(snapshot, assistance, uncertainty, svid, self.cipher_mode)
        for code in codes:
            window = arrival_window(code.transmit_time, uncertainty.at(snapshot.time), e6)
            if window is None:
                continue
            delay_m = assisted_delay_m(assistance, svid, snapshot.time, self.group_delay_convention)
            lines = [
                line
                for one in signals
                for line in line_stretches(BatchSource(e1), one, e1.start, code, *window, delay_m=delay_m)
            ]
            found, _ = handover_peaks(e6, lines, overall_pfa=self.p_fa / len(codes), taps=self.taps)
            own = decide_vestigial(
                svid,
                found,
                _proof(code, snapshot, assistance, uncertainty),
                repeated_after_s=repeated_after_s(code.chips, svid),
            )
            if _says(own) > _says(decision):
                decision, sent = own, code.transmit_time
        return decision, sent


@dataclass(frozen=True, slots=True, kw_only=True)
class E6ExhaustiveSearch:
    """Search of every half chip and Doppler bin of E6."""

    p_fa: float = 1e-3  # false-alarm probability of the search in one snapshot
    # integration time, Doppler span, engine and number of workers of the search
    how: ExhaustiveSearch = ExhaustiveSearch()  # noqa: RUF009  (frozen)
    # time in s to search before and after the RECS that E1 predicts; None for the whole time uncertainty
    around_s: float | None = None
    cipher_mode: CipherMode = CipherMode.CBC  # setting with the same meaning as in `AcasProcessor`

    def __post_init__(self) -> None:
        check_budget(self.p_fa)

    def search(
        self,
        snapshot: Snapshot,
        assistance: Assistance,
        uncertainty: TimeUncertainty,
        e6: SampleSource | None = None,
        *,
        expected: Mapping[int, GalileoTime] | None = None,
    ) -> tuple[SatelliteSearch, ...]:
        """Return the result for every satellite with a RECS.

        `e6` replaces the samples of the snapshot, for example if the file is too long for a snapshot. If `around_s` is
        set, `expected` gives the time at which E1 predicts the RECS of a satellite. In this case, satellites without a
        predicted time are not searched.
        """
        source = e6 or _samples(snapshot)
        found = {
            svid: _codes(snapshot, assistance, uncertainty, svid, self.cipher_mode) for svid in _satellites(assistance)
        }
        unclear = {svid for svid, codes in found.items() if codes and not self._clear(codes)}
        codes = [code for codes in found.values() for code in self._clear(codes)]
        decisions: dict[int, VestigialDecision] = {}
        sent: dict[int, GalileoTime] = {}
        if source is not None:
            stretches = self._stretches(source, codes, uncertainty.at(snapshot.time), expected or {})
            found_of = sorted(self._peaks(source, stretches), key=lambda one: _apart_s(one[0], snapshot))
            for code, peaks in found_of:
                own = decide_vestigial(code.svid, peaks, _proof(code, snapshot, assistance, uncertainty))
                if code.svid not in decisions or _says(own) > _says(decisions[code.svid]):
                    decisions[code.svid] = own
                    sent[code.svid] = code.transmit_time
        return tuple(
            _not_run(svid, "no E6 samples")
            if source is None
            else _not_run(svid, _OPEN_CODE)
            if svid in unclear
            else _of_decision(svid, decisions.get(svid), codes, sent)
            for svid, codes in found.items()
        )

    def _clear(self, codes: Sequence[ChipSequence]) -> tuple[ChipSequence, ...]:
        """Return the RECS that occur once in the searched samples; an open code occurs in each code period."""
        if self.around_s is not None and self.around_s < E6C.period_s / 2:
            return tuple(codes)
        return tuple(code for code in codes if not is_open_e6c(code.chips, code.svid))

    def _stretches(
        self, source: SampleSource, codes: list[ChipSequence], uncertainty_s: float, expected: Mapping[int, GalileoTime]
    ) -> list[_Stretch]:
        """Return the codes to search in each time range.

        The codes with the same transmission time share a time range; if `around_s` is set, each code has its own time
        range.
        """
        stretches = []
        for sent in sorted({code.transmit_time for code in codes}):
            group = [code for code in codes if code.transmit_time == sent]
            window = arrival_window(sent, uncertainty_s, source)
            if window is None:
                continue
            if self.around_s is None:
                stretches.append((group, *window))
                continue
            for code in group:
                if code.svid in expected:
                    first = max(window[0], expected[code.svid] + -self.around_s)
                    stretches.append(([code], first, min(window[1], expected[code.svid] + self.around_s)))
        return stretches

    def _peaks(
        self, source: SampleSource, stretches: list[_Stretch]
    ) -> Iterator[tuple[ChipSequence, tuple[Peak, ...]]]:
        """Yield each searched code with the peaks of its search."""
        for group, first, last in stretches:
            starts = searchable(source, self.how.integration_s, first, last)[1]
            hypotheses = self.how.hypotheses(starts, len(group))
            if hypotheses <= 0:
                continue
            share = self.p_fa / len(stretches)
            limit = search_budget(hypotheses, self.how.integration_s, overall_pfa=share).threshold
            *_, state = self.how.run(source, group, first, last, limit)
            yield from ((code, state.peaks) for code in group)


def _not_run(svid: int, why: str) -> SatelliteSearch:
    return SatelliteSearch(svid=svid, signals=(), peaks=(), count=math.nan, not_run=SEARCH_NOT_RUN.index(why) + 1)


def _of_decision(
    svid: int, decision: VestigialDecision | None, codes: tuple[ChipSequence, ...], sent: Mapping[int, GalileoTime]
) -> SatelliteSearch:
    """Return the result of an exhaustive search for one satellite."""
    if decision is None:
        why = "the E6 samples do not hold the RECS anywhere in the time uncertainty"
        return _not_run(
            svid, why if codes else "the satellite has no RECS with a known key that was still secret at reception"
        )
    if not decision.peaks:
        return _not_run(svid, "the RECS was not found in E6")
    if decision.true is None and not decision.spoofed:
        return _not_run(svid, "the RECS was found, but its key may have been public when it arrived")
    return SatelliteSearch(
        svid=svid,
        signals=(),
        peaks=_proven(decision),
        count=float(len(decision.peaks)),
        carrying=len(decision.peaks),
        true_is_known=len(decision.peaks) > 1,
        sent=sent[svid],
    )


def _preceded(peak: Peak, signals: Sequence[Acquisition], e1: SampleBatch, sent: GalileoTime | None) -> bool:
    """Return whether a signal on E1 comes before a peak in E6, by at most half a period of the secondary code.

    If the phase of the secondary code is unknown, half a period of the primary code (2 ms) is used. Signals on E1 that
    were handed over to the same peak do not come before the peak; their times may differ from the peak by `_SAME_S`.
    """
    if sent is None:
        return False
    for one in signals:
        sent_s, period_s = _sent_on_e1(one, e1, peak.start_time)
        behind_s = (sent_s - sent.fraction + period_s / 2) % period_s - period_s / 2
        if behind_s > _SAME_S:
            return True
    return False


def _sent_on_e1(signal: Acquisition, e1: SampleBatch, received: GalileoTime) -> tuple[float, float]:
    """Return the transmission time of a signal on E1 for a time of reception, and the period of the signal.

    Both values are in s. The transmission time is known only up to a multiple of the period.
    """
    measured = measure_e1(e1, signal)
    if measured is not None and measured.secondary_margin_db >= MIN_SECONDARY_MARGIN_DB:
        since_s = (received - measured.time) * (1 + measured.doppler_hz / E1_CARRIER_HZ)
        return measured.transmit_phase_s + since_s, SECONDARY_PERIOD_S
    return (received - e1.start - signal.code_start_s) * (1 + signal.doppler_hz / E1_CARRIER_HZ), E1_CODE_PERIOD_S


def _says(decision: VestigialDecision) -> int:
    """Return the rank of a decision: 2 with several signals, 1 with a single signal, 0 without a signal.

    Among decisions of equal rank, the decision on the RECS that is nearest to the snapshot in time is used.
    """
    return min(len(decision.peaks), 2)


def _apart_s(code: ChipSequence, snapshot: Snapshot) -> float:
    return abs(code.transmit_time - snapshot.time)


def _proven(decision: VestigialDecision) -> tuple[Peak, ...]:
    """Return the peaks if the first peak is the true signal, else no peak."""
    return () if decision.true is None else decision.peaks


def _proof(
    code: ChipSequence, snapshot: Snapshot, assistance: Assistance, uncertainty: TimeUncertainty
) -> ReceptionProof:
    """Return the `ReceptionProof` of a RECS, which says whether the RECS arrived before the disclosure of its key.

    The time tags of the samples follow E1, and may therefore follow a spoofing signal. `received_at` does not follow
    E1.
    """
    proof = reception_proof(assistance, code, uncertainty.at(snapshot.received_at))
    behind_s = 0.0 if snapshot.e6 is None else max(snapshot.received_at - snapshot.e6.received_until, 0.0)
    return replace(proof, labels_behind_s=behind_s)


def _codes(
    snapshot: Snapshot, assistance: Assistance, uncertainty: TimeUncertainty, svid: int, cipher_mode: CipherMode
) -> tuple[ChipSequence, ...]:
    """Return the decrypted RECS whose keys were provably secret when the samples began, the nearest in time first."""
    begin = snapshot.received_at if snapshot.e6 is None else snapshot.e6.received_from
    keys = {key.time: key for key in assistance.keys}
    codes = [
        decrypt(segment, keys[segment.key_time], mode=cipher_mode)
        for segment in assistance.segments
        if segment.svid == svid and segment.key_time in keys
    ]
    proven = [code for code in codes if _proof(code, snapshot, assistance, uncertainty).holds(begin)]
    return tuple(sorted(proven, key=lambda code: _apart_s(code, snapshot)))


def _samples(snapshot: Snapshot) -> SampleSource | None:
    """Return the E6 samples of a snapshot; None if the snapshot has no samples, or a model in place of samples."""
    return None if snapshot.e6 is None else snapshot.e6.searched


def _satellites(assistance: Assistance) -> list[int]:
    return sorted({one.svid for one in assistance.segments})
