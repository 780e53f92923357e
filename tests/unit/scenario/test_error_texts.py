from __future__ import annotations

from pathlib import Path

import pytest

from vestige.errors import InputFileError
from vestige.scenario.load import load_scenario

QUICK = Path(__file__).resolve().parents[3] / "scenarios" / "quick.toml"


@pytest.mark.parametrize(
    ("setting", "text"),
    [
        ("receiver.cn0_dbz=1", "receiver.cn0_dbz: found an unknown key cn0_dbz, expected cn0_dbhz"),
        ("zzz=1", "zzz: found an unknown key zzz, expected one of those in docs/scenarios.md"),
        ("receiver.cn0_dbhz=none", "receiver.cn0_dbhz: found nothing, expected a value: the key is needed"),
        ("receiver.cn0_dbhz=90", "receiver.cn0_dbhz: found 90, expected at most 80"),
        ("receiver.cn0_dbhz=-1", "receiver.cn0_dbhz: found -1, expected at least 0"),
        ('receiver.cn0_dbhz="x"', "receiver.cn0_dbhz: found x, expected a number"),
        ("epochs=1.5", "epochs: found 1.5, expected a whole number"),
        ("interval_s=0.15", "interval_s: found 0.15, expected a multiple of 0.1"),
        ("receiver=3", "receiver: found 3, expected a table"),
        ("receiver.multipath=3", "receiver.multipath: found 3, expected a table"),
        ("receiver.signal=7", "receiver.signal: found 7, expected true or false"),
        ("recs.duration_ms=3", "recs.duration_ms: found 3, expected 1, 2, 4, 8 or 16"),
        ("attack=1", "attack: found 1, expected a list"),
        ("receiver.ionosphere={}", "receiver.ionosphere.kind: found nothing, expected a kind"),
    ],
)
def test_errors_in_our_words(setting: str, text: str) -> None:
    with pytest.raises(InputFileError) as caught:
        load_scenario(QUICK, (setting,))
    assert str(caught.value) == f"{QUICK}: {text}"
