"""`vestige search`: search for every signal of a satellite on E1, and for the encrypted signal anywhere in E6."""

from __future__ import annotations

import json
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.options import (
    PATH,
    assistance_folder,
    assistance_option,
    cipher_mode,
    cipher_mode_option,
    group_delay_convention,
    group_delay_option,
    json_option,
    number_option,
    options_together,
    parse_svids,
    recording_argument,
    start_option,
)
from vestige.cli.recordings.searches.search_input import (
    arrival_window_in,
    clock_bound_s,
    decrypted_recs,
    grouped_by_transmission,
    opened_recording,
    reader_of,
    say_jump,
)
from vestige.cli.terminal import echo, note
from vestige.output import check_output

if TYPE_CHECKING:
    from vestige.cli.recordings.searches.search_report import Answer
    from vestige.recording.samples.sample_file import SampleReader
    from vestige.recording.search_log import SearchLog
    from vestige.records import ChipSequence
    from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch
    from vestige.time import GalileoTime

_svids = click.option("--svids", default="1-36", help="Satellites to search, for example 2,3,7-9.")
_p_fa = number_option("--p-fa-overall", (1e-15, 0.5), default=1e-3, help="False-alarm probability of the whole search.")
_uncertainty = number_option(
    "--uncertainty-s",
    (1e-6, 1e5),
    metavar="SECONDS",
    help="Search within ± SECONDS of the expected arrival. [default: time uncertainty of the recording]",
)
_plot = click.option("--plot", type=PATH, help="Draw the search of one satellite into this file (.png, .pdf, .svg).")


_doppler_span = number_option(
    "--doppler-span-hz", (100, 50_000), default=5000.0, help="Half width of the Doppler search in Hz."
)
# options of the two commands that search E6 for RECS, `handover` and `exhaustive`
_recs_options = options_together(
    recording_argument, assistance_option, _svids, start_option, _p_fa, _uncertainty, cipher_mode_option
)
_IDENTIFYING_SAMPLES = 65_536  # number of samples at the start that identify a recording, because noise is unique
INTERRUPTED = 130  # exit code after Ctrl-C (SIGINT), as in a shell


@click.group()
def command() -> None:
    """Search for vestigial signals: the true signal beside a spoofing signal."""


@command.command("e1")
@recording_argument
@_svids
@start_option
@_p_fa
@click.option(
    "--periods",
    type=click.IntRange(1, 24),
    default=24,
    help="Number of code periods of 4 ms whose powers are added.",
)
@_doppler_span
@_plot
@json_option
def e1(
    recording_path: Path,
    svids: str,
    start: GalileoTime | None,
    p_fa_overall: float,
    periods: int,
    doppler_span_hz: float,
    plot: Path | None,
    as_json: bool,
) -> None:
    """List every signal of every satellite on E1 at the start of RECORDING.

    At most the first 100 ms are searched, and each signal is measured in these samples. The values of a signal that
    cannot be measured come from the search, and are marked "rough". If samples are missing, only the longest part
    without a gap is used. All values refer to the time of the first sample in use.
    """
    from vestige.cli.progress import progress
    from vestige.cli.recordings.searches.search_report import e1_json, e1_lines
    from vestige.records import Band
    from vestige.sample_processor.e1_snapshot import E1_WINDOW_S
    from vestige.sample_processor.search.e1_list import list_e1

    recording = opened_recording(recording_path, start)
    reader = reader_of(recording, Band.E1)
    batch = reader.read(reader.first_sample, min(round(E1_WINDOW_S * reader.file.sample_rate_hz), reader.n_samples))
    with progress() as report:
        found = list_e1(
            batch,
            parse_svids(svids),
            overall_pfa=p_fa_overall,
            doppler_span_hz=doppler_span_hz,
            periods=periods,
            progress=lambda done, total: report("E1 search", done, total),
        )
    for jump in found.jumps:
        say_jump(jump)
    if plot is not None:
        from vestige.cli.recordings.searches.search_figure import draw_e1

        draw_e1(
            plot, found.batch, parse_svids(svids), [one.found for one in found.signals],
            overall_pfa=p_fa_overall, periods=periods, doppler_span_hz=doppler_span_hz,
        )  # fmt: skip
    if as_json:
        echo(json.dumps(e1_json(found), allow_nan=False))
        return
    for line in e1_lines(found):
        echo(line)


