"""Completion with Tab: the script that bash gets from `vestige`, asked as bash asks it."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from vestige.cli.main import VERBS

BASH = shutil.which("bash")
VESTIGE = Path(sys.executable).parent / "vestige"
SCRIPT = """
eval "$(_VESTIGE_COMPLETE=bash_source vestige)"
complete -p vestige | grep -q _vestige_completion || exit 3
for line in "$@"; do
  eval "COMP_WORDS=($line)"; COMP_CWORD=$(( ${#COMP_WORDS[@]} - 1 )); COMPREPLY=()
  _vestige_completion vestige
  echo "${COMPREPLY[*]}"
done
"""


@pytest.mark.skipif(BASH is None or not VESTIGE.exists(), reason="needs bash and the command `vestige`")
def test_bash_completes_commands_options_and_their_values() -> None:
    lines = [
        "vestige ''",
        "vestige pro",
        "vestige recs ''",
        "vestige theory --integ",
        "vestige track --pll-discriminator arctan",
        "vestige plot --detector ''",
        "vestige process --detector m",
        "vestige threats --only A2",
        "vestige threats --only A15,A1",
    ]
    path = f"{VESTIGE.parent}{os.pathsep}{os.environ['PATH']}"
    answer = subprocess.run(  # noqa: S603
        [str(BASH), "-c", SCRIPT, "bash", *lines],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PATH": path},
    )
    all_verbs, *others = answer.stdout.splitlines()
    assert shlex.split(all_verbs) == list(VERBS)
    after_comma = " ".join(f"A15,A1{last}" for last in ("", *range(10)))
    assert others == [
        "process", "decrypt info make", "--integration-ms", "arctan2 arctan",
        "early maximum", "maximum", "A2 A20 A21", after_comma,
    ]  # fmt: skip
