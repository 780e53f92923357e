from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from results_builder import campaign_results, lift_off
from vestige.plots.attacks import animation
from vestige.plots.attacks.animation import write_animation


def _frames(path: Path) -> list[np.ndarray]:
    frames = []
    with Image.open(path) as image:
        for number in range(getattr(image, "n_frames", 1)):
            image.seek(number)
            frames.append(np.asarray(image.convert("RGB")))
    return frames


def test_one_frame_an_epoch_and_each_is_another(tmp_path: Path) -> None:
    assert write_animation(campaign_results(6, spoofer=lift_off), tmp_path / "a.gif", width_cm=6.0) == 6
    frames = _frames(tmp_path / "a.gif")
    assert len(frames) == 6
    assert frames[0].shape[1] == pytest.approx(6.0 / 2.54 * animation.ANIMATION_DPI, abs=1)
    for before, after in pairwise(frames):
        assert not np.array_equal(before, after)


def test_a_long_run_has_a_bounded_number_of_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(animation, "FRAMES", 5)
    assert write_animation(campaign_results(1001), tmp_path / "a.gif") <= 5
    assert len(_frames(tmp_path / "a.gif")) <= 5
    assert len(_frames(tmp_path / "a.gif")) >= 4


def test_gaps_and_misses_are_frames_too(tmp_path: Path) -> None:
    results = campaign_results(4, cn0_dbhz=5.0, unavailable=slice(1, 2), spoofer=lift_off)
    assert write_animation(results, tmp_path / "a.gif") == 4


def test_another_suffix_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"\.gif"):
        write_animation(campaign_results(2), tmp_path / "a.png")
