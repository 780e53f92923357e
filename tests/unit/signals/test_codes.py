from __future__ import annotations

import numpy as np
import pytest

from vestige.signals.codes import N_CODES, primary_code, secondary_code, tiered_code
from vestige.signals.definitions import ALL_SIGNALS, E1B, E1C, E6B, E6C, SignalDefinition


@pytest.mark.parametrize(
    ("signal", "first"),
    [(E1B, "F5D710130573541B"), (E1C, "B39340CA1C817D81"), (E6B, "E6648AA5EFF0907A"), (E6C, "F5A3D656F9DAC534")],
    ids=lambda value: getattr(value, "name", value),
)
def test_first_digits_of_satellite_1(signal: SignalDefinition, first: str) -> None:
    bits = (primary_code(signal, 1)[:64] < 0).astype(np.uint8)
    assert np.packbits(bits).tobytes().hex().upper() == first


@pytest.mark.parametrize("signal", ALL_SIGNALS, ids=lambda signal: signal.name)
def test_every_code_is_balanced(signal: SignalDefinition) -> None:
    """Every E1 code sums to 0, every E6 code to +1."""
    for svid in range(1, N_CODES + 1):
        code = primary_code(signal, svid)
        assert code.size == signal.code_length
        assert set(np.unique(code)) == {-1, 1}
        assert code.sum(dtype=int) == (0 if signal in (E1B, E1C) else 1)


def test_secondary_codes() -> None:
    bits = "".join("01"[int(chip < 0)] for chip in secondary_code(E1C, 12))
    assert bits == "0011100000001010110110010"
    assert np.array_equal(secondary_code(E6B, 3), [1])
    assert len({secondary_code(E6C, svid).tobytes() for svid in range(1, 51)}) == 50


def test_tiered_code_repeats_the_primary_code_with_the_secondary_sign() -> None:
    tiered = tiered_code(E6C, 11).reshape(100, 5115)
    assert np.array_equal(tiered, secondary_code(E6C, 11)[:, None] * primary_code(E6C, 11)[None, :])


@pytest.mark.parametrize("svid", [0, 51, -1])
def test_no_such_satellite(svid: int) -> None:
    with pytest.raises(ValueError, match="SVID"):
        primary_code(E1B, svid)


def test_codes_cannot_be_changed_by_accident() -> None:
    with pytest.raises(ValueError, match="read-only"):
        primary_code(E1B, 1)[0] = 1


def test_e1_e6_alignment() -> None:
    """Both bands' tiered codes last 100 ms, so they start together with every tenth of a second."""
    assert E1C.period_s * E1C.secondary_length == pytest.approx(0.1)
    assert E6C.period_s * E6C.secondary_length == pytest.approx(0.1)
