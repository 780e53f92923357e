"""
A meaconer moves the position to its antenna
============================================

Use this example to see the effect of a meaconer on a whole sky. A receiver that follows the meaconer computes the
position of the meaconer's antenna. The receiver's clock is then late by the meaconer's delay and the travel time from
the antenna to the receiver.
"""

# %%
# The antenna stands 0.001 degrees (111 m) north of the receiver. The repeated signals begin after 60 s, and are 6 dB
# stronger than the true signals.
import matplotlib.pyplot as plt
import numpy as np

import vestige as vs
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.scenario.shipped import shipped_scenarios

(sky,) = (path for path in shipped_scenarios() if path.name == "sky.toml")
ATTACK = (
    'attack=[{kind="meaconing", start_s=60, delay_s=2e-6, power_db=6, reception_gain_db=20,'
    " antenna={latitude_deg=48.101, longitude_deg=11.6, height_m=500}}]"
)
settings = ["epochs=180", "recs.every=10", ATTACK]
results = direct_results(ScenarioPlan(scenario=vs.load_scenario(sky, settings)))

# %%
# The figure shows the error of the position fix from all satellites. Level 2 detects that each satellite has a second
# signal (see :doc:`/threats`).
error = results["fix_error_m"].sel(fix="all")
figure, axes = plt.subplots(2, 1, sharex=True, layout="constrained")
for axis in ("east", "north", "up"):
    axes[0].plot(results["time_s"], error.sel(local_axis=axis), linewidth=0.8, label=axis)
axes[0].set(ylabel="error of the fix (m)")
axes[0].legend()
clock_m = results["fix_clock_error_m"].sel(fix="all").values
axes[1].plot(results["time_s"], clock_m, color="grey", linewidth=0.8)
axes[1].set(xlabel="time (s)", ylabel="error of the clock (m)")
during = results["time_s"].values > 90
print(f"north: {np.nanmedian(error.sel(local_axis='north').values[during]):.1f} m")
way_m = 111.2  # distance from the antenna to the receiver
print(f"clock: {np.nanmedian(clock_m[during]):.1f} m; 2 µs and the way are {2e-6 * 299_792_458 + way_m:.1f} m")
plt.show()
