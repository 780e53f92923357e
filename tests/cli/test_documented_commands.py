"""Every command of README.md and of the pages in docs runs as it is printed, but for those in `NOT_RUN`.

The commands of a page run in its order, in one folder. The files that they name are there, but small: the scenarios of
the project with fewer epochs (`SHORT`), the scenario of docs/your_own_attack.md, and for any recording two seconds of
three satellites out of `night.toml`, with its RECS and keys. So this test says that a command works and that its inputs
and options fit together; what comes out of it is the matter of the other tests.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from code_blocks import ROOT, blocks_of, commands
from vestige.cli.main import vestige

pytestmark = pytest.mark.slow

SHORT = {"harsh": 100, "quick": 300, "liftoff": 100, "sky": 750, "my": 60}
NIGHT = (
    "simulate", "scenarios/night.toml", "-o", "night", "--epochs", "29:31",
    "--set", "receiver.sample_rate_hz=6.2e6", "--set", "constellation.svids=[7,8,13]",
)  # fmt: skip
# Names under which pages have an assistance folder, and what belongs to it.
ASSISTANCE = ("recs", "assistance", "network-keys")
TREES = ("OSNMA_MerkleTree.xml", "MerkleTree.xml", "tree.xml")
OTHERS = {"night/rinex/navigation.rnx": "BRDC.rnx", "night/inav_pages.csv": "messages.sbf"}
# What a command looks like, as a regular expression, and why it does not run here.
NOT_RUN = {
    r"demo": "`make demo` and tests/cli/test_main.py run it",
    r"inspect (night|demo)/?( --json)?": "it searches 36 satellites for 8 s; tests/cli/test_inspect.py runs it",
    r"live .*": "it waits for a recorder; tests/cli/test_follow.py runs it",
    r"plot all .*": "it takes 4 s, and tests/cli/test_plot.py runs it",
    r"plot animation .*": "it takes 15 s; tests/cli/test_plot.py runs it",
    r"plot (detection|miss|false-alarm)-curve .*": "it needs a sweep; tests/cli/test_plot.py runs it",
    r"plot threats .*": "it needs the whole threat table; tests/cli/test_plot.py runs it",
    r"process attacked .*": "test_the_attack_from_end_to_end_prints_what_the_page_shows runs it",
    r"process night --calibrate --taps 63 --hardware-bias-m 900": "a guess for a front end that is 900 m late",
    r"process night/? --track": "it takes 10 s; tests/cli/test_tracked_sky.py runs it",
    r"process night/? --assistance night/assistance --merkle-tree \S+": "tests/cli/test_samples_alone.py",
    r"process (revoked|demo)": "it needs the recording of `simulate`, as below",
    r"process recorded --calibrate": "it needs the published recording; tests/golden/test_real_recording.py has it",
    r"process night/? --level 3 .*": "level 3 searches for a minute; tests/cli/test_accelerations.py runs it in small",
    r"recs make .*": "it needs a recording of 2023; tests/golden and tests/cli/test_recs.py run it",
    r"report threats .*": "it needs the whole threat table; tests/cli/test_report.py runs it",
    r"run .* --scheduler .*": "it needs a cluster; tests/cli/test_run.py runs one",
    r"run .* --sweep .*": "it takes 10 s; tests/cli/test_run.py runs sweeps in small",
    r"search .*": "it takes long; tests/cli/test_search.py runs it",
    r"simulate scenarios/night.toml .*": "eight satellites take a minute and 300 MB; NIGHT is the same in small",
    r"simulate scenarios/(vestigial|quick).toml .*": "it takes 5 to 20 s; tests/cli/test_simulate.py runs it in small",
    r"osnma verify revoked/.*": "it needs the recording of `simulate`, as above",
    r"threats .*(?<!--level 3)": "it takes minutes; tests/cli/test_threats.py runs it with single scenes",
    r"track .*": "it takes 10 s; tests/cli/test_track.py runs it",
}
ELSEWHERE = "docs/extend.md"  # tests/cli/test_extend_page.py runs all of it


@pytest.fixture(scope="module")
def stand_ins(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with everything that a page may name."""
    folder = tmp_path_factory.mktemp("stand_ins")
    shutil.copytree(ROOT / "scenarios", folder / "scenarios")
    (folder / "my.toml").write_text(next(one.text for one in blocks_of("toml") if "your_own_attack" in one.page))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        typed(NIGHT)
    for name, epochs in SHORT.items():
        path = folder / ("my.toml" if name == "my" else f"scenarios/{name}.toml")
        path.write_text(re.sub(r"^epochs = [\d_]+", f"epochs = {epochs}", path.read_text(), flags=re.MULTILINE))
    for name in ASSISTANCE:
        shutil.copytree(folder / "night" / "assistance", folder / name)
    for name in TREES:
        shutil.copy(folder / "night" / "assistance" / "merkle_tree.xml", folder / name)
    for source, name in OTHERS.items():
        shutil.copy(folder / source, folder / name)
    (folder / "imu.csv").write_text(next(one.text for one in blocks_of("text") if "inertial" in one.page))
    return folder


def typed(words: tuple[str, ...]) -> str:
    """Run a command of vestige and return what it printed."""
    result = CliRunner().invoke(vestige, words, catch_exceptions=False)
    assert result.exit_code == 0, (words, result.output)
    return result.stdout


def output_of(words: tuple[str, ...]) -> Path | None:
    return Path(words[words.index("-o") + 1]) if "-o" in words else None


RUN = [
    command
    for command in commands()
    if command.words[0] == "vestige"
    and command.block.page != ELSEWHERE
    and not any(re.fullmatch(one, " ".join(command.words[1:])) for one in NOT_RUN)
]
ONCE: set[str] = set()  # commands that have run: another page may have the same one


@pytest.mark.parametrize("page", list(dict.fromkeys(command.block.page for command in RUN)))
def test_the_commands_of_a_page_run(page: str, stand_ins: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(stand_ins)
    for command in (one for one in RUN if one.block.page == page):
        if command.text in ONCE:
            continue
        output = output_of(command.words)
        if output is not None and output.is_dir():
            shutil.rmtree(output)  # of another page, with another content
        said = typed(command.words[1:])
        assert said or command.words[1] in ("plot", "report"), command.text
        assert output is None or output.exists(), command.text
        ONCE.add(command.text)
    names: dict[str, Any] = {}
    for block in blocks_of("python"):
        if block.page == page == "docs/campaigns.md":
            exec(compile(block.text, block.place, "exec"), names)  # noqa: S102


def test_the_attack_from_end_to_end_prints_what_the_page_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(ROOT / "scenarios", tmp_path / "scenarios")
    monkeypatch.chdir(tmp_path)
    simulate, process = (one.words[1:] for one in commands() if "attacked" in one.words)
    typed(simulate)
    result = CliRunner().invoke(vestige, process)
    assert result.exit_code == 3
    (shown,) = (one.text for one in blocks_of("text") if one.page == "docs/test_cases.md" and "SPOOFED" in one.text)
    assert shown.strip() == result.stdout.strip()


def test_what_is_not_run_is_still_there() -> None:
    lines = [" ".join(command.words[1:]) for command in commands() if command.words[0] == "vestige"]
    assert [one for one in NOT_RUN if not any(re.fullmatch(one, line) for line in lines)] == []
    assert len(RUN) > 30
