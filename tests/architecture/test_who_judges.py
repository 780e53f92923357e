"""Only the processor judges: the import contracts hold for type annotations too, and name what they forbid."""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CONTRACTS = {
    one["name"]: one
    for one in tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
}
JUDGE_NOTHING = CONTRACTS["campaigns, threats, plots and reports judge nothing"]
NO_PROCESSOR = CONTRACTS["the simulated receiver imports no processor"]
NO_SIMULATION = CONTRACTS["the processor cannot see the simulated world"]
ONLY_PLOTS = CONTRACTS["matplotlib only in plots"]
ROOMS = {f"vestige.{path.parent.name}" for path in (ROOT / "src" / "vestige").glob("*/__init__.py")}
# what campaigns, threats, plots and reports take from the processor: itself, records, and the table of levels
TAKEN = {
    "levels": {"ALARMS", "GRAVITY", "LEVELS", "NO_CAUSE", "OTHERS", "POSITION", "TestCadence", "is_alarm"},
    "measurement": {"Availability", "DetectedBlock", "FixBlock", "MeasurementBlock", "spread_over_block"},
    "monitoring.state": {"ReceiverState"},
    "position.fix_measurement": {"LazyFix"},
    "processor": {"AcasProcessor", "Step"},
    "verdict_block": {"VerdictBlock"},
}


def imports(path: Path) -> set[str]:
    """Return the modules of vestige that a file imports, for its types alone too."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("vestige."):
            found |= {node.module, *(f"{node.module}.{one.name}" for one in node.names)}
        if isinstance(node, ast.Import):
            found |= {one.name for one in node.names}
    return found


@pytest.mark.parametrize("contract", [JUDGE_NOTHING, NO_PROCESSOR], ids=["judges nothing", "no processor"])
def test_a_room_imports_nothing_that_is_forbidden(contract: dict[str, list[str]]) -> None:
    allowed = {tuple(one.split(" -> ")) for one in contract.get("ignore_imports", [])}
    wrong = []
    for room in contract["source_modules"]:
        for path in sorted((ROOT / "src" / Path(*room.split("."))).rglob("*.py")):
            module = ".".join(path.relative_to(ROOT / "src").with_suffix("").parts)
            for name in imports(path):
                for forbidden in contract["forbidden_modules"]:
                    inside = name == forbidden or name.startswith(f"{forbidden}.")
                    if inside and (module, forbidden) not in allowed:
                        wrong.append(f"{module} imports {name}")
    assert not wrong


def test_the_contract_names_every_room_that_computes_a_verdict() -> None:
    parts = {"assess", "checks", "measure", "searches", "evidence", "monitoring.alarm_budget", "monitoring.baseline"}
    assert {f"vestige.acas_processor.{one}" for one in parts} <= set(JUDGE_NOTHING["forbidden_modules"])
    assert "vestige.theory.thresholds" in JUDGE_NOTHING["forbidden_modules"]
    assert NO_PROCESSOR["forbidden_modules"] == ["vestige.acas_processor"]


def test_what_is_taken_from_the_processor_is_named() -> None:
    """A threshold, a statistic or a decision of the processor has no other way into these rooms."""
    processor, taken = "vestige.acas_processor", set()
    for room in JUDGE_NOTHING["source_modules"]:
        for path in (ROOT / "src" / Path(*room.split("."))).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"{processor}."):
                    module = (node.module or "").removeprefix(f"{processor}.")
                    taken |= {(module, one.name) for one in node.names}
                if isinstance(node, ast.Import):
                    assert not [one.name for one in node.names if one.name.startswith(processor)], path
    assert taken == {(module, name) for module, names in TAKEN.items() for name in names}


def test_every_other_module_of_the_processor_is_forbidden() -> None:
    processor, forbidden = ROOT / "src" / "vestige" / "acas_processor", set(JUDGE_NOTHING["forbidden_modules"])
    for path in processor.rglob("*.py"):
        name = ".".join(path.relative_to(processor).with_suffix("").parts)
        if path.name != "__init__.py" and name not in TAKEN:
            whole = f"vestige.acas_processor.{name}"
            assert any(whole == one or whole.startswith(f"{one}.") for one in forbidden), whole


def test_the_receiver_side_may_not_import_what_is_simulated() -> None:
    simulated = {"broadcast", "receiver", "scenario", "signal_generator", "simulated", "spoofer"}
    assert {f"vestige.{one}" for one in simulated} <= set(NO_SIMULATION["forbidden_modules"])


def test_every_room_but_plots_is_kept_from_matplotlib() -> None:
    assert set(ONLY_PLOTS["source_modules"]) == ROOMS - {"vestige.plots"}


def test_sources_are_not_told_apart_by_their_class() -> None:
    """A block answers `correlate` and both searches; nobody asks which class it is, but one guard."""
    sources = {
        "CorrelatableSamples",
        "DrawnE6",
        "DrawnSearches",
        "KnownSearches",
        "SampledSearches",
        "SimulatedE6Samples",
    }
    asked = set()
    for path in sorted((ROOT / "src" / "vestige").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "isinstance":
                named = {one.id for one in ast.walk(node.args[1]) if isinstance(one, ast.Name)}
                if named & sources:
                    asked.add(path.relative_to(ROOT / "src" / "vestige").as_posix())
    assert asked == {"receiver/snapshots/assistance.py"}  # refuses snapshots that are not of its own receiver


def test_records_of_blocks_have_types() -> None:
    text = (ROOT / "src" / "vestige" / "records" / "snapshot_block.py").read_text(encoding="utf-8")
    assert "Any" not in {node.id for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Name)}
