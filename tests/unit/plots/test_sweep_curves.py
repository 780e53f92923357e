from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray

from vestige.errors import VestigeError
from vestige.plots.curves.detection_curve import detection_curve
from vestige.plots.curves.sweep import read_sweep

HEADING = "cn0_dbhz,integration_s,p_fa,trials,detections"


def table(path: Path, keys: str, *rows: str) -> xarray.Dataset:
    path.write_text("\n".join([f"{keys},{HEADING}", *rows]) + "\n")
    return read_sweep(path)


def test_one_curve_for_each_value_of_the_other_key(tmp_path: Path) -> None:
    rows = [
        f"{power},{cn0},{cn0},0.016,1e-7,100,{hits}"
        for power, cn0, hits in ((-20, 30, 60), (-20, 29, 50), (-10, 30, 40), (-10, 29, 30))
    ]
    ax = detection_curve(table(tmp_path / "a.csv", "receiver.multipath.power_db,receiver.cn0_dbhz", *rows))
    found = {line.get_label(): (line.get_color(), *np.array(line.get_data()).T.tolist()) for line in ax.lines[1:]}
    assert {label: points for label, (_, *points) in found.items()} == {
        "power_db = -20": [[29.0, 0.5], [30.0, 0.6]],
        "power_db = -10": [[29.0, 0.3], [30.0, 0.4]],
    }
    assert len({colour for colour, *_ in found.values()}) == 2


def test_a_sweep_at_one_c_over_n0_is_drawn_against_its_key(tmp_path: Path) -> None:
    rows = [f"{power},33,0.016,1e-7,100,{hits}" for power, hits in ((-10, 40), (-20, 60))]
    ax = detection_curve(table(tmp_path / "a.csv", "receiver.multipath.power_db", *rows))
    theory, counted = ax.lines
    assert ax.get_xlabel() == "receiver.multipath.power_db"
    assert np.array(counted.get_data()).T.tolist() == [[-20.0, 0.6], [-10.0, 0.4]]
    assert np.ptp(np.asarray(theory.get_ydata())) == 0


def test_texts_are_curves(tmp_path: Path) -> None:
    rows = [f"{name},33,0.016,1e-7,100,{hits}" for name, hits in (("samples", 40), ("correlators", 60))]
    ax = detection_curve(table(tmp_path / "a.csv", "fidelity", *rows))
    assert ax.get_xlabel() == "C/N0 (dBHz)"
    assert [line.get_label() for line in ax.lines[1:]] == ["fidelity = samples", "fidelity = correlators"]


def test_too_many_curves(tmp_path: Path) -> None:
    rows = [f"{seed},{cn0},0.016,1e-7,100,50" for seed in range(9) for cn0 in (30, 31)]
    with pytest.raises(VestigeError, match="found 9 combinations of seed, expected at most 6 curves"):
        detection_curve(table(tmp_path / "a.csv", "seed", *rows))
