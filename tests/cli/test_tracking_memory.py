"""Tracking of minutes of signal as it arrives: the process needs no more memory than after the first minutes.

Nothing is replaced: `LiveTracking` tracks samples of three satellites with the pages of a sky, and OSNMA is verified.
The samples are cheap: each satellite is at a constant range and has no Doppler, so a code period of E1-B and one of
E1-C, with the signs of the message and the secondary code, make any length of signal. A second of noise is repeated.

Resident memory shows what grows by 50 kB a second, such as the periods of the channels. The number of Python objects
shows what is small: the pages of three satellites are 3 objects a second.
"""

from __future__ import annotations

import gc
import multiprocessing
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from builders import batch_of
from vestige.navigation.inav.coding.channel_coding import page_symbols
from vestige.navigation.inav.page import InavPage
from vestige.recording.assistance.assistance_files import FileTrust, Settings
from vestige.recording.description import BandFile
from vestige.recording.live.live_tracking import LiveTracking
from vestige.recording.live.received_message import ReceivedMessage
from vestige.recording.samples.sample_format import SampleFormat
from vestige.records import Band, SampleBatch
from vestige.scenario.load import load_scenario
from vestige.signals.codes import primary_code, secondary_code
from vestige.signals.definitions import CARRIER_HZ, E1B, E1C
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import write_companions
from vestige.time import GalileoTime

RATE_HZ = 4.1e6
PERIOD_SAMPLES = 16_400  # 4 ms
PERIODS_PER_S = 250
TRAVEL_PERIODS = 20  # 80 ms
DELAYS = {6: 1_000, 7: 5_000, 13: 9_000}  # samples beyond 80 ms by SVID
CN0_DBHZ = 45.0
NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
START = GalileoTime.parse("2026-11-22T22:00:00 GST") + 1  # the first page of a subframe
WARM_S, END_S = 150, 240  # whole subframes between the two; pages and keys are kept for `KEPT_S`
KEPT_S = 60.0
MOST_BYTES = 4_000_000
MOST_OBJECTS = 250


@dataclass(frozen=True, kw_only=True)
class RepeatedSky:
    """Samples of E1 that are made when they are read, for `LiveTracking`."""

    signs: dict[int, np.ndarray]  # of E1-B and E1-C in each period, by SVID
    noise: np.ndarray  # of one second
    end_sample: int = round((END_S + 2) * RATE_HZ)

    def read(self, first: int, count: int) -> SampleBatch:
        k, n = first // PERIOD_SAMPLES, count // PERIOD_SAMPLES
        noise = self.noise.reshape(PERIODS_PER_S, PERIOD_SAMPLES)[(k + np.arange(n)) % PERIODS_PER_S]
        samples = noise.copy()
        for svid, signs in self.signs.items():
            delay = DELAYS[svid]
            for code, sign in zip(_codes(svid), signs, strict=True):
                rolled = np.roll(code, delay)
                samples.real[:, :delay] += sign[k : k + n, None] * rolled[:delay]
                samples.real[:, delay:] += sign[k + 1 : k + n + 1, None] * rolled[delay:]
        batch = batch_of(samples.reshape(-1), RATE_HZ, Band.E1)
        return SampleBatch(
            band=Band.E1,
            samples=batch.samples,
            sample_rate_hz=RATE_HZ,
            center_frequency_hz=batch.center_frequency_hz,
            first_sample=first,
            start=START + first / RATE_HZ,
        )


@cache
def _codes(svid: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a period of E1-B and of minus E1-C, each with the amplitude of `CN0_DBHZ`; the noise has power 2."""
    chips = np.arange(PERIOD_SAMPLES) * (4092 / PERIOD_SAMPLES)
    boc = np.where((2 * chips).astype(int) % 2 == 0, 1, -1) * np.sqrt(2 * 10 ** (CN0_DBHZ / 10) / RATE_HZ)
    e1b, e1c = (primary_code(signal, svid)[chips.astype(int)] * boc for signal in (E1B, E1C))
    return e1b.astype(np.float32), -e1c.astype(np.float32)


def _signs(pages: Iterable[InavPage], svid: int) -> np.ndarray:
    """Return the signs of E1-B and E1-C in each period at the receiver, one more in front for the samples before."""
    symbols = np.concatenate([page_symbols(page.data) for page in sorted(pages, key=lambda page: page.time)])
    e1c = np.resize(secondary_code(E1C, svid), symbols.size)
    signs = np.stack([1 - 2 * symbols.astype(np.float32), e1c.astype(np.float32)])
    return np.concatenate([np.ones((2, TRAVEL_PERIODS + 1), np.float32), signs], axis=1)


def _resident_bytes() -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * int(next(line.split()[1] for line in lines if line.startswith("VmRSS")))


def followed(folder: Path) -> dict[str, Any]:
    """Track the sky, and return what memory there is after the warm-up and at the end."""
    changes = (f"epochs={END_S + 30}", f"constellation.svids={list(DELAYS)}")
    case = AcasTestCase(scenario=load_scenario(NIGHT, changes), first=0, end=END_S + 30)  # type: ignore[arg-type]
    assert case.message is not None
    pages = case.message.pages
    write_companions(case, folder)
    (tree,) = folder.rglob("merkle_tree.xml")
    settings = Settings(trust=FileTrust.load([], tree))
    noise = np.random.default_rng(1).standard_normal((round(RATE_HZ), 2), np.float32).view(np.complex64)[:, 0]
    samples = RepeatedSky(signs={svid: _signs(pages[svid], svid) for svid in DELAYS}, noise=noise)
    message = ReceivedMessage(folder, kept_s=KEPT_S)
    file = BandFile(
        band=Band.E1, path=folder / "e1.bin", described_in=folder, form=SampleFormat(component="int8", layout="iq"),
        sample_rate_hz=RATE_HZ, center_frequency_hz=CARRIER_HZ[Band.E1],
    )  # fmt: skip
    tracking = LiveTracking(file, message, warn=lambda error: pytest.fail(str(error)))
    found: dict[str, Any] = {"bytes": [], "objects": []}
    while tracking.tracked_s < END_S:
        tracking.advance(samples)
        tracking.release(START + (tracking.tracked_s - KEPT_S))
        contents = message.contents(settings) if tracking.is_told else None
        if round(tracking.tracked_s) in (WARM_S, END_S):
            gc.collect()
            found["bytes"].append(_resident_bytes())
            found["objects"].append(len(gc.get_objects()))
    found["seen"], found["keys"] = sorted(tracking.seen), len(contents.keys) if contents else 0
    found["ephemerides"] = sorted({one.svid for one in message.ephemerides()[0]})
    return found


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="resident memory is read from /proc")
def test_resident_memory_is_constant(tmp_path: Path) -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:  # its memory is that of the tracking alone
        found = pool.apply(followed, (tmp_path,))
    # all satellites are tracked, their message is received, and its keys are verified
    assert found["seen"] == found["ephemerides"] == list(DELAYS)
    assert found["keys"] > 0
    warm, end = found["bytes"]
    assert end - warm < MOST_BYTES, found
    warm, end = found["objects"]
    assert end - warm < MOST_OBJECTS, found
