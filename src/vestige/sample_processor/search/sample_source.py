"""Give a search samples that are in memory; `vestige.recording` reads the samples of a file in pieces."""

from __future__ import annotations

from dataclasses import dataclass

from vestige.records import SampleBatch


@dataclass(frozen=True, slots=True)
class BatchSource:
    """Batch of samples in memory as a `SampleSource`."""

    batch: SampleBatch

    @property
    def first_sample(self) -> int:
        """Number of the first sample."""
        return self.batch.first_sample

    @property
    def end_sample(self) -> int:
        """Number of the last sample plus 1."""
        return self.batch.first_sample + self.batch.samples.size

    def read(self, first: int, count: int) -> SampleBatch:
        """Return `count` samples from number `first` on."""
        skip = first - self.batch.first_sample
        if skip < 0 or skip + count > self.batch.samples.size:
            raise ValueError(f"samples {first} to {first + count - 1} are not all in the batch")
        return SampleBatch(
            band=self.batch.band,
            samples=self.batch.samples[skip : skip + count],
            sample_rate_hz=self.batch.sample_rate_hz,
            center_frequency_hz=self.batch.center_frequency_hz,
            first_sample=first,
            start=self.batch.start + skip / self.batch.sample_rate_hz,
        )
