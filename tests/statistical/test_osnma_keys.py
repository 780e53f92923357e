"""Keys of a weak satellite are lost with the probability that the loss of their pages gives."""

from __future__ import annotations

import numpy as np
import pytest

from sky_builder import CLEAN, columns_of, sky_scenario
from vestige.campaign.statistics import binomial_test
from vestige.receiver.errors.tracking_noise import BetzTrackingNoise
from vestige.receiver.osnma_reception import page_loss


@pytest.mark.judged(by="theory", what="lost OSNMA keys of a weak satellite", figure="binomial test at 1e-4")
def test_keys_are_lost_with_the_probability_of_their_pages() -> None:
    """One satellite of 23 dBHz: five pages of its key, each with the loss of that C/N0."""
    settings = ("constellation.svids=[7]", "constellation.cn0_fall_db=0.0", "receiver.cn0_e1_dbhz=23.0")
    found = columns_of(sky_scenario(*CLEAN, *settings, "epochs=1500", "interval_s=30.0", "recs.every=1"))
    keys = found["osnma_key"][np.isfinite(found["elevation_deg"][:, 0])]
    whole = (1 - float(page_loss(np.array([23.0]), BetzTrackingNoise())[0])) ** 5
    assert keys.size > 300
    assert binomial_test(int(keys.sum()), keys.size, whole) > 1e-4
