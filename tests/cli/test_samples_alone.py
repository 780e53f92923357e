"""Three minutes of eight satellites, RECS and a Merkle tree: `process` needs nothing else, cold and with a wrong label.

E1 is recorded without a gap at 4 MHz, E6 at 5.5 MHz in 1.4 s around each RECS; its file has zeros in between. There are
no observations, no keys and no orbits. E1 is tracked once for each time tag, because it does not depend on the other
options of `process`; a shorter recording has what was tracked by its end.
"""

from __future__ import annotations

import csv
import json
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from night import invoke
from vestige.cli.recordings.process import command as process
from vestige.constants import MEDIAN_TRAVEL_TIME_S, SUBFRAME_S
from vestige.crypto.keys.key_file import write_key_file
from vestige.navigation.earth import ecef_from_geodetic
from vestige.navigation.inav.page import PAGE_S
from vestige.recording.assistance.assistance_files import KEYS_NAME
from vestige.recording.recording import Recording
from vestige.recording.samples.sample_format import SampleFormat, encode
from vestige.recording.tracked import track_recording as tracking
from vestige.recording.tracked.track_recording import TrackedRecording
from vestige.records import Band
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import simulated, write_companions
from vestige.time import GalileoTime

pytestmark = pytest.mark.slow

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
DURATION_S, EVERY_S, SATELLITES = 180, 30, 8
RATE_HZ = {Band.E1: 4e6, Band.E6: 5.5e6}
CARRIERS_HZ = {Band.E1: 1575.42e6, Band.E6: 1278.75e6}
AROUND_RECS_S = (-0.2, 1.2)  # of E6
START = GalileoTime(1422, 79200)  # of night.toml
KEY_S = 61.0  # from a RECS until the subframe with its key is complete: a key delay of one subframe
LABEL_LATE_S = 10


def _case(band: Band) -> AcasTestCase:
    scenario = load_scenario(NIGHT, (f"receiver.sample_rate_hz={RATE_HZ[band]}",))
    return AcasTestCase(scenario=scenario, first=0, end=DURATION_S)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Night:
    """The folder of the recording, and what a receiver must not know."""

    folder: Path
    tree: Path
    place_m: np.ndarray
    case: AcasTestCase

    def process(self, *arguments: object) -> dict[str, Any]:
        result = invoke(process, self.folder, "--merkle-tree", self.tree, "--json", *arguments)
        if result.exception is not None:
            raise result.exception
        found: dict[str, Any] = json.loads(result.stdout)
        return found

    def position_errors_m(self, found: dict[str, Any]) -> list[float]:
        """Return the distance of each position from the true one in m, in three dimensions."""
        names = ("latitude_deg", "longitude_deg", "height_m")
        places = np.array([[one[name] for name in names] for one in found["positions"]])
        ecef_m = ecef_from_geodetic(np.radians(places[:, 0]), np.radians(places[:, 1]), places[:, 2])
        return [float(error) for error in np.linalg.norm(ecef_m - self.place_m, axis=1)]


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Night]:
    made, folder = tmp_path_factory.mktemp("made"), tmp_path_factory.mktemp("night")
    case = _case(Band.E1)
    write_companions(case, made)
    (folder / "assistance").mkdir()
    for path in (made / "assistance").iterdir():
        if path.suffix in (".bin", ".BGD"):
            path.rename(folder / "assistance" / path.name)
    form = SampleFormat(component="int8", layout="iq")
    with (folder / "e1").open("wb") as stream:
        for batch in simulated(case).record(Band.E1):  # one thread: two take turns and use more time of the processor
            stream.write(encode(batch.samples, form, scale=20.0).tobytes())
    e6 = simulated(_case(Band.E6))
    with (folder / "e6").open("wb") as stream:
        for sent_s in range(0, DURATION_S, EVERY_S):
            window = e6.window(Band.E6, max(sent_s + AROUND_RECS_S[0], 0.0), sent_s + AROUND_RECS_S[1])
            stream.seek(2 * window.first_sample)
            stream.write(encode(window.samples, form, scale=20.0).tobytes())
        stream.truncate(2 * len(e6.samples))
    text = f'start = "{START}"\ntime_uncertainty_s = 0.001\nsample_rate_hz = {RATE_HZ[Band.E1]}\n'
    for band in Band:
        text += f'[{band.value.lower()}]\nfile = "{band.value.lower()}"\nformat = "int8"\nlayout = "iq"\n'
        text += f"center_frequency_hz = {CARRIERS_HZ[band]}\nsample_rate_hz = {RATE_HZ[band]}\n"
    (folder / "recording.toml").write_text(text)
    with (made / "receiver_truth.csv").open() as stream:
        truth = next(csv.DictReader(stream))
    place_m = np.array([float(truth[name]) for name in ("x_m", "y_m", "z_m")])
    yield Night(folder, made / "assistance" / "merkle_tree.xml", place_m, case)
    for band in Band:
        (folder / band.value.lower()).unlink()  # 1.5 GB, which pytest would keep


