"""The decision map as a figure: colours where the classes are, dots where the measurements are."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.collections import QuadMesh

from vestige import plots
from vestige.acas_processor.checks.power.decision_map import DecisionMap
from vestige.plots.figure import figure_of
from vestige.records.checks import SignalClass

REGIONS = DecisionMap(
    power_edges_db=np.array([-1.0, 1.0, 3.0]),
    distortion_edges=np.array([0.0, 9.0, 99.0]),
    classes=np.array([[0, 1], [3, 2]], dtype=np.int8),
)


def test_each_cell_has_the_colour_of_its_class() -> None:
    ax = plots.decision_map(REGIONS, title="a map")
    (mesh,) = (one for one in ax.collections if isinstance(one, QuadMesh))
    shown = mesh.get_array()
    assert shown is not None
    # the lower row is that of little distortion
    assert np.asarray(shown).tolist() == [
        [SignalClass.CLEAN, SignalClass.JAMMED],
        [SignalClass.MULTIPATH, SignalClass.SPOOFED],
    ]
    assert [text.get_text() for text in figure_of(ax).legends[0].get_texts()] == [
        "clean", "multipath", "spoofed", "jammed",
    ]  # fmt: skip
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("rise of the power (dB)", "distortion (σ)")


def test_dots_are_what_was_measured_and_what_is_beyond_stands_at_the_edge() -> None:
    power_db = np.array([0.0, 2.0, 50.0, np.nan])
    distortion = np.array([9.0, 0.0, 1e6, 1.0])
    attacked = np.array([False, False, True, True])
    ax = plots.decision_map(REGIONS, title="", power_db=power_db, distortion=distortion, attacked=attacked)
    calm, hit = ax.lines
    assert calm.get_xydata() == pytest.approx(np.array([[0.0, 1.0], [2.0, 0.0]]))  # log10(1 + D)
    assert hit.get_xydata() == pytest.approx(np.array([[3.0, 2.0]]))
