"""The versions of the judges stand in two files, which say the same."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_command_by_hand_installs_what_make_judges_installs() -> None:
    (pinned,) = re.findall(r"^JUDGES := (.+)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    by_hand = re.findall(r"pip install --no-deps (.+)$", (ROOT / "CONTRIBUTING.md").read_text("utf-8"), re.MULTILINE)
    assert by_hand == [pinned]
    assert all(re.fullmatch(r"[\w-]+==[\d.]+", one) for one in pinned.split())
    assert "make judges" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
