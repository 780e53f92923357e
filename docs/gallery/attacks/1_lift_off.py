"""
The lift-off attack
===================

Use this example to see when each detector follows a spoofing signal. The attacker repeats E6. The weak spoofing
signal first approaches the true signal, and then gains power and moves away. Section VI-B of the paper has the same
attack.
"""

# %%
# The comments of ``liftoff.toml`` explain every line of the attack. In this example the correlators are simulated, not
# the samples.
import numpy as np

import vestige as vs
from vestige import plots
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.scenario.shipped import shipped_scenarios

(liftoff,) = (path for path in shipped_scenarios() if path.name == "liftoff.toml")
results = direct_results(ScenarioPlan(scenario=vs.load_scenario(liftoff, ['fidelity="correlators"'])))

# %%
# The upper axes show the power of the spoofing signal. The lower axes show the range that each detector measures. The
# early detector returns to the true signal when the two peaks have separated, because nothing can arrive before the
# true signal.
axes = plots.attack_comparison(results)

# %%
# The script prints the median range offset of each detector for the time from 1200 s on.
last = results["time_s"].values >= 1200
for detector in ("early", "maximum"):
    offset_m = results["range_offset_m"].sel(detector=detector).values[last, 0]
    print(f"{detector:8s} median range offset {np.nanmedian(offset_m):+.1f} m")
