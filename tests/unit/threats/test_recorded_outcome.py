from __future__ import annotations

import numpy as np
import pytest

from vestige.acas_processor.levels import POSITION
from vestige.campaign.range_errors import window_of
from vestige.records import Status
from vestige.scenario.scenario_processor import processor_of
from vestige.threats.recorded_outcome import RecordedVerdicts, recorded_outcome
from vestige.threats.recorded_scenes import RecordedScene, recorded_scenes

RECORDED = next(recorded_scenes())


def found(error_m: float) -> RecordedVerdicts:
    """Return verdicts of one satellite that is AUTHENTIC during the attack, with a range in use of a given error."""
    begin_s, _ = window_of(RECORDED.scenario())
    shape = (4, 1)
    status = np.full(shape, POSITION[Status.AUTHENTIC], np.int8)
    return RecordedVerdicts(
        status=status,
        state=status,
        recs=np.ones(4, np.bool_),
        seen=np.ones(shape, np.bool_),
        range_error_m=np.full(shape, error_m),
        tests={},
        failed={},
        time_s=begin_s + np.arange(4.0),
    )


@pytest.mark.parametrize("alarms_per_day", [None, 1.0])
def test_an_error_is_harmful_beyond_twice_the_limit_of_the_processor(
    alarms_per_day: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With `alarms_per_day` the processor chooses κ, and the setting `kappa` is not used."""
    scenario = RECORDED.scenario()
    table = scenario.processor.model_copy(update={"alarms_per_day": alarms_per_day})
    changed = scenario.replaced(processor=table)
    monkeypatch.setattr(RecordedScene, "scenario", lambda _: changed)
    limit_m = processor_of(changed).range_limit_m
    assert (limit_m > 1.2 * table.budget.limit_m(table.kappa)) == (alarms_per_day is not None)
    assert not recorded_outcome(RECORDED, found(2 * limit_m - 0.1)).missed
    assert recorded_outcome(RECORDED, found(2 * limit_m + 0.1)).missed
