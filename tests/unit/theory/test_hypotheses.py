from __future__ import annotations

import numpy as np
import pytest

from vestige.theory.hypotheses import (
    code_offsets,
    doppler_bins,
    effective_taps,
    exhaustive_hypotheses,
    handover_hypotheses,
)


def test_exhaustive_search_counts_every_offset_and_bin() -> None:
    assert code_offsets(30.0) == pytest.approx(30 * 5.115e6 * 2)
    assert [doppler_bins(10e3, t) for t in (4e-3, 8e-3, 16e-3)] == pytest.approx([80, 160, 320])
    assert exhaustive_hypotheses(30.0, 4e-3, 10e3) == pytest.approx(30 * 5.115e6 * 2 * 80)


def test_one_period_of_e1() -> None:
    # 4092 chips, two offsets each, 80 bins
    assert exhaustive_hypotheses(4e-3, 4e-3, 10e3, 1 / 1.023e6) == pytest.approx(4092 * 2 * 80)


def test_handover_counts_one_position_a_code_period() -> None:
    assert handover_hypotheses(30.0) == pytest.approx(7500)
    assert handover_hypotheses(30.0, taps=11) == pytest.approx(82_500)


@pytest.mark.parametrize(("pfa", "expected"), [(1e-2, 8.5), (1e-3, 9.4), (1e-4, 10.0), (1e-7, 10.7)])
def test_effective_taps_of_the_papers_bank(pfa: float, expected: float) -> None:
    assert effective_taps(pfa, 11, 1 - 15 / 58.6105) == pytest.approx(expected, abs=0.05)


def test_effective_taps_at_both_ends() -> None:
    pfa = np.array([1e-2, 1e-7])
    np.testing.assert_allclose(effective_taps(pfa, 11, 0.0), 11 - 10 * pfa)  # independent neighbours coincide by chance
    assert effective_taps(1e-3, 11, 0.999999) == pytest.approx(1.0, abs=0.05)  # one and the same
    with pytest.raises(ValueError, match="correlation"):
        effective_taps(1e-3, 11, 1.0)
