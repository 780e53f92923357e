"""Draw figures of campaigns, sweeps, searches and checks.

A function that draws a figure returns the axes of the figure, or one of the axes if the figure has several. Most of
these functions take the results of a campaign. The functions compute only what the figure shows in addition to the
results, such as bins, counts and confidence intervals.

The arguments `detector` and `svid` choose a detector and a satellite. If `svid` is None, the results must have only one
satellite. A function with the argument `ax` draws on the axes `ax`, by default on new axes.
"""

from __future__ import annotations

from vestige.plots.attacks.animation import write_animation
from vestige.plots.attacks.attack_comparison import attack_comparison
from vestige.plots.attacks.threat_map import threat_map
from vestige.plots.attacks.waterfall import waterfall, waterfall_map
from vestige.plots.curves.check_curves import check_curves
from vestige.plots.curves.detection_curve import detection_curve
from vestige.plots.curves.range_offset import range_offset
from vestige.plots.curves.roc import roc_curves
from vestige.plots.curves.sweep import read_sweep, sweep_of
from vestige.plots.decision_map import decision_map
from vestige.plots.detecting_correlator import detecting_correlator
from vestige.plots.epochs import between, is_attacked
from vestige.plots.figure import new_axes, write
from vestige.plots.magnitude_histogram import magnitude_histogram
from vestige.plots.range_histogram import RightFlank, range_histogram
from vestige.plots.sky import MonitorLine, monitor_timeline, position_error, sky_plot
from vestige.plots.vestigial_search import SearchTrace, code_phases, vestigial_search

__all__ = [
    "MonitorLine",
    "RightFlank",
    "SearchTrace",
    "attack_comparison",
    "between",
    "check_curves",
    "code_phases",
    "decision_map",
    "detecting_correlator",
    "detection_curve",
    "is_attacked",
    "magnitude_histogram",
    "monitor_timeline",
    "new_axes",
    "position_error",
    "range_histogram",
    "range_offset",
    "read_sweep",
    "roc_curves",
    "sky_plot",
    "sweep_of",
    "threat_map",
    "vestigial_search",
    "waterfall",
    "waterfall_map",
    "write",
    "write_animation",
]
