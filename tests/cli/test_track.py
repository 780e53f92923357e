"""`vestige track`: what it refuses, and its help. What it makes of a sky is in `test_tracked_sky.py`."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from builders import received_batch, satellite
from night import done
from vestige.cli.recordings.track import command as track
from vestige.errors import InputFileError
from vestige.recording.observations.observation_file import open_observations
from vestige.recording.tracked import track_recording
from vestige.records import Band
from vestige.sample_processor.tracking.tracking_receiver import TrackingReceiver


@pytest.fixture
def few_satellites(monkeypatch: pytest.MonkeyPatch) -> None:
    """Search only two satellites; tests/unit/sample_processor/tracking and tests/cli/test_tracked_sky.py search all."""
    monkeypatch.setattr(track_recording, "TrackingReceiver", partial(TrackingReceiver, svids=(11, 12)))


@pytest.mark.usefixtures("few_satellites")
def test_too_short_a_recording_is_not_tracked(tmp_path: Path) -> None:
    np.random.default_rng(1).integers(-40, 40, 2 * 800_000, dtype=np.int8).tofile(tmp_path / "e1")
    (tmp_path / "recording.toml").write_text(
        'start = "2026-11-21T12:00:16 GST"\ntime_uncertainty_s = 1.0\nsample_rate_hz = 4e6\n'
        '[e1]\nfile = "e1"\nformat = "int8"\nlayout = "iq"\ncenter_frequency_hz = 1575.42e6\n'
    )
    with pytest.raises(InputFileError, match=r"found 0\.2 s.*expected at least 2 s.*vestige process"):
        done(track, tmp_path, "-o", tmp_path / "tracked")
    assert not (tmp_path / "tracked").exists()


def test_track_refuses_what_it_cannot_do(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    with pytest.raises(InputFileError, match="an existing file or folder"):
        done(track, tmp_path, "-o", tmp_path / "there")
    with pytest.raises(InputFileError, match="no description of samples"):
        done(track, tmp_path, "-o", tmp_path / "new")


@pytest.mark.usefixtures("few_satellites")
def test_the_observation_rate_is_that_of_the_files(tmp_path: Path) -> None:
    one = satellite(11, 2.41e7, -350.0, 45.0, 45.0, seed=2)
    sky = received_batch(Band.E1, [one], duration_s=2.2, rate_hz=4.1e6, seed=4)
    np.round(sky.samples.view(np.float32) * 20).clip(-127, 127).astype(np.int8).tofile(tmp_path / "e1")
    (tmp_path / "recording.toml").write_text(
        'start = "2026-11-21T12:00:16 GST"\ntime_uncertainty_s = 1.0\nsample_rate_hz = 4.1e6\n'
        '[e1]\nfile = "e1"\nformat = "int8"\nlayout = "iq"\ncenter_frequency_hz = 1575.42e6\n'
    )
    done(track, tmp_path, "-o", tmp_path / "tracked", "--observation-rate-hz", "50")
    times = [epoch.time for epoch in open_observations(tmp_path / "tracked" / "observations.rnx")]
    assert len(times) > 50
    assert {round((after - before) * 1e3) for before, after in pairwise(times)} == {20}


def test_help_names_the_loops() -> None:
    text = CliRunner().invoke(track, ["--help"]).stdout
    for option in ("--pll-bandwidth-hz", "--dll-bandwidth-hz", "--integration-ms", "--correlators", "--replica"):
        assert option in text
