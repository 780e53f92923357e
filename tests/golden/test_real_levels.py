"""The real recording through mitigation levels 1 to 3, as it is and with a stronger, later copy of both bands mixed in.

The recording loses 80 µs of samples 12 ms before its end, which a search cannot tell from a second signal of every
satellite: so only what is in front is used, and RECS of 8 ms fit in. Its E6-C is not encrypted yet and repeats every
millisecond, so the exhaustive search stays within half of one.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from night import invoke
from vestige.acas_processor.monitoring.monitoring_settings import MonitoringSettings
from vestige.acas_processor.processor import AcasProcessor, Step
from vestige.acas_processor.searches.sampled_searches import E6ExhaustiveSearch
from vestige.cli.services.recs_make import command as recs_make
from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.recording.assistance.folder import read_assistance
from vestige.recording.recorded_block import OtherChannels
from vestige.recording.recording import open_recording
from vestige.recording.snapshots import RecordingSource
from vestige.records import Assistance, Outcome, Snapshot, Status
from vestige.sample_processor.search.exhaustive_search import ExhaustiveSearch

IN_THE_SKY = (2, 3, 5, 7, 8, 13, 15, 25)
RATE_HZ = 12e6
INTACT = round(0.086 * RATE_HZ)
DELAY_S = 1.3e-3
COPY = 10 ** (3 / 20)  # 3 dB stronger
BIAS_M = -20.8  # E6 minus E1 (protocol reference, section 9.1)
DESCRIPTION = """
start = "2025-12-12T13:30:16 GST"
time_uncertainty_s = 1.0
sample_rate_hz = 12e6
[e1]
file = "e1.bin"
format = "int16"
layout = "real"
center_frequency_hz = 1572.42e6
[e6]
file = "e6.bin"
format = "int16"
layout = "iq"
center_frequency_hz = 1278.75e6
spectral_inversion = true
"""


def _written(folder: Path, data: Path, *, meaconed: bool) -> Path:
    folder.mkdir()
    (folder / "recording.toml").write_text(DESCRIPTION)
    late = round(DELAY_S * RATE_HZ)
    for name, band, columns in (("L1", "e1", 1), ("L6", "e6", 2)):
        (path,) = data.glob(f"{name}_*.bin")
        stored = np.fromfile(path, np.int8, INTACT * columns).reshape(-1, columns).astype(np.float32)
        if meaconed:
            stored[late:] += COPY * stored[:-late].copy()
        np.rint(16 * stored).astype("<i2").tofile(folder / f"{band}.bin")
    return folder


@pytest.fixture(scope="module")
def assistance_folder(tmp_path_factory: pytest.TempPathFactory, recording_data: Path, osnma_data: Path) -> Path:
    night = _written(tmp_path_factory.mktemp("levels") / "night", recording_data, meaconed=False)
    result = invoke(
        recs_make, "--from-recording", night, "--keys", osnma_data / "recorded_2025-12-12.sbf",
        "--merkle-tree", osnma_data / "recorded_2025-12-12_merkle_tree.xml",
        "--svids", "2,3,4,5,7,8,13,15,25", "--length-ms", "8", "-o", night / "assistance",
    )  # fmt: skip
    assert result.exception is None
    return night / "assistance"


def _snapshot(folder: Path, assistance_folder: Path) -> tuple[Snapshot, Assistance]:
    assistance = read_assistance(assistance_folder).assistance
    assistance = replace(assistance, hardware_bias_e1_e6_s=BIAS_M / SPEED_OF_LIGHT_MPS)
    source = RecordingSource(recording=open_recording(folder), assistance=assistance, searchable=True)
    (snapshot,) = source.snapshots()
    return snapshot, assistance


@pytest.fixture(scope="module")
def quiet(assistance_folder: Path) -> tuple[Snapshot, Assistance]:
    return _snapshot(assistance_folder.parent, assistance_folder)


@pytest.fixture(scope="module")
def meaconed(assistance_folder: Path, recording_data: Path) -> tuple[Snapshot, Assistance]:
    folder = _written(assistance_folder.parent.parent / "meaconed", recording_data, meaconed=True)
    return _snapshot(folder, assistance_folder)


def _step(level: int, snapshot: Snapshot, assistance: Assistance) -> Step:
    exhaustive = E6ExhaustiveSearch(how=ExhaustiveSearch(integration_s=8e-3), around_s=4e-4)
    processor = AcasProcessor(level=level, monitoring=MonitoringSettings(exhaustive_search=exhaustive))
    block = OtherChannels(second_channel=assistance).block(snapshot, assistance, None)
    return processor.step(None, block, assistance)


@pytest.mark.judged(
    by="real recording",
    what="levels 1, 2 and 3 without an attack",
    figure="eight satellites AUTHENTIC, no alarm",
)
@pytest.mark.parametrize("level", [1, 2, 3])
def test_no_alarm(level: int, quiet: tuple[Snapshot, Assistance]) -> None:
    step = _step(level, *quiet)
    assert [(one.svid, one.status) for one in step.verdicts] == [(svid, Status.AUTHENTIC) for svid in IN_THE_SKY]
    assert not any(change.alarm for change in step.changes)
    searches = {"E1 vestigial search", "E6 exhaustive search"} if level == 3 else {"E1 vestigial search"}
    for one in step.verdicts if level > 1 else ():
        assert {check.name for check in one.checks if check.outcome is Outcome.PASS} >= searches
        assert np.isnan(one.true_offset_m)


def test_the_open_code_is_no_spoofing_however_far_one_looks(quiet: tuple[Snapshot, Assistance]) -> None:
    """E6-C was open when this was recorded: its code repeats in every millisecond, 97 times for one satellite."""
    processor = AcasProcessor(level=3)
    block = OtherChannels(second_channel=quiet[1]).block(*quiet, None)
    step = processor.step(None, block, quiet[1])
    assert [one.status for one in step.verdicts] == [Status.AUTHENTIC] * len(IN_THE_SKY)
    for one in step.verdicts:
        (search,) = (check for check in one.checks if check.name == "E6 exhaustive search")
        assert search.outcome is Outcome.NOT_RUN
        assert "open E6-C code" in search.reason


def test_level_1_takes_the_copy_for_the_truth(meaconed: tuple[Snapshot, Assistance]) -> None:
    """A meaconer of both bands keeps the range of E6 equal to E1 [WFO, Sec. IV-A], here 390 km away."""
    step = _step(1, *meaconed)
    assert [one.status for one in step.verdicts] == [Status.AUTHENTIC] * len(IN_THE_SKY)


@pytest.mark.judged(
    by="real recording",
    what="levels 2 and 3 under a copy 3 dB stronger",
    figure="an alarm for each satellite, earlier signal within 12.0 m",
)
@pytest.mark.parametrize("level", [2, 3])
def test_a_stronger_later_copy_is_an_alarm_and_the_earlier_signal_is_the_one_used(
    level: int, meaconed: tuple[Snapshot, Assistance]
) -> None:
    step = _step(level, *meaconed)
    verdicts = {one.svid: one for one in step.verdicts}
    assert {change.svid for change in step.changes if change.alarm} == set(IN_THE_SKY)
    twice = {svid for svid, one in verdicts.items() if one.status is Status.SPOOFED}
    assert {one.status for svid, one in verdicts.items() if svid not in twice} <= {Status.SUSPECT}
    earlier = {svid: one.true_offset_m for svid, one in verdicts.items() if np.isfinite(one.true_offset_m)}
    assert len(earlier) >= 5
    assert set(earlier) <= twice
    for svid, offset_m in earlier.items():
        # E1 follows the copy; both measurements have some metres of noise
        assert offset_m == pytest.approx(-DELAY_S * SPEED_OF_LIGHT_MPS, abs=12.0), svid
