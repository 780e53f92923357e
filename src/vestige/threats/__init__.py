"""Make the threat table: the measured and the expected outcome of every attack at every mitigation level.

`read_threats` returns the attacks, `cases` returns their scenes, and `case_of` makes a scene from your own scenario.
`measure_threats` measures the scenes, and `threat_dataset` makes the table that `plots.threat_map` draws. The command
`vestige threats` does all these steps.

Examples
--------
>>> from concurrent.futures import ThreadPoolExecutor
>>> import vestige as vs
>>> scenario = vs.load_scenario("scenarios/liftoff.toml", ["epochs=60", 'fidelity="correlators"'])
>>> with ThreadPoolExecutor() as pool:
...     cells = list(vs.threats.measure_threats([vs.threats.case_of("lift-off", scenario)], range(2), pool))
>>> [cell.level for cell in cells]
[1, 2, 3]
"""

from __future__ import annotations

from vestige.threats.matrix import Case, SceneCell, case_of, cases, measure_threats
from vestige.threats.scenes import read_threats
from vestige.threats.table import threat_dataset, write_table

__all__ = [
    "Case",
    "SceneCell",
    "case_of",
    "cases",
    "measure_threats",
    "read_threats",
    "threat_dataset",
    "write_table",
]
