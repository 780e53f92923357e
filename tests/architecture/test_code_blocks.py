"""Every code block of README.md and of the pages in docs is run, read or parsed; here is how, for each language.

toml
    The reader of vestige that a user would give it to reads it: a scenario, a part of a scenario over a small one, a
    recording, the corrections of a receiver.
python
    It runs: here, or in the test that `RUN_ELSEWHERE` names.
sh
    The parser of vestige's command line takes each command of vestige with all its words, and a scenario that the
    command names is read with its settings and for every value of a sweep. tests/cli/test_documented_commands.py also
    runs every command, but for those that its table `NOT_RUN` names with a reason. Another program stands in
    `OTHER_PROGRAMS` with what is known of it.
text
    Nothing: output, a picture, an extract of a file. The tests of a page compare some of them.
"""

from __future__ import annotations

import importlib
import re
import shutil
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest
from pydantic import TypeAdapter

from code_blocks import LANGUAGES, ROOT, CodeBlock, blocks_of, code_blocks, commands
from extend_page import no_parts, write_page
from vestige.campaign.sweep.sweep_axes import as_settings, grid, parse_axis
from vestige.cli.main import VERBS
from vestige.crypto.keys.public_key_writer import write_merkle_tree
from vestige.crypto.osnma.operator.key_tree import draw_key_tree
from vestige.crypto.osnma.operator.osnma_service import OperatorKey
from vestige.errors import InputFileError, VestigeError
from vestige.own_parts import own_parts_from
from vestige.recording.assistance.receiver_corrections import read_hardware_bias
from vestige.recording.recording_toml import read_recording_toml
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.scenario.toml.toml_file import validated

# A part of a scenario is laid over one of these.
LINE_OF_SIGHT: dict[str, Any] = {
    "kind": "campaign",
    "seed": 1,
    "start": "2026-11-21T12:00:00 GST",
    "epochs": 5,
    "fidelity": "correlators",
    "receiver": {"cn0_dbhz": 40.0, "cn0_e1_dbhz": 40.0},
}
SKY = tomllib.loads((ROOT / "scenarios" / "night.toml").read_text(encoding="utf-8")) | {"epochs": 600}
# Files that blocks name; nothing but their names matters to the reader of a scenario.
NAMED_FILES = (
    "L1.bin",
    "L6.bin",
    "L1_20211125_004000_12MHz_I.bin",
    "L6_20211125_004000_12MHz_IQ.bin",
    "observations.csv",
)
E6_RESIDUALS = "e6_minus_e1_m\n0.5\n-0.5\n"
RUN_ELSEWHERE = {
    "README.md": "tests/architecture/test_docs.py::test_toml_and_python_of_the_readme_run",
    "docs/extend.md": "tests/cli/test_extend_page.py::test_the_commands_run",
    "docs/campaigns.md": "tests/cli/test_documented_commands.py::test_the_commands_of_a_page_run",
    "docs/scer.md": "tests/unit/sample_processor/tracking/test_partial_correlation.py::test_the_code_of_the_page_runs",
}
# First word of what is typed: why no test runs it as it stands.
OTHER_PROGRAMS = {
    "make": "`.ci/run` calls make; every target exists (tests/architecture/test_docs.py)",
    "python": "the file exists and has the options; tests/cli/test_examples.py and tests that load a benchmark run it",
    "pytest": "`make test` runs all tests; the folder exists",
    ".venv/bin/python": "installs what `make judges` installs, with the same versions",
    "source": "activates what `make setup` made",
    "cd": "the folder is made by the command before",
    "dask": "a program of dask.distributed; its workers run in tests/cli and tests/unit of executors",
    "rnx2rtkp": "a program of RTKLIB; tests/agreement/test_rtklib_position.py runs it on such files",
    "gnss-sdr": "a program of its own; tests/agreement/test_gnss_sdr.py runs it on such files",
    "pipx": "runs nox and build in environments of its own; tests/architecture/test_package.py reads the sessions",
    "docker": "builds the image of Dockerfile; tests/architecture/test_package.py reads its programs",
    "eval": "turns on completion in bash and zsh; tests/cli/test_completion.py asks bash",
    "_VESTIGE_COMPLETE=fish_source": "turns on completion in fish; tests/cli/test_completion.py asks bash",
    "my_recorder": "stands for a program of the reader's",
    "my_receiver": "stands for a program of the reader's",
    "my_receiver_of_both_bands": "stands for a program of the reader's",
}


