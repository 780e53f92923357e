from __future__ import annotations

import numpy as np
import pytest

from vestige.acas_processor.monitors.osnma_check import AssistedOsnmaMonitor, OsnmaAvailabilityMonitor, OsnmaField
from vestige.campaign.statistics import binomial_test
from vestige.records import Outcome
from vestige.streams import stream

N = 100_000
LEVEL = 1e-4
A, B = b"\x01" * 5, b"\x02" * 5


@pytest.mark.parametrize("monitor", [OsnmaAvailabilityMonitor(p_fa=0.01), AssistedOsnmaMonitor(p_fa=0.01)])
@pytest.mark.parametrize("loss", [None, 0.2])
def test_rate_of_alarms(monitor: OsnmaAvailabilityMonitor | AssistedOsnmaMonitor, loss: float | None) -> None:
    """Counts are whole: the rate is the exact one of the threshold, at most the budget."""
    trials = 40
    probability = monitor.loss_probability if loss is None else loss
    lost = stream(6, "osnma", monitor.name, str(loss)).binomial(trials, probability, N)
    alarms = int(np.count_nonzero(lost > monitor.threshold(trials)))
    if loss is None:
        expected = monitor.probability_of_false_alarm(trials)
        assert expected <= monitor.p_fa
    else:
        expected = float(monitor.probability_of_detection(np.array([loss]), trials)[0])
    assert binomial_test(alarms, N, expected) > LEVEL


def test_availability() -> None:
    monitor = OsnmaAvailabilityMonitor()
    limit = monitor.threshold(20)
    assert monitor.check([True] * 20).outcome is Outcome.PASS
    assert monitor.check([False] * limit + [True] * (20 - limit)).outcome is Outcome.PASS
    failed = monitor.check([False] * (limit + 1) + [True] * (19 - limit))
    assert (failed.outcome, failed.statistic, failed.threshold) == (Outcome.FAIL, limit + 1, limit)
    assert failed.reason.startswith(f"{limit + 1} of 20 subframes brought no validated key")
    for few in ([], [False], [False] * 2):
        assert monitor.check(few).outcome is Outcome.NOT_RUN


def test_bit_error_jamming_is_seen_by_comparison() -> None:
    monitor = AssistedOsnmaMonitor()
    sound = [OsnmaField(demodulated=A, assisted=A)] * 30
    limit = monitor.threshold(30)
    reception, agreement = monitor.check(sound)
    assert (reception.outcome, agreement.outcome) == (Outcome.PASS, Outcome.PASS)
    jammed = [OsnmaField(demodulated=None, assisted=A)] * (limit + 1) + sound[limit + 1 :]
    reception, agreement = monitor.check(jammed)
    assert (reception.outcome, agreement.outcome) == (Outcome.FAIL, Outcome.PASS)
    assert reception.reason == f"{limit + 1} of 30 fields were lost, more than {limit}"


def test_one_forged_field_is_enough() -> None:
    fields = [OsnmaField(demodulated=A, assisted=A)] * 29 + [OsnmaField(demodulated=B, assisted=A)]
    reception, agreement = AssistedOsnmaMonitor().check(fields)
    assert reception.outcome is Outcome.PASS
    assert (agreement.outcome, agreement.name) == (Outcome.FAIL, "OSNMA agreement")
    assert agreement.reason == "1 fields are not what the satellites sent"


def test_comparisons_that_cannot_be_made() -> None:
    monitor = AssistedOsnmaMonitor()
    for fields in ([], [OsnmaField(demodulated=A, assisted=None)] * 9):
        reception, agreement = monitor.check(fields)
        assert reception.reason == agreement.reason == "no OSNMA data from a second channel"
    reception, agreement = monitor.check([OsnmaField(demodulated=None, assisted=A)] * 30)
    assert (reception.outcome, agreement.outcome) == (Outcome.FAIL, Outcome.NOT_RUN)
    reception, agreement = monitor.check([OsnmaField(demodulated=B, assisted=A)])
    assert (reception.outcome, agreement.outcome) == (Outcome.NOT_RUN, Outcome.FAIL)
