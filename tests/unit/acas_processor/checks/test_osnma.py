from __future__ import annotations

import numpy as np
import pytest

from evidence_builder import evidence, outcome
from vestige.acas_processor.checks.check import Check
from vestige.acas_processor.checks.osnma import (
    OsnmaAgreementMonitor,
    OsnmaAvailabilityMonitor,
    OsnmaReceptionMonitor,
)
from vestige.acas_processor.checks.osnma_subframes import KEY_BIT, Subframes, subframes
from vestige.acas_processor.monitoring.memory import OsnmaMemory
from vestige.campaign.statistics import binomial_test
from vestige.records import CheckResult, Outcome
from vestige.records.snapshot_block import OsnmaBlock
from vestige.streams import stream

N = 100_000
LEVEL = 1e-4
NAMES = ("epoch", "missing", "window", "due", "lost", "received", "differs")
SOME = OsnmaBlock(
    epoch=np.zeros(0, np.int64),
    subframe=np.zeros(0, np.int64),
    due=np.zeros((0, 1), np.int64),
    received=np.zeros((0, 1), np.int64),
    differs=np.zeros((0, 1), np.int64),
    last=np.zeros(0, bool),
)


@pytest.mark.parametrize("monitor", [OsnmaAvailabilityMonitor(p_fa=0.01), OsnmaReceptionMonitor(p_fa=0.01)])
@pytest.mark.parametrize("loss", [None, 0.2])
def test_rate_of_alarms(monitor: OsnmaAvailabilityMonitor | OsnmaReceptionMonitor, loss: float | None) -> None:
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


def _ended(missing: int = 0, window: int = 20, due: int = 30, lost: int = 0, differs: int = 0) -> Subframes:
    """One subframe that ended at the first epoch."""
    values = (0, missing, window, due, lost, due - lost, differs)
    return Subframes(**{name: np.array([value]) for name, value in zip(NAMES, values, strict=True)})


def _of(monitor: Check, ended: Subframes) -> CheckResult:
    return outcome(monitor, evidence(subframes=ended, osnma=SOME))


def test_availability() -> None:
    monitor = OsnmaAvailabilityMonitor()
    limit = monitor.threshold(20)
    assert _of(monitor, _ended()).outcome is Outcome.PASS
    assert _of(monitor, _ended(missing=limit)).outcome is Outcome.PASS
    failed = _of(monitor, _ended(missing=limit + 1))
    assert (failed.outcome, failed.statistic, failed.threshold) == (Outcome.FAIL, limit + 1, limit)
    assert failed.reason.startswith(f"{limit + 1} of the last subframes brought no validated key")
    for few in (1, 2):
        assert _of(monitor, _ended(missing=few, window=few)).outcome is Outcome.NOT_RUN


def test_bit_error_jamming_is_seen_by_comparison() -> None:
    reception, agreement = OsnmaReceptionMonitor(), OsnmaAgreementMonitor()
    limit = reception.threshold(30)
    for lost, expected in ((0, Outcome.PASS), (limit, Outcome.PASS), (limit + 1, Outcome.FAIL)):
        assert _of(reception, _ended(lost=lost)).outcome is expected
        assert _of(agreement, _ended(lost=lost)).outcome is Outcome.PASS
    assert _of(reception, _ended(lost=limit + 1)).reason == f"{limit + 1} fields were lost, more than {limit}"


def test_one_forged_field_is_enough() -> None:
    assert _of(OsnmaReceptionMonitor(), _ended(differs=1)).outcome is Outcome.PASS
    agreement = _of(OsnmaAgreementMonitor(), _ended(differs=1))
    assert (agreement.outcome, agreement.name) == (Outcome.FAIL, "OSNMA agreement")
    assert agreement.reason == "1 fields are not what the satellites sent"


