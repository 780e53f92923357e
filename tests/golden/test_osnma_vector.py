"""OSNMA on the official test vector and on a recorded broadcast: the counts are those of an independent program.

The whole files are verified by the command line in a process of its own, which does not check types and is ten times
faster; what is changed on purpose is shorter and is done here.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from osnma_builder import make_page
from vestige.crypto.keys.key_file import read_key_file
from vestige.crypto.keys.public_key import PublicKey, Trust
from vestige.crypto.keys.public_key_file import load_public_keys
from vestige.crypto.osnma.messages.dsm import NmaHeader, parse_kroot
from vestige.crypto.osnma.messages.root_key import RootKey, verify_root_key
from vestige.crypto.osnma.messages.tesla import Chain, Key, validate
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.crypto.osnma.osnma_report import Count
from vestige.errors import AuthenticationError, VestigeError
from vestige.navigation.inav.page import InavPage
from vestige.recording.navigation.navigation_pages import read_pages
from vestige.time import GalileoTime

VECTOR = "test_vector_configuration_1_2023-08-16T0500.csv"
VECTOR_START = GalileoTime(1251, 277_201)
VECTOR_FILES = "test_vector_configuration_1_{}.xml"
RECORDED = "recorded_2025-12-12.sbf"
RECORDED_FILES = "recorded_2025-12-12_{}.xml"


def keys_of(folder: Path, files: str) -> tuple[PublicKey, ...]:
    return load_public_keys(folder / files.format("public_key"), folder / files.format("merkle_tree"))


def command_line(folder: Path, pages: str, files: str, output: Path) -> dict[str, Any]:
    """What `vestige osnma verify --json` says, with the path of its key file."""
    trust = [f"--{name.replace('_', '-')}={folder / files.format(name)}" for name in ("public_key", "merkle_tree")]
    arguments = ["osnma", "verify", str(folder / pages), *trust, "-o", str(output), "--json"]
    run = subprocess.run(  # noqa: S603  (our own program)
        [sys.executable, "-m", "vestige.cli.main", *arguments], capture_output=True, text=True, check=True
    )
    return json.loads(run.stdout) | {"output": output}


@pytest.fixture(scope="module")
def vector(osnma_data: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return command_line(osnma_data, VECTOR, VECTOR_FILES, tmp_path_factory.mktemp("vector") / "keys.csv")


@pytest.fixture(scope="module")
def recorded(osnma_data: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return command_line(osnma_data, RECORDED, RECORDED_FILES, tmp_path_factory.mktemp("recorded") / "keys.csv")


def at(week: int, second: int) -> dict[str, int]:
    return {"week": week, "second": second}


def second_and_hex(report: dict[str, Any], number: int) -> tuple[int, str]:
    return report["keys"][number]["time"]["second"], report["keys"][number]["key_hex"]


def roots_of(report: dict[str, Any], public_keys: tuple[PublicKey, ...]) -> list[RootKey]:
    return [
        verify_root_key(
            parse_kroot(bytes.fromhex(root["dsm_kroot"])),
            NmaHeader(int(root["nma_header"], 16)),
            public_keys,
            near=GalileoTime(**root["received_at"]),
        )
        for root in report["roots"]
    ]


def test_vector_pages(vector: dict[str, Any]) -> None:
    assert (vector["first_page"], vector["last_page"]) == (at(1251, 277_201), at(1251, 280_799))
    assert vector["pages"] == {"given": 46_800, "taken": 46_800, "crc_failures": 0, "alert": 0, "missing": 0}
    assert vector["subframes"] == {"OSNMA": 2171, "no OSNMA": 829, "dummy pages": 120}
    assert (len(vector["satellites"]), len(vector["osnma_satellites"])) == (26, 22)
    assert vector["time_stamps"] == {"ok": 17_400, "failed": 0}


def test_vector_root_key(vector: dict[str, Any], osnma_data: Path) -> None:
    (check,) = vector["roots"]
    assert check["verified"]
    assert (check["dsm_id"], check["nma_header"], check["pkid"], check["chain_id"]) == (7, "72", 1, 3)
    (root,) = roots_of(vector, keys_of(osnma_data, VECTOR_FILES))
    assert (root.kroot.n_blocks, root.parameters.mac_lookup) == (8, 33)
    assert root.parameters.alpha.hex() == "a06221261ad9"
    assert root.time == GalileoTime(1251, 277_170)
    assert root.data.hex() == "c72b9d4317a0c32b6cdcd7d9dc1f3751"
    assert root.public_key.trust is Trust.MERKLE_TREE


@pytest.mark.judged(by="official test vectors", what="OSNMA keys", figure="120 keys, 119 chain steps, 0 failed")
def test_vector_keys(vector: dict[str, Any]) -> None:
    assert len(vector["keys"]) == 120
    assert vector["chain_steps"] == {"ok": 119, "failed": 0}
    assert second_and_hex(vector, 0) == (277_200, "be7801d2d4eb75a7e686054a18c58141")
    assert second_and_hex(vector, 1) == (277_230, "ed2ba8f2cc11bda55d2e1283e405eff3")
    assert second_and_hex(vector, -1) == (280_770, "321763441855f4fb5b6137e6fbad4075")
    assert vector["keys"][0]["disclosed_at"] == at(1251, 277_222)
    assert vector["keys"][0]["complete_at"] == at(1251, 277_231)


@pytest.mark.judged(
    by="official test vectors",
    what="OSNMA tags and MACSEQ",
    figure="8536, 1065 and 2923 tags of the three kinds, 0 failed",
)
def test_vector_tags(vector: dict[str, Any]) -> None:
    assert vector["macseq"] == {"ok": 2152, "failed": 0}
    assert {adkd: (count["ok"], count["failed"]) for adkd, count in vector["tags"].items()} == {
        "0": (8536, 0),
        "4": (1065, 0),
        "12": (2923, 0),
    }
    assert vector["tags_not_counted"] == {"dummy": 8, "no_data": 102, "no_key": 392, "unsupported": 0}


def test_recorded_pages(recorded: dict[str, Any]) -> None:
    assert (recorded["first_page"], recorded["last_page"]) == (at(1372, 480_101), at(1372, 484_745))
    # The checksum fails for the same pages that failed the receiver's own check.
    assert (recorded["pages"]["taken"], recorded["pages"]["crc_failures"]) == (24_679, 436)
    assert recorded["subframes"] == {"OSNMA": 951, "no OSNMA": 679, "incomplete": 29}
    assert recorded["osnma_satellites"] == [4, 6, 13, 15, 18, 19, 21, 23, 27, 29, 30, 34]
    assert recorded["time_stamps"]["failed"] == 0
    expected = {"blocks": 50_277, "skipped_bytes": 26, "bad_blocks": 0, "e1b": 25_115, "e5b": 25_160, "mixed": 2}
    assert recorded["sbf"] == expected | {"other": 0, "no_time": 0}


def test_recorded_root_keys(recorded: dict[str, Any], osnma_data: Path) -> None:
    assert [root["dsm_id"] for root in recorded["roots"]] == [11, 0]
    assert [root["on_known_chain"] for root in recorded["roots"]] == [False, True]
    assert recorded["roots"][1]["received_at"]["second"] >= 482_490
    first, second = roots_of(recorded, keys_of(osnma_data, RECORDED_FILES))
    assert (first.time, first.data.hex()) == (GalileoTime(1372, 478_770), "ec7649a34f6d811393b8a3423648742e")
    assert (second.time, second.data.hex()) == (GalileoTime(1372, 482_370), "5c49326bfe2834feba5ae66e4507777d")
    equal = next(key for key in recorded["keys"] if key["time"]["second"] == 482_370)
    assert equal["key_hex"] == second.data.hex()
    assert {root.header.value for root in (first, second)} == {0x82}
    assert {root.parameters.mac_lookup for root in (first, second)} == {34}


@pytest.mark.judged(
    by="real recording",
    what="OSNMA keys of a recorded broadcast",
    figure="154 keys, 153 chain steps, 0 failed",
)
def test_recorded_keys(recorded: dict[str, Any]) -> None:
    assert len(recorded["keys"]) == 154
    assert recorded["chain_steps"] == {"ok": 153, "failed": 0}
    assert recorded["gaps"] == []
    assert second_and_hex(recorded, 0) == (480_120, "97f9530bd97bb91e8a3d15597b4a52f4")
    assert second_and_hex(recorded, 1) == (480_150, "99e1a6726c76723c4b4d8aae5de01d0f")
    assert second_and_hex(recorded, -1) == (484_710, "56fdea00f6a78a58111b5570436ff4e1")


@pytest.mark.judged(
    by="real recording",
    what="OSNMA tags of a recorded broadcast",
    figure="945 MACSEQ, 2788 tags of ADKD 0, 0 failed",
)
def test_recorded_tags(recorded: dict[str, Any]) -> None:
    assert recorded["macseq"] == {"ok": 945, "failed": 0}
    assert {adkd: (count["ok"], count["failed"]) for adkd, count in recorded["tags"].items()} == {
        "0": (2788, 0),
        "4": (451, 0),
        "12": (1233, 0),
    }
    assert recorded["tags_not_counted"] == {"dummy": 67, "no_data": 1041, "no_key": 126, "unsupported": 0}


@pytest.mark.parametrize("name", ["vector", "recorded"])
def test_nothing_is_wrong(request: pytest.FixtureRequest, name: str) -> None:
    report = request.getfixturevalue(name)
    assert (report["problems"], report["failures"], report["gaps"], report["withheld"]) == ([], [], [], [])


@pytest.mark.judged(by="real recording", what="DSM-KROOT with one wrong bit", figure="each one is refused")
@pytest.mark.parametrize(("name", "files"), [("vector", VECTOR_FILES), ("recorded", RECORDED_FILES)])
def test_no_bit_of_the_broadcast_root_keys_can_change(
    osnma_data: Path, request: pytest.FixtureRequest, name: str, files: str
) -> None:
    """Every bit of the whole DSM-KROOT (fields, key, signature, padding) and of the NMA header."""
    public_keys = keys_of(osnma_data, files)
    for root in roots_of(request.getfixturevalue(name), public_keys):
        message = root.kroot.serialise()
        for bit in range(8 * len(message)):
            changed = bytearray(message)
            changed[bit // 8] ^= 0x80 >> bit % 8
            with pytest.raises(VestigeError):
                verify_root_key(parse_kroot(bytes(changed)), root.header, public_keys, near=root.time)
        for bit in range(8):
            with pytest.raises(AuthenticationError):
                verify_root_key(root.kroot, NmaHeader(root.header.value ^ 1 << bit), public_keys, near=root.time)


@pytest.mark.parametrize("files", [VECTOR_FILES, RECORDED_FILES])
def test_no_digit_of_the_published_merkle_trees_and_keys_can_change(
    osnma_data: Path, tmp_path: Path, files: str
) -> None:
    names = ("public_key", "merkle_tree")
    texts = {name: (osnma_data / files.format(name)).read_text() for name in names}
    paths = {name: tmp_path / f"{name}.xml" for name in names}
    for name in names:
        paths[name].write_text(texts[name])
    (key,) = load_public_keys(paths["public_key"], paths["merkle_tree"])
    assert (key.pkid, key.trust) == (1 if files is VECTOR_FILES else 2, Trust.MERKLE_TREE)
    for name in names:
        for place in _hex_places(texts[name]):
            digit = f"{int(texts[name][place], 16) ^ 1 << place % 4:X}"
            paths[name].write_text(texts[name][:place] + digit + texts[name][place + 1 :])
            with pytest.raises(VestigeError):
                load_public_keys(paths["public_key"], paths["merkle_tree"])
        paths[name].write_text(texts[name])


def _hex_places(text: str) -> Iterator[int]:
    for tag in ("x_ji", "point"):
        at = -1
        while (at := text.find(f"<{tag}>", at + 1)) >= 0:
            yield from range(at + len(tag) + 2, text.index("</", at))


def test_no_bit_of_a_broadcast_key_can_change(vector: dict[str, Any], osnma_data: Path) -> None:
    (root,) = roots_of(vector, keys_of(osnma_data, VECTOR_FILES))
    keys = [Key(time=GalileoTime(**key["time"]), data=bytes.fromhex(key["key_hex"])) for key in vector["keys"]]
    for number in (0, 1, 60, 119):
        for bit in range(128):
            chain = Chain(root)
            validate(keys[0], chain)
            data = (int.from_bytes(keys[number].data, "big") ^ 1 << bit).to_bytes(16, "big")
            with pytest.raises(AuthenticationError, match="does not chain"):
                validate(Key(time=keys[number].time, data=data), chain)


def _flip_osnma(pages: Iterator[InavPage], wanted: Callable[[InavPage], int | None]) -> Iterator[InavPage]:
    """The pages, with one bit of the OSNMA field changed (and the checksum made good) where `wanted` says which."""
    for page in pages:
        bit = wanted(page)
        if bit is None or not any(page.osnma):
            yield page
        else:
            osnma = (int.from_bytes(page.osnma, "big") ^ 1 << (39 - bit)).to_bytes(5, "big")
            yield replace(page, data=make_page(page.svid, page.time, page.word, osnma).data)


def _in_page(page: InavPage, first: int, index: int) -> bool:
    return first <= page.time.second < first + 30 and page.time.second == first + 1 + 2 * index


@pytest.mark.parametrize("bit", [24, 39])  # of page 10: bits 336 and 351 of the MACK are the first ones of the key
def test_a_changed_bit_of_a_key_on_air_fails_with_the_reason(osnma_data: Path, bit: int) -> None:
    first_five_minutes = islice(read_pages(osnma_data / VECTOR, start=VECTOR_START), 26 * 150)
    pages = _flip_osnma(first_five_minutes, lambda page: bit if _in_page(page, 277_320, 10) else None)
    report = OsnmaReceiver(keys_of(osnma_data, VECTOR_FILES)).process_all(pages)
    assert len(report.keys) == 9
    assert report.chain_steps == Count(ok=8, failed=1)
    with pytest.raises(AuthenticationError, match=r"1251:277320 key: E02.* does not chain to"):
        report.raise_if_failed()


@pytest.mark.parametrize("page_index", [2, 6, 14])
def test_a_changed_bit_of_the_root_key_on_air_leaves_nothing(osnma_data: Path, page_index: int) -> None:
    pages = _flip_osnma(
        islice(read_pages(osnma_data / VECTOR, start=VECTOR_START), 26 * 75),
        lambda page: 7 if page.time.second % 30 == 1 + 2 * page_index else None,
    )
    report = OsnmaReceiver(keys_of(osnma_data, VECTOR_FILES)).process_all(pages)
    assert report.keys == ()
    with pytest.raises(AuthenticationError):
        report.raise_if_failed()


def test_a_wrong_start_time_is_not_believed(osnma_data: Path) -> None:
    pages = islice(read_pages(osnma_data / VECTOR, start=GalileoTime(1251, 277_231)), 26 * 75)
    report = OsnmaReceiver(keys_of(osnma_data, VECTOR_FILES)).process_all(pages)
    assert report.keys == ()
    assert report.time_stamps.ok == 0


def test_keys_of_the_other_operation_are_refused(osnma_data: Path) -> None:
    report = OsnmaReceiver(keys_of(osnma_data, VECTOR_FILES)).process_all(
        islice(read_pages(osnma_data / RECORDED), 4000)
    )
    assert report.keys == ()
    with pytest.raises(AuthenticationError, match="PKID 2, which was not given"):
        report.raise_if_failed()


@pytest.mark.parametrize(("name", "files"), [("vector", VECTOR_FILES), ("recorded", RECORDED_FILES)])
def test_the_key_file_proves_itself(osnma_data: Path, request: pytest.FixtureRequest, name: str, files: str) -> None:
    report = request.getfixturevalue(name)
    keys = read_key_file(report["output"], keys_of(osnma_data, files))
    assert [key.data.hex() for key in keys] == [key["key_hex"] for key in report["keys"]]
    assert {key.disclosed_at - key.time for key in keys} == {22}
