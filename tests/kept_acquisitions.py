"""Acquisition of E1 that is computed once in equal samples: it is most of the time of `vestige process`."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from vestige.records import SampleBatch
from vestige.sample_processor.acquisition import Acquisition, acquire
from vestige.sample_processor.search.e1_search import search_e1


def _once(search: Callable[..., tuple[Acquisition, ...]]) -> Callable[..., tuple[Acquisition, ...]]:
    """Return the same pure function, which keeps what it found for equal samples, satellites and settings."""
    known: dict[tuple[Any, ...], tuple[Acquisition, ...]] = {}

    def kept(
        batch: SampleBatch, svids: Iterable[int], *, progress: Callable[[int, int], None] | None = None, **settings: Any
    ) -> tuple[Acquisition, ...]:
        satellites, samples = tuple(svids), hashlib.sha256(batch.samples.tobytes()).digest()
        key = (samples, batch.sample_rate_hz, batch.center_frequency_hz, satellites, *sorted(settings.items()))
        if key not in known:
            known[key] = search(batch, satellites, progress=progress, **settings)
        elif progress is not None:
            progress(len(satellites), len(satellites))
        return known[key]

    return kept


@contextmanager
def e1_acquired_once() -> Iterator[None]:
    """Let every user of the acquisition and of the search of E1 have what was found in equal samples before."""
    with pytest.MonkeyPatch.context() as patch:
        kept = _once(acquire)
        patch.setattr("vestige.recording.observations.e1_observation.acquire", kept)
        patch.setattr("vestige.recording.doctor.e1_signals.acquire", kept)
        patch.setattr("vestige.sample_processor.tracking.tracking_receiver.acquire", kept)
        kept_search = _once(search_e1)
        patch.setattr("vestige.recording.observations.time_tag_search.search_e1", kept_search)
        patch.setattr("vestige.acas_processor.searches.sampled_searches.search_e1", kept_search)
        yield