def test_comparisons_that_cannot_be_made() -> None:
    for monitor in (OsnmaAvailabilityMonitor(), OsnmaReceptionMonitor(), OsnmaAgreementMonitor()):
        assert outcome(monitor, evidence()).reason == "no OSNMA data from a second channel"
        assert outcome(monitor, evidence(osnma=SOME)).reason == "no subframe ended since the epoch before"
    assert _of(OsnmaAgreementMonitor(), _ended(lost=30)).reason == "no field was received"
    assert _of(OsnmaReceptionMonitor(), _ended(due=1)).outcome is Outcome.NOT_RUN


def _pieces(bits: list[tuple[int, int, int]], *, last: list[bool] | None = None) -> OsnmaBlock:
    """Pieces of one subframe of one satellite: due, received, differs."""
    due, received, differs = np.array(bits, np.int64).T[..., None]
    ends = [False] * (len(bits) - 1) + [True] if last is None else last
    return OsnmaBlock(
        epoch=np.arange(len(bits)),
        subframe=np.zeros(len(bits), np.int64),
        due=due,
        received=received,
        differs=differs,
        last=np.array(ends),
    )


def test_a_key_needs_all_its_pages_and_none_that_differs() -> None:
    whole, key_pages = (1 << 15) - 1, 0b11111 << 10
    for received, differs, missing, lost in (
        (whole, 0, 0, 0),
        (whole & ~(1 << 12), 0, 1, 1),
        (whole, 1 << 12, 1, 0),
        (key_pages, 0, 0, 10),
    ):
        found, memory = subframes(_pieces([(whole, received, differs)]), (11,), OsnmaMemory())
        assert (found.missing[0], found.window[0], found.due[0], found.lost[0]) == (missing, 1, 15, lost)
        assert found.differs[0] == bin(differs).count("1")
        assert memory.keyed == (not missing,)


def test_a_subframe_in_pieces_is_judged_at_its_end() -> None:
    pieces = [(1 << page, 1 << page, 0) for page in range(15)]
    found, memory = subframes(_pieces(pieces), (11,), OsnmaMemory())
    assert found.epoch.tolist() == [14]
    assert (found.due[0], found.lost[0]) == (15, 0)
    first, memory = subframes(_pieces(pieces[:9], last=[False] * 9), (11,), OsnmaMemory())
    assert not first.epoch.size
    second, _ = subframes(_pieces(pieces[9:]), (11,), memory)
    assert (second.epoch.tolist(), second.due.tolist()) == ([5], [15])


def test_a_key_that_is_compared_as_a_whole() -> None:
    for received, differs, missing in ((KEY_BIT, 0, 0), (0, 0, 1), (KEY_BIT, KEY_BIT, 1)):
        found, _ = subframes(_pieces([(KEY_BIT, received, differs)]), (11,), OsnmaMemory())
        assert (found.missing[0], found.due[0]) == (missing, 1)


def test_pieces_at_once_are_those_one_by_one() -> None:
    """Subframes of several pieces, without an end, and with an end before their last piece."""
    rng = stream(0, "pieces")
    bits = rng.integers(0, 1 << 15, (3, 200, 2))
    pieces = OsnmaBlock(
        epoch=np.arange(200),
        subframe=30 * np.cumsum(rng.random(200) < 0.3),
        due=bits[0],
        received=bits[0] & bits[1],
        differs=bits[0] & bits[1] & bits[2],
        last=rng.random(200) < 0.3,
    )
    whole, memory = subframes(pieces, (11, 12), OsnmaMemory())
    rows, then = [], OsnmaMemory()
    for k in range(200):
        one, then = subframes(
            OsnmaBlock(**{name: getattr(pieces, name)[k : k + 1] for name in OsnmaBlock.__slots__}), (11, 12), then
        )
        rows.append([getattr(one, name) for name in NAMES])
    assert memory == then
    for name, parts in zip(NAMES, zip(*rows, strict=True), strict=True):
        assert getattr(whole, name).tolist() == np.concatenate(parts).tolist()
