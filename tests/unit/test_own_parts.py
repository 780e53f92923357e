"""Parts of the user's: one clear line for whatever is wrong with them, and results that know what made them."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from extend_page import no_parts, page_scenario, scenario
from vestige import own_parts
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.execution.executors import measure_chunk
from vestige.campaign.levels import level_verdicts
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.campaign.store.build_id import build_id
from vestige.campaign.store.results import open_results
from vestige.campaign.sweep.sweep import run_sweep
from vestige.errors import InputFileError, VestigeError
from vestige.own_parts import OwnPartError, digest, is_own, own_parts_from, part
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.scenario.toml.campaign_toml import campaign_toml
from vestige.spoofer.attack import Attack

DETECTOR = (
    "class D:\n    def __init__(self, spacing):\n        self.spacing = spacing\n"
    "    def detect(self, magnitudes, threshold):\n        "
)
CHECK = (
    "import numpy as np\nfrom vestige.records.checks import CheckSeries\n"
    "class C:\n    name = 'own'\n    unit = 'm'\n    p_fa = 0.1\n    {extra}\n    def series(self, evidence):\n"
    "        e = np.zeros(evidence.shape)\n        {body}\n"
    "        return CheckSeries(name=self.name, unit=self.unit, p_fa=self.p_fa, statistic=e, threshold=e,"
    " explain=lambda i, j: 'why')\n"
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder that is named, for the test alone."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    path = tmp_path / "parts"
    path.mkdir()
    with no_parts():
        own_parts_from(path)
        yield path


def made(folder: Path, module: str, source: str, tables: str, *settings: str) -> CampaignScenario:
    (folder / f"{module}.py").write_text(source)
    (folder / "own.toml").write_text(f"{scenario()}\n{tables}")
    found = load_scenario(folder / "own.toml", ("epochs=10", *settings))
    assert isinstance(found, CampaignScenario)
    return found


def test_what_is_own() -> None:
    assert is_own("my_attack:Swing")
    assert not is_own("lift-off")
    assert not is_own(None)


def test_no_such_folder(tmp_path: Path) -> None:
    with pytest.raises(VestigeError, match="nowhere: parts: found no such folder, expected the folder with"):
        own_parts_from(tmp_path / "nowhere")


def test_nothing_is_imported_without_a_folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own_parts, "_folders", [])
    with pytest.raises(OwnPartError, match=r"antigravity:x: found no folder of own parts, expected --parts FOLDER"):
        part("antigravity:x", object)
    assert "antigravity" not in sys.modules


@pytest.mark.parametrize(
    ("kind", "source", "text"),
    [
        ("antigravity:x", None, r"found no antigravity.py in .*parts, expected the file of the module"),
        ("a b:C", "", "found another form, expected module:Name"),
        ("own_a:../C", "", "found another form, expected module:Name"),
        ("own_a:C", "", r"found no C in .*own_a.py, expected a class of that name"),
        ("own_a:C", "C = 3", r"found C in .*own_a.py, which is no class, expected a class"),
        ("own_a:C", "from fractions import Fraction as C", "found a class that fractions defines, expected a class th"),
        ("own_a:C", "class C: pass", "found a class that is not derived from Attack, expected vestige.spoofer.attack:"),
        ("own_a:C", "1 / 0", r"found line 1 of .*own_a.py raises ZeroDivisionError: division by zero, expected a modu"),
        ("own_a:C", "\n\nclass C(:", r"own_a.py raises SyntaxError: .*line 3\), expected a module that can be importe"),
        ("own_a:C", "import sys; sys.exit(3)", r"own_a.py raises SystemExit: 3, expected a module that can be importe"),
        ("json:C", "class C: pass", "found another module json that is already imported, expected a name that no"),
    ],
)  # fmt: skip
def test_a_part_that_cannot_be_had_is_one_line(folder: Path, kind: str, source: str | None, text: str) -> None:
    if source is not None:
        (folder / f"{kind.partition(':')[0]}.py").write_text(source)
    with pytest.raises(OwnPartError, match=text) as caught:
        part(kind, Attack)
    assert "\n" not in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)  # noqa: S301


ATTACK = (
    "from dataclasses import dataclass\nfrom vestige.spoofer.attack import Attack\n"
    "@dataclass(frozen=True, kw_only=True)\nclass A(Attack):\n    size_m: float\n    names: tuple[str, ...] = ()\n"
    "    def __post_init__(self):\n        Attack.__post_init__(self)\n"
    "        if self.size_m < 0:\n            raise ValueError('a size that is not negative')\n"
)


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ("", "attack.0.size_m: found nothing, expected a value: the key is needed"),
        ("size_m = '3'", 'attack.0.size_m: found the text "3", expected a number'),
        ("size_m = 3\nsize = 3", "attack.0.size: found an unknown key size, expected size_m"),
        ("size_m = 3\nnames = [1]", "attack.0.names.0: found 1, expected a text"),
        ("size_m = 3\nstart_s = -1", "attack.0.start_s: found -1 s with stop_s = inf s, expected 0 s or later"),
        ("size_m = -3", "attack.0: found size_m = -3, expected a size that is not negative"),
    ],
)
def test_a_wrong_key_of_an_own_attack_has_its_place(folder: Path, keys: str, text: str) -> None:
    with pytest.raises(InputFileError, match=f"own.toml: {text}"):
        made(folder, "own_b", ATTACK, f"[[attack]]\nkind = 'own_b:A'\n{keys}\n")


@pytest.mark.parametrize(
    ("source", "tables", "text"),
    [
        ("class M: pass", "[receiver.clock]\nkind = 'own_c:M'", r"receiver.clock.kind: found own_c:M and no process, "),
        ("class M: process = 1", "[receiver.bias]\nkind = 'own_c:M'", r"receiver.bias.kind: found own_c:M, expected a"),
        ("class M: process = 1", "[receiver.multipath]\nkind = 'own_c:M'", "and no n_rays, expected the members of ve"),
        ("", "[receiver.ionosphere]\nkind = 'own_c:M'", "receiver.ionosphere.kind: found own_c:M and no M in"),
        ("class M: pass", "[processor]\ndetector = 'own_c:M'", r"own_c:M: found TypeError: M\(\) takes no arguments, "),
        ("class M:\n def __init__(self, spacing): pass", "[processor]\ndetector = 'own_c:M'", "own_c:M: found no dete"),
        ("class M:\n name = 'RAIM'", "[processor]\nchecks = ['own_c:M']", "processor.checks: found own_c:M and no p_f"),
        ("", "[processor]\ndetector = 'late'", "processor.detector: found late, expected 'early' or 'maximum', or 'mo"),
    ],
)  # fmt: skip
def test_a_part_that_lacks_something_is_one_line(folder: Path, source: str, tables: str, text: str) -> None:
    with pytest.raises(VestigeError, match=text):
        made(folder, "own_c", source, tables)


@pytest.mark.parametrize(
    ("body", "text"),
    [
        ("1 / 0", r"own_d: found line \d of .*own_d.py raises ZeroDivisionError: division by zero"),
        ("return [1.5] * len(magnitudes)", "own_d:D: found float64 values of shape .10,. from detect, expected whole"),
        (
            "return [1]",
            r"own_d:D: found int64 values of shape \(1,\) from detect, expected whole numbers of shape \(10,\)",
        ),
        (
            "return [0] * len(magnitudes)",
            "own_d:D: found indices from 0 to 0 from detect, expected -1 for none, or 1 to 44",
        ),
    ],
)
def test_a_detector_that_errs_is_one_line(folder: Path, body: str, text: str) -> None:
    plan = ScenarioPlan(scenario=made(folder, "own_d", DETECTOR + body, "[processor]\ndetector = 'own_d:D'"))
    with pytest.raises(OwnPartError, match=text):
        direct_results(plan)


SPOOFING_SIGNAL = (
    "import numpy as np\nfrom dataclasses import dataclass\nfrom vestige.spoofer.attack import Attack\n"
    "@dataclass(frozen=True, kw_only=True)\nclass A(Attack):\n    def noise_over_n0(self, band, times_s):\n        "
)


@pytest.mark.parametrize(
    ("body", "text"),
    [
        (
            "return np.ones(3)",
            r"shape \(3,\) from noise_over_n0, expec",
        ),
        (
            "return 0 / np.zeros(times_s.size)",
            "NaN among the values",
        ),
        ("return 1 / 0", "raises ZeroDivisionError"),
    ],
)
def test_an_attack_that_errs_is_one_line(folder: Path, body: str, text: str) -> None:
    scenario = made(folder, "own_g", SPOOFING_SIGNAL + body, "[[attack]]\nkind = 'own_g:A'")
    with pytest.raises(OwnPartError, match=f"own_g.*{text}"), np.errstate(invalid="ignore"):
        direct_results(ScenarioPlan(scenario=scenario))


MODEL = (
    "import numpy as np\nfrom dataclasses import dataclass\n"
    "class P:\n    def advance(self, times_s):\n        return {0}\n"
    "@dataclass(frozen=True)\nclass M:\n    def process(self, streams, **_):\n        return P()\n"
)


@pytest.mark.parametrize(
    ("table", "values", "text"),
    [
        (
            "clock",
            "np.zeros(times_s.size)",
            r"float64 values of shape \(10,\) from advance, expected numbers of",
        ),
        ("bias", "np.zeros(3)", r"float64 values of shape \(3,\) from advance, expected numbers of shape \(10,\)"),
        ("ionosphere", "np.full(times_s.size, np.nan)", "NaN among the values of advance"),
        ("ionosphere", "['a'] * times_s.size", "<U1 values of shape"),
    ],
)
def test_an_error_model_that_errs_is_one_line(folder: Path, table: str, values: str, text: str) -> None:
    scenario = made(folder, "own_h", MODEL.format(values), f"[receiver.{table}]\nkind = 'own_h:M'")
    with pytest.raises(OwnPartError, match=text):
        direct_results(ScenarioPlan(scenario=scenario))


@pytest.mark.parametrize(
    ("extra", "body", "text"),
    [
        (
            "",
            "1 / 0",
            r"own_e: found line \d+ of .*own_e.py raises ZeroDivisionError: division by zero, expected no error",
        ),
        ("", "return 3", "own_e:C: found a int from series, expected a CheckSeries"),
        ("", "e = e[0]", r"own_e:C: found statistic of float64 of shape \(1,\) from series, expected float64 of shape"),
        (
            "of_receiver = True",
            "",
            r"found statistic of float64 of shape \(10, 1\) from series, expected float64 of shape",
        ),
        ("", "self.name = 'other'", "own_e:C: found a series with the name 'other', expected 'own'"),
    ],
)
def test_a_check_that_errs_is_one_line(folder: Path, extra: str, body: str, text: str) -> None:
    source = CHECK.format(extra=extra, body=body)
    plan = ScenarioPlan(scenario=made(folder, "own_e", source, "[processor]\nchecks = ['own_e:C']"))
    with pytest.raises(OwnPartError, match=text):
        direct_results(plan)


@pytest.mark.parametrize(
    ("memory", "text"),
    [
        (
            "1 / 0",
            r"own_m: found line \d+ of .*own_m.py raises ZeroDivisionError: division by zero, expected",
        ),
        ("[1.0]", "own_m:C: found a list from remember, expected numbers by satellite: a mapping from SVIDs"),
        ("{0: 1.0}", "'float' object is not iterable in the result of remember, expected numbers by satellite"),
        ("{0: ['many']}", "could not convert string to float: 'many' in the result of remember"),
        ("{'E11': [1.0]}", "'str' object cannot be interpreted as an integer in the result of remember"),
    ],
)
def test_a_memory_that_is_no_memory_is_one_line(folder: Path, memory: str, text: str) -> None:
    source = CHECK.format(extra=f"remember = lambda self, evidence: {memory}", body="")
    plan = ScenarioPlan(scenario=made(folder, "own_m", source, "[processor]\nchecks = ['own_m:C']"))
    with pytest.raises(OwnPartError, match=text):
        direct_results(plan)


@pytest.mark.parametrize(
    ("extra", "text"),
    [
        ("remember = 3", "found own_f:C and remember = 3, expected a method"),
        (
            "name = 'RAIM'",
            "found own_f:C and name = 'RAIM', expected a text that is not the name of one of vestige's checks",
        ),
        ("p_fa = 2.0", "found own_f:C and p_fa = 2.0, expected a number between 0 and 1"),
        ("level = 4", "found own_f:C and level = 4, expected 1, 2 or 3"),
        ("failure = 'bad'", "found own_f:C and failure = 'bad', expected Status.SUSPECT, Status.SPOOFED or"),
        ("confirm = 0", "found own_f:C and confirm = 0, expected 1 to 1000"),
        ("cadence = 3", "found own_f:C and cadence = 3, expected a TestCadence"),
    ],
)
def test_what_a_check_says_of_itself_is_looked_at(folder: Path, extra: str, text: str) -> None:
    with pytest.raises(InputFileError, match=f"own.toml: processor.checks: {text}"):
        made(folder, "own_f", CHECK.format(extra=extra, body=""), "[processor]\nchecks = ['own_f:C']")


def test_a_scenario_with_own_parts_is_written_and_read_again(tmp_path: Path) -> None:
    for module in ("my_attack", "my_error", "my_detector", "my_check"):
        one = page_scenario(module)
        (tmp_path / "again.toml").write_text(campaign_toml(one.model_dump_json()))
        again = load_scenario(tmp_path / "again.toml")
        assert isinstance(again, CampaignScenario)
        assert again.model_dump_json() == one.model_dump_json()
        assert again.own_parts == one.own_parts
        assert len(one.own_parts) == 1


def test_a_store_is_not_continued_with_a_changed_part(folder: Path, tmp_path: Path) -> None:
    source = CHECK.format(extra="", body="")
    plan = ScenarioPlan(scenario=made(folder, "own_g", source, "[processor]\nchecks = ['own_g:C']"))
    store = tmp_path / "a.zarr"
    run(plan, store)
    before = digest("own_g:C")
    assert open_results(store).attributes.own_parts == f"own_g:C@{before}"
    own_parts._digests["own_g"] = "0" * 12  # as if the file had been another one when it was imported
    with pytest.raises(InputFileError, match=f"own_parts: found own_g:C@{before}, expected own_g:C@"):
        run(plan, store)
    with pytest.raises(VestigeError, match=r"own_parts: found own_g:C@0+ now, expected own_g:C@"):
        level_verdicts(open_results(store).dataset, (1,))
    with pytest.raises(VestigeError, match=r"worker .*: own_parts: found own_g:C@0+, expected own_g:C@"):
        measure_chunk(plan, 0, {}, build_id(plan) | {"own_parts": f"own_g:C@{before}"})


def test_results_without_their_part_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module, readable in (("my_check", False), ("my_detector", False), ("my_attack", True), ("my_error", True)):
        run(ScenarioPlan(scenario=page_scenario(module, "epochs=10")), tmp_path / module)
        results = open_results(tmp_path / module)
        with monkeypatch.context() as without:
            without.setattr(own_parts, "_folders", [])
            if readable:
                assert results.scenario.epochs == 10
                continue
            with pytest.raises(
                VestigeError, match=r"processor\.(checks|detector): found .* and no folder of own parts"
            ):
                _ = results.scenario


@pytest.mark.slow
def test_processes_and_threads_give_the_same(tmp_path: Path) -> None:
    plan = ScenarioPlan(scenario=page_scenario("my_detector", "epochs=30"))
    one = run(plan, tmp_path / "threads", chunk_epochs=10)
    other = run(plan, tmp_path / "processes", chunk_epochs=7, executor="processes", workers=1)
    assert one.drop_attrs().identical(other.drop_attrs())
    assert [str(name) for name in one["detector"].values] == ["early", "maximum", "my_detector:RelativePeak"]
    np.testing.assert_array_equal(one["tap_index"].values[2] >= 0, True)


def test_a_sweep_has_a_column_for_an_own_detector(tmp_path: Path) -> None:
    campaigns = [({"seed": seed}, page_scenario("my_detector", "epochs=10", f"seed={seed}")) for seed in (1, 2)]
    rows = list(run_sweep(campaigns, tmp_path / "sweep"))
    assert all(list(row.detections)[-1] == row.detector == "my_detector:RelativePeak" for row in rows)
    assert "detections_my_detector:RelativePeak" in (tmp_path / "sweep" / "sweep.csv").read_text()
