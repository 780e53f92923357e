"""Readers of recordings: samples and their descriptions, observations, ephemerides, accelerations, live streams."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import astuple
from pathlib import Path
from random import Random

import numpy as np

from fuzz.authority import START, files_of
from fuzz.engine import Files, Target, WrongAcceptanceError, spoil_files
from fuzz.ion_corpus import ion_recording
from vestige.acas_processor.monitoring import memory
from vestige.acas_processor.monitoring.alarm import AlarmState
from vestige.acas_processor.monitoring.baseline import Baseline, Quantity
from vestige.acas_processor.monitoring.state import ReceiverState, SearchMemory
from vestige.errors import VestigeError
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.recording.assistance.receiver_corrections import read_hardware_bias, read_ionosphere
from vestige.recording.description import BandFile
from vestige.recording.live.follow_journal import STATE, FollowJournal, FollowProgress
from vestige.recording.live.live_recording import LiveRecording, awaited_observations
from vestige.recording.navigation.rinex_navigation import read_rinex_navigation, write_rinex_navigation
from vestige.recording.numeric_csv import WAYPOINTS, read_numeric_csv
from vestige.recording.observations.accelerations import ACCELERATION_COLUMNS, GrowingAccelerations, read_accelerations
from vestige.recording.observations.csv_observations import write_csv_observations
from vestige.recording.observations.growing_observations import GrowingObservations
from vestige.recording.observations.observation_epoch import LIMITS
from vestige.recording.observations.observation_file import ObservationTrack, open_observations
from vestige.recording.observations.rinex_writer import write_rinex_observations
from vestige.recording.recording import open_recording
from vestige.recording.samples.sample_format import SampleFormat
from vestige.recording.samples.sample_stream import SampleStream
from vestige.recording.search_log import SearchLog
from vestige.records import Band, E1Observation, Status
from vestige.records.checks import CheckName
from vestige.records.observation_epoch import ObservationEpoch
from vestige.records.time_uncertainty import TimeUncertainty
from vestige.sample_processor.search.exhaustive_search import SearchState
from vestige.sample_processor.search.peak import Peak

_RATE_HZ = 12.5e6
_FEW = 1 << 20  # samples

# --- descriptions and samples

_RAW = """
start = "2026-04-22T13:00:00.25 UTC"
time_uncertainty_s = 1.0
sample_rate_hz = 12.5e6
[e1]
file = "e1.bin"
format = "int8"
layout = "real"
center_frequency_hz = 1572.42e6
bandwidth_hz = 4.2e6
[e6]
file = "e6.bin"
format = "float32"
layout = "iq"
center_frequency_hz = 1278.75e6
spectral_inversion = true
first_sample = 6
header_bytes = 4
sample_rate_hz = 12.5e6
[observations]
file = "observations.csv"
"""


def _raw_recordings() -> Sequence[Files]:
    samples = np.random.default_rng(1).standard_normal(64).astype("<f4").tobytes()
    return [
        {
            "recording.toml": _RAW.encode(),
            "e1.bin": bytes(range(128)),
            "e6.bin": b"head" + samples,
            **_observation_csv(),
        },
        ion_recording(),
    ]


def _observation_csv() -> Files:
    return files_of(lambda folder: write_csv_observations(folder / "observations.csv", _epochs()))


def _sigmf_recordings() -> Sequence[Files]:
    def meta(frequency_hz: float, index: int) -> bytes:
        return json.dumps(
            {
                "global": {
                    "core:datatype": "ci8", "core:version": "1.0.0", "core:sample_rate": _RATE_HZ,
                    "core:num_channels": 1, "core:sha512": hashlib.sha512(bytes(20)).hexdigest(),
                    "core:extensions": [{"name": "vestige", "version": "1.0.0", "optional": True}],
                    "vestige:time_uncertainty_s": 2.5, "vestige:bandwidth_hz": 1e7, "vestige:sample_count": 10,
                    "vestige:spectral_inversion": False, "core:trailing_bytes": 0,
                },
                "captures": [
                    {
                        "core:sample_start": 0, "core:frequency": frequency_hz, "core:global_index": index,
                        "core:datetime": "2026-04-22T13:00:00.250000Z", "core:header_bytes": 0,
                    }
                ],
                "annotations": [{"core:sample_start": 0, "core:sample_count": 4, "core:comment": "a"}],
            }
        ).encode()  # fmt: skip

    folder: dict[str, bytes] = {
        "e1.sigmf-meta": meta(1575.42e6, 0), "e1.sigmf-data": bytes(20), "e6.sigmf-meta": meta(1278.75e6, 0),
        "e6.sigmf-data": bytes(20),
    }  # fmt: skip
    streams = [
        {"name": name, "hash": hashlib.sha512(folder[f"{name}.sigmf-meta"]).hexdigest()} for name in ("e1", "e6")
    ]
    collection = {"collection": {"core:version": "1.0.0", "core:streams": streams}}
    unhashed = {"collection": {"core:version": "1.0.0", "core:streams": [{"name": "e1"}, {"name": "e6"}]}}
    return [
        folder,
        folder | _observation_csv() | {"both.sigmf-collection": json.dumps(collection).encode()},
        folder | {"both.sigmf-collection": json.dumps(unhashed).encode()},
    ]


def _read_recording(folder: Path) -> None:
    """What is opened has finite samples at a finite rate, all of them."""
    recording = open_recording(folder)
    _ = recording.notes
    awaited_observations(recording.description)
    if Band.E6 in recording.description.bands:
        LiveRecording(recording.description, observations=None, warn=_ignore)
    for reader in filter(None, (recording.e1, recording.e6)):
        file = reader.file
        if not (math.isfinite(file.sample_rate_hz) and math.isfinite(file.center_frequency_hz)):
            raise WrongAcceptanceError(f"a rate or frequency that is not finite: {file}")
        if reader.n_samples < _FEW:  # all of them are read
            reader.hash_agrees()
        first = reader.read(reader.first_sample, min(reader.n_samples, 1000))
        last = reader.read(reader.end_sample - 1, 1)
        if not (np.isfinite(first.samples).all() and last.start - first.start >= 0):
            raise WrongAcceptanceError("samples that are not finite, or a time that runs backwards")
    if recording.observations is not None:
        _check_epochs(recording.observations)


def _ignore(_warning: VestigeError) -> None:
    """Be told what is wrong with a line."""


def _streams() -> Sequence[Files]:
    return [{"header.json": b"[4, 6, 1, 3, 9]", "e6.bin": bytes(range(250))}]


def _read_stream(folder: Path) -> None:
    """Samples out of a pipe are those that were written, wherever the windows lie."""
    header_bytes, first, *windows = json.loads((folder / "header.json").read_bytes())
    content = (folder / "e6.bin").read_bytes()
    file = BandFile(
        band=Band.E6, path=Path("-"), described_in=Path("-"), form=SampleFormat(component="int16", layout="iq"),
        sample_rate_hz=_RATE_HZ, center_frequency_hz=1278.75e6, first_sample=first, header_bytes=header_bytes,
        start=START,
    )  # fmt: skip
    read, write = os.pipe()
    try:
        stream = SampleStream(read, file, capacity_bytes=1 << 20)
        os.write(write, content[:9])
        os.write(write, content[9:])
        os.close(write)
        while not stream.look().ended:
            stream.wait(1.0)
        data = np.frombuffer(content[header_bytes:][: (len(content) - header_bytes) // 4 * 4], "<i2").astype(np.float32)
        for begin in windows:
            reader = stream.cut(first + begin, first + begin + 20)
            true = (data[::2] + 1j * data[1::2])[begin : begin + 20]
            if reader is None or not np.array_equal(reader.samples(reader.first_sample, reader.n_samples), true):
                raise WrongAcceptanceError("other samples than those that were written")
    finally:
        os.close(read)


def _spoil_stream(rng: Random, files: Files) -> Files:
    header = [rng.choice((0, 1, 4, 9, 300)), rng.choice((0, 6, 1 << 40)), *(rng.randrange(80) for _ in range(3))]
    return {"header.json": json.dumps(header).encode(), "e6.bin": rng.randbytes(rng.choice((10, 11, 250, 5000)))}


# --- observations, ephemerides, accelerations


def _epochs(n: int = 6) -> Iterable[ObservationEpoch]:
    return [
        ObservationEpoch(
            time=START + 0.5 + k,
            observations={
                svid: E1Observation(
                    svid=svid,
                    pseudorange_m=25e6 + 101.125 * svid * k,
                    carrier_phase_cycles=531.5 * svid * k,
                    doppler_hz=-531.25 * svid,
                    doppler_rate_hz_per_s=0.25 if svid == 3 else math.nan,
                    cn0_dbhz=45.0,
                )
                for svid in (3, 11, 12)[: 3 - k % 2]
            },
            slipped=frozenset({11} if k == 3 else ()),
        )
        for k in range(n)
    ]


def _observations() -> Sequence[Files]:
    def write(folder: Path) -> None:
        write_csv_observations(folder / "observations.csv", _epochs())
        write_rinex_observations(folder / "observations.rnx", _epochs())

    return [{name: data} for name, data in files_of(write).items()]


def _read_observations(folder: Path) -> None:
    """The same, whether the file is read at once, looked up at times, or grows."""
    for path in sorted(folder.iterdir()):
        file = open_observations(path)
        n_epochs = _check_epochs(file)
        track = ObservationTrack(file)
        for k in (0.0, 1.25, 3.0, 60.0):
            for observation in track.at(START + 0.5 + k).values():
                if not math.isfinite(observation.pseudorange_m):
                    raise WrongAcceptanceError(f"a pseudorange of {observation.pseudorange_m} m")
        growing = GrowingObservations(path, warn=_refuse)
        if not growing.begun:
            raise WrongAcceptanceError("a file that has not begun")
        growing.end()
        if _check_epochs(growing) != n_epochs:
            raise WrongAcceptanceError("a file that grew has other epochs than the whole")


def _refuse(error: VestigeError) -> None:
    raise error


def _check_epochs(epochs: Iterable[ObservationEpoch]) -> int:
    """Return how many epochs there are; their times rise, their values are numbers within the limits, or NaN."""
    n_epochs, before = 0, None
    for epoch in epochs:
        n_epochs += 1
        if before is not None and epoch.time <= before:
            raise WrongAcceptanceError("time does not advance")
        before = epoch.time
        for svid, observation in epoch.observations.items():
            if svid != observation.svid or not 1 <= svid <= 36 or math.isnan(observation.pseudorange_m):
                raise WrongAcceptanceError(f"no observation of a satellite: {observation}")
            for name, (low, high) in LIMITS.items():
                value = getattr(observation, name)
                if not (math.isnan(value) or low - 4 <= value <= high):  # RINEX counts C/N0 of both components together
                    raise WrongAcceptanceError(f"{name} of {value}")
    return n_epochs


def _navigation() -> Sequence[Files]:
    return [files_of(lambda folder: write_rinex_navigation(folder / "navigation.rnx", walker_ephemerides(START)[:3]))]


def _read_navigation(folder: Path) -> None:
    for ephemeris in read_rinex_navigation(folder / "navigation.rnx"):
        numbers = [value for value in astuple(ephemeris) if isinstance(value, float)]
        if not all(map(math.isfinite, [value for value in numbers if value is not ephemeris.sisa_m])):
            raise WrongAcceptanceError(f"an ephemeris that is not finite: {ephemeris}")


def _accelerations() -> Sequence[Files]:
    rows = [f"1372,{478_800 + k / 2},0.01{k},-0.002,0.008" for k in range(6)]
    return [{"accelerations.csv": "\n".join([",".join(ACCELERATION_COLUMNS), *rows, ""]).encode()}]


def _read_accelerations(folder: Path) -> None:
    path = folder / "accelerations.csv"
    whole = read_accelerations(path)
    growing = GrowingAccelerations(path, warn=_refuse)
    growing.look()
    if not (np.isfinite(whole.acceleration_mps2).all() and np.all(np.diff(whole.elapsed_s) > 0)):
        raise WrongAcceptanceError("accelerations that are not finite, or in no order")
    if not np.array_equal(growing.found.elapsed_s, whole.elapsed_s):
        raise WrongAcceptanceError("a file that grew has other rows than the whole")


def _corrections() -> Sequence[Files]:
    return [
        {"receiver.toml": b"hardware_bias_e1_e6_m = -20.6\n", "ionosphere.csv": b"svid,slant_delay_e1_m\n3,2.5\n11,4\n"}
    ]


def _read_corrections(folder: Path) -> None:
    if not abs(read_hardware_bias(folder / "receiver.toml")) <= 1e-3:
        raise WrongAcceptanceError("a bias of more than a millisecond")
    if not all(0 <= delay <= 1000 for delay in read_ionosphere(folder / "ionosphere.csv").values()):
        raise WrongAcceptanceError("a delay that no ionosphere has")


def _waypoints() -> Sequence[Files]:
    rows = "".join(f"{10 * k},48.{k},11.{k},{500 + k}\n" for k in range(4))
    return [{"waypoints.csv": f"{','.join(WAYPOINTS)}\n{rows}".encode()}]


def _read_waypoints(folder: Path) -> None:
    rows = read_numeric_csv(folder / "waypoints.csv", WAYPOINTS)
    if not (np.isfinite(rows).all() and np.all(np.diff(rows[:, 0]) > 0)):
        raise WrongAcceptanceError("waypoints that are not finite, or in no order")


# --- what a run keeps to go on from

_SETTINGS = {"level": "3", "recording": "night"}
_OF = {"recording": "night", "integration time": 0.016}


_STATE = ReceiverState(
    origin=START + -30.0,
    last=START + 0.5,
    uncertainty=TimeUncertainty(initial_s=math.inf, fixed_at=START),
    baseline=Baseline(values={Quantity.E1_POWER_DB: {0: (0.1, -0.2)}, Quantity.E6_CN0_DBHZ: {11: (41.5,)}}),
    position_m=(6_378_137.0, 0.0, 0.5),
    fix=memory.FixMemory(time_s=30.0, position_m=(6_378_137.0, 0.0, 0.5)),
    osnma=memory.OsnmaMemory(
        keyed=(True, False),
        open=memory.Subframe(start=START.gst_seconds, due={11: 7}, received={11: 3}, differs={11: 1}),
    ),
    memory={
        CheckName.CLOCK_SLOPE: {0: (30.0, 1.5, -0.1, 9.0, 1e-3)},
        CheckName.E6_PHASE: {11: (30.0, math.nan, 12.5, 41.5, 0.08)},
        "a check of a user": {0: (), 11: (1.0,)},
    },
    search=SearchMemory(searched_at=START, suspicious=True),
    streaks={CheckName.POWER_DISTORTION: {11: 2}},
    alarm=AlarmState(seen={11: {Status.SPOOFED: 12.0}}, shown={11: Status.SPOOFED}),
    on_e1={11: START + 0.25},
)


def _journals() -> Sequence[Files]:
    def write(folder: Path) -> None:
        with FollowJournal(folder, _SETTINGS) as journal:
            journal.record(['{"svid": 11}'] * 3, FollowProgress(index=3, sent=START + 0.5, state=_STATE))

    return [files_of(write)]


def _spoil_journal(rng: Random, files: Files) -> Files:
    """The state more often than the lines, of which any change is refused."""
    if rng.random() < 0.2:
        return spoil_files(rng, files)
    return dict(files) | {STATE: spoil_files(rng, {STATE: files[STATE]}).get(STATE, b"")}


def _read_journal(folder: Path) -> None:
    with FollowJournal(folder, _SETTINGS) as journal:
        progress = journal.progress
        if progress is not None:
            journal.record(['{"svid": 12}'], progress)
    with FollowJournal(folder, _SETTINGS) as journal:
        if repr(journal.progress) != repr(progress):  # NaN is not equal to itself
            raise WrongAcceptanceError("a state is not what was read of it")


def _search_logs() -> Sequence[Files]:
    peak = Peak(svid=11, start_time=START + 0.1, doppler_hz=-3.5, magnitude=9.1, threshold=7.7, cn0_dbhz=40.1)
    state = SearchState(done=1e9, total=1e10, peaks=(peak,), block_start=START + 1.0, block_magnitude=6.6, blocks=7)
    return [files_of(lambda folder: SearchLog(path=folder / "log.json", of=_OF).keep("E11", state))]


def _read_search_log(folder: Path) -> None:
    log = SearchLog.open(folder / "log.json", _OF)
    for name, state in list(log.states.items()):
        log.keep(name, state)
    if repr(SearchLog.open(folder / "log.json", _OF).states) != repr(log.states):
        raise WrongAcceptanceError("a search log is not what was read of it")


TARGETS = (
    Target(name="recording-raw", make=_raw_recordings, read=_read_recording, share=60),
    Target(name="recording-sigmf", make=_sigmf_recordings, read=_read_recording, share=10),
    Target(name="sample-stream", make=_streams, read=_read_stream, spoil=_spoil_stream, share=20),
    Target(name="observations", make=_observations, read=_read_observations, share=80),
    Target(name="navigation", make=_navigation, read=_read_navigation, share=50),
    Target(name="accelerations", make=_accelerations, read=_read_accelerations, share=40),
    Target(name="corrections", make=_corrections, read=_read_corrections, share=40),
    Target(name="waypoints", make=_waypoints, read=_read_waypoints, share=30),
    Target(name="journal", make=_journals, read=_read_journal, spoil=_spoil_journal, share=16),
    Target(name="search-log", make=_search_logs, read=_read_search_log, share=30),
)
