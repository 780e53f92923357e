"""Laws that hold for every detector, for that of a user as well."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from extend_page import page_part
from vestige.acas_processor.detectors import DETECTORS, NOT_DETECTED, Detector, OwnDetector

OWN = "my_detector:RelativePeak"
MAKERS = dict(DETECTORS) | {OWN: lambda spacing: OwnDetector(kind=OWN, detector=page_part(OWN)(spacing=spacing))}
every_detector = pytest.mark.parametrize(
    "detector", [make(spacing=n) for make in MAKERS.values() for n in (1, 2)], ids=lambda one: str(one)[:40]
)
N_TAPS = 11


def banks(n: int, *, seed: int = 1) -> np.ndarray:
    """Return magnitudes of noise with a triangle somewhere."""
    rng = np.random.default_rng(seed)
    middle = rng.uniform(2.0, N_TAPS - 3.0, n)
    triangle = 12 * np.maximum(1 - np.abs(np.arange(N_TAPS) - middle[:, None]) / 4, 0)
    return np.hypot(triangle + rng.standard_normal((n, N_TAPS)), rng.standard_normal((n, N_TAPS)))


@every_detector
def test_every_epoch_by_itself(detector: Detector) -> None:
    magnitudes = banks(300)
    whole = detector.detect(magnitudes, 5.0)
    pieces = [detector.detect(part, 5.0) for part in np.split(magnitudes, [1, 2, 150, 299])]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)
    np.testing.assert_array_equal(detector.detect(magnitudes, np.full(300, 5.0)), whole)


@every_detector
def test_what_is_found_exceeds_the_threshold_and_has_both_neighbours(detector: Detector) -> None:
    magnitudes = banks(300)
    tap = detector.detect(magnitudes, 5.0)
    found = tap != NOT_DETECTED
    assert found.mean() > 0.9
    assert np.all((tap[found] >= detector.spacing) & (tap[found] <= N_TAPS - 1 - detector.spacing))
    assert np.all(magnitudes[found, tap[found]] > 5.0)


@every_detector
def test_noise_and_nothing_are_not_detected(detector: Detector) -> None:
    for magnitudes in (banks(50), np.full((50, N_TAPS), np.nan), np.zeros((50, N_TAPS))):
        assert np.all(detector.detect(magnitudes, 100.0) == NOT_DETECTED)
    assert detector.detect(np.zeros((0, N_TAPS)), 5.0).shape == (0,)


@every_detector
def test_the_unit_does_not_matter(detector: Detector) -> None:
    magnitudes = banks(300)
    np.testing.assert_array_equal(detector.detect(4 * magnitudes, 20.0), detector.detect(magnitudes, 5.0))


@every_detector
def test_pickled(detector: Detector) -> None:
    assert pickle.loads(pickle.dumps(detector)) == detector  # noqa: S301
