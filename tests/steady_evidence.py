"""Evidence of phases and magnitudes of E6 over many RECS, for the monitors of its carrier."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evidence_builder import evidence
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.monitoring.memory import CheckMemory


def steady_evidence(
    phase_rad: np.ndarray,
    magnitude_sigma: np.ndarray | float = 10.0,
    *,
    interval_s: float = 1.0,
    first: int = 0,
    cn0_e1_dbhz: float = 90.0,
    seen: np.ndarray | None = None,
    predicted_rad: np.ndarray | float = 0.0,
    memory: CheckMemory | None = None,
) -> Evidence:
    """Return evidence of n RECS and m satellites; a magnitude of NaN is a RECS that was not detected.

    At an E1 of 90 dBHz the noise of its loops is nothing beside that of E6.
    """
    shape = phase_rad.shape
    given = evidence(shape, noise_power=1.0, time_s=(first + np.arange(shape[0])) * interval_s)
    magnitude = np.broadcast_to(np.asarray(magnitude_sigma, np.float64), shape).copy()
    wrapped = phase_rad - 2 * np.pi * np.round(phase_rad / (2 * np.pi))
    measured, tracked = given.measured, np.ones(shape, bool) if seen is None else seen
    e1 = replace(
        measured.snapshots.e1,
        pseudorange_m=np.where(tracked, 2.4e7, np.nan),
        cn0_dbhz=np.full(shape, cn0_e1_dbhz),
    )
    detected = replace(
        measured.detected,
        tap=np.where(np.isnan(magnitude), -1, 5),
        magnitude_sigma=magnitude,
        phase_rad=np.where(np.isnan(magnitude), np.nan, wrapped),
    )
    measured = replace(
        measured,
        snapshots=replace(measured.snapshots, e1=e1),
        detected=detected,
        predicted_phase_rad=np.broadcast_to(np.asarray(predicted_rad, np.float64), shape).copy(),
        extrapolated_s=np.zeros(shape),
    )
    return replace(given, measured=measured, memory=memory or {})
