from __future__ import annotations

import numpy as np

from vestige.streams import stream, stream_key


def test_same_labels_same_numbers() -> None:
    assert np.array_equal(stream(7, "noise", 3).random(8), stream(7, "noise", 3).random(8))


def test_every_label_matters() -> None:
    keys = {
        stream_key(*labels)
        for labels in [(7, "a", 1), (8, "a", 1), (7, "b", 1), (7, "a", 2), (7, "a"), (7, "a", "1"), (7, "a1")]
    }
    assert len(keys) == 7


def test_neighbouring_epochs_are_uncorrelated() -> None:
    draws = np.array([stream(1, "noise", epoch).standard_normal(1000) for epoch in range(50)])
    correlation = np.corrcoef(draws) - np.eye(50)
    assert np.max(np.abs(correlation)) < 5.6 / np.sqrt(1000)  # 1225 pairs, family error 3e-5
