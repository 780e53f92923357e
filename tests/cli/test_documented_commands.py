"""Every command of README.md and of the pages in docs runs as it is printed, but for those in `NOT_RUN`.

The commands of a page run in its order, in one folder. The files that they name are there, but small: the scenarios of
the project with fewer epochs (`SHORT`), the scenario of docs/your_own_attack.md, and for any recording four seconds of
two satellites out of `night.toml`, with its RECS and keys. So this test says that a command works and that its inputs
and options fit together; what comes out of it is the matter of the other tests.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from code_blocks import ROOT, Command, blocks_of, commands
from vestige.cli.main import vestige

pytestmark = pytest.mark.slow

SHORT = {"harsh": 200, "quick": 500, "liftoff": 300, "liftoff_sudden": 300, "sky": 750, "my": 120}
NIGHT = (
    "simulate", "scenarios/night.toml", "-o", "night", "--epochs", "28:32",
    "--set", "receiver.sample_rate_hz=6.2e6", "--set", "constellation.svids=[7,8]",
)  # fmt: skip
# Names under which pages have a recording, an assistance folder, and what belongs to them.
RECORDINGS = ("RECORDING", "build/night")
ASSISTANCE = ("recs", "sas", "assistance", "network-keys")
TREES = ("OSNMA_MerkleTree.xml", "MerkleTree.xml", "tree.xml")
OTHERS = {"night/rinex/navigation.rnx": "BRDC.rnx", "night/inav_pages.csv": "messages.sbf"}
# The beginning of a command, and why it is not run here.
NOT_RUN = {
    "vestige demo": "`make demo` is it; tests/cli/test_main.py",
    "vestige threats --expected": "",
}


@pytest.fixture(scope="module")
def stand_ins(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with everything that a page may name."""
    folder = tmp_path_factory.mktemp("stand_ins")
    shutil.copytree(ROOT / "scenarios", folder / "scenarios")
    (folder / "my.toml").write_text(next(one.text for one in blocks_of("toml") if "your_own_attack" in one.page))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        typed(NIGHT)
    for name in (*SHORT, "my"):
        path = folder / ("my.toml" if name == "my" else f"scenarios/{name}.toml")
        path.write_text(re.sub(r"^epochs = [\d_]+", f"epochs = {SHORT[name]}", path.read_text(), flags=re.MULTILINE))
    for name in ASSISTANCE:
        shutil.copytree(folder / "night" / "assistance", folder / name)
    for name in TREES:
        shutil.copy(folder / "night" / "assistance" / "merkle_tree.xml", folder / name)
    for source, name in OTHERS.items():
        shutil.copy(folder / source, folder / name)
    (folder / "imu.csv").write_text(next(one.text for one in blocks_of("text") if "inertial" in one.page))
    (folder / "build").mkdir()
    for name in RECORDINGS:
        (folder / name).symlink_to(folder / "night")
    return folder


def typed(words: tuple[str, ...]) -> str:
    """Run a command of vestige and return what it printed."""
    result = CliRunner().invoke(vestige, words, catch_exceptions=False)
    assert result.exit_code == 0, (words, result.output)
    return result.stdout
