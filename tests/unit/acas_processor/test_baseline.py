from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evidence_builder import evidence
from vestige.acas_processor.measurement import MeasurementBlock
from vestige.acas_processor.monitoring.baseline import (
    BASELINE_WINDOW,
    LEARNED,
    Antenna,
    Baseline,
    Observed,
    Quantity,
    ReferenceLevels,
)
from vestige.records import Band
from vestige.records.snapshot_block import FrontEndBlock

NOBODY = np.full((1, 1), np.nan)


def _measured(values: list[float], *, gain_db: float = 0.0, saturated: bool = False) -> MeasurementBlock:
    """E1 of a power that changes from epoch to epoch, one satellite with correlators of E6."""
    n = len(values)
    status = FrontEndBlock(
        agc_gain_db=np.full(n, gain_db), total_power_db=np.array(values), saturated=np.full(n, saturated)
    )
    taps = np.full((n, 1, 1), 20.0 + 0j)
    given_ = evidence((n, 1), front_end=dict.fromkeys(Band, status), taps=taps, noise_power=2.0, svids=(7,))
    e1 = replace(given_.measured.snapshots.e1, cn0_dbhz=np.array(values)[:, None] + 40.0)
    return replace(given_.measured, snapshots=replace(given_.measured.snapshots, e1=e1))


def _plain_medians(values: list[float], teaches: list[bool], before: list[float]) -> list[float]:
    """The rule written out: the median of the last quiet values before each epoch."""
    known, found = list(before), []
    for value, teach in zip(values, teaches, strict=True):
        found.append(float(np.median(known[-BASELINE_WINDOW:])) if len(known) >= LEARNED else np.nan)
        if teach and np.isfinite(value):
            known.append(value)
    return found


@given(
    st.lists(st.tuples(st.one_of(st.floats(-50, 50), st.just(float("nan"))), st.booleans()), min_size=1, max_size=60),
    st.integers(0, BASELINE_WINDOW),
)
def test_a_reference_is_the_median_of_the_last_quiet_values(steps: list[tuple[float, bool]], known: int) -> None:
    values, teaches = [value for value, _ in steps], [teach for _, teach in steps]
    before = list(np.linspace(-3, 3, known))
    baseline = Baseline(values={Quantity.E1_POWER_DB: {0: tuple(before)}})
    observed = Observed(measured=_measured(values, gain_db=np.nan))  # a gain that is known would stand for the power
    shape = (len(values), 1)
    found = observed.references(ReferenceLevels(), baseline, np.array(teaches), np.full(shape, np.nan))
    power = found[Quantity.E1_POWER_DB]
    np.testing.assert_array_equal(power.value, _plain_medians(values, teaches, before))
    after = observed.after(baseline, np.array(teaches)).of(Quantity.E1_POWER_DB, 0)
    taught = [value for value, teach in steps if teach and np.isfinite(value)]
    assert list(after) == (before + taught)[-BASELINE_WINDOW:]


def test_every_quantity_is_learned_for_each_satellite() -> None:
    observed = Observed(measured=_measured([1.0] * (LEARNED + 1)))
    n = LEARNED + 1
    found = observed.references(ReferenceLevels(), Baseline(), np.ones(n, bool), np.full((n, 1), np.nan))
    for quantity, reference in found.items():
        assert np.isnan(reference.value[:LEARNED]).all(), quantity
        assert reference.learned.ravel().tolist() == list(range(n))
        last = reference.value.ravel()[LEARNED]
        assert last == pytest.approx(observed.values[quantity].ravel()[0]), quantity
    after = observed.after(Baseline(), np.ones(n, bool))
    assert sorted(after.values[Quantity.FLOOR_DB]) == [7]
    assert sorted(after.values[Quantity.E6_POWER_DB]) == [0]


def test_what_the_settings_state_is_not_learned() -> None:
    elevation_rad = np.radians([[90.0], [30.0], [np.nan]])
    levels = ReferenceLevels(e1_power_db=2.0, antenna=Antenna(e1_dbhz=45.0, e6_dbhz=47.0, fall_db=10.0))
    found = Observed(measured=_measured([0.0] * 3)).references(levels, Baseline(), np.ones(3, bool), elevation_rad)
    assert found[Quantity.E1_POWER_DB].value.tolist() == [2.0] * 3
    np.testing.assert_allclose(found[Quantity.E1_CN0_DBHZ].value[:, 0], [45.0, 40.0, np.nan])
    np.testing.assert_allclose(found[Quantity.E6_CN0_DBHZ].value[:, 0], [47.0, 42.0, np.nan])
    assert np.isinf(found[Quantity.E1_CN0_DBHZ].learned).all()
    assert found[Quantity.E1_CN0_DBHZ].growth.tolist() == [[1.0]] * 3
    assert "elevation" in found[Quantity.E1_CN0_DBHZ].why_unknown((2, 0))
    flat = Antenna(e1_dbhz=40.0, e6_dbhz=42.0).expected_dbhz(40.0, NOBODY)
    assert flat.tolist() == [[40.0]], "without a fall no elevation is needed"


def test_saturation_teaches_nothing_and_a_gain_stands_for_an_unknown_power() -> None:
    assert np.isnan(Observed(measured=_measured([1.0], saturated=True)).values[Quantity.E1_POWER_DB]).all()
    assert Observed(measured=_measured([np.nan], gain_db=-20.0)).values[Quantity.E6_POWER_DB].tolist() == [20.0]


def test_the_floor_is_before_the_gain_and_without_the_signal() -> None:
    """|c|² = 400 over noise of 2: SNR 199, Ec/N0 199/81,840 chips."""
    floor = Observed(measured=_measured([0.0], gain_db=-3.0)).values[Quantity.FLOOR_DB]
    assert floor[0, 0] == pytest.approx(10 * np.log10(2.0 / (1 + 199 / 81_840)) + 3.0, abs=1e-9)
    nothing = evidence((1, 1)).measured
    assert np.isnan(Observed(measured=nothing).values[Quantity.FLOOR_DB]).all()
    assert np.isnan(Observed(measured=nothing).values[Quantity.E6_CN0_DBHZ]).all()
