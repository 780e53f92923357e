"""A recording in blocks of epochs has the bytes of the whole, and needs the memory of a block."""

from __future__ import annotations

import gc
import json
import tracemalloc
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest

from sky_builder import CLEAN, sky_scenario
from vestige.receiver.samples.recorder import stretch_samples
from vestige.receiver.snapshots.receiver_truth import ReceiverTruth
from vestige.receiver.snapshots.sky_samples import SkySamples
from vestige.receiver.truth import TruthBlock
from vestige.recording.observations.csv_observations import write_csv_observations
from vestige.recording.observations.rinex_writer import write_rinex_observations
from vestige.recording.samples.test_vector_csv import write_test_vector, write_test_vector_in_parts
from vestige.records import Band
from vestige.simulated import simulated_recording, unfinished_recording
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import simulated, write_companions, write_tables

T = TypeVar("T")
RATE_HZ = 6.2e6
SKY = ("constellation.svids=[7, 13]", f"receiver.sample_rate_hz={RATE_HZ}", "receiver.accelerometers=none")
LATE = 'attack=[{kind="meaconing", start_s=2, delay_s=2.5, power_db=3}]'
AIR = (
    "atmosphere.troposphere={kind='saastamoinen'}",
    "atmosphere.ionosphere={kind='ntcm-g', ai0_sfu=100.0, ai1_sfu_per_deg=0.1, ai2_sfu_per_deg2=0.0}",
)


def case(block_epochs: int, first: int, end: int, *settings: str) -> AcasTestCase:
    scenario = sky_scenario(*SKY, f"epochs={end}", "recs.every=5", *settings)
    return AcasTestCase(scenario=scenario, first=first, end=end, block_epochs=block_epochs)


def files(of: AcasTestCase, folder: Path) -> dict[str, bytes]:
    folder.mkdir()
    write_companions(of, folder)
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("settings", [AIR, (LATE,), ("interval_s=0.2", LATE)], ids=["air", "late", "fast"])
def test_every_file_has_the_bytes_of_the_whole(settings: tuple[str, ...], tmp_path: Path) -> None:
    whole = files(case(100, 3, 17, *settings), tmp_path / "whole")
    assert {"truth.csv", "receiver_truth.csv", "inav_pages.csv", "rinex/navigation.rnx"} < whole.keys()
    assert ("observations.csv" in whole) == (LATE not in settings or "interval_s=0.2" in settings)
    for block_epochs in (1, 4):
        assert files(case(block_epochs, 3, 17, *settings), tmp_path / str(block_epochs)) == whole


@pytest.mark.parametrize(("settings", "interval_s"), [(AIR, 1.0), ((LATE,), 1.0), (("interval_s=0.2", LATE), 0.2)])
def test_samples_have_the_bits_of_the_whole(settings: tuple[str, ...], interval_s: float) -> None:
    """Around the beginnings of blocks, where the samples of the delayed signal have the errors of an earlier block."""
    whole, blocks = (simulated(case(n, 3, 17, *settings)) for n in (100, 4))
    begins = [3, *(epoch * interval_s for epoch in (7, 11, 15)), (17 * interval_s) + 2.5]
    for begin_s in begins if interval_s == 1.0 else begins[1:]:
        first = round((begin_s - 0.02) * RATE_HZ)
        for band in Band:
            one, other = (
                np.concatenate([batch.samples for batch in made._made(band, range(first, first + 250_000), noise=True)])
                for made in (whole, blocks)
            )
            assert one.size == 250_000
            assert np.array_equal(one, other)


def test_a_campaign_has_the_samples_of_the_recording_at_the_beginning_of_a_block() -> None:
    """The spoofing signal there is 2.5 s late, so it has the errors of epochs before the block."""
    of = case(100, 0, 12, 'fidelity="samples"', LATE)
    receiver, recording = of.scenario.simulated_receiver, simulated(of)
    processes = receiver.truth()
    for first, count in ((0, 8), (8, 4)):
        truth = tuple(one.advance(first, count) for one in processes)
        block = ReceiverTruth(simulations=receiver.simulations, truth=truth, first=first, every=receiver.every)
        made = SkySamples(of=block, band=Band.E6).between(first + 0.07, first + 0.1)
        begin, n = made.first_sample, made.samples.size
        filed = recording.window(Band.E6, begin / RATE_HZ, (begin + n) / RATE_HZ)
        assert n > 0.03 * RATE_HZ - 1
        assert np.array_equal(made.samples, filed.samples)


