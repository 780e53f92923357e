"""Compute the status of a front end from samples: the power of the samples, and whether the samples clip.

The power is the power of the stored numbers. The gain is not known (NaN). Behind a gain control whose gain was not
recorded, the power of the numbers tells nothing about the power of the received signals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from vestige.recording.samples.sample_format import SampleFormat, SampleType
from vestige.records import FrontEndStatus, SampleBatch

# A larger share of numbers at the ends of the scale means clipping. Gaussian noise has a share of 0.3 % if the scale
# ends at 3 σ.
CLIPPED = 0.01
_END_OF_SCALE: Mapping[SampleType, float] = {"int8": 127.0, "uint8": 127.0, "int16": 32767.0, "uint16": 32767.0}


def front_end_status(batch: SampleBatch, form: SampleFormat) -> FrontEndStatus:
    """Return the power in dB relative to one squared unit of the numbers, and whether the converter was saturated."""
    values = batch.samples.view(np.float32)
    power = float(np.vdot(values, values)) / batch.samples.size
    end = _END_OF_SCALE.get(form.component, math.inf)
    parts = form.components_per_sample * batch.samples.size
    return FrontEndStatus(
        agc_gain_db=math.nan,
        total_power_db=10 * math.log10(power) if power > 0 else -math.inf,
        saturated=int(np.count_nonzero(np.abs(values) >= end)) > CLIPPED * parts,
    )
