from __future__ import annotations

import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.crypto.recs import group_delay
from vestige.crypto.recs.group_delay import (
    GroupDelayConvention,
    GroupDelayFile,
    GroupDelayScale,
    inter_frequency_delay_s,
)
from vestige.crypto.recs.recs_name import time_of_deciseconds
from vestige.errors import InputFileError, UnsupportedError, VestigeError
from vestige.records import GroupDelay
from vestige.time import GalileoTime

PATH = Path("some.BGD")
VALID_FROM = GalileoTime(1251, 277216)


def by_hand(values: dict[int, int], n_bytes: int = 191) -> bytes:
    """Return a BGD file built field by field from the reference's table; the first 16 bytes as in a unitary RECS."""
    mask = sum(1 << (160 - svid) for svid in values).to_bytes(20, "big")
    slots = b"".join(struct.pack("<h", values.get(svid, 0)) for svid in range(1, 37))
    return (b"GSCX\x01\x04\xe3\x2a\x4c\xc0" + bytes(6) + mask + b"\x12" * 36 + slots).ljust(n_bytes, b"\0")


def test_known_value() -> None:
    file = group_delay.parse_group_delay_file(by_hand({1: -1, 14: 192, 36: 511}), PATH)
    assert file.valid_from == VALID_FROM
    assert [delay.svid for delay in file.delays] == [1, 14, 36]
    assert file.delays[1].bgd_e1_e6_s == pytest.approx(44.70e-9, abs=0.005e-9)
    assert file.delays[1].bgd_e1_e6_s * SPEED_OF_LIGHT_MPS == pytest.approx(13.40, abs=0.005)
    assert file.delays[0].bgd_e1_e6_s == -(2.0**-32)


values = st.dictionaries(st.integers(1, 36), st.integers(-512, 511))
times = st.builds(time_of_deciseconds, st.integers(0, 4095), st.integers(0, 6_047_999))


@given(values, times, st.binary(min_size=6, max_size=6))
def test_round_trip(raw: dict[int, int], time: GalileoTime, validity: bytes) -> None:
    delays = tuple(GroupDelay(svid=svid, bgd_e1_e6_s=raw[svid] * 2.0**-32, valid_from=time) for svid in sorted(raw))
    file = GroupDelayFile(provider="GSCX", valid_from=time, delays=delays, validity=validity)
    assert (
        group_delay.parse_group_delay_file(group_delay.serialize_group_delay_file(file), PATH, reference=time) == file
    )


@given(values)
def test_writer_agrees_with_the_table(raw: dict[int, int]) -> None:
    delays = tuple(GroupDelay(svid=svid, bgd_e1_e6_s=raw[svid] * 2.0**-32, valid_from=VALID_FROM) for svid in raw)
    assert group_delay.serialize_group_delay_file(
        GroupDelayFile(provider="GSCX", valid_from=VALID_FROM, delays=delays)
    ) == by_hand(raw)


def test_write_and_read(tmp_path: Path) -> None:
    delays = [GroupDelay(svid=svid, bgd_e1_e6_s=svid * 1e-9, valid_from=VALID_FROM) for svid in (30, 2)]
    path = group_delay.write_group_delay_file(delays, tmp_path)
    assert path.name == "GSCX01_232280500160.BGD"
    read = group_delay.parse_group_delay_file(path.read_bytes(), path).delays
    assert [delay.svid for delay in read] == [2, 30]
    assert [delay.bgd_e1_e6_s for delay in read] == pytest.approx([2e-9, 30e-9], abs=2.0**-33)


@pytest.mark.parametrize(
    ("offset", "change", "message"),
    [
        (0, b"GS-X", "byte 0: provider"),
        (7, b"\x5c\x49\x00", "time of week"),
        (20, b"\x08", "satellite mask: found SVID 37"),
        (40, b"\x13", "byte 36: filling"),
        (98, b"\x00\x02", "value of SVID 14: found 512"),
        (98, b"\xff\xfd", "value of SVID 14: found -513"),
    ],
)
def test_field_that_cannot_be(offset: int, change: bytes, message: str) -> None:
    data = by_hand({14: 192})
    with pytest.raises(InputFileError, match=message):
        group_delay.parse_group_delay_file(data[:offset] + change + data[offset + len(change) :], PATH)


