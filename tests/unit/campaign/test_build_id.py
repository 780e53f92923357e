from __future__ import annotations

from pathlib import Path

import pytest

from toy_plan import ToyPlan
from vestige.campaign.execution.executors import measure_chunk
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.store import build_id
from vestige.campaign.store.store import open_store
from vestige.errors import InputFileError, VestigeError
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.source_version import source_digest

QUICK = Path(__file__).resolve().parents[3] / "scenarios" / "quick.toml"


def plan(fidelity: str) -> ScenarioPlan:
    scenario = load_scenario(QUICK, (f'fidelity="{fidelity}"', "epochs=4"))
    assert isinstance(scenario, CampaignScenario)
    return ScenarioPlan(scenario=scenario)


def test_the_digest_is_of_names_and_contents(tmp_path: Path) -> None:
    def digest(**files: str) -> str:
        for path in tmp_path.glob("*"):
            path.unlink()
        for name, content in files.items():
            (tmp_path / f"{name}.py").write_text(content)
        (tmp_path / "notes.txt").write_text("of no importance")
        return source_digest(tmp_path)

    whole = digest(a="x = 1", b="y = 2")
    assert digest(b="y = 2", a="x = 1") == whole
    others = ({"a": "x = 1", "b": "y = 3"}, {"a": "x = 1", "c": "y = 2"}, {"a": "x = 1"}, {"a": "x = 1y", "b": " = 2"})
    assert len({whole, *(digest(**files) for files in others)}) == 5


def test_another_processor_neither_resumes_nor_helps_with_samples(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = {}
    for fidelity in ("samples", "correlators"):
        open_store(tmp_path / fidelity, plan(fidelity), chunk_epochs=4)
        expected[fidelity] = build_id.build_id(plan(fidelity))
    monkeypatch.setattr("vestige.campaign.store.build_id.processor_name", lambda: "pentium")
    monkeypatch.setattr("vestige.campaign.scenario_plan.processor_name", lambda: "pentium")
    open_store(tmp_path / "correlators", plan("correlators"), chunk_epochs=4)
    assert build_id.build_id(plan("correlators")) == expected["correlators"]
    with pytest.raises(InputFileError, match=r"samples: processor: found \w+, expected pentium; finish with"):
        open_store(tmp_path / "samples", plan("samples"), chunk_epochs=4)
    with pytest.raises(VestigeError, match=r"worker .*: processor: found pentium, expected"):
        measure_chunk(plan("samples"), 0, {}, expected["samples"])


def test_another_source_does_not_help(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = build_id.build_id(ToyPlan(n_epochs=1))
    monkeypatch.setattr("vestige.campaign.store.build_id.vestige_version", lambda: "0.1.0+source.0")
    with pytest.raises(VestigeError, match=r"worker .*: vestige_version: found 0\.1\.0\+source\.0, expected"):
        measure_chunk(ToyPlan(n_epochs=1), 0, {}, expected)
