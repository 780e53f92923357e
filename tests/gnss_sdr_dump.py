"""The tracking dumps of gnss-sdr, for tests and `benchmarks/sky_gnss_sdr.py`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

# one record of the tracking dump of gnss-sdr 0.0.17
TRACK_RECORD = np.dtype(
    [
        ("correlators", "<f4", 5), ("prompt", "<f4", 2), ("sample", "<u8"), ("carrier_phase_rad", "<f4"),
        ("doppler_hz", "<f4"), ("doppler_rate", "<f4"), ("code_rate_hz", "<f4"), ("code_rate_rate", "<f4"),
        ("errors", "<f4", 4), ("cn0_dbhz", "<f4"), ("lock", "<f4"), ("aux1", "<f4"), ("aux2", "<f8"), ("svid", "<u4"),
    ]
)  # fmt: skip


def tracked_e6(folder: Path, n_channels: int, first_sample: float) -> dict[int, np.ndarray]:
    """Return the records of each satellite whose E6-B is locked, from a sample on, by SVID.

    A channel counts as locked if its Doppler, in Hz, is always that of a satellite.
    """
    found = {}
    for channel in range(n_channels):
        dump = folder / f"e6_track{channel}.dat"
        track = np.fromfile(dump, TRACK_RECORD) if dump.exists() else np.empty(0, TRACK_RECORD)
        track = track[track["sample"] > first_sample]
        if track.size > 3000 and np.abs(track["doppler_hz"]).max() < 5000 and np.unique(track["svid"]).size == 1:
            found[int(track["svid"][0])] = track
    return found
