"""Make the recording that a scenario describes, and write its folder: samples of E1 and E6, and all other files.

docs/test_cases.md describes the content of the folder.
"""

from __future__ import annotations

import hashlib
import shutil
import threading
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from vestige.errors import VestigeError
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.samples.recorder import (
    Interference,
    band_noise_key,
    record_band,
    stretch_samples,
)
from vestige.recording.recording import open_recording
from vestige.recording.samples.exports import COPY_BYTES, ExportedSky, check_export, export
from vestige.recording.samples.ion_metadata import ION_SUFFIX
from vestige.recording.samples.ion_metadata_writer import has_ion_encoding, write_ion_metadata
from vestige.recording.samples.sample_format import SampleFormat, SampleType, encode
from vestige.recording.samples.sigmf_writer import SigmfWriter, write_collection
from vestige.records import Band, SampleBatch
from vestige.simulated.clipping import clipping_warning, largest_level, n_clipped
from vestige.simulated.sky_parts import SkyParts
from vestige.simulated.unfinished_recording import UnfinishedRecording, unfinished_recording
from vestige.source_version import processor_name, vestige_version
from vestige.time import GalileoTime

Report = Callable[[str, int, int], None]
Say = Callable[[str], None]

# Stored value of an I or Q of 1.0, by number type. In int8, the noise of I and of Q has a standard deviation of 14
# counts, and the largest number is 9 σ.
SCALES: Mapping[SampleType, float] = {"int8": 20.0, "int16": 1000.0, "float32": 1.0}
_PROBE_S = 0.05
_KEPT_BATCHES = 50  # number of batches (half a second) after which progress is stored, for a resumption
_LONG_S = 900.0  # length in s of a recording above which its other files take seconds to write
_WRITING = 1.5  # time to make, convert, check and store samples as a multiple of the time to make samples


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedRecording:
    """Recording that is simulated when its samples are requested or written."""

    sky: SkyParts  # signals in each band
    reference: GalileoTime  # receiver-clock time of sample 0, a whole second
    front_end: FrontEnd  # front end of each band, with the sampling rate
    samples: range  # numbers of the samples
    seed: int  # seed of the noise
    time_uncertainty_s: float  # upper limit of the clock error in s, as the receiver states it
    description: str  # a line of text for the user
    companions: Callable[[Path], None]  # function that writes all other files of the folder
    interference: Mapping[Band, Interference] = field(default_factory=dict)  # noise and jamming of attacks
    own_parts: tuple[str, ...] = ()  # the user's own classes in the scenario, `module:Name@digest`
    troposphere: bool = False  # whether a troposphere delays the signals
    ionosphere: bool = False  # whether the ionosphere of the message delays the signals

    @property
    def sample_rate_hz(self) -> float:
        """Sampling rate of both bands in Hz."""
        return self.front_end.sample_rate_hz

    @property
    def duration_s(self) -> float:
        """Length of the recording in s."""
        return len(self.samples) / self.sample_rate_hz

    def record(
        self, band: Band, *, at_most: int | None = None, noise: bool = True, pool: Executor | None = None
    ) -> Iterator[SampleBatch]:
        """Yield batches of the samples of a band in order of time."""
        return self._made(band, self.samples[:at_most], noise=noise, pool=pool)

    def window(self, band: Band, from_s: float, to_s: float) -> SampleBatch:
        """Return the samples of a band from `from_s` to `to_s`, in s after the reference time, as one batch.

        Samples within the recording are equal to the samples from `record`. `from_s` and `to_s` may lie after the end
        of the recording.
        """
        first, end = (round(at_s * self.sample_rate_hz) for at_s in (from_s, to_s))
        batches = list(self._made(band, range(first, end), noise=True))
        return replace(batches[0], samples=np.concatenate([batch.samples for batch in batches]))

    def _first_batch(self, band: Band) -> SampleBatch:
        return next(self.record(band, at_most=stretch_samples(self.sample_rate_hz)))

    def _rest(self, band: Band, done: int, pool: Executor) -> Generator[SampleBatch]:
        """Yield batches of the samples of a band that follow the first `done` samples."""
        if rest := self.samples[done:]:
            yield from self._made(band, rest, noise=True, pool=pool)

    def begin(self, band: Band) -> tuple[GalileoTime, float]:
        """Return the receiver-clock time of the first sample, and the radio frequency in Hz that appears at 0 Hz."""
        first = self._first_batch(band)
        return first.start, first.center_frequency_hz

    def send(
        self,
        bands: Band | Sequence[Band],
        write: Callable[[bytes], object],
        *,
        component: SampleType = "int8",
        workers: int = 2,
        progress: Report | None = None,
        warn: Say | None = None,
    ) -> None:
        """Pass samples to `write`, about 10 ms at a time.

        A single band gives the same bytes as the file that `self.write` writes. Two bands alternate sample by sample.
        The bands (E1, E6) give the bytes of E1[0], E6[0], E1[1], E6[1] and so on, with I before Q in each sample.

        Parameters
        ----------
        bands
            Band of the samples, or two bands in the order in which their samples alternate.
        write
            Function that takes the samples as bytes: little-endian numbers with I before Q. While this function waits,
            at most eight batches of about 10 ms are made for each band.
        component
            Number type of I and of Q.
        workers
            Number of threads that make samples; the samples do not depend on this number.
        progress
            Function that is called with three values: a text that names the bands, the number of written samples of
            each band, and the number of all samples of each band.
        warn
            Function that is called with one line at the end if more than 0.1 % of the numbers of a band clip.

        Raises
        ------
        OSError
            If `write` fails.
        """
        chosen = (bands,) if isinstance(bands, Band) else tuple(bands)
        form, scale, done = SampleFormat(component=component, layout="iq"), self.scale(component), 0
        name = " and ".join(band.value for band in chosen)
        largest, clipped = largest_level(component, self.front_end), dict.fromkeys(chosen, 0)
        with ThreadPoolExecutor(workers) as makers, ExitStack() as made:
            each = [made.enter_context(closing(self._rest(band, 0, makers))) for band in chosen]
            for batches in zip(*each, strict=True):
                parts = [encode(batch.samples, form, scale=scale).reshape(-1, 2) for batch in batches]
                for band, part in zip(chosen, parts, strict=True):
                    clipped[band] += n_clipped(part, largest)
                write(np.stack(parts, axis=1).tobytes())
                done += batches[0].samples.size
                if progress is not None:
                    progress(f"{name} samples", done, len(self.samples))
        shares = {band: n / max(2 * done, 1) for band, n in clipped.items()}
        self._warn_of_clipping(shares, warn)

    def _warn_of_clipping(self, shares: Mapping[Band, float], warn: Say | None) -> None:
        if warn is not None and (line := clipping_warning(shares, self.front_end)):
            warn(line)

    def _made(self, band: Band, samples: range, *, noise: bool, pool: Executor | None = None) -> Iterator[SampleBatch]:
        for part, signals in self.sky.parts(band, samples):
            yield from record_band(
                band,
                signals,
                reference=self.reference,
                front_end=self.front_end,
                first_sample=part.start,
                n_samples=len(part),
                noise_key=band_noise_key(self.seed, band) if noise else None,
                interference=self.interference.get(band),
                pool=pool,
            )

    def n_bytes(self, component: SampleType, exports: Sequence[str] = ()) -> int:
        """Return the size in bytes of the samples of both bands, including the copies for the receivers `exports`."""
        own = SampleFormat(component=component, layout="iq").sample_bytes
        return len(Band) * len(self.samples) * (own + sum(COPY_BYTES[name] for name in exports))

    def check_exports(self, component: SampleType, exports: Sequence[str]) -> None:
        """Raise `UnsupportedError` if one of the receivers `exports` could not read the samples."""
        for name in exports:
            check_export(name, SampleFormat(component=component, layout="iq"), self.sample_rate_hz)

    def seconds_to_write(self) -> float:
        """Return the approximate time in s to write the recording, estimated from a short part of each band."""
        n_samples = min(len(self.samples), int(_PROBE_S * self.sample_rate_hz))
        slowest_s = 0.0
        for band in Band:
            for _ in range(2):  # the first pass compiles the code, and the second pass gives the time
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
        say: Say | None = None,
        warn: Say | None = None,
    ) -> tuple[Path, ...]:
        """Write the folder of the recording and return its files; continue a recording that a killed process left.

        Parameters
        ----------
        folder
            Folder of the recording, which appears when all files are complete.
        scenario_text
            Scenario as TOML, with all values that `--set` has replaced.
        component
            Number type of I and of Q.
        exports
            Names of the receivers for which files are written, from `recording.samples.exports.EXPORTS`.
        workers
            Number of threads that make samples; the samples do not depend on this number.
        progress
            Function that is called with three values: a text that names the band, the number of written samples, and
            the number of all samples.
        say
            Function that is called with a line of text if a recording is continued. For a recording of more than 900 s,
            the function is also called before message, truth and assistance are written.
        warn
            Function that is called with one line at the end if more than 0.1 % of the numbers of a band clip.

        Raises
        ------
        InputFileError
            If `folder` exists, lies in the results of a campaign, or is being written by another process. If a killed
            process left another recording, or if another user could have prepared the hidden folder.
        UnsupportedError
            If one of the receivers `exports` cannot read the samples; in this case nothing is written.
        VestigeError
            If the samples do not fit on the disk.
        """
        self.check_exports(component, exports)
        form = SampleFormat(component=component, layout="iq")
        with unfinished_recording(folder, self._identity(scenario_text, component)) as unfinished:
            part, left = unfinished.folder, dict(unfinished.samples)
            needed = self.n_bytes(component, exports) - form.sample_bytes * sum(left.values())
            if (free := shutil.disk_usage(part).free) < needed:
                raise VestigeError(f"{folder}: found {free / 1e9:.1f} GB free, expected {needed / 1e9:.1f} GB")
            if left and say is not None:
                there = [f"{n / self.sample_rate_hz:.2f} s of {band.value}" for band in Band if (n := left.get(band))]
                say(f"{folder}: resumes an interrupted recording; already there: {', '.join(there)}")
            if self.duration_s > _LONG_S and say is not None:
                say(f"{folder}: writes message, truth and assistance before the samples")
            (part / "scenario.toml").write_text(scenario_text, encoding="utf-8", newline="\n")
            self.companions(part)
            metas, clipped = self._write_samples(unfinished, form, workers, progress)
            write_collection(part / "recording", metas)
            recording = open_recording(part)
            if has_ion_encoding(component):
                write_ion_metadata(part / f"recording{ION_SUFFIX}", recording.description)
            for name in exports:
                export(name, recording, part, self.exported_sky)
        self._warn_of_clipping(clipped, warn)
        return tuple(sorted(path for path in folder.rglob("*") if path.is_file()))

    @property
    def exported_sky(self) -> ExportedSky:
        """Satellites and atmosphere of the recording, which the files for other receivers state."""
        return ExportedSky(svids=self.sky.svids, troposphere=self.troposphere, ionosphere=self.ionosphere)

    def _identity(self, scenario_text: str, component: SampleType) -> dict[str, str]:
        """Return all values on which the bits of the samples depend, by the name that an error message uses."""
        return {
            "scenario": hashlib.sha256(scenario_text.encode()).hexdigest(),
            "stretch of time": f"samples {self.samples.start} to {self.samples.stop}",
            "number format": component,
            "own class": " ".join(self.own_parts),
            "version of vestige": vestige_version(),
            "kind of processor": processor_name(),
        }

    def scale(self, component: SampleType) -> float:
        """Return the stored value of an I or Q of 1.0; the levels of a quantiser are stored unscaled."""
        return SCALES[component] if self.front_end.bits is None else 1.0

    def _write_samples(
        self, unfinished: UnfinishedRecording, form: SampleFormat, workers: int, progress: Report | None
    ) -> tuple[list[Path], dict[Band, float]]:
        """Write both bands at the same time; return the metadata file and the clipped share of numbers of each band.

        One thread for each band writes the samples that the workers make.
        """
        stop = threading.Event()
        left = dict(unfinished.samples)
        largest = largest_level(form.component, self.front_end)

        def written(band: Band) -> tuple[Path, float]:
            done = left.get(band, 0)
            with SigmfWriter(
                unfinished.folder / band.value.lower(),
                form=form,
                scale=self.scale(form.component),
                bandwidth_hz=self.front_end.bandwidth_hz,
                time_uncertainty_s=self.time_uncertainty_s,
                description=self.description,
                kept=(self._first_batch(band), done) if done else None,
                counted=lambda components: n_clipped(components, largest),
            ) as writer:
                for number, batch in enumerate(self._rest(band, done, makers), start=1):
                    if stop.is_set():
                        raise InterruptedError("the other band failed")
                    writer.append(batch)
                    done += batch.samples.size
                    if number % _KEPT_BATCHES == 0:
                        writer.flush()
                        unfinished.keep(band, done)
                    if progress is not None:
                        progress(f"{band.value} samples", done, len(self.samples))
                writer.flush()
                unfinished.keep(band, done)
            return writer.meta, writer.count_share

        with ThreadPoolExecutor(workers) as makers, ThreadPoolExecutor(len(Band)) as pool:
            futures = [pool.submit(written, band) for band in Band]
            try:
                bands = [future.result() for future in futures]
            except BaseException:
                stop.set()
                raise
        return [meta for meta, _ in bands], {band: share for band, (_, share) in zip(Band, bands, strict=True)}
