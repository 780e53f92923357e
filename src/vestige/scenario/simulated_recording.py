"""The recording that a scenario describes, and the folder that it is written to: samples of both bands and companions.

docs/test_cases.md says what is in the folder.
"""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from vestige.errors import VestigeError
from vestige.receiver.recorder import ReceivedSatellite, record_band
from vestige.recording.exports import COPY_BYTES, export
from vestige.recording.new_folder import new_folder
from vestige.recording.recording import open_recording
from vestige.recording.sample_format import Component, SampleFormat
from vestige.recording.sigmf_writer import SigmfWriter, write_collection
from vestige.records import Band, SampleBatch
from vestige.signal_generator.noise_kernel import noise_key
from vestige.time import GalileoTime

Report = Callable[[str, int, int], None]

# stored component: counts of one unit. int8: noise of 14 counts in I and in Q, 9 σ to the end of the scale
SCALES: Mapping[Component, float] = {"int8": 20.0, "int16": 1000.0, "float32": 1.0}
_NOISE = {Band.E1: 61, Band.E6: 66}  # stream numbers
_PROBE_S = 0.05
_WRITING = 1.5  # times synthesis: conversion, checksum and disk


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedRecording:
    """A recording that can be made.

    Attributes
    ----------
    sky
        What each band receives.
    reference
        Receiver-clock time of sample 0, a whole second.
    samples
        Numbers of the samples.
    seed
        Seed of the noise.
    time_uncertainty_s
        What the receiver believes of its clock.
    description
        One line for a person.
    companions
        Writes all other files of the folder.
    """

    sky: Mapping[Band, tuple[ReceivedSatellite, ...]]
    reference: GalileoTime
    sample_rate_hz: float
    samples: range
    seed: int
    time_uncertainty_s: float
    description: str
    companions: Callable[[Path], None]

    @property
    def duration_s(self) -> float:
        """Length in s."""
        return len(self.samples) / self.sample_rate_hz

    def record(self, band: Band, *, at_most: int | None = None, noise: bool = True) -> Iterator[SampleBatch]:
        """Yield the samples of a band.

        Parameters
        ----------
        at_most
            Number of samples after which to stop.
        noise
            Whether there is any.
        """
        samples = self.samples[:at_most]
        return record_band(
            band,
            self.sky[band],
            reference=self.reference,
            sample_rate_hz=self.sample_rate_hz,
            first_sample=samples.start,
            n_samples=len(samples),
            noise_key=noise_key(self.seed, 0, _NOISE[band]) if noise else None,
        )

    def n_bytes(self, component: Component, exports: Sequence[str] = ()) -> int:
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
        component: Component = "int8",
        exports: Sequence[str] = (),
        progress: Report | None = None,
    ) -> tuple[Path, ...]:
        """Write the folder and return its files.

        Parameters
        ----------
        folder
            Made; complete or not there at all.
        scenario_text
            The scenario as TOML.
        component
            Number type of the samples.
        exports
            Names in `recording.exports.EXPORTS`.
        progress
            Called with the band, the samples written, and all.

        Raises
        ------
        InputFileError
            If `folder` exists.
        VestigeError
            If the samples do not fit on the disk.
        """
        with new_folder(folder) as part:
            free, needed = shutil.disk_usage(part).free, self.n_bytes(component, exports)
            if free < needed:
                raise VestigeError(f"{folder}: found {free / 1e9:.1f} GB free, expected {needed / 1e9:.1f} GB")
            (part / "scenario.toml").write_text(scenario_text, encoding="utf-8", newline="\n")
            self.companions(part)
            metas = self._write_samples(part, SampleFormat(component=component, layout="iq"), progress)
            write_collection(part / "recording", metas)
            recording, svids = open_recording(part), sorted({one.svid for sky in self.sky.values() for one in sky})
            for name in exports:
                export(name, recording, part, svids)
        return tuple(sorted(path for path in folder.rglob("*") if path.is_file()))

    def _write_samples(self, folder: Path, form: SampleFormat, progress: Report | None) -> list[Path]:
        """Write both bands at once, each on a thread of its own, and return their metadata."""
        stop = threading.Event()

        def written(band: Band) -> Path:
            with SigmfWriter(
                folder / band.value.lower(),
                form=form,
                scale=SCALES[form.component],
                time_uncertainty_s=self.time_uncertainty_s,
                description=self.description,
            ) as writer:
                done = 0
                for batch in self.record(band):
                    if stop.is_set():
                        raise InterruptedError("the other band failed")
                    writer.append(batch)
                    done += batch.samples.size
                    if progress is not None:
                        progress(f"{band.value} samples", done, len(self.samples))
            return writer.meta

        with ThreadPoolExecutor(len(Band)) as pool:
            futures = [pool.submit(written, band) for band in Band]
            try:
                return [future.result() for future in futures]
            except BaseException:
                stop.set()
                raise
