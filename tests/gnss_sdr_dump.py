"""The tracking dumps of gnss-sdr, for tests."""

from __future__ import annotations

import numpy as np

# one record of the tracking dump of gnss-sdr 0.0.17
TRACK_RECORD = np.dtype(
    [
        ("correlators", "<f4", 5), ("prompt", "<f4", 2), ("sample", "<u8"), ("carrier_phase_rad", "<f4"),
        ("doppler_hz", "<f4"), ("doppler_rate", "<f4"), ("code_rate_hz", "<f4"), ("code_rate_rate", "<f4"),
        ("errors", "<f4", 4), ("cn0_dbhz", "<f4"), ("lock", "<f4"), ("aux1", "<f4"), ("aux2", "<f8"), ("svid", "<u4"),
    ]
)  # fmt: skip
