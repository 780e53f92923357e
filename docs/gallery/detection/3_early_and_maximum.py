"""
Early and maximum detector under multipath
==========================================

Use this example to see the effect of reflections on the range that each detector measures. A reflection arrives later
than the direct signal, so a detector that takes the reflection for the signal measures a range that is too long.
"""

# %%
# The scene has multipath and no ionosphere. Reflections are as strong as the direct signal, as in a street.
import matplotlib.pyplot as plt
import numpy as np

import vestige as vs
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.scenario.shipped import shipped_scenarios

(quick,) = (path for path in shipped_scenarios() if path.name == "quick.toml")
MULTIPATH = 'receiver.multipath={kind="lms-lite", power_db=0.0, mean_excess_m=80.0, mean_life_m=0.0}'
settings = ["epochs=20000", "receiver.ionosphere=none", "receiver.cn0_dbhz=40", MULTIPATH]
results = direct_results(ScenarioPlan(scenario=vs.load_scenario(quick, settings)))

# %%
# The range offset is the range of E6 minus the range that E1 predicts.
figure, axes = plt.subplots(layout="constrained")
for detector in ("early", "maximum"):
    offset_m = results["range_offset_m"].sel(detector=detector).values.ravel()
    found = offset_m[np.isfinite(offset_m)]
    label = f"{detector}: median {np.median(found):+.1f} m, {np.mean(found > 20):.2%} beyond 20 m"
    axes.hist(found, bins=np.arange(-60, 75, 1.5), histtype="step", label=label)
axes.set(xlabel="range offset (m)", ylabel="RECS", yscale="log")
axes.legend(loc="upper right")
plt.show()
