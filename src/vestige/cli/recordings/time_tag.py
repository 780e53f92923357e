"""Time tag of samples in `vestige process` for recordings without a message or an observation file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vestige.cli.terminal import warn

if TYPE_CHECKING:
    from vestige.acas_processor.processor import AcasProcessor
    from vestige.recording.recording import Recording
    from vestige.records import Assistance

MAX_LABEL_S = 1e5  # uncertainty of an unknown time, which covers the whole recording


def late_or_early(error_s: float) -> str:
    """Return the error of a time tag as text for the user.

    Examples
    --------
    >>> late_or_early(-0.004), late_or_early(10.02)
    ('4 ms early', '10.02 s late')
    """
    size_s = abs(error_s)
    size = f"{size_s * 1e3:.0f} ms" if size_s < 1 else f"{size_s:.2f} s"
    return f"{size} {'early' if error_s < 0 else 'late'}"


def label_uncertainty_s(recording: Recording, stated_s: float | None) -> float:
    """Return the uncertainty of the time tag if E1 samples alone tell time, which is modulo 100 ms; otherwise 0."""
    from vestige.recording.observations.e1_observation import TIME_TAG_TOLERANCE_S

    around_s = recording.description.time_uncertainty_s if stated_s is None else stated_s
    return 0.0 if recording.observations is not None or around_s <= TIME_TAG_TOLERANCE_S else min(around_s, MAX_LABEL_S)


def label_error_s(recording: Recording, assistance: Assistance, around_s: float, processor: AcasProcessor) -> float:
    """Search the samples for RECS, print the result, and return the delay of the time tag in s."""
    from vestige.recording.observations.e1_observation import TIME_TAG_TOLERANCE_S
    from vestige.recording.observations.time_tag_search import search_label

    found = search_label(
        recording,
        assistance,
        around_s,
        cipher_mode=processor.cipher_mode,
        group_delay_convention=processor.group_delay_convention,
    )
    for decision in found.decisions:
        if decision.spoofed:
            times = ", ".join(str(peak.start_time) for peak in decision.peaks)
            warn(f"E{decision.svid:02d}: spoofing: its RECS was found {len(decision.peaks)} times, at {times}")
    if found.error_s is None:
        warn(
            f"no RECS was found within the time tag's ±{around_s:g} s, so the time tag is taken to be right "
            f"to {TIME_TAG_TOLERANCE_S * 1e3:g} ms: without an observation file E1 tells time only modulo 100 ms"
        )
        return 0.0
    if abs(found.error_s) > TIME_TAG_TOLERANCE_S:
        warn(f"the time tag is {late_or_early(found.error_s)} by the RECS in the samples")
    return found.error_s if abs(found.error_s) > TIME_TAG_TOLERANCE_S else 0.0
