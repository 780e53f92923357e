"""
A sky of verdicts
=================

Use this example to read verdicts in a script. An attacker pulls two of eight satellites away. The sky plot shows the
last verdict of each satellite.
"""

# %%
# ``vs.simulate`` is a source of snapshots, as a recording is. A spoofing signal pulls E1 of E07 and E13 away by 150 m.
import matplotlib.pyplot as plt
import numpy as np

import vestige as vs
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.scenario.shipped import shipped_scenarios

(sky,) = (path for path in shipped_scenarios() if path.name == "sky.toml")
ATTACK = (
    'attack=[{kind="position-push", bands=["E1"], svids=[7, 13], start_s=30, power_db=6,'
    ' delay_m={kind="ramp", first=0, last=150, start_s=40, stop_s=140}}]'
)
scenario = vs.load_scenario(sky, ["epochs=181", ATTACK])
verdicts = [*vs.processor_of(scenario).run(vs.simulate(scenario))]
last = {verdict.svid: verdict for verdict in verdicts}
for svid, verdict in sorted(last.items()):
    print(f"E{svid:02d} {verdict.status.name:14s} {verdict.reason}")

# %%
# The results of the same campaign give the directions of the satellites.
results = direct_results(ScenarioPlan(scenario=scenario), judge=False).isel(epoch=-1)
marks = {"AUTHENTIC": ("o", "tab:green"), "SPOOFED": ("X", "tab:red"), "SUSPECT": ("s", "tab:orange")}
figure, axes = plt.subplots(subplot_kw={"projection": "polar"}, figsize=(5, 4.4), layout="constrained")
axes.set_theta_zero_location("N")
axes.set_theta_direction(-1)
for place, svid in enumerate(results["svid"].values.tolist()):
    azimuth = np.radians(results["azimuth_deg"].values[place])
    away_deg = 90 - results["elevation_deg"].values[place]
    status = last[svid].status.name
    marker, colour = marks.get(status, ("D", "tab:grey"))
    axes.plot(azimuth, away_deg, marker, markersize=12, color=colour, linestyle="none", label=status)
    axes.annotate(f"E{svid:02d}", (azimuth, away_deg), (8, 8), textcoords="offset points")
axes.set_rlim(0, 90)
axes.set_xticks(np.radians([0, 90, 180, 270]), ["N", "E", "S", "W"])
axes.set_yticks([30, 60], ["60°", "30°"])
once = {line.get_label(): line for line in axes.lines}  # one legend entry for each verdict
figure.legend(once.values(), once.keys(), loc="outside lower center", ncols=4, frameon=False)
plt.show()