def test_parts_cover_all_samples_once() -> None:
    recording = simulated(case(4, 3, 17))
    parts = [part for part, _ in recording.sky.parts(Band.E1, recording.samples)]
    assert len(parts) == 4
    assert parts[0].start == recording.samples.start
    assert parts[-1].stop == recording.samples.stop
    assert all(one.stop == other.start for one, other in pairwise(parts))
    ((part, _),) = recording.sky.parts(Band.E1, range(int(12 * RATE_HZ), int(13 * RATE_HZ)))
    assert part == range(int(12 * RATE_HZ), int(13 * RATE_HZ))


def test_a_recording_that_is_resumed_has_the_bytes_of_the_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process is killed in the second of four blocks, while its samples are partly on the disk."""
    recording = simulated(case(4, 3, 17, "interval_s=0.1", "recs.duration_ms=1"))
    recording.write(tmp_path / "whole", scenario_text="")

    def killed(*_: object) -> None:
        raise SystemError

    with monkeypatch.context() as patch:
        patch.setattr(simulated_recording, "_KEPT_BATCHES", 53)
        patch.setattr(simulated_recording, "write_collection", killed)
        patch.setattr(unfinished_recording.shutil, "rmtree", lambda *_, **__: None)
        with pytest.raises(SystemError):
            recording.write(tmp_path / "again", scenario_text="")
    progress = unfinished_recording.unfinished_folder(tmp_path / "again") / "progress.json"
    counted = dict.fromkeys(("E1", "E6"), 53 * stretch_samples(RATE_HZ))
    progress.write_text(json.dumps(json.loads(progress.read_text()) | {"samples": counted}))
    said: list[str] = []
    recording.write(tmp_path / "again", scenario_text="", say=said.append)
    assert "resumes an interrupted recording; already there: 0.53 s of E1, 0.53 s of E6" in said[0]
    whole, again = (
        {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
        for folder in (tmp_path / "whole", tmp_path / "again")
    )
    assert whole == again


def epochs_in_memory() -> int:
    """Return the number of epochs of all truths that exist."""
    gc.collect()
    return sum(one.time_s.size for one in gc.get_objects() if isinstance(one, TruthBlock))


def most_in_memory(end: int) -> int:
    """Return the largest number of epochs that exist while both bands go through a recording in blocks of ten."""
    recording, before = simulated(case(10, 0, end, *CLEAN, LATE)), epochs_in_memory()
    parts = {band: recording.sky.parts(band, recording.samples) for band in Band}
    found = [epochs_in_memory() - before for _ in zip(*parts.values(), strict=True)]
    assert len(found) == end / 10
    return max(found)


@pytest.mark.slow
def test_the_truth_in_memory_does_not_grow_with_the_recording() -> None:
    """While the samples are made, each band has one block of its own, with the epochs around it."""
    short, long = (most_in_memory(end) for end in (40, 160))
    assert 0 < short == long


def cleaned(parts: Iterable[T], every: int = 1) -> Iterator[T]:
    """Yield parts, and free what is no longer in use."""
    for number, part in enumerate(parts):
        yield part
        if number % every == 0:
            gc.collect()


@pytest.mark.slow
def test_the_memory_of_the_files_does_not_grow_with_the_recording(tmp_path: Path) -> None:
    """Twice as many epochs need as much memory, once the caches are full; the whole would need twice as much."""
    peaks = []
    for end in (300, 300, 600):  # the first fills the caches
        of = case(50, 0, end, *CLEAN, "recs.every=150")
        gc.collect()
        gc.freeze()  # so that later collections look at new objects only
        tracemalloc.start()
        write_csv_observations(tmp_path / "observations.csv", cleaned(of.observations(), 50))
        write_rinex_observations(tmp_path / "observations.rnx", cleaned(of.observations(), 50))
        write_tables(tmp_path / "truth.csv", cleaned(of.truth_tables()))
        write_tables(tmp_path / "receiver_truth.csv", cleaned(one.table() for one in of.receivers()))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        gc.unfreeze()
    assert peaks[2] < 1.3 * peaks[1], peaks


def test_pages_in_parts_are_the_same_file(tmp_path: Path) -> None:
    message = case(100, 0, 40).message
    assert message is not None
    counts = {svid: len(pages) for svid, pages in message.pages.items()}
    write_test_vector(tmp_path / "whole.csv", message.pages)
    write_test_vector_in_parts(tmp_path / "parts.csv", counts, message.subframes())
    assert (tmp_path / "parts.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
    with pytest.raises(ValueError, match="pages by SVID"):
        write_test_vector_in_parts(tmp_path / "short.csv", counts, list(message.subframes())[:-1])
    with pytest.raises(ValueError, match="do not follow each other"):
        write_test_vector_in_parts(tmp_path / "gap.csv", counts, list(message.subframes())[::2])
