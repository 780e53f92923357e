"""All 256 values of a header that nobody signed, after each of the seven kinds of withdrawal: no key comes back."""

from __future__ import annotations

import pytest

from withdrawal_builder import KINDS, START, WITHDRAWN_AT, forged_subframes, nominal, received, withdrawal


@pytest.mark.judged(
    by="ICD",
    what="unsigned OSNMA headers",
    figure="none of the 256 headers brings a withdrawn key back",
)
@pytest.mark.parametrize("saw_the_root_key_before", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_no_header_brings_keys_back(kind: str, saw_the_root_key_before: bool) -> None:
    """The first 16 forged subframes send old root keys again; the 256 after them have a value of the header each."""
    told = withdrawal(kind)
    first = WITHDRAWN_AT + len(told)
    forged = forged_subframes(first)
    assert len(forged) == 16 + 256
    receiver, times = received([*(nominal() if saw_the_root_key_before else []), *told, *forged])
    known_from = START + 30 * (first - 1)
    assert all(time < known_from for time in times)
    report = receiver.report()
    if saw_the_root_key_before:
        assert len(report.withheld) >= len(forged)
        assert {START + 30 * k for k in range(WITHDRAWN_AT)} <= times