@command.command("handover")
@_recs_options
@group_delay_option
@click.option(
    "--taps",
    type=click.Choice(["1", "3", "5", "7", "9"]),
    default="5",
    help="Number of E6 correlators at each possible arrival, half a chip apart.",
)
@click.option(
    "--every-4-ms",
    is_flag=True,
    help="Search every 4 ms. Without this option the secondary code of E1 leaves one arrival in 100 ms.",
)
@_plot
@json_option
def handover(recording_path: Path, svids: str, start: GalileoTime | None, as_json: bool, **options: Any) -> None:
    """Search E6 at the arrival times that E1 predicts for the RECS.

    The earliest signal found is the true signal, if this signal was received before anybody could know the key.
    """
    from vestige.acas_processor.searches.handover import assisted_delay_m
    from vestige.acas_processor.searches.vestigial import (
        decide_vestigial,
        handover_peaks,
        line_stretches,
        reception_proof,
    )
    from vestige.cli.recordings.searches.search_figure import SearchFigure
    from vestige.cli.recordings.searches.search_report import Answer, places_line, print_answers
    from vestige.records import Band
    from vestige.sample_processor.e1_snapshot import E1_WINDOW_S
    from vestige.sample_processor.search.e1_search import search_e1
    from vestige.signals.open_e6c import repeated_after_s

    recording = opened_recording(recording_path, start)
    e1_reader, e6 = reader_of(recording, Band.E1), reader_of(recording, Band.E6)
    around_s = clock_bound_s(recording, options["uncertainty_s"])
    folder = assistance_folder(recording_path, options["assistance_path"])
    codes, assistance = decrypted_recs(recording, folder, parse_svids(svids), around_s, cipher_mode(options))
    count = min(round(E1_WINDOW_S * e1_reader.file.sample_rate_hz), e1_reader.n_samples)
    batch = e1_reader.read(e1_reader.first_sample, count)
    signals = search_e1(batch, dict.fromkeys(code.svid for code in codes), jumped=say_jump)
    figure = SearchFigure(options["plot"], codes, "E6, handed over from E1")
    answers = []
    for code in codes:
        first, last = arrival_window_in(e6, code, around_s)
        stretches = [
            stretch
            for signal in signals
            if signal.svid == code.svid
            for stretch in line_stretches(
                e1_reader, signal, batch.start, code, first, last,
                delay_m=assisted_delay_m(assistance, code.svid, batch.start, group_delay_convention(options)),
                secondary=not options["every_4_ms"],
            )
        ]  # fmt: skip
        peaks, budget = handover_peaks(
            e6, stretches, overall_pfa=options["p_fa_overall"], taps=int(options["taps"]), trace=figure.add
        )
        proof = reception_proof(assistance, code, around_s)
        decision = decide_vestigial(code.svid, peaks, proof, repeated_after_s=repeated_after_s(code.chips, code.svid))
        answers.append(Answer(decision=decision, budget=budget, proof=proof))
        if budget.hypotheses:
            note(places_line(code.svid, budget))
    figure.write([(one.decision, one.budget) for one in answers])
    print_answers(answers, as_json=as_json)


