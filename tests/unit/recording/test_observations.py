from __future__ import annotations

import itertools
import math
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vestige.errors import InputFileError
from vestige.recording.observations.csv_observations import write_csv_observations
from vestige.recording.observations.interpolation import interpolate
from vestige.recording.observations.observation_file import ObservationTrack, observation_kind, open_observations
from vestige.recording.observations.rinex_writer import write_rinex_observations
from vestige.records import E1Observation
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime

START = GalileoTime(1161, 348018)


def epoch(second: float) -> ObservationEpoch:
    observation = E1Observation(
        svid=5, pseudorange_m=2.4e7 + 100 * second, carrier_phase_cycles=math.nan,
        doppler_hz=-100 * 1575.42e6 / 299_792_458, doppler_rate_hz_per_s=0.0, cn0_dbhz=45.0,
    )  # fmt: skip
    return ObservationEpoch(time=START + second, observations={5: observation})


EPOCHS = [epoch(second) for second in range(60) if second not in (20, 30, 31)]


@pytest.fixture
def csv(tmp_path: Path) -> Path:
    write_csv_observations(tmp_path / "o.csv", EPOCHS)
    return tmp_path / "o.csv"


def test_files_are_told_by_their_first_line(tmp_path: Path, csv: Path) -> None:
    write_rinex_observations(tmp_path / "o.data", EPOCHS)
    assert (observation_kind(csv), observation_kind(tmp_path / "o.data")) == ("CSV", "RINEX")
    assert [e.time for e in open_observations(tmp_path / "o.data")] == [e.time for e in EPOCHS]
    file = open_observations(csv)
    assert repr(list(file)) == repr(list(file))  # as often as you like; a NaN equals no other


@pytest.mark.parametrize("content", [b"", b"SVID,NumNavBits,NavBitsHEX\n", b"$@\x00\n", b"\0" * 100_000])
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x"
    path.write_bytes(content)
    assert observation_kind(path) is None
    with pytest.raises(InputFileError, match="line 1"):
        open_observations(path)


def test_no_file_is_refused(tmp_path: Path) -> None:
    assert observation_kind(tmp_path / "none") is None
    for path in (tmp_path / "none", tmp_path):
        with pytest.raises(InputFileError):
            open_observations(path)


@given(st.lists(st.floats(-5, 65), min_size=1, max_size=8))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
def test_a_track_at_any_times_equals_the_whole_file(csv: Path, seconds: list[float]) -> None:
    track = ObservationTrack(open_observations(csv))
    assert track.max_gap_s == pytest.approx(2.0, abs=1e-5)
    for second in seconds:
        time = START + second
        assert repr(track.at(time)) == repr(interpolate(EPOCHS, time, max_gap_s=track.max_gap_s))  # NaN equals no other


def test_gaps_of_more_than_two_intervals_are_not_bridged(csv: Path) -> None:
    track = ObservationTrack(open_observations(csv))
    assert track.at(START + 19.5)[5].pseudorange_m == pytest.approx(2.4e7 + 1950)
    assert track.at(START + 29.5) == {}
    assert set(ObservationTrack(open_observations(csv), max_gap_s=3.0).at(START + 29.5)) == {5}


def test_a_track_keeps_a_few_epochs_only(csv: Path) -> None:
    track = ObservationTrack(open_observations(csv))
    for second in itertools.chain(range(60), [3.5]):
        track.at(START + second)
        assert len(track._window) <= 11


def test_single_epochs_stand_for_themselves(tmp_path: Path) -> None:
    write_csv_observations(tmp_path / "o.csv", EPOCHS[:1])
    track = ObservationTrack(open_observations(tmp_path / "o.csv"))
    assert repr(track.at(START)) == repr(EPOCHS[0].observations)  # NaN equals no other
    assert track.at(START + 0.1) == {}


@pytest.mark.parametrize("late_s", [1e-9, -1e-9])
def test_a_single_epoch_answers_for_a_time_that_rounding_moved(tmp_path: Path, late_s: float) -> None:
    """The time of a snapshot is a sum, which differs from the time in the file by a rounding error."""
    write_csv_observations(tmp_path / "o.csv", EPOCHS[:1])
    track = ObservationTrack(open_observations(tmp_path / "o.csv"))
    assert repr(track.at(START + late_s)) == repr(EPOCHS[0].observations)  # NaN equals no other