@pytest.fixture(scope="module")
def tracked(night: Night) -> Iterator[dict[str, TrackedRecording]]:
    """What was tracked, by the time tag: `process` tracks each once."""
    known: dict[str, TrackedRecording] = {}
    track = tracking.track_recording

    def once(recording: Recording, *_settings: object, **options: Any) -> TrackedRecording:
        assert recording.e1 is not None
        label = str(recording.e1.start)
        if label not in known:
            known[label] = track(recording, **options)
        return known[label]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tracking, "track_recording", once)
        yield known


@pytest.fixture(scope="module")
def cold(night: Night, tracked: dict[str, TrackedRecording]) -> dict[str, Any]:
    return night.process()


@pytest.fixture(scope="module")
def late(night: Night, tracked: dict[str, TrackedRecording], cold: dict[str, Any]) -> dict[str, Any]:
    return night.process("--start", START + LABEL_LATE_S, "--time-uncertainty", LABEL_LATE_S + 0.5)


def _statuses(found: dict[str, Any]) -> Counter[tuple[int, str]]:
    return Counter((one["snapshot"], one["status"]) for one in found["verdicts"])


def test_all_satellites_are_authentic_with_every_recs_whose_key_was_received(
    night: Night, cold: dict[str, Any]
) -> None:
    """The RECS at 0 s came before tracking, and the keys of those at 120 and 150 s after the recording."""
    assert _statuses(cold) == {
        (number, "AUTHENTIC" if number * EVERY_S + KEY_S < DURATION_S else "NOT_AVAILABLE"): SATELLITES
        for number in range(1, DURATION_S // EVERY_S)
    }
    reasons = {one["reason"] for one in cold["verdicts"] if one["status"] == "NOT_AVAILABLE"}
    assert all("no validated OSNMA key" in reason for reason in reasons)
    assert any(f"{SATELLITES} RECS came before E1 was tracked" in line for line in cold["warnings"])
    assert len(cold["positions"]) == 3
    errors_m = night.position_errors_m(cold)
    print("position errors in m:", errors_m)
    assert max(errors_m) < 5.0


def _by(tracked: TrackedRecording, end: GalileoTime) -> TrackedRecording:
    """Return what was tracked by a time of reception."""
    return replace(
        tracked,
        epochs=tuple(epoch for epoch in tracked.epochs if epoch.time < end),
        pages=tuple(page for page in tracked.pages if page.time + (PAGE_S + MEDIAN_TRAVEL_TIME_S) < end),
    )


def test_time_to_the_first_authenticated_fix(
    night: Night, tracked: dict[str, TrackedRecording], cold: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The recording need not be longer for an authenticated position.

    The first RECS that is tracked comes at 30 s, and its key is complete at 91 s: so long it takes with a chain that is
    known, from the signed root key in a key file that has no key of this night. Cold it takes until the root key is
    complete, whose eight blocks come in four subframes of this sky.
    """
    whole = tracked[str(START)]

    def has_fix(end_s: float) -> bool:
        monkeypatch.setattr(tracking, "track_recording", lambda *_a, **_o: _by(whole, START + end_s))
        return bool(night.process()["positions"])

    def first_fix_s() -> int:
        return bisect_left(range(DURATION_S), True, lo=EVERY_S, key=has_fix)

    cold_s = first_fix_s()
    keys, operator = night.folder / "assistance" / KEYS_NAME, night.case.operator
    write_key_file(keys, [key for key in operator.validated_keys() if key.time < START], operator.roots)
    try:
        known_s = first_fix_s()
    finally:
        keys.unlink()
    print(f"time to the first authenticated fix: cold {cold_s} s, chain known {known_s} s")
    assert EVERY_S + 22 < known_s <= EVERY_S + KEY_S + PAGE_S  # the key is sent from 52 s on
    assert 4 * SUBFRAME_S - 10 < cold_s <= 4 * SUBFRAME_S + PAGE_S


def test_a_label_ten_seconds_late(night: Night, cold: dict[str, Any], late: dict[str, Any]) -> None:
    assert _statuses(late) == _statuses(cold)
    assert max(night.position_errors_m(late)) < 5.0


def test_a_clock_that_cannot_prove_the_order(night: Night, late: dict[str, Any]) -> None:
    """The key is sent 52 s after the RECS. By a clock 10 s late that may be 45 s wrong the RECS may be later."""
    found = night.process("--start", START + LABEL_LATE_S, "--time-uncertainty", 45)
    assert {one["status"] for one in found["verdicts"]} == {"NOT_AVAILABLE"}
    with_key = [one["reason"] for one in found["verdicts"] if (one["snapshot"], "AUTHENTIC") in _statuses(late)]
    assert len(with_key) == 3 * SATELLITES
    assert all("disclos" in reason for reason in with_key)
    assert not found["positions"]
