from __future__ import annotations

import re
from pathlib import Path

from vestige.sample_processor.code_repetition import USUAL_RATES_HZ

ADVICE = Path(__file__).parents[3] / "docs/recorder_to_verdict.md"


def test_the_rates_that_the_documentation_recommends_are_usual() -> None:
    """Complex samples have the rates of the table, real samples twice these rates."""
    section = ADVICE.read_text(encoding="utf-8").split("\n## Sampling rates and front ends\n")[1].split("\n## ")[0]
    rows = re.findall(r"^\| (lowest rate|good|no gain above) \|(.*)$", section, re.MULTILINE)
    assert len(rows) == 3
    rates_hz = {1e6 * float(number) for _, row in rows for number in re.findall(r"([\d.]+) MHz", row)}
    assert {5.5e6, 12.5e6} <= rates_hz
    assert rates_hz | {2 * rate for rate in rates_hz} <= set(USUAL_RATES_HZ)
