"""Report and correct the error of the samples' time tag in `vestige track`, `vestige process` and `vestige live`."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vestige.acas_processor.processor import AcasProcessor, Step
    from vestige.recording.recording import Recording
    from vestige.records import Assistance

MAX_LABEL_S = 1e5  # largest uncertainty in s that is searched, also if the error of the time tag has no limit


def ahead_or_behind(error_s: float) -> str:
    """Return the error of a time tag as text; the caller appends the time to which the error refers.

    Examples
    --------
    >>> ahead_or_behind(-0.004), ahead_or_behind(10.02)
    ('4 ms behind', '10.02 s ahead of')
    """
    size_s = abs(error_s)
    size = f"{size_s * 1e3:.0f} ms" if size_s < 1 else f"{size_s:.2f} s"
    return f"{size} {'behind' if error_s < 0 else 'ahead of'}"


def by_the_message(error_s: float) -> str:
    """Return a line with the error of the time tag, relative to the time in the navigation message.

    Examples
    --------
    >>> by_the_message(-9.998)
    'the time tag of the samples is 10.00 s behind the time in the navigation message, ± 10 ms'
    """
    return f"the time tag of the samples is {ahead_or_behind(error_s)} the time in the navigation message, ± 10 ms"


def time_tag_warning(error_s: float, said_s: float = 0.0) -> str:
    """Return a warning about the error of the time tag; "" if the error minus `said_s` is within the tolerance.

    `said_s` is the error in s of which the user was already warned. The tolerance is `TIME_TAG_TOLERANCE_S`.
    """
    from vestige.recording.observations.e1_observation import TIME_TAG_TOLERANCE_S

    if abs(error_s - said_s) <= TIME_TAG_TOLERANCE_S:
        return ""
    return f"{by_the_message(error_s)}; verdicts and positions have the time of the signal"


def on_signal_clock(step: Step, late_s: float) -> Step:
    """Return a step for output, with the times of its snapshots on the clock of the signal.

    The state for the next snapshot stays on the clock of the receiver. The time of reception, which is compared with
    the disclosure of the key, also stays on this clock.

    Parameters
    ----------
    step
        Result of the processor, on the clock of the receiver.
    late_s
        Error of the receiver's clock in s, positive if this clock is ahead of the clock of the signal.
    """
    from dataclasses import replace

    import numpy as np

    if late_s == 0.0:
        return step
    measured = step.block.measured
    time = measured.snapshots.time + np.full(len(measured.snapshots.time), -late_s)
    snapshots = replace(measured.snapshots, time=time)
    return replace(step, block=replace(step.block, measured=replace(measured, snapshots=snapshots)))


def label_uncertainty_s(recording: Recording, stated_s: float | None) -> float:
    """Return the uncertainty of the time tag in s that a search must cover, at most `MAX_LABEL_S`; 0 without a search.

    No search is needed if there are E1 observations, or if the uncertainty is at most `TIME_TAG_TOLERANCE_S`. In other
    cases the E1 samples give the time only modulo 100 ms.
    """
    from vestige.recording.observations.e1_observation import TIME_TAG_TOLERANCE_S

    around_s = recording.description.time_uncertainty_s if stated_s is None else stated_s
    return 0.0 if recording.observations is not None or around_s <= TIME_TAG_TOLERANCE_S else min(around_s, MAX_LABEL_S)


def label_error_s(
    recording: Recording,
    assistance: Assistance,
    around_s: float,
    processor: AcasProcessor,
    say: Callable[[object], None],
) -> float:
    """Search the samples for RECS, give warnings to `say`, and return the error of the time tag in s.

    The error is positive if the time tag is ahead of the time of the RECS. The result is 0 if no RECS is found, or if
    the magnitude of the error is at most `TIME_TAG_TOLERANCE_S`.
    """
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
            say(f"E{decision.svid:02d}: spoofing: its RECS was found {len(decision.peaks)} times, at {times}")
    if found.error_s is None:
        say(
            f"no RECS was found within the time tag's ±{around_s:g} s, so the time tag is taken to be right "
            f"to {TIME_TAG_TOLERANCE_S * 1e3:g} ms: without an observation file E1 tells time only modulo 100 ms"
        )
        return 0.0
    if abs(found.error_s) > TIME_TAG_TOLERANCE_S:
        say(f"the time tag is {ahead_or_behind(found.error_s)} the time of the RECS in the samples")
    return found.error_s if abs(found.error_s) > TIME_TAG_TOLERANCE_S else 0.0
