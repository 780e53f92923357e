"""The packaged codes against an independent text table of the published codes, bit for bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from vestige.signals.codes import primary_code, secondary_code
from vestige.signals.definitions import E1B, E1C, E6B, E6C


@pytest.mark.judged(by="published code tables", what="codes of E1 and E6", figure="50 satellites, bit for bit")
def test_all_published_codes(code_tables: Path) -> None:
    signals = {
        "E1B": (primary_code, E1B),
        "E1C": (primary_code, E1C),
        "E6B": (primary_code, E6B),
        "E6C": (primary_code, E6C),
    }
    signals |= {"CS25": (secondary_code, E1C), "CS100": (secondary_code, E6C)}
    compared = 0
    for line in (code_tables / "galileo_memory_codes.txt").read_text().splitlines():
        if line.startswith("#") or not line.strip():
            continue
        component, svid, length, digits = line.split()
        bits = np.unpackbits(np.frombuffer(bytes.fromhex(digits + "0" * (len(digits) % 2)), np.uint8))[: int(length)]
        code, signal = signals[component]
        assert np.array_equal(code(signal, int(svid)) < 0, bits == 1), line[:20]
        compared += 1
    assert compared == 4 * 50 + 50 + 1
