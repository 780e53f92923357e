"""
Probability of detection against C/N0
=====================================

Use this example to find the C/N0 that a receiver needs for a given integration time. The script simulates 2000
RECS at each C/N0 and compares the detected share with theory.
"""

# %%
# The scenario has one satellite, white noise, and a receiver that knows the range. The scenario has no errors of clock,
# multipath and ionosphere. ``quick.toml`` comes with vestige. ``vestige init`` writes this file into a folder.
import numpy as np

import vestige as vs
from vestige import plots
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.scenario.shipped import shipped_scenarios

(quick,) = (path for path in shipped_scenarios() if path.name == "quick.toml")
NO_ERRORS = ["epochs=2000", "receiver.clock=none", "receiver.multipath=none", "receiver.ionosphere=none"]

# %%
# ``receiver.e1_tracking`` is removed too, so the correlator in the middle is exactly on the signal. Each campaign has
# another C/N0 and another seed.
campaigns = []
for seed, cn0_dbhz in enumerate(np.arange(26.0, 33.1, 1.0)):
    settings = [*NO_ERRORS, "receiver.e1_tracking=none", f"receiver.cn0_dbhz={cn0_dbhz}", f"seed={seed}"]
    campaigns.append(direct_results(ScenarioPlan(scenario=vs.load_scenario(quick, settings))))

# %%
# The dots show the simulated shares, with 95 % intervals. The curve shows the theory for a single correlator.
sweep = plots.sweep_of(campaigns, detector="maximum")
axes = plots.detection_curve(sweep)
print(f"Theory: P_d = 0.9 needs {vs.required_cn0_dbhz(0.9, integration_s=16e-3, pfa=1e-7):.2f} dBHz in 16 ms.")
