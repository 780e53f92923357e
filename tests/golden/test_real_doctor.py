"""`vestige inspect` finds in the real recording eight satellites, open E6-C, and missing samples."""

from __future__ import annotations

from pathlib import Path

import pytest

from vestige.recording.doctor.examination import examine
from vestige.recording.doctor.finding import FindingKind
from vestige.recording.recording import describe_recording
from vestige.records import Band

IN_THE_SKY = [2, 3, 5, 7, 8, 13, 15, 25]


@pytest.mark.judged(
    by="real recording",
    what="`vestige inspect`",
    figure="the lost samples are found, E6-C of 6 satellites is open",
)
def test_the_real_recording_has_one_fault(tmp_path: Path, recording_data: Path) -> None:
    (tmp_path / "recording.toml").write_text(f"""
        start = "2021-11-25T00:40:00 UTC"
        sample_rate_hz = 12e6
        [e1]
        file = "{recording_data}/L1_20211125_004000_12MHz_I.bin"
        format = "int8"
        layout = "real"
        center_frequency_hz = 1572.42e6
        [e6]
        file = "{recording_data}/L6_20211125_004000_12MHz_IQ.bin"
        format = "int8"
        layout = "iq"
        center_frequency_hz = 1278.75e6
        spectral_inversion = true
    """)
    found = examine(describe_recording(tmp_path))
    assert sorted(one.svid for one in found.e1) == IN_THE_SKY
    assert all(one.e6c_open and one.secondary_fits for one in found.e6)
    assert len(found.e6) == 6
    (one,) = (finding for finding in found.findings if finding.is_fault)
    assert (one.kind, one.band) == (FindingKind.LOST_SAMPLES, Band.E1)
    assert "(966 samples) are missing" in one.line or "(965 samples) are missing" in one.line
    assert {one.kind for one in found.findings if not one.is_fault} == {FindingKind.E6C_OPEN, FindingKind.DURATION}
