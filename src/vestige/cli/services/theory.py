"""`vestige theory`: compute thresholds, probabilities of detection and required C/N0, or the paper's numbers."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.options import FiniteRange
from vestige.cli.terminal import echo

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from vestige.theory.paper_numbers import PaperNumber

DEFAULT_P_FA = 1e-7  # [WFO, Sec. VI-A]

_probability = FiniteRange(1e-250, 1, max_open=True)


@click.command()
@click.option("--cn0", "cn0_dbhz", type=FiniteRange(-100, 200), default=35.0, help="C/N0 in dBHz.")
@click.option(
    "--integration-ms",
    type=FiniteRange(0, 1e6, min_open=True),
    default=16.0,
    help="Coherent integration time in ms.",
)
@click.option("--p-fa", type=_probability, help=f"False-alarm probability of one test.  [default: {DEFAULT_P_FA:g}]")
@click.option(
    "--p-fa-overall", type=_probability, help="False-alarm probability of all tests together, in place of --p-fa."
)
@click.option("--hypotheses", type=FiniteRange(1, 1e30), default=1.0, help="Number of tests.")
@click.option("--p-d", type=_probability, default=0.9, help="Required probability of detection.")
@click.option(
    "--noncoherent", type=click.IntRange(1, 1000), default=1, help="Number of squared magnitudes that are added."
)
@click.option("--paper", is_flag=True, help="Print the paper's numbers, recomputed; the other options have no effect.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, in full precision.")
def command(
    cn0_dbhz: float,
    integration_ms: float,
    p_fa: float | None,
    p_fa_overall: float | None,
    hypotheses: float,
    p_d: float,
    noncoherent: int,
    paper: bool,
    as_json: bool,
) -> None:
    """Print detection threshold, probability of detection and required C/N0.

    The C/N0 refers to a single component (such as E6-C alone). Amplitudes are in standard deviations of the noise in
    one dimension (I or Q).
    """
    if paper:
        _print_paper(as_json)
        return
    if p_fa is not None and p_fa_overall is not None:
        raise click.UsageError("give --p-fa or --p-fa-overall, not both")

    from vestige.theory import thresholds as theory

    single = DEFAULT_P_FA if p_fa is None else p_fa
    if p_fa_overall is not None:
        single = theory.single_event_pfa(p_fa_overall, hypotheses)
    if p_d <= single:
        raise click.UsageError(f"--p-d {p_d:g} must exceed the false-alarm probability {single:g}")

    integration_s = integration_ms / 1e3
    case = (integration_s, single, noncoherent)
    result = {
        "cn0_dbhz": cn0_dbhz,
        "integration_s": integration_s,
        "noncoherent": noncoherent,
        "hypotheses": hypotheses,
        "p_fa": float(single),
        "p_fa_overall": float(theory.overall_pfa(single, hypotheses)),
        "threshold_sigma": float(theory.threshold(single, noncoherent)),
        "amplitude_sigma": float(theory.correlator_amplitude(cn0_dbhz, integration_s, noncoherent)),
        "p_d": float(theory.probability_of_detection(cn0_dbhz, *case)),
        "p_miss": float(theory.miss_probability(cn0_dbhz, *case)),
        "p_d_required": p_d,
        "cn0_required_dbhz": float(theory.required_cn0_dbhz(p_d, *case)),
    }
    if as_json:
        echo(json.dumps(result))
    else:
        _print_result(result)


def _print_result(result: Mapping[str, float]) -> None:
    # P_d close to 1 is printed with enough digits to differ from 1
    digits = max(6, 3 - math.floor(math.log10(result["p_miss"]))) if result["p_miss"] > 1e-12 else 15
    lines = (
        ("C/N0", f"{result['cn0_dbhz']:g} dBHz"),
        ("integration", f"{result['noncoherent']} × {result['integration_s'] * 1e3:g} ms"),
        ("hypotheses", f"{result['hypotheses']:.6g}"),
        ("P_fa of one test", f"{result['p_fa']:.4e}"),
        ("P_FA of all tests", f"{result['p_fa_overall']:.4e}"),
        ("threshold", f"{result['threshold_sigma']:.4f} σ"),
        ("signal", f"{result['amplitude_sigma']:.4f} σ"),
        ("P_d", f"{result['p_d']:.{digits}g}"),
        ("1 − P_d", f"{result['p_miss']:.4e}"),
        (f"C/N0 for P_d {result['p_d_required']:g}", f"{result['cn0_required_dbhz']:.3f} dBHz"),
    )
    width = max(len(name) for name, _ in lines)
    for name, value in lines:
        echo(f"{name:{width}}  {value}")


def _print_paper(as_json: bool) -> None:
    from vestige.theory.paper_numbers import NOT_COMPUTED, paper_numbers

    rows = paper_numbers()
    if as_json:
        echo(json.dumps({"rows": [_as_dict(row) for row in rows], "not_computed": NOT_COMPUTED}, ensure_ascii=False))
        return
    table = [("row", "where", "printed", "quantity", "recomputed", "verdict")]
    for row in rows:
        for line, quantity in enumerate(row.quantities):
            first = (row.row, row.where, row.printed) if line == 0 else ("", "", "")
            table.append((*first, quantity.name, quantity.text, row.verdict if line == 0 else ""))
    _print_table(table)
    for number, reason in NOT_COMPUTED.items():
        echo(f"row {number} is not computed: {reason}")


def _as_dict(row: PaperNumber) -> dict[str, Any]:
    return {
        "row": row.row,
        "where": row.where,
        "printed": row.printed,
        "quantities": [
            {"name": q.name, "value": q.value, "unit": q.unit, "printed": q.printed or None, "agrees": q.agrees}
            for q in row.quantities
        ],
        "verdict": row.verdict,
    }


def _print_table(table: Sequence[tuple[str, ...]]) -> None:
    widths = [max(len(row[column]) for row in table) for column in range(len(table[0]))]
    for row in table:
        echo("  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)).rstrip())