@command.command("exhaustive")
@_recs_options
@click.option(
    "--integration-ms",
    type=click.Choice(["1", "2", "4", "8", "16"]),
    default="4",
    help="Coherent integration time in ms.",
)
@_doppler_span
@click.option(
    "--engine",
    type=click.Choice(["auto", "cuda", "segment", "fft"]),
    default="auto",
    help="Program that computes the correlations; auto takes the fastest program that runs on this machine.",
)
@click.option("--workers", type=click.IntRange(1, 1024), help="Number of threads. [default: one for each core]")
@click.option(
    "--correlated-neighbours",
    is_flag=True,
    help="Set the threshold for the effective number of hypotheses, because neighbouring hypotheses are correlated.",
)
@click.option(
    "-o", "--output", type=PATH, help="Keep progress and results in this file. If the file exists, continue from it."
)
@_plot
@json_option
def exhaustive(recording_path: Path, svids: str, start: GalileoTime | None, as_json: bool, **options: Any) -> None:
    """Search E6 in steps of half a chip over the time uncertainty, and in every Doppler bin.

    The cost is printed before the search starts, and each signal is printed as soon as it is found. Ctrl-C ends the
    search and prints the signals found so far.
    """
    from vestige.acas_processor.searches.vestigial import decide_vestigial, reception_proof
    from vestige.cli.recordings.searches.search_figure import SearchFigure
    from vestige.cli.recordings.searches.search_report import Answer, follow_search, print_answers, print_budget
    from vestige.records import Band
    from vestige.sample_processor.search.engines.choice import choose_engine
    from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch, searchable
    from vestige.signals.open_e6c import is_open_e6c
    from vestige.theory.search_budget import search_budget

    recording = opened_recording(recording_path, start)
    folder = assistance_folder(recording_path, options["assistance_path"])
    check_output(options["output"], (recording_path, *recording.description.files, folder))
    e6 = reader_of(recording, Band.E6)
    around_s = clock_bound_s(recording, options["uncertainty_s"])
    codes, assistance = decrypted_recs(recording, folder, parse_svids(svids), around_s, cipher_mode(options))
    engine = choose_engine(options["engine"])
    search = ExhaustiveSearch(
        integration_s=float(options["integration_ms"]) * 1e-3,
        doppler_span_hz=options["doppler_span_hz"],
        engine=engine.name,
        workers=options["workers"],
    )
    figure = SearchFigure(options["plot"], codes, "E6, exhaustive")
    log = _log(e6, codes, search, {**options, "uncertainty_s": around_s})
    answers: list[Answer] = []
    unsearched: GalileoTime | None = None
    for group in grouped_by_transmission(codes):
        first, last = arrival_window_in(e6, group[0], around_s)
        hypotheses = search.hypotheses(searchable(e6, search.integration_s, first, last)[1], len(group))
        budget = search_budget(
            hypotheses,
            search.integration_s,
            overall_pfa=options["p_fa_overall"],
            correlated_neighbours=options["correlated_neighbours"],
        )
        print_budget(budget, search, engine)
        name = str(group[0].transmit_time)
        before = None if log is None else log.states.get(name)
        peaks, unsearched = follow_search(
            search.run(e6, group, first, last, budget.threshold, after=before),
            before=before,
            each=figure.add,
            keep=(lambda _: None) if log is None else partial(log.keep, name),
        )
        for code in group:
            proof = reception_proof(assistance, code, around_s)
            decision = decide_vestigial(code.svid, peaks, proof, open_code=is_open_e6c(code.chips, code.svid))
            answers.append(Answer(decision=decision, budget=budget, proof=proof))
        if unsearched is not None:
            break
    figure.write([(one.decision, one.budget) for one in answers])
    print_answers(answers, as_json=as_json, unsearched=unsearched)
    if unsearched is not None:
        sys.exit(INTERRUPTED)


def _log(
    e6: SampleReader, codes: list[ChipSequence], search: ExhaustiveSearch, options: dict[str, Any]
) -> SearchLog | None:
    """Return the search log that `-o` names, for these samples, codes and settings; None without `-o`."""
    from hashlib import sha256

    from vestige.recording.search_log import SearchLog

    if options["output"] is None:
        return None
    secret = sha256(b"".join(code.chips.tobytes() for code in codes)).hexdigest()
    head = sha256(e6.read(e6.first_sample, min(e6.n_samples, _IDENTIFYING_SAMPLES)).samples.tobytes()).hexdigest()
    of = {
        "recording": f"{e6.n_samples} samples from {e6.start} at {e6.file.sample_rate_hz} Hz, {head[:16]}",
        "RECS": " ".join(f"E{code.svid:02d} {code.transmit_time}" for code in codes) + " " + secret[:16],
        "integration time": search.integration_s,
        "Doppler span": search.doppler_span_hz,
        "engine": search.engine,
        "time uncertainty": options["uncertainty_s"],
        "P_FA": options["p_fa_overall"],
        "budget": "correlated neighbours" if options["correlated_neighbours"] else "independent hypotheses",
    }
    return SearchLog.open(options["output"], of)