def test_unknown_interface_version() -> None:
    data = by_hand({14: 192})
    with pytest.raises(UnsupportedError, match="interface version 2"):
        group_delay.parse_group_delay_file(data[:4] + b"\x02" + data[5:], PATH)


def test_truncated() -> None:
    data = by_hand({14: 192, 31: 5})
    for n_bytes in range(72 + 2 * 31):
        with pytest.raises(InputFileError):
            group_delay.parse_group_delay_file(data[:n_bytes], PATH)
    assert group_delay.parse_group_delay_file(data[: 72 + 2 * 31], PATH) == group_delay.parse_group_delay_file(
        data, PATH
    )


@given(st.binary(max_size=300), st.dictionaries(st.integers(0, 190), st.integers(0, 255), max_size=4))
def test_garbage(data: bytes, changes: dict[int, int]) -> None:
    damaged = bytearray(by_hand({14: 192, 30: -3}))
    for offset, value in changes.items():
        damaged[offset] = value
    for candidate in (data, bytes(damaged)):
        delays, message = (), ""
        try:
            delays = group_delay.parse_group_delay_file(candidate, PATH).delays
        except VestigeError as error:
            message = str(error)
        assert not message or message.startswith("some.BGD: ")
        assert "\n" not in message
        assert all(abs(delay.bgd_e1_e6_s) < 120e-9 for delay in delays)


@pytest.mark.parametrize(
    "delays",
    [
        [],
        [GroupDelay(svid=1, bgd_e1_e6_s=200e-9, valid_from=VALID_FROM)],
        [GroupDelay(svid=37, bgd_e1_e6_s=0.0, valid_from=VALID_FROM)],
        [GroupDelay(svid=1, bgd_e1_e6_s=0.0, valid_from=VALID_FROM)] * 2,
        [GroupDelay(svid=svid, bgd_e1_e6_s=0.0, valid_from=VALID_FROM + svid) for svid in (1, 2)],
    ],
)
def test_what_does_not_fit_is_not_written(tmp_path: Path, delays: list[GroupDelay]) -> None:
    with pytest.raises(ValueError, match="BGD file"):
        group_delay.write_group_delay_file(delays, tmp_path)


def test_hand_over_vector() -> None:
    # 40 TECU and BGD -2.5 ns, from the model reference: I1 = 6.494898 m, I6 = 9.858112 m, P6 - P1 = 2.975115 m.
    ionosphere_e1_m, ionosphere_e6_m = (40.3 * 40e16 / (f0 * 10.23e6) ** 2 for f0 in (154, 125))
    assert (ionosphere_e1_m, ionosphere_e6_m) == pytest.approx((6.494898, 9.858112), abs=1e-6)
    difference = ionosphere_e6_m - ionosphere_e1_m + SPEED_OF_LIGHT_MPS * inter_frequency_delay_s(-2.5e-9)
    assert difference == pytest.approx(2.975115, abs=1e-6)


def test_definition_by_the_two_group_delays() -> None:
    # BGD(f1,f2) = (T_R1 - T_R2) / (1 - (f1/f2)^2), inverted.
    t_r1, t_r6 = 3e-9, 8e-9
    bgd = (t_r1 - t_r6) / (1 - (1575.42 / 1278.75) ** 2)
    assert bgd > 0
    assert inter_frequency_delay_s(bgd) == pytest.approx(t_r6 - t_r1, rel=1e-12)  # a larger BGD makes E6 later


def test_other_conventions() -> None:
    file_value = GroupDelayConvention(scale=GroupDelayScale.FILE_VALUE)
    assert inter_frequency_delay_s(4e-9, file_value) == 4e-9
    assert inter_frequency_delay_s(4e-9, GroupDelayConvention(sign=-1)) == -inter_frequency_delay_s(4e-9)
    with pytest.raises(ValueError, match="1 or -1"):
        GroupDelayConvention(sign=0)
