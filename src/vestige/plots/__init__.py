"""Figures of the results of a campaign: results in, axes out. They compute nothing but bins and counts."""

from __future__ import annotations

from vestige.plots.detecting_correlator import detecting_correlator
from vestige.plots.detection_curve import detection_curve
from vestige.plots.epochs import between
from vestige.plots.figure import new_axes, write
from vestige.plots.magnitude_histogram import magnitude_histogram
from vestige.plots.range_histogram import RightFlank, range_histogram
from vestige.plots.range_offset import range_offset
from vestige.plots.sweep import read_sweep, sweep_of
from vestige.plots.waterfall import waterfall, waterfall_map

__all__ = [
    "RightFlank",
    "between",
    "detecting_correlator",
    "detection_curve",
    "magnitude_histogram",
    "new_axes",
    "range_histogram",
    "range_offset",
    "read_sweep",
    "sweep_of",
    "waterfall",
    "waterfall_map",
    "write",
]
