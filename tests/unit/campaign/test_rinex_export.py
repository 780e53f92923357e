from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray

from sky_builder import CLEAN, SCENARIO, sky_scenario
from vestige.campaign.rinex_export import export_rinex
from vestige.campaign.run import run
from vestige.campaign.scenario_plan import ScenarioPlan
from vestige.errors import VestigeError
from vestige.navigation.orbit import satellite_state
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.recording.navigation.rinex_navigation import read_rinex_navigation, write_rinex_navigation
from vestige.recording.observations.observation_file import open_observations
from vestige.time import GalileoTime

START = GalileoTime.parse("2026-11-21T16:00:00 GST")
EVERYBODY = ("constellation.svids=none", "recs.every=10")


def _results(store: Path, *settings: str, path: Path = SCENARIO) -> xarray.Dataset:
    scenario = sky_scenario(*settings, path=path)
    return run(ScenarioPlan(scenario=scenario), store, executor="threads")


def test_what_the_receiver_tracked_at_every_epoch_is_in_the_file(tmp_path: Path) -> None:
    """RINEX keeps a millimetre, a millihertz and a thousandth of a dBHz; epochs are a tenth of a second apart."""
    results = _results(tmp_path / "sky.zarr", *EVERYBODY, "epochs=31", "interval_s=0.1")
    written = export_rinex(results, tmp_path / "rinex")
    epochs = list(open_observations(written.files[0]))
    assert written.n_epochs == len(epochs) == 31
    assert written.svids == tuple(results["svid"].values.tolist())
    svids = results["svid"].values.tolist()
    for row, epoch in enumerate(epochs):
        assert epoch.time == START + row // 10 + row % 10 / 10
        there = np.isfinite(results["e1_pseudorange_m"].values[row])
        assert sorted(epoch.observations) == [svid for svid, up in zip(svids, there, strict=True) if up]
        for svid, one in epoch.observations.items():
            values = results.isel(epoch=row, satellite=svids.index(svid))
            assert one.pseudorange_m == pytest.approx(float(values["e1_pseudorange_m"]), abs=6e-4)
            assert one.doppler_hz == pytest.approx(float(values["e1_doppler_hz"]), abs=6e-4)
            assert one.cn0_dbhz == pytest.approx(float(values["e1_cn0_dbhz"]), abs=6e-4)
            assert np.isnan(one.carrier_phase_cycles)


def test_what_lost_lock_or_has_set_is_not_there(tmp_path: Path) -> None:
    results = _results(tmp_path / "sky.zarr", *EVERYBODY, "epochs=60", "interval_s=60.0").load()
    results["e1_pseudorange_m"][10:20, 1] = np.nan
    results["e1_pseudorange_m"][30:33] = np.nan
    written = export_rinex(results, tmp_path / "rinex")
    epochs = {epoch.time - START: epoch for epoch in open_observations(written.files[0])}
    assert written.n_epochs == len(epochs) == 57
    seen = np.array([[svid in epoch.observations for svid in results["svid"].values] for epoch in epochs.values()])
    assert list(epochs) == [60.0 * row for row in range(60) if not 30 <= row < 33]
    there = np.isfinite(results["elevation_deg"].values)
    assert not there.all()
    there[10:20, 1] = False
    assert np.array_equal(seen, np.delete(there, range(30, 33), axis=0))


def test_nobody_tracked_is_an_error(tmp_path: Path) -> None:
    """The loops of E1 lose lock at 20 dBHz."""
    results = _results(tmp_path / "sky.zarr", *EVERYBODY, "epochs=3", "receiver.cn0_e1_dbhz=19")
    with pytest.raises(VestigeError, match="no satellite that E1 tracked"):
        export_rinex(results, tmp_path / "rinex")
    assert not (tmp_path / "rinex").exists()


def test_orbits_of_a_file_that_is_gone_serve_a_whole_day_through_a_weeks_end(tmp_path: Path) -> None:
    """What the file holds of other satellites, and of other times, is not what was simulated."""
    start, toe = START, GalileoTime.parse("2026-11-21T14:50:00 GST")
    other = walker_ephemerides(toe + 7200.0 * 3)
    write_rinex_navigation(tmp_path / "day.rnx", (*walker_ephemerides(toe), *other))
    text = SCENARIO.read_text(encoding="utf-8").replace('kind = "walker"', 'kind = "rinex"\npath = "day.rnx"')
    (tmp_path / "day.toml").write_text(text, encoding="utf-8")
    settings = (*CLEAN, "epochs=49", "interval_s=1800.0", "recs.every=1")
    results = _results(tmp_path / "sky.zarr", *settings, path=tmp_path / "day.toml")
    (tmp_path / "day.rnx").unlink()
    written = export_rinex(results, tmp_path / "rinex")
    found = read_rinex_navigation(written.files[1])
    assert {one.svid for one in found} == set(results["svid"].values.tolist()) == {6, 7, 8, 12, 13, 14, 23, 24}
    toes_s = sorted({one.toe - start for one in found})
    assert toes_s == [-4200.0 + 7200.0 * k for k in range(len(toes_s))]
    assert len(found) == written.n_ephemerides == 8 * len(toes_s)
    assert 24 * 3600 - 7200 <= toes_s[-1] < 24.5 * 3600
    elapsed_s = np.linspace(0.0, 86_400.0, 9)
    for one in found:
        expected = satellite_state(walker_ephemerides(toe)[one.svid - 1], start, elapsed_s).position_m
        assert satellite_state(one, start, elapsed_s).position_m == pytest.approx(expected, abs=1e-2)
