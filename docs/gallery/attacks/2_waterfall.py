"""
Correlators against time
========================

Use this figure to see a second signal appear and move away. The script draws the magnitude of the correlators over
time as a surface, as in the paper, and as a map.
"""

# %%
# In the lift-off attack the spoofing signal has the delay of the true signal at 600 s, and then moves away. The two
# peaks begin to separate at about 850 s.
import vestige as vs
from vestige import plots
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.scenario.shipped import shipped_scenarios

(liftoff,) = (path for path in shipped_scenarios() if path.name == "liftoff.toml")
results = direct_results(ScenarioPlan(scenario=vs.load_scenario(liftoff, ['fidelity="correlators"'])))
landscape = plots.waterfall(results)

# %%
# The map shows every epoch. The true signal stays at 0 m, and the spoofing signal ends at 71 m.
map_axes = plots.waterfall_map(results)
