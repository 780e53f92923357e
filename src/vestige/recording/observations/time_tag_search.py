"""Search the samples of a recording for the error of the time tag, by hand-over at all times that the tag allows.

E1 samples give a satellite's time of transmission modulo 100 ms, the period of the secondary code. No open code
resolves this ambiguity, but the chips of a RECS are sent only once. So each signal on E1 is handed over at all periods
that the time tag allows. The period at which the RECS is found gives the error of the time tag. If the RECS is found
more than once, the earliest arrival counts [WFO, Sec. III-E].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vestige.acas_processor.searches.handover import assisted_delay_m
from vestige.acas_processor.searches.vestigial import (
    VestigialDecision,
    arrival_window,
    decide_vestigial,
    handover_peaks,
    line_stretches,
)
from vestige.constants import MEDIAN_TRAVEL_TIME_S
from vestige.crypto.recs.group_delay import OS_ICD_CONVENTION, GroupDelayConvention
from vestige.crypto.recs.recs_segment import CipherMode, decrypt
from vestige.recording.recording import Recording
from vestige.records import Assistance
from vestige.sample_processor.e1_snapshot import E1_WINDOW_S
from vestige.sample_processor.search.e1_search import search_e1
from vestige.signals.open_e6c import repeated_after_s


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelSearch:
    """Result of the search for the error of a time tag."""

    # Error of the time tag in s, positive if the time tag is ahead of Galileo System Time. The travel time makes the
    # error uncertain by 10 ms. None if no RECS was found.
    error_s: float | None
    decisions: tuple[VestigialDecision, ...]  # a decision for each RECS that was searched for


def search_label(
    recording: Recording,
    assistance: Assistance,
    uncertainty_s: float,
    *,
    cipher_mode: CipherMode = CipherMode.CBC,
    group_delay_convention: GroupDelayConvention = OS_ICD_CONVENTION,
) -> LabelSearch:
    """Return the error of a recording's time tag from the RECS in its samples, and the decision for each searched RECS.

    `uncertainty_s` is the upper limit of the time tag's error in s.
    """
    e1, e6 = recording.e1, recording.e6
    keys = {key.time: key for key in assistance.keys}
    segments = [one for one in assistance.segments if one.key_time in keys]
    if e1 is None or e6 is None or not segments:
        return LabelSearch(error_s=None, decisions=())
    batch = e1.read(e1.first_sample, min(round(E1_WINDOW_S * e1.file.sample_rate_hz), e1.n_samples))
    signals = search_e1(batch, sorted({one.svid for one in segments}))
    errors_s, decisions = [], []
    for segment in segments:
        own = [one for one in signals if one.svid == segment.svid]
        window = arrival_window(segment.transmit_time, uncertainty_s, e6)
        if window is None or not own:
            continue
        code = decrypt(segment, keys[segment.key_time], mode=cipher_mode)
        delay_m = assisted_delay_m(assistance, segment.svid, batch.start, group_delay_convention)
        stretches = [
            stretch for one in own for stretch in line_stretches(e1, one, batch.start, code, *window, delay_m=delay_m)
        ]
        decision = decide_vestigial(
            segment.svid,
            handover_peaks(e6, stretches)[0],
            repeated_after_s=repeated_after_s(code.chips, segment.svid),
        )
        decisions.append(decision)
        if decision.true is not None:
            errors_s.append(decision.true.start_time - segment.transmit_time - MEDIAN_TRAVEL_TIME_S)
    return LabelSearch(error_s=float(np.median(errors_s)) if errors_s else None, decisions=tuple(decisions))
