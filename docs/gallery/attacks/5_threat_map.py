"""
A row of the threat table
=========================

Use this example to measure an attack against each mitigation level in a script. The command
``vestige threats --only A3 --seeds 2`` makes the same measurement.
"""

# %%
# A3 is the attack of the threat table that replays both bands.
from concurrent.futures import ThreadPoolExecutor

from vestige import plots
from vestige.threats.matrix import cases, measure_threats
from vestige.threats.scenes import read_threats
from vestige.threats.table import threat_dataset

chosen = tuple(threat for threat in read_threats() if threat.id == "A3")
with ThreadPoolExecutor(1) as executor:
    cells = list(measure_threats(cases(chosen), range(2), executor, workers=1))
axes = plots.threat_map(threat_dataset(cells))
