"""Results as pages show them: small runs of the scenarios, a threat table, and what stands in a page."""

from __future__ import annotations

import base64
import csv
import html
import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario

SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"
QUICK = ("epochs=400", "receiver.cn0_dbhz=33")
LIFT_OFF = (
    'fidelity="correlators"', "epochs=300", "attack.0.start_s=100", "attack.0.delay_m.start_s=100",
    "attack.0.delay_m.turn_s=120", "attack.0.delay_m.stop_s=220", "attack.0.power_db.start_s=120",
    "attack.0.power_db.stop_s=144",
)  # fmt: skip
SKY = ("epochs=240", "recs.every=10", "constellation.svids=[6, 7, 8, 12, 13]")
THREAT_ROW = {
    "threat": "A1", "attack": "none of <b>these</b>", "scene": "one", "expected_level_1": "detect: it is seen",
    "expected_level_2": "miss", "level_1": "as expected",
    "detected": "19", "detected_of": "20", "detected_low": "0.75", "detected_high": "0.99",
    "mitigated": "0", "mitigated_of": "20", "mitigated_low": "0", "mitigated_high": "0.17",
    "missed": "3", "missed_of": "20", "missed_low": "0.03", "missed_high": "0.38",
    "denied": "0", "denied_of": "20", "denied_low": "0", "denied_high": "0.17",
    "by_chance": "2", "by_chance_of": "20", "alarms": "60", "days": "0.2778",
    "budget_alarms_a_day": "62", "alarms_a_day": "216",
    "alarms_a_day_low": "166", "alarms_a_day_high": "275", "time_to_detect_s": "90.0", "worst_range_m": "28.3",
    "shows": "", "note": "", "checks": "C/N0 19/20 after 4.5 s; RAIM 2/20 after 60 s", "vestige_version": "1.2",
}  # fmt: skip


def made(path: Path, name: str, *settings: str) -> Path:
    """Return the store of a run of one of the scenarios."""
    scenario = load_scenario(SCENARIOS / f"{name}.toml", settings)
    assert isinstance(scenario, CampaignScenario)
    run(ScenarioPlan(scenario=scenario), path)
    return path


def threat_folder(folder: Path, *rows: dict[str, str]) -> Path:
    """Return the folder of a threat table with these rows; each says what differs from `THREAT_ROW`."""
    folder.mkdir(parents=True, exist_ok=True)
    whole = [THREAT_ROW | row for row in rows or ({},)]
    with (folder / "threats.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(whole[0]))
        writer.writeheader()
        writer.writerows(whole)
    return folder


def data_of(page: str) -> dict[str, Any]:
    """Return what the script of a page draws."""
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    found: dict[str, Any] = json.loads(text)
    return found


def unpacked(packed: dict[str, str]) -> np.ndarray:
    """Return an array as the script reads it."""
    return np.frombuffer(base64.b64decode(packed["base64"]), dtype=np.dtype(packed["type"]).newbyteorder("<"))


def rows_of(page: str, caption: str) -> dict[str, list[str]]:
    """Return the text of the cells in the first table below a caption, by the heading of their row."""
    after = page[page.index(f'<p class="caption">{html.escape(caption, quote=True)}') :]
    body = re.sub(r"\s+", " ", after[after.index("<tbody>") : after.index("</tbody>")])
    rows = {}
    for row in re.findall(r"<tr[^>]*>(.*?)</tr>", body):
        cells = [html.unescape(re.sub(r"<[^>]+>", " ", cell)) for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row)]
        heading, *others = (" ".join(cell.replace("\N{NO-BREAK SPACE}", " ").split()) for cell in cells)
        rows[heading] = others
    return rows