def ids(found: list[CodeBlock]) -> list[str]:
    return [block.place for block in found]


def test_every_block_has_a_language_with_a_rule() -> None:
    assert [block.place for block in code_blocks() if block.language not in LANGUAGES] == []
    assert len(code_blocks()) > 100


# --- toml


def merged(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Return tables in which those above replace those below, key by key; a table of another kind replaces all."""
    result = dict(below)
    for key, value in above.items():
        old = result.get(key)
        same = (
            isinstance(old, dict)
            and isinstance(value, dict)
            and value.get("kind") == old.get("kind", value.get("kind"))
        )
        result[key] = merged(old, value) if same else value
    return result


def needs_a_sky(tables: dict[str, Any]) -> bool:
    return bool({"osnma", "atmosphere"} & tables.keys()) or "every" in tables.get("recs", {})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with the files that blocks and commands name, as short as they can be."""
    made = tmp_path_factory.mktemp("blocks")
    shutil.copytree(ROOT / "scenarios", made / "scenarios")
    for name in NAMED_FILES:
        (made / name).write_bytes(b"")
    (made / "residuals.csv").write_text(E6_RESIDUALS)
    write_page(made)
    tree = draw_key_tree(b"a tree", b"")
    write_merkle_tree(made / "merkle_tree.xml", tree.published([1]))
    (made / "operator.pem").write_bytes(OperatorKey.of(tree.private_key(1)).pem)
    shutil.copy(
        made / "my_attack.toml", made / "own.toml"
    )  # of the four own.toml of docs/extend.md, the one with a sweep
    (made / "my.toml").write_text(next(one.text for one in blocks_of("toml") if "your_own_attack" in one.page))
    before = list(sys.path)
    yield made
    sys.path[:] = before


@pytest.mark.parametrize("block", blocks_of("toml"), ids=ids(blocks_of("toml")))
def test_toml_is_read(block: CodeBlock, folder: Path, tmp_path: Path) -> None:
    tables = tomllib.loads(block.text)
    path = folder / f"{tmp_path.name}.toml"
    path.write_text(block.text)
    if "e1" in tables:
        assert len(read_recording_toml(path).bands) == 2
    elif "hardware_bias_e1_e6_m" in tables:
        assert read_hardware_bias(path) != 0
    else:
        base = {} if "epochs" in tables else SKY if needs_a_sky(tables) else LINE_OF_SIGHT
        with no_parts():
            own_parts_from(folder)
            scenario = validated(TypeAdapter(CampaignScenario), merged(base, tables), path)
        assert scenario.epochs


def test_a_wrong_key_of_a_part_of_a_scenario_is_seen(folder: Path) -> None:
    """What the test above would say of a page whose TOML is out of date."""
    tables = tomllib.loads('[[attack]]\nkind = "meaconing"\nstart_sec = 1\ndelay_s = 1e-6\npower_db = 3')
    with pytest.raises(InputFileError, match="start_sec"):
        validated(TypeAdapter(CampaignScenario), merged(LINE_OF_SIGHT, tables), folder / "wrong.toml")


# --- python


def test_python_that_runs_elsewhere_runs_there() -> None:
    for test in RUN_ELSEWHERE.values():
        path, _, name = test.partition("::")
        assert re.search(rf"^def {name}\(", (ROOT / path).read_text(encoding="utf-8"), re.MULTILINE), test
    assert set(RUN_ELSEWHERE) <= {block.page for block in blocks_of("python")}


HERE = [block for block in blocks_of("python") if block.page not in RUN_ELSEWHERE]


@pytest.mark.parametrize("block", HERE, ids=ids(HERE))
def test_python_runs(block: CodeBlock) -> None:
    """In a file of tests: what it uses besides its own names is pytest."""
    exec(compile(block.text, block.place, "exec"), {"pytest": pytest})  # noqa: S102


# --- sh


def parsed(words: list[str]) -> dict[str, Any]:
    """Return what the parser of vestige makes of the words after `vestige`.

    Raises `click.UsageError` if the parser refuses them.
    """
    verb, *words = words
    if verb not in VERBS:
        raise click.UsageError(f"no such verb: {verb}")
    command = importlib.import_module(f"vestige.cli.{VERBS[verb][0]}").command
    while isinstance(command, click.Group):
        below = command.get_command(click.Context(command), words[0]) if words else None
        if below is None:
            raise click.UsageError(f"no such verb in {verb}: {words}")
        command, words = below, words[1:]
    return dict(command.make_context(verb, words).params)


def read_scenarios(params: dict[str, Any]) -> int:
    """Read the scenario that a command names, with its settings and for every value of a sweep; return how many."""
    names = [params.get("scenario"), params.get("attack"), *(params.get("scenarios") or ())]
    fidelity = params.get("fidelity")
    settings = (*params.get("settings", ()), *([f'fidelity="{fidelity}"'] if fidelity else []))
    axes = [parse_axis(text) for text in params.get("sweeps", ())]
    count = 0
    for name in filter(None, names):
        for values in grid(axes):
            load_scenario(name, (*settings, *as_settings(values)))
            count += 1
    return count


def test_every_command_of_vestige_is_taken(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    refused, count = [], 0
    for command in (one for one in commands() if one.words[0] == "vestige"):
        with no_parts():
            try:
                count += read_scenarios(parsed(list(command.words[1:])))
            except (click.ClickException, VestigeError) as error:
                refused.append(f"{command.block.place}: {command.text}: {error}")
    assert refused == []
    assert count > 60


@pytest.mark.parametrize(
    "line",
    [
        "run scenarios/quick.toml -o a.zarr -j none",
        "run scenarios/quick.toml -o a.zarr --worker 2",
        "run scenarios/quick.toml -o a.zarr --set receiver.cn0=37",
        "run scenarios/quick.toml -o a.zarr --sweep receiver.cn0_dbhz=a:b",
        "run scenarios/quiet.toml -o a.zarr",
        "plot nothing a.zarr -o a.png",
    ],
)
def test_a_wrong_command_is_refused(line: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    with pytest.raises((click.ClickException, VestigeError)):
        read_scenarios(parsed(line.split()))


def test_every_other_program_is_accounted_for() -> None:
    used = {one.words[0] for one in commands()} - {"vestige"}
    assert used == set(OTHER_PROGRAMS)


def test_scripts_and_folders_of_other_programs_exist() -> None:
    for command in commands():
        program, *words = command.words
        if program in ("python", "pytest"):
            path = ROOT / words[0]
            assert path.exists(), command.block.place
            wanted = [word for word in words if word.startswith("--")]
            assert [word for word in wanted if f'"{word}"' not in path.read_text(encoding="utf-8")] == []
        if program == ".venv/bin/python":
            judges = re.search(r"^JUDGES := (.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
            assert judges is not None
            assert judges[1].split() == [word for word in words if "==" in word]


def test_options_of_scripts_in_prose_of_a_command_exist() -> None:
    """`--full FOLDER` in a comment of docs/benchmarks.md."""
    text = next(block.text for block in blocks_of("sh") if block.page == "docs/benchmarks.md")
    options = re.findall(r"benchmarks/(\w+\.py).*?(--[a-z-]+)", text)
    assert options
    for script, option in options:
        assert f'"{option}"' in (ROOT / "benchmarks" / script).read_text(encoding="utf-8")
