from __future__ import annotations

import json
from typing import Any

import pytest
from click.testing import CliRunner, Result

from vestige.cli.services.theory import command
from vestige.theory.thresholds import probability_of_detection, required_cn0_dbhz


def run(*arguments: str) -> Result:
    return CliRunner().invoke(command, arguments)


def as_json(*arguments: str) -> dict[str, Any]:
    result = run(*arguments, "--json")
    assert result.exit_code == 0
    return json.loads(result.stdout)


def test_json_is_the_library_in_full_precision() -> None:
    found = as_json("--cn0", "34", "--integration-ms", "8", "--p-fa", "1e-9", "--p-d", "0.99", "--noncoherent", "3")
    assert found["p_d"] == probability_of_detection(34.0, 8e-3, 1e-9, 3)
    assert found["cn0_required_dbhz"] == required_cn0_dbhz(0.99, 8e-3, 1e-9, 3)


@pytest.mark.parametrize(
    ("integration_ms", "hypotheses", "cn0"), [("4", "2.4e10", 40.123), ("16", "9.6e10", 34.269), ("4", "7500", 37.654)]
)
def test_overall_false_alarm(integration_ms: str, hypotheses: str, cn0: float) -> None:
    found = as_json("--p-fa-overall", "1e-3", "--hypotheses", hypotheses, "--integration-ms", integration_ms)
    assert found["cn0_required_dbhz"] == pytest.approx(cn0, abs=5e-4)
    assert found["p_fa_overall"] == pytest.approx(1e-3)


def test_text_shows_what_tells_the_probability_from_one() -> None:
    lines = dict(line.rsplit("  ", 1) for line in run().stdout.splitlines())
    values = {name.strip(): value for name, value in lines.items()}
    assert values["threshold"] == "5.6777 σ"
    assert values["P_d"] == "0.999995651"
    assert values["1 − P_d"] == "4.3489e-06"
    assert values["C/N0 for P_d 0.9"] == "31.699 dBHz"


def test_paper_as_table() -> None:
    result = run("--paper")
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert lines[0].split() == ["row", "where", "printed", "quantity", "recomputed", "verdict"]
    row_21 = next(line for line in lines if line.startswith("21 "))
    assert " ".join(row_21.split()) == "21 III-E 37.66 dBHz C/N0 37.6541 dBHz differs: last digit (E7)"
    assert any(line.startswith("row 24 is not computed") for line in lines)


def test_paper_as_json() -> None:
    found = as_json("--paper")
    assert set(found) == {"rows", "not_computed"}
    row_12 = next(row for row in found["rows"] if row["row"] == "12")
    assert row_12["quantities"][0]["value"] == pytest.approx(4.168751389931e-14, rel=1e-12)
    assert row_12["quantities"][0]["agrees"] is False


@pytest.mark.parametrize(
    "arguments",
    [
        ("--cn0", "nan"),
        ("--cn0", "inf"),
        ("--cn0", "strong"),
        ("--p-fa", "0"),
        ("--p-fa", "1"),
        ("--p-fa", "nan"),
        ("--integration-ms", "0"),
        ("--integration-ms", "-4"),
        ("--hypotheses", "0.5"),
        ("--noncoherent", "0"),
        ("--noncoherent", "1001"),
        ("--p-fa", "1e-7", "--p-fa-overall", "1e-3"),
        ("--p-d", "1e-8"),
    ],
)
def test_usage_errors(arguments: tuple[str, ...]) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""


@pytest.mark.parametrize(
    "arguments",
    [
        ("--cn0", "200", "--integration-ms", "1e6", "--noncoherent", "1000"),
        ("--cn0", "-100", "--noncoherent", "1000"),
        ("--p-fa-overall", "1e-250", "--hypotheses", "1e30", "--noncoherent", "1000"),
        ("--p-fa", "0.999", "--p-d", "0.99999999999999", "--hypotheses", "1e30"),
    ],
)
def test_the_ends_of_the_ranges(arguments: tuple[str, ...]) -> None:
    found = as_json(*arguments)
    assert 0 <= found["p_d"] <= 1
    assert found["p_d"] + found["p_miss"] == pytest.approx(1)
    assert run(*arguments).exit_code == 0
