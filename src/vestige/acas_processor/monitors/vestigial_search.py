"""The vestigial searches as checks: whether there is more than one signal of a satellite.

Step 4 of [WFO, Sec. IV-B] and step 5 of [WFO, Sec. IV-C].

`E1VestigialSearch` belongs to level 2: all signals on E1, and the hand-over of each to E6. `E6ExhaustiveSearch` belongs
to level 3: every half chip and Doppler bin of E6. Both take a snapshot and its assistance and answer for each satellite
with the peaks and a check of the number of signals against one. What an attacker can do against them: null the true
signal, or bury it in noise; then the check of E6 power and that of received power have something to say.

Both search the `TimeUncertainty`: what the receiver knows of its clock before its first authentic fix, and after it
only what the oscillator may have drifted since.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from vestige.acas_processor.handover import assisted_delay_m
from vestige.acas_processor.monitors.judgement import Monitor, check_budget, judged, not_run
from vestige.acas_processor.search_budget import search_budget
from vestige.acas_processor.vestigial import (
    E1_WINDOW_S,
    VestigialDecision,
    arrival_window,
    decide_vestigial,
    handover_peaks,
    line_stretches,
    reception_proof,
)
from vestige.crypto.disclosure import ReceptionProof
from vestige.crypto.recs import decrypt
from vestige.records import Assistance, CheckResult, ChipSequence, SampleBatch, Snapshot
from vestige.sample_processor.acquisition import Acquisition
from vestige.sample_processor.correlator import CorrelatableSamples
from vestige.sample_processor.search.e1_search import search_e1
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch, searchable
from vestige.sample_processor.search.peak import Peak
from vestige.sample_processor.search.sample_source import BatchSource, SampleSource
from vestige.time import GalileoTime
from vestige.valid_numbers import require_finite, require_time_uncertainty

_Stretch = tuple[list[ChipSequence], GalileoTime, GalileoTime]  # codes, first and last time of arrival

FIXED_S = 1e-6  # 300 m: of a position out of authenticated pseudoranges


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeUncertainty:
    """Bound on the error of the receiver's clock.

    Attributes
    ----------
    initial_s
        Before the first authentic fix.
    frequency_error
        Bound on the relative frequency error of the oscillator.
    fixed_at, fixed_s
        Time of the last authentic fix, and how good it was.
    """

    initial_s: float = 15.0
    frequency_error: float = 2e-6  # of a temperature-compensated crystal oscillator over temperature and age
    fixed_at: GalileoTime | None = None
    fixed_s: float = FIXED_S

    def __post_init__(self) -> None:
        require_time_uncertainty(self.initial_s)
        require_finite("time uncertainty", frequency_error=self.frequency_error, fixed_s=self.fixed_s)

    def at(self, time: GalileoTime) -> float:
        """Return the bound at a time, in s."""
        if self.fixed_at is None:
            return self.initial_s
        return min(self.fixed_s + self.frequency_error * abs(time - self.fixed_at), self.initial_s)

    def after_fix(self, time: GalileoTime, fixed_s: float = FIXED_S) -> TimeUncertainty:
        """Return the uncertainty after an authentic fix at a time."""
        return replace(self, fixed_at=time, fixed_s=fixed_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class SatelliteSearch:
    """What a search says of one satellite.

    Attributes
    ----------
    signals
        On E1, the strongest first; none from the exhaustive search.
    peaks
        In E6, in order of time: the first is the true signal. None if the first may have arrived after the disclosure
        of its key; then E6 says nothing of it, but `check` counts what was found all the same.
    sent
        Time of transmission of the RECS that the peaks are of; None without peaks.
    """

    svid: int
    signals: tuple[Acquisition, ...]
    peaks: tuple[Peak, ...]
    check: CheckResult
    sent: GalileoTime | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class E1VestigialSearch:
    """All signals on E1, handed over to E6.

    Attributes
    ----------
    p_fa
        Of one snapshot, for E1 and for E6 each.
    doppler_span_hz, periods
        Of `search_e1`.
    taps
        Of `search_handover`.
    """

    p_fa: float = 1e-3
    doppler_span_hz: float = 5000.0
    periods: int = 24
    taps: int = 5

    def __post_init__(self) -> None:
        check_budget(self.p_fa)

    @property
    def name(self) -> str:
        """Name in `CheckResult`."""
        return "E1 vestigial search"

    @property
    def unit(self) -> str:
        """Unit of statistic and threshold."""
        return "signals"

    def search(
        self, snapshot: Snapshot, assistance: Assistance, uncertainty: TimeUncertainty
    ) -> tuple[SatelliteSearch, ...]:
        """Return what there is of every satellite with a RECS; without E6 or a key E1 alone decides.

        The hand-over is made of satellites with more than one signal on E1 and, before the first authentic fix, of all:
        then a signal may be the right one at the wrong time.

        Parameters
        ----------
        snapshot
            With at least 8 ms of E1, better 100; E6 as far as it goes.
        """
        svids = _satellites(assistance)
        if snapshot.e1 is None:
            nothing = not_run(self, "no E1 samples")
            return tuple(SatelliteSearch(svid=svid, signals=(), peaks=(), check=nothing) for svid in svids)
        signals = search_e1(
            _beginning(snapshot.e1),
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
            count = max(len(own), len(decision.peaks))
            check = _count(self, count, decision) if own else not_run(self, "no signal of this satellite on E1")
            results.append(SatelliteSearch(svid=svid, signals=own, peaks=_proven(decision), check=check, sent=sent))
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
        """Return the decision on E6 at the places of all signals on E1, and when its RECS was sent, which says most."""
        decision, sent = decide_vestigial(svid, ()), None
        e6 = _samples(snapshot)
        if e6 is None or not signals:
            return decision, sent
        codes, _ = _codes(snapshot, assistance, uncertainty, svid)
        for code in codes:
            window = arrival_window(code.transmit_time, uncertainty.at(snapshot.time), e6)
            if window is None:
                continue
            delay_m = assisted_delay_m(assistance, svid, snapshot.time)
            lines = [
                line
                for one in signals
                for line in line_stretches(BatchSource(e1), one, e1.start, code, *window, delay_m=delay_m)
            ]
            found, _ = handover_peaks(e6, lines, overall_pfa=self.p_fa / len(codes), taps=self.taps)
            own = decide_vestigial(svid, found, _proof(code, snapshot, assistance, uncertainty))
            if _says(own) > _says(decision):
                decision, sent = own, code.transmit_time
        return decision, sent


@dataclass(frozen=True, slots=True, kw_only=True)
class E6ExhaustiveSearch:
    """Every half chip and Doppler bin of E6.

    Attributes
    ----------
    p_fa
        Of one snapshot.
    how
        Integration time, Doppler span, engine, workers.
    around_s
        How far before and after the place where E1 expects the RECS to look; None for all of the time uncertainty.
    """

    p_fa: float = 1e-3
    how: ExhaustiveSearch = ExhaustiveSearch()  # noqa: RUF009  (frozen)
    around_s: float | None = None

    def __post_init__(self) -> None:
        check_budget(self.p_fa)

    @property
    def name(self) -> str:
        """Name in `CheckResult`."""
        return "E6 exhaustive search"

    @property
    def unit(self) -> str:
        """Unit of statistic and threshold."""
        return "signals"

    def search(
        self,
        snapshot: Snapshot,
        assistance: Assistance,
        uncertainty: TimeUncertainty,
        e6: SampleSource | None = None,
        *,
        expected: Mapping[int, GalileoTime] | None = None,
    ) -> tuple[SatelliteSearch, ...]:
        """Return what there is of every satellite with a RECS.

        Parameters
        ----------
        e6
            Samples in place of those of the snapshot: a file that is too long for one.
        expected
            Where E1 puts the RECS of a satellite, for `around_s`; satellites without are not searched then.
        """
        source = e6 or _samples(snapshot)
        found = {svid: _codes(snapshot, assistance, uncertainty, svid) for svid in _satellites(assistance)}
        codes = [code for codes, _ in found.values() for code in codes]
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
            SatelliteSearch(
                svid=svid,
                signals=(),
                peaks=_proven(decisions[svid]) if svid in decisions else (),
                check=self._judged(decisions.get(svid), "no E6 samples" if source is None else reason),
                sent=sent.get(svid),
            )
            for svid, (_, reason) in found.items()
        )

    def _stretches(
        self,
        source: SampleSource,
        codes: list[ChipSequence],
        uncertainty_s: float,
        expected: Mapping[int, GalileoTime],
    ) -> list[_Stretch]:
        """Return which codes to look for where: those of one transmission at once, or each around its own place."""
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
        """Yield the codes that could be looked for, each with the peaks of its search."""
        for group, first, last in stretches:
            hypotheses = self._hypotheses(source, (first, last), len(group))
            if hypotheses <= 0:
                continue
            share = self.p_fa / len(stretches)
            limit = search_budget(hypotheses, self.how.integration_s, overall_pfa=share).threshold
            *_, state = self.how.run(source, group, first, last, limit)
            yield from ((code, state.peaks) for code in group)

    def _hypotheses(self, source: SampleSource, window: tuple[GalileoTime, GalileoTime], n_codes: int) -> float:
        return self.how.hypotheses(searchable(source, self.how.integration_s, *window)[1], n_codes)

    def _judged(self, decision: VestigialDecision | None, reason: str) -> CheckResult:
        if decision is None:
            return not_run(self, reason or "the E6 samples do not hold the RECS anywhere in the time uncertainty")
        if not decision.peaks:
            return not_run(self, "the RECS was not found in E6")
        if decision.true is None and not decision.spoofed:
            where = f"the RECS was found at {decision.peaks[0].start_time}, when its key may have been known"
            return not_run(self, where)
        return _count(self, len(decision.peaks), decision)


def _count(monitor: Monitor, count: int, decision: VestigialDecision) -> CheckResult:
    """Return the check of a number of signals against one."""
    where = "E6 does not say which is the true one"
    if decision.spoofed:
        where = f"{len(decision.peaks)} carry the encrypted chips; " + (
            f"the earliest, at {decision.true.start_time}, is the true one"
            if decision.true is not None
            else "all of them when their key may have been known"
        )
    return judged(monitor, float(count), 1.0, f"{count} signals of one satellite: {where}")


def _says(decision: VestigialDecision) -> int:
    """Return 2 of what is spoofed, 1 of one signal, 0 of none: of equals, the RECS of the snapshot itself counts."""
    return min(len(decision.peaks), 2)


def _apart_s(code: ChipSequence, snapshot: Snapshot) -> float:
    return abs(code.transmit_time - snapshot.time)


def _proven(decision: VestigialDecision) -> tuple[Peak, ...]:
    """Return the peaks if the first is the true signal."""
    return () if decision.true is None else decision.peaks


def _proof(
    code: ChipSequence, snapshot: Snapshot, assistance: Assistance, uncertainty: TimeUncertainty
) -> ReceptionProof:
    """Return which arrivals of a RECS in a snapshot are provably from before the disclosure of its key.

    The labels of the samples follow E1, and with it a spoofer; `received_at` does not.
    """
    proof = reception_proof(assistance, code, uncertainty.at(snapshot.received_at))
    behind_s = 0.0 if snapshot.e6 is None else max(snapshot.received_at - snapshot.e6.received_until, 0.0)
    return replace(proof, labels_behind_s=behind_s)


def _codes(
    snapshot: Snapshot, assistance: Assistance, uncertainty: TimeUncertainty, svid: int
) -> tuple[tuple[ChipSequence, ...], str]:
    """Return the RECS of a satellite that may prove something in a snapshot, its own first, and why there is none."""
    begin = snapshot.e6.batch.start if isinstance(snapshot.e6, CorrelatableSamples) else snapshot.received_at
    keys = {key.time: key for key in assistance.keys}
    codes, reason = [], "no RECS of this satellite"
    for segment in assistance.segments:
        if segment.svid != svid:
            continue
        key = keys.get(segment.key_time)
        if key is None:
            reason = f"no validated OSNMA key of {segment.key_time}"
            continue
        code = decrypt(segment, key)
        if _proof(code, snapshot, assistance, uncertainty).holds(begin):
            codes.append(code)
        else:
            reason = f"not provably received before the key's disclosure at {key.disclosed_at}"
    return tuple(sorted(codes, key=lambda code: _apart_s(code, snapshot))), "" if codes else reason


def _samples(snapshot: Snapshot) -> SampleSource | None:
    """Return the E6 samples of a snapshot, None if it has none, or a model in place of them."""
    if not isinstance(snapshot.e6, CorrelatableSamples):
        return None
    return snapshot.e6.surroundings or BatchSource(snapshot.e6.batch)


def _beginning(batch: SampleBatch) -> SampleBatch:
    """Return the first 100 ms."""
    return replace(batch, samples=batch.samples[: math.ceil(E1_WINDOW_S * batch.sample_rate_hz)])


def _satellites(assistance: Assistance) -> list[int]:
    return sorted({one.svid for one in assistance.segments})
