"""
A detector of your own
======================

Use this example to try an idea for a detector before you run a campaign with it. A detector is a class with the method
``detect``. ``detect`` gets the magnitudes of all correlators of many epochs, and returns the index of the correlator
that counts as the signal. :doc:`/extend` says how a scenario names the class.
"""

# %%
# The detector takes the earliest peak that exceeds the threshold and a third of the highest correlator.
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np

import vestige as vs
from vestige.campaign.execution.direct import direct_results
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.scenario.shipped import shipped_scenarios


@dataclass(frozen=True, kw_only=True)
class RelativePeak:
    """Detect the earliest peak above the threshold and above a third of the highest correlator."""

    spacing: int = 1

    def detect(self, magnitudes, threshold):
        """Return the index of the chosen correlator of each epoch, -1 for none."""
        n = self.spacing
        early, punctual, late = magnitudes[:, : -2 * n], magnitudes[:, n:-n], magnitudes[:, 2 * n :]
        limit = np.maximum(threshold, punctual.max(axis=1) / 3)[:, None]
        peak = (punctual > limit) & (punctual > early) & (punctual > late)
        return np.where(peak.any(axis=1), np.argmax(peak, axis=1) + n, -1)


# %%
# The detectors get the correlators of 20,000 epochs in a street, where reflections are as strong as the direct signal.
# The magnitudes are in standard deviations of the noise.
MULTIPATH = 'receiver.multipath={kind="lms-lite", power_db=0.0, mean_excess_m=80.0, mean_life_m=0.0}'
(quick,) = (path for path in shipped_scenarios() if path.name == "quick.toml")
results = direct_results(ScenarioPlan(scenario=vs.load_scenario(quick, [MULTIPATH])))
magnitudes = np.abs(results["taps"].isel(satellite=0).values)
noise = np.sqrt(results["noise_power"].isel(satellite=0).values / 2)[:, None]  # σ of one dimension of the noise
detectors = {"own": RelativePeak(), "early": vs.EarlyDetector(), "maximum": vs.MaximumDetector()}
threshold = vs.threshold(1e-7)
chosen = {name: one.detect(magnitudes / noise, threshold) for name, one in detectors.items()}

# %%
# The figure shows which correlator each detector chooses. Correlators are 15 m apart. The prediction from E1 is at 0 m.
# Most counts far to the right of 0 m are reflections that a detector took for the signal.
offsets_m = results["tap_offset_m"].values
figure, axes = plt.subplots(layout="constrained")
for place, (name, taps) in enumerate(chosen.items()):
    counts = np.bincount(taps[taps >= 0], minlength=offsets_m.size)
    axes.bar(offsets_m + 4 * (place - 1), counts, width=4, label=f"{name}: {np.sum(taps < 0)} not detected")
axes.set(xlabel="chosen correlator (m after the prediction)", ylabel="epochs", yscale="log")
axes.legend()
plt.show()
