from __future__ import annotations

import dataclasses
import itertools
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from builders import validated_key
from vestige.crypto.recs import recs_file
from vestige.crypto.recs import recs_segment as recs
from vestige.crypto.recs.recs_file import RecsFile, RecsFileKind
from vestige.crypto.recs.recs_name import time_of_deciseconds
from vestige.crypto.recs.recs_segment import LENGTHS, SegmentLength
from vestige.errors import InputFileError, UnsupportedError, VestigeError
from vestige.records import ChipSequence
from vestige.time import GalileoTime

KEY = bytes(range(16))
START = GalileoTime(1251, 277216)
PATH = Path("renamed")  # a name that says nothing

flags = st.integers(0, 1)
starts = st.builds(time_of_deciseconds, st.integers(0, 4095), st.integers(0, 6_047_999))
common = {"start": starts, "svid": st.integers(1, 36), "key_delay": flags, "random_offset": flags,
          "file_version": st.integers(0, 255)}  # fmt: skip


@st.composite
def unitary_files(draw: st.DrawFn) -> RecsFile:
    return draw(
        st.builds(
            RecsFile, kind=st.just(RecsFileKind.UNITARY), provider=st.from_regex(r"[A-Z0-9]{4}", fullmatch=True),
            n_chip_code=st.just(0), body=st.binary(min_size=640, max_size=640), reserved=st.integers(0, 15), **common,
        )
    )  # fmt: skip


@st.composite
def aggregated_files(draw: st.DrawFn) -> RecsFile:
    count, period = draw(st.integers(1, 4)), draw(st.integers(1, 65_535))
    duration = draw(st.integers((count - 1) * period + 1, count * period))
    return draw(
        st.builds(
            RecsFile,
            kind=st.just(RecsFileKind.AGGREGATED),
            provider=st.from_regex(r"[A-Z0-9]{1,8}", fullmatch=True),
            n_chip_code=st.just(0),
            body=st.binary(min_size=640 * count, max_size=640 * count),
            reserved=st.integers(0, 255),
            duration_ds=st.just(duration),
            period_ds=st.just(period),
            **common,
        )
    )


files = st.one_of(unitary_files(), aggregated_files())
UNITARY_FILE = RecsFile(
    kind=RecsFileKind.UNITARY,
    provider="GSCX",
    start=START,
    svid=11,
    key_delay=0,
    random_offset=0,
    n_chip_code=0,
    body=bytes(640),
)
A_UNITARY = recs_file.serialize_recs_file(UNITARY_FILE)
AN_AGGREGATE = recs_file.serialize_recs_file(
    dataclasses.replace(UNITARY_FILE, kind=RecsFileKind.AGGREGATED, body=bytes(3 * 640), duration_ds=900, period_ds=300)
)


def random_chips(length: SegmentLength, time: GalileoTime) -> ChipSequence:
    chips = np.random.default_rng(time.second).choice(np.array([-1, 1], np.int8), length.n_chips)
    return ChipSequence.of(svid=11, transmit_time=time, chip_rate_hz=5.115e6, chips=chips)


@given(files)
def test_every_field_survives(file: RecsFile) -> None:
    data = recs_file.serialize_recs_file(file)
    assert recs_file.parse_recs_file(data, PATH, reference=file.start) == file
    assert recs_file.parse_recs_file(data, Path(str(file.name)), reference=file.start) == file


@pytest.mark.parametrize(
    ("length", "kind", "key_delay"), list(itertools.product(LENGTHS, RecsFileKind, (0, 1))), ids=str
)
def test_write_read_decrypt(tmp_path: Path, length: SegmentLength, kind: RecsFileKind, key_delay: int) -> None:
    times = [START + 30 * i for i in range(3 if kind is RecsFileKind.AGGREGATED else 1)]
    chips = [random_chips(length, time) for time in times]
    segments = [recs.encrypt(sequence, KEY, key_delay=key_delay, random_offset=1) for sequence in chips]
    path = recs_file.write_recs_file(recs_file.from_segments(segments), tmp_path)
    file = recs_file.read_recs_file(path)
    assert file.kind is kind
    assert file.n_chip_code == length.code
    assert file.segments == tuple(segments)
    for segment, sequence in zip(file.segments, chips, strict=True):
        time = segment.key_time
        key = validated_key(time, KEY)
        decrypted = recs.decrypt(segment, key)
        assert (decrypted.svid, decrypted.transmit_time) == (11, sequence.transmit_time)
        np.testing.assert_array_equal(decrypted.chips, sequence.chips)


