"""`process --track` with damaged samples: a reason in the end, never a traceback, and nothing AUTHENTIC that is not."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from night import invoke
from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.simulate import command as simulate
from vestige.errors import VestigeError

pytestmark = pytest.mark.slow

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
RATE_HZ, DURATION_S, EVERY_S = 5.2e6, 5, 2
BAD_S = 3.4  # after the start, between two RECS
SETTINGS = (f"receiver.sample_rate_hz={RATE_HZ}", "constellation.svids=[7, 13]", f"recs.every={EVERY_S}")
BANDS = ("e1", "e6")
START_S = 79200.0
UNSEEN = {("NOT_AVAILABLE", "not seen on E1")}
ELSEWHERE = {("NOT_DETECTED", "no encrypted signal where E1 predicts it")}

Samples = dict[str, np.ndarray]
Damage = Callable[[Samples], Samples]


class Night(NamedTuple):
    """A recording, and its samples as I and Q in turn."""

    folder: Path
    samples: Samples


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Night]:
    """Two satellites for 5 s, without observations; OSNMA keys are there."""
    folder = tmp_path_factory.mktemp("damaged") / "night"
    settings = [item for one in SETTINGS for item in ("--set", one)]
    assert invoke(simulate, NIGHT, "-o", folder, "--epochs", f"0:{DURATION_S}", *settings).exception is None
    yield Night(folder, {band: np.fromfile(folder / f"{band}.sigmf-data", np.int8) for band in BANDS})
    shutil.rmtree(folder)


def _place(second: float) -> int:
    """Return where the samples of a second begin, in numbers of the file."""
    return 2 * round(second * RATE_HZ)


def _from(second: float, change: Callable[[np.ndarray], np.ndarray], *bands: str) -> Damage:
    """Return a damage of some bands that begins at a second."""

    def damage(samples: Samples) -> Samples:
        place = _place(second)
        return samples | {
            band: np.concatenate([samples[band][:place], change(samples[band][place:])]) for band in bands
        }

    return damage


def _lost(length_s: float, *bands: str) -> Damage:
    return _from(BAD_S, lambda part: part[_place(length_s) :], *bands)


def _repeated(length_s: float, *bands: str) -> Damage:
    return _from(BAD_S, lambda part: np.concatenate([part[: _place(length_s)], part]), *bands)


def _zeros(part: np.ndarray) -> np.ndarray:
    return np.zeros_like(part)


def _clipped(part: np.ndarray) -> np.ndarray:
    return np.where(part < 0, -128, 127).astype(np.int8)


def _noise(part: np.ndarray) -> np.ndarray:
    return np.random.default_rng(3).integers(-40, 40, part.size, dtype=np.int8)


def _processed(night: Night, folder: Path, samples: Samples, *options: object, floats: bool = False) -> list[dict]:
    """Return the verdicts of samples with the description of the night."""
    return list(_object(night, folder, samples, *options, floats=floats)["verdicts"])


def _object(night: Night, folder: Path, samples: Samples, *options: object, floats: bool = False) -> dict:
    """Return what `process --json` prints of samples, as plain files beside a `recording.toml`."""
    folder.mkdir()
    meta = json.loads((night.folder / "e1.sigmf-meta").read_text())["captures"][0]
    lines = [f'start = "{meta["vestige:start_gst"]}"', "time_uncertainty_s = 0.01", f"sample_rate_hz = {RATE_HZ}"]
    for band, carrier_hz in (("e1", 1575.42e6), ("e6", 1278.75e6)):
        if band in samples:
            form = "float32" if floats else "int8"
            samples[band].astype(form).tofile(folder / band)
            lines += [f"[{band}]", f'file = "{band}"', f'format = "{form}"', 'layout = "iq"']
            lines.append(f"center_frequency_hz = {carrier_hz}")
    (folder / "recording.toml").write_text("\n".join(lines) + "\n")
    assistance = ("--assistance", night.folder / "assistance")
    try:
        result = invoke(process, folder, "--track", *assistance, "--json", *options)
    finally:
        shutil.rmtree(folder)
    if result.exception is not None:
        raise result.exception
    return dict(json.loads(result.stdout))


def _said(verdicts: list[dict], from_s: float, to_s: float) -> set[str]:
    """Return what is said of the RECS of a stretch of the recording; each verdict has a reason."""
    assert all(one["reason"] for one in verdicts)
    return {one["status"] for one in verdicts if from_s <= one["gst_second"] - START_S < to_s}


def test_undamaged_samples_are_authentic(night: Night, tmp_path: Path) -> None:
    """Whole numbers and floats, with the same verdicts: what the other tests compare with."""
    assert _said(_processed(night, tmp_path / "whole", night.samples), 1.5, DURATION_S) == {"AUTHENTIC"}
    samples = {name: one[: _place(4.5)] for name, one in night.samples.items()}
    assert _said(_processed(night, tmp_path / "floats", samples, floats=True), 1.5, 4.3) == {"AUTHENTIC"}


@pytest.mark.parametrize(
    ("damage", "later"),
    [
        # nothing to find from the damage on
        pytest.param(_from(BAD_S, _zeros, "e1"), UNSEEN, id="zeros in E1"),
        pytest.param(_from(BAD_S, _zeros, "e6"), {("NOT_AVAILABLE", "the E6 samples are all zero")}, id="zeros in E6"),
        pytest.param(_from(BAD_S, _zeros, *BANDS), UNSEEN, id="zeros in both"),
        pytest.param(_from(BAD_S, _noise, "e1"), UNSEEN, id="noise in E1"),
        pytest.param(_from(BAD_S, _noise, "e6"), ELSEWHERE, id="noise in E6"),
        pytest.param(_from(BAD_S, lambda part: part[:0], "e1"), UNSEEN, id="E1 ends"),
        pytest.param(_from(BAD_S, lambda part: part[:0], "e6"), set(), id="E6 ends"),
        # samples that are not where the counter says
        pytest.param(_lost(0.0737, "e1"), UNSEEN, id="lost in E1"),
        pytest.param(_lost(0.0737, "e6"), ELSEWHERE, id="lost in E6"),
        pytest.param(_lost(0.0002, "e6"), ELSEWHERE, id="1040 samples lost in E6"),
        pytest.param(_lost(0.0737, *BANDS), UNSEEN, id="lost in both"),
        pytest.param(_repeated(0.25, "e1"), UNSEEN, id="repeated in E1"),
        pytest.param(_repeated(0.25, "e6"), ELSEWHERE, id="repeated in E6"),
    ],
)
def test_after_the_damage_nothing_is_authentic(
    night: Night, tmp_path: Path, damage: Damage, later: set[tuple[str, str]]
) -> None:
    """Before it all is as without it; after it each satellite has its verdict, with the right reason.

    RECS behind the end of E6 have none, as in any recording.
    """
    found = _processed(night, tmp_path / "night", damage(night.samples), "--level", 2, "--search-window", 0.05)
    assert _said(found, 1.5, BAD_S) == {"AUTHENTIC"}
    after = [one for one in found if one["gst_second"] - START_S >= BAD_S]
    assert {one["svid"] for one in after} == ({7, 13} if later else set())
    assert {(one["status"], one["reason"]) for one in after} <= later


@pytest.mark.parametrize("level", [1, 2])
def test_saturated_samples(night: Night, tmp_path: Path, level: int) -> None:
    """One bit still holds the signal: AUTHENTIC is right, and level 2 says that the front end is saturated."""
    samples = _from(BAD_S, _clipped, *BANDS)(night.samples)
    found = _processed(night, tmp_path / "night", samples, "--level", level, "--search-window", 0.05)
    assert _said(found, 1.5, BAD_S) == {"AUTHENTIC"}
    assert _said(found, BAD_S, DURATION_S) == ({"AUTHENTIC"} if level == 1 else {"SUSPECT"})
    if level == 2:
        assert any("saturated" in one["reason"] for one in found)


@pytest.mark.parametrize(("band", "value"), [("e1", np.nan), ("e6", np.inf)])
def test_a_sample_that_is_no_number(night: Night, tmp_path: Path, band: str, value: float) -> None:
    """One line names the file and the sample; no verdict is made with such samples."""
    samples = {name: one[: _place(4.5)].astype(np.float32) for name, one in night.samples.items()}
    samples[band][_place(4.085)] = value  # in the RECS of 4 s
    with pytest.raises(VestigeError, match=r"^\S*night/" + band + r": .*finite") as failure:
        _processed(night, tmp_path / "night", samples, floats=True)
    assert "\n" not in str(failure.value)


@pytest.mark.parametrize("band", BANDS)
def test_a_missing_band(night: Night, tmp_path: Path, band: str) -> None:
    """There is no verdict without E6 or E1, and a warning says why."""
    found = _object(night, tmp_path / "night", {name: one for name, one in night.samples.items() if name != band})
    assert found["verdicts"] == []
    assert any(line.startswith(f"no {band.upper()} samples") for line in found["warnings"])


@pytest.mark.parametrize("band", BANDS)
@pytest.mark.parametrize("change", ["in the middle", "of one band", "time tag"])
def test_a_counter_that_jumps(night: Night, tmp_path: Path, band: str, change: str) -> None:
    """A description that contradicts itself is refused in one line."""
    folder = tmp_path / "night"
    folder.mkdir()
    for path in night.folder.iterdir():
        if "sigmf" in path.name:
            (folder / path.name).symlink_to(path)
    meta = json.loads((folder / f"{band}.sigmf-meta").read_text())
    first = meta["captures"][0]
    if change == "in the middle":
        place = round(BAD_S * RATE_HZ)
        meta["captures"].append(first | {"core:sample_start": place, "core:global_index": place + 1040})
        meta["captures"][1].pop("vestige:start_gst", None)
    elif change == "of one band":
        first["core:global_index"] += 1040
    else:
        week, second = first["vestige:start_gst"].split(":")
        first["vestige:start_gst"] = f"{week}:{float(second) + 0.25!r}"
        first.pop("core:datetime")
    (folder / f"{band}.sigmf-meta").unlink()
    (folder / f"{band}.sigmf-meta").write_text(json.dumps(meta))
    result = invoke(process, folder, "--track", "--assistance", night.folder / "assistance", "--json")
    assert isinstance(result.exception, VestigeError)
    assert "\n" not in str(result.exception)
    assert "sigmf-meta" in str(result.exception)
