"""The recording that a scenario describes, and the folder that it is written to: samples of both bands and companions.

docs/test_cases.md says what is in the folder.
"""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from vestige.errors import VestigeError
from vestige.output import new_folder
from vestige.receiver.samples.front_end import FrontEnd
from vestige.receiver.samples.recorder import Interference, ReceivedSatellite, record_band
from vestige.recording.recording import open_recording
from vestige.recording.samples.exports import COPY_BYTES, export
from vestige.recording.samples.sample_format import SampleFormat, SampleType
from vestige.recording.samples.sigmf_writer import SigmfWriter, write_collection
from vestige.records import Band, SampleBatch
from vestige.signal_generator.noise_kernel import noise_key
from vestige.time import GalileoTime

Report = Callable[[str, int, int], None]

# stored component: counts of one unit. int8: noise of 14 counts in I and in Q, 9 σ to the end of the scale
SCALES: Mapping[SampleType, float] = {"int8": 20.0, "int16": 1000.0, "float32": 1.0}
_NOISE = {Band.E1: 61, Band.E6: 66}  # stream numbers
_PROBE_S = 0.05
_WRITING = 1.5  # times synthesis: conversion, checksum and disk


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedRecording:
    """A recording that can be made."""

    sky: Mapping[Band, tuple[ReceivedSatellite, ...]]  # what each band receives
    reference: GalileoTime  # receiver-clock time of sample 0, a whole second
    front_end: FrontEnd  # of each band, with the sampling rate
    samples: range  # numbers of the samples
    seed: int  # seed of the noise
    time_uncertainty_s: float  # what the receiver believes of its clock
    description: str  # one line for a person
    companions: Callable[[Path], None]  # writes all other files of the folder
    interference: Mapping[Band, Interference] = field(default_factory=dict)  # noise and jamming, where there is any

    @property
    def sample_rate_hz(self) -> float:
        """Sampling rate of both bands."""
        return self.front_end.sample_rate_hz

    @property
    def duration_s(self) -> float:
        """Length in s."""
        return len(self.samples) / self.sample_rate_hz

    def record(
        self, band: Band, *, at_most: int | None = None, noise: bool = True, pool: Executor | None = None
    ) -> Iterator[SampleBatch]:
        """Yield the samples of a band."""
        return self._made(band, self.samples[:at_most], noise=noise, pool=pool)

    def window(self, band: Band, from_s: float, to_s: float) -> SampleBatch:
        """Return the samples of a band between two times in s after the reference, as one batch.

        They are those of the recording where it holds them; a window may lie beyond its end.
        """
        first, end = (round(at_s * self.sample_rate_hz) for at_s in (from_s, to_s))
        batches = list(self._made(band, range(first, end), noise=True))
        return replace(batches[0], samples=np.concatenate([batch.samples for batch in batches]))

    def _made(self, band: Band, samples: range, *, noise: bool, pool: Executor | None = None) -> Iterator[SampleBatch]:
        return record_band(
            band,
            self.sky[band],
            reference=self.reference,
            front_end=self.front_end,
            first_sample=samples.start,
            n_samples=len(samples),
            noise_key=noise_key(self.seed, 0, _NOISE[band]) if noise else None,
            interference=self.interference.get(band),
            pool=pool,
        )

    def n_bytes(self, component: SampleType, exports: Sequence[str] = ()) -> int:
        """Return how large the samples of both bands will be, copies for exports included."""
        own = SampleFormat(component=component, layout="iq").sample_bytes
        return len(Band) * len(self.samples) * (own + sum(COPY_BYTES[name] for name in exports))

    def seconds_to_write(self) -> float:
        """Return about how long writing takes on this machine, from a short stretch of each band, in s."""
        n_samples = min(len(self.samples), int(_PROBE_S * self.sample_rate_hz))
        slowest_s = 0.0
        for band in Band:
            for _ in range(2):  # the first one compiles
                started = time.perf_counter()
                for _batch in self.record(band, at_most=n_samples):
                    pass
                taken_s = time.perf_counter() - started
            slowest_s = max(slowest_s, taken_s)
        return _WRITING * slowest_s * len(self.samples) / n_samples

    def write(
        self,
        folder: Path,
        *,
        scenario_text: str,
        component: SampleType = "int8",
        exports: Sequence[str] = (),
        workers: int = 2,
        progress: Report | None = None,
    ) -> tuple[Path, ...]:
        """Write the folder and return its files.

        `component` is the number type of the samples, `exports` are names in `recording.exports.EXPORTS`, `workers` is
        the number of threads that make samples, and `progress` is called with the band, the samples written, and all.

        Raises `InputFileError` if `folder` exists. Raises `VestigeError` if the samples do not fit on the disk.
        """
        with new_folder(folder) as part:
            free, needed = shutil.disk_usage(part).free, self.n_bytes(component, exports)
            if free < needed:
                raise VestigeError(f"{folder}: found {free / 1e9:.1f} GB free, expected {needed / 1e9:.1f} GB")
            (part / "scenario.toml").write_text(scenario_text, encoding="utf-8", newline="\n")
            self.companions(part)
            metas = self._write_samples(part, SampleFormat(component=component, layout="iq"), workers, progress)
            write_collection(part / "recording", metas)
            recording, svids = open_recording(part), sorted({one.svid for sky in self.sky.values() for one in sky})
            for name in exports:
                export(name, recording, part, svids)
        return tuple(sorted(path for path in folder.rglob("*") if path.is_file()))

    def _write_samples(self, folder: Path, form: SampleFormat, workers: int, progress: Report | None) -> list[Path]:
        """Write both bands at once and return their metadata; each has a thread that takes what the workers make."""
        stop = threading.Event()

        def written(band: Band) -> Path:
            with SigmfWriter(
                folder / band.value.lower(),
                form=form,
                scale=SCALES[form.component] if self.front_end.bits is None else 1.0,
                bandwidth_hz=self.front_end.bandwidth_hz,
                time_uncertainty_s=self.time_uncertainty_s,
                description=self.description,
            ) as writer:
                done = 0
                for batch in self.record(band, pool=makers):
                    if stop.is_set():
                        raise InterruptedError("the other band failed")
                    writer.append(batch)
                    done += batch.samples.size
                    if progress is not None:
                        progress(f"{band.value} samples", done, len(self.samples))
            return writer.meta

        with ThreadPoolExecutor(workers) as makers, ThreadPoolExecutor(len(Band)) as pool:
            futures = [pool.submit(written, band) for band in Band]
            try:
                return [future.result() for future in futures]
            except BaseException:
                stop.set()
                raise