def test_week_rolls_over_inside_an_aggregate() -> None:
    start = time_of_deciseconds(1251, 6_048_000 - 305)  # 30.5 s before the week's end
    file = RecsFile(kind=RecsFileKind.AGGREGATED, provider="GSCX", start=start, svid=1, key_delay=1, random_offset=0,
                    n_chip_code=0, body=bytes(3 * 640), duration_ds=900, period_ds=300)  # fmt: skip
    assert [(s.transmit_time, s.key_time) for s in file.segments] == [
        (GalileoTime(1251, 604_769, 0.5), GalileoTime(1251, 604_770)),
        (GalileoTime(1251, 604_799, 0.5), GalileoTime(1252, 0)),
        (GalileoTime(1252, 29, 0.5), GalileoTime(1252, 30)),
    ]


@pytest.mark.parametrize(
    ("week", "reference", "expected"),
    [(1251, None, 1251), (1251, 1200, 1251), (4095, 4096, 4095), (0, 4095, 4096), (5, 8190, 8197), (4095, 1, 4095)],
)
def test_twelve_bit_week_is_the_nearest_to_the_reference(week: int, reference: int | None, expected: int) -> None:
    assert recs_file.resolve_week(week, None if reference is None else GalileoTime(reference, 0)) == expected


def test_name_resolves_the_twelve_bit_week(tmp_path: Path) -> None:
    start = GalileoTime.parse("2078-06-01T00:00:16")  # after week 4095
    file = dataclasses.replace(recs_file.parse_recs_file(A_UNITARY, PATH), start=start)
    path = recs_file.write_recs_file(file, tmp_path)
    assert recs_file.read_recs_file(path).start == start
    assert recs_file.parse_recs_file(path.read_bytes(), PATH).start.week == start.week - 4096


def test_content_decides_not_the_suffix() -> None:
    assert recs_file.parse_recs_file(A_UNITARY, Path("a.bin")).kind is RecsFileKind.UNITARY
    assert recs_file.parse_recs_file(AN_AGGREGATE, Path("a.RCS")).kind is RecsFileKind.AGGREGATED


@pytest.mark.parametrize(
    "name",
    [
        "GSCX01_232280500160_12_0_0_01.RCS",
        "GSCX01_232280500160_11_1_0_01.RCS",
        "GSCX01_232280500161_11_0_0_01.RCS",
        "GSCY01_232280500160_11_0_0_01.RCS",
        "01_232280500160_000090_00300_11_0_0_0_01.bin",
    ],
)
def test_name_that_disagrees_with_the_header(name: str) -> None:
    with pytest.raises(InputFileError, match=r"expected GSCX01_232280500160_11_0_0_01\.RCS as the header says"):
        recs_file.parse_recs_file(A_UNITARY, Path(name))


