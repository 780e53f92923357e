"""Print the output of `vestige search`: signals on E1, or cost, progress and signals of a search in E6."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from vestige.cli.terminal import echo, note

if TYPE_CHECKING:
    from vestige.acas_processor.searches.vestigial import VestigialDecision
    from vestige.crypto.osnma.disclosure import ReceptionProof
    from vestige.sample_processor.search.e1_list import E1Signals
    from vestige.sample_processor.search.engines.choice import EngineChoice
    from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch, SearchState
    from vestige.sample_processor.search.peak import Peak
    from vestige.theory.search_budget import SearchBudget
    from vestige.time import GalileoTime

REPORT_EVERY_S = 5.0  # time between two progress lines
_NOWHERE = "no signal on E1 for the hand-over, or the samples do not hold the RECS within the time uncertainty"


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """Result of a search for one RECS."""

    decision: VestigialDecision
    budget: SearchBudget
    proof: ReceptionProof  # rule that says whether a chip was received before the disclosure of the key


def print_budget(budget: SearchBudget, search: ExhaustiveSearch, engine: EngineChoice) -> None:
    """Print the cost and the engine of an exhaustive search before the search starts."""
    from vestige.sample_processor.search.speed import expected_seconds

    lines = (
        ("hypotheses", f"{budget.hypotheses:.4g}"),
        ("P_FA of all, P_fa of one", f"{budget.pfa_overall:g}, {budget.pfa:.3e}"),
        ("threshold", f"{budget.threshold:.3f} σ"),
        (
            "C/N0 for P_d 0.9",
            f"{budget.required_cn0_dbhz:.2f} dBHz at a grid point, up to {budget.grid_loss_db:.2f} dB more between "
            "grid points",
        ),
        ("engine", str(engine)),
        ("expected run time", f"{expected_seconds(search, budget.hypotheses):.0f} s"),
    )
    for name, value in lines:
        note(f"{name:26}{value}")


def places_line(svid: int, budget: SearchBudget) -> str:
    """Return the size and the sensitivity of the hand-over search for a RECS, as a line of text."""
    return (
        f"E{svid:02d}  {budget.hypotheses:.4g} hypotheses, P_FA {budget.pfa_overall:g}: threshold "
        f"{budget.threshold:.2f} σ, {budget.required_cn0_dbhz:.2f} dBHz for P_d 0.9 at a grid point"
    )


def follow_search(
    states: Iterable[SearchState],
    *,
    before: SearchState | None,
    each: Callable[[GalileoTime, float], None],
    keep: Callable[[SearchState], None],
) -> tuple[tuple[Peak, ...], GalileoTime | None]:
    """Follow a search to its end, and return the peaks, and the time from which on not all samples were searched.

    The time is None if all samples were searched. Each peak is printed at once. The rate and the remaining time of the
    search are printed with each peak, and at intervals of `REPORT_EVERY_S`.

    `before` is the last state of an earlier run. `each` is called with the first arrival time and the largest magnitude
    of every block. `keep` is called with the state of the search at intervals of `REPORT_EVERY_S`, after every new
    peak, and at the end.
    """
    state, done = before, 0.0
    if before is not None:
        done = before.done
        note(f"continues after {done / max(before.total, 1):.1%}, {len(before.peaks)} peaks")
    begin = reported = time.monotonic()
    try:
        for latest in states:
            now = time.monotonic()
            news = [peak for peak in latest.peaks if state is None or peak not in state.peaks]
            state = latest
            each(state.block_start, state.block_magnitude)
            for peak in news:
                note(f"found: {_peak_line(peak)}")
            if news or now - reported > REPORT_EVERY_S:
                rate = max(state.done - done, 1.0) / max(now - begin, 1e-9)
                note(
                    f"{state.done / max(state.total, 1):6.1%}  {rate / 1e6:.0f} million hypotheses/s  "
                    f"{(state.total - state.done) / rate:.0f} s left  {len(state.peaks)} peaks"
                )
                keep(state)
                reported = now
    except KeyboardInterrupt:
        if state is None:
            raise
        keep(state)
        return state.peaks, state.block_start
    if state is None:
        return (), None
    keep(state)
    return state.peaks, None


def print_answers(answers: Sequence[Answer], *, as_json: bool, unsearched: GalileoTime | None = None) -> None:
    """Print the result for each RECS.

    After an interruption, `unsearched` is the time from which on not all samples were searched.
    """
    if as_json:
        results = [
            {
                "svid": one.decision.svid,
                "spoofed": one.decision.spoofed,
                "open_code": one.decision.open_code,
                "true_start_time": None if one.decision.true is None else str(one.decision.true.start_time),
                "hypotheses": one.budget.hypotheses,
                "peaks": [_as_dict(peak, one.proof) for peak in one.decision.peaks],
            }
            for one in answers
        ]
        echo(json.dumps({"complete": unsearched is None, "satellites": results}))
        return
    for one in answers:
        if not one.budget.hypotheses:
            echo(f"E{one.decision.svid:02d}  not searched: {_NOWHERE}")
        elif not one.decision.peaks:
            echo(f"E{one.decision.svid:02d}  not found")
        for peak in one.decision.peaks:
            echo(f"{_peak_line(peak)}  {_role(peak, one)}")
    if unsearched is not None:
        echo(f"INTERRUPTED: samples from {unsearched} on were not all searched, so there may be later signals")


def _role(peak: Peak, answer: Answer) -> str:
    if answer.decision.open_code:
        return "proves nothing: the RECS contains the open E6-C code, which repeats each ms"
    if peak is answer.decision.true:
        return "true: the earliest"
    if peak is not answer.decision.peaks[0]:
        return "later: SPOOFING"
    return "proves nothing: its key may have been public"


def _peak_line(peak: Peak) -> str:
    return (
        f"E{peak.svid:02d}  {peak.start_time}  Doppler {peak.doppler_hz:8.1f} Hz  "
        f"{peak.magnitude:6.2f} σ (threshold {peak.threshold:.2f})  C/N0 {peak.cn0_dbhz:4.1f} dBHz"
    )


def _as_dict(peak: Peak, proof: ReceptionProof) -> dict[str, Any]:
    return {
        "start_time": str(peak.start_time),
        "start_fraction_s": peak.start_time.fraction,
        "doppler_hz": peak.doppler_hz,
        "magnitude_sigma": peak.magnitude,
        "threshold_sigma": peak.threshold,
        "cn0_dbhz": peak.cn0_dbhz,
        "before_disclosure": proof.holds(peak.start_time),
    }


def e1_lines(found: E1Signals) -> Iterator[str]:
    """Yield the lines that `vestige search e1` prints.

    The first line has the time to which the values refer. Each further line describes a signal. Without a signal, a
    single line says that no signal was found.
    """
    if not found.signals:
        yield "no signal found"
        return
    yield f"at {found.batch.start}, sample {found.batch.first_sample}"
    for one in found.signals:
        rank = "" if sum(other.svid == one.svid for other in found.signals) == 1 else "  one of several: spoofing"
        rough = "" if one.is_measured else "  rough: Doppler ±63 Hz, C/N0 up to 4 dB too low"
        yield (
            f"E{one.svid:02d}  code phase {one.code_start_s * 1e3:8.5f} ms  Doppler {one.doppler_hz:8.1f} Hz  "
            f"C/N0 {one.cn0_dbhz:5.1f} dBHz{rough}{rank}"
        )


def e1_json(found: E1Signals) -> dict[str, Any]:
    """Return the object that `vestige search e1 --json` prints."""
    from math import isfinite

    return {
        "time": str(found.batch.start),
        "first_sample": found.batch.first_sample,
        "signals": [
            {
                "svid": one.svid,
                "code_start_s": one.code_start_s,
                "transmit_phase_s": one.transmit_phase_s,
                "doppler_hz": one.doppler_hz,
                "cn0_dbhz": one.cn0_dbhz if isfinite(one.cn0_dbhz) else None,
                "measured": one.is_measured,
                "statistic": one.found.statistic,
                "threshold": one.found.threshold,
            }
            for one in found.signals
        ],
        "jumps": [{"svid": one.svid, "at_s": one.at_s, "by_s": one.by_s} for one in found.jumps],
    }