UNITARY_FAULTS = [
    (0, b"GS/X", "provider"), (0, b"GSC\0", "provider: length"), (5, b"\x04\xe3\x5c\x49\x00", "ATOW"),
    (10, b"\x00", "SVID"), (10, b"\x25", "SVID"),
    (11, b"\x02", "KDI"), (12, b"\x02", "RAND"), (14, b"\x00\x11", "HeaderLength"),
]  # fmt: skip
AGGREGATED_FAULTS = [
    (0, bytes(8), "provider"), (0, b"GS\0X", "provider"), (12, b"\x5c\x49\x00", "ATOW"), (15, bytes(3), "tDur"),
    (15, b"\x00\x03\x85", "body"), (18, b"\x00", "SVID"), (19, b"\x02", "KDI"), (20, b"\x02", "RAND"),
    (21, b"\x05", "NChip"),
    (21, b"\x01", "body"), (22, bytes(2), "RTBA"), (22, b"\x01\x2b", "body"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("data", "offset", "change", "place"),
    [(A_UNITARY, *fault) for fault in UNITARY_FAULTS] + [(AN_AGGREGATE, *fault) for fault in AGGREGATED_FAULTS],
)
def test_field_that_cannot_be(data: bytes, offset: int, change: bytes, place: str) -> None:
    damaged = data[:offset] + change + data[offset + len(change) :]
    with pytest.raises(InputFileError) as caught:
        recs_file.parse_recs_file(damaged, PATH)
    assert place in caught.value.place


@pytest.mark.parametrize(("data", "offset"), [(A_UNITARY, 4), (AN_AGGREGATE, 8)])
def test_unknown_interface_version(data: bytes, offset: int) -> None:
    with pytest.raises(UnsupportedError, match="interface version 2 is not known"):
        recs_file.parse_recs_file(data[:offset] + b"\x02" + data[offset + 1 :], PATH)


@pytest.mark.parametrize("data", [A_UNITARY, AN_AGGREGATE], ids=["unitary", "aggregated"])
def test_no_truncated_file_is_read(data: bytes) -> None:
    for n_bytes in range(len(data)):
        with pytest.raises(InputFileError):
            recs_file.parse_recs_file(data[:n_bytes], PATH)


def reads_or_says_why(data: bytes) -> None:
    """Check that garbage is one clear line, or a file that is exactly these bytes."""
    file, message = None, ""
    try:
        file = recs_file.parse_recs_file(data, PATH)
    except VestigeError as error:
        message = str(error)
    if file is None:
        assert message.startswith("renamed: ")
        assert "\n" not in message
    else:
        assert recs_file.serialize_recs_file(file) == data
        assert len(file.segments) == file.n_segments


@given(st.binary(max_size=1000))
def test_garbage(data: bytes) -> None:
    reads_or_says_why(data)


@given(st.sampled_from([A_UNITARY, AN_AGGREGATE]), st.dictionaries(st.integers(0, 24), st.integers(0, 255), max_size=4),
       st.integers(-700, 700))  # fmt: skip
def test_damaged_header(data: bytes, changes: dict[int, int], grow: int) -> None:
    damaged = bytearray(data)
    for offset, value in changes.items():
        damaged[offset] = value
    reads_or_says_why(bytes(damaged[:grow] if grow < 0 else damaged + bytes(grow)))


def test_file_that_is_not_there(tmp_path: Path) -> None:
    for path in (tmp_path / "missing.bin", tmp_path):
        with pytest.raises(InputFileError, match="file: found"):
            recs_file.read_recs_file(path)


@pytest.mark.parametrize(
    "change",
    [
        {"svid": 0}, {"provider": "GS"}, {"provider": "G/CX"}, {"body": bytes(639)}, {"key_delay": 2},
        {"period_ds": 300},
        {"reserved": 16}, {"start": GalileoTime(1251, 0, 0.05)}, {"file_version": 256}, {"interface_version": 2},
    ],
)  # fmt: skip
def test_what_does_not_fit_is_not_written(change: dict[str, int]) -> None:
    with pytest.raises(ValueError, match=r"found|whole number of deciseconds"):
        recs_file.serialize_recs_file(dataclasses.replace(UNITARY_FILE, **change))


@pytest.mark.parametrize(
    "change", [{"svid": 12}, {"key_delay": 1}, {"transmit_time": START + 31}, {"transmit_time": START}]
)
def test_unlike_segments_do_not_share_a_file(change: dict[str, int]) -> None:
    (first,) = UNITARY_FILE.segments
    second = dataclasses.replace(first, transmit_time=START + 30)
    third = dataclasses.replace(second, **{"transmit_time": START + 60, **change})
    with pytest.raises(ValueError, match="segments of one file"):
        recs_file.from_segments([first, second, third])
    with pytest.raises(ValueError, match="equal intervals"):
        recs_file.from_segments([first, first])


def test_a_file_of_forty_gigabytes_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = recs_file.write_recs_file(UNITARY_FILE, tmp_path)
    os.truncate(path, 40_000_000_000)  # sparse: the disk has some kB of it
    assert recs_file.MAX_RECS_FILE_BYTES == 25 + 86_400 * 10_240  # a day of RECS of 16 ms, one a second
    with pytest.raises(InputFileError, match="length: found 40000000000 bytes, expected at most 884736025 bytes"):
        recs_file.read_recs_file(path)
