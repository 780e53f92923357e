from __future__ import annotations

import dataclasses
import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from builders import validated_key
from osnma_builder import Broadcast
from signed_files import sign_files
from simulated_chain import SimulatedChain, make_chain
from vestige.crypto.keys.key_file import write_key_file
from vestige.crypto.osnma.messages.dsm import NmaHeader
from vestige.crypto.osnma.operator.signed_messages import sign_kroot
from vestige.crypto.recs import recs_file
from vestige.crypto.recs import recs_segment as recs
from vestige.crypto.recs.file_signature import SignatureStatus
from vestige.crypto.recs.recs_name import time_of_deciseconds
from vestige.errors import AuthenticationError, InputFileError, VestigeError
from vestige.navigation.inav.page import InavPage
from vestige.recording.assistance.assistance_files import FileKind
from vestige.recording.assistance.assistance_writer import write_assistance
from vestige.recording.assistance.folder import AssistanceFolder, read_assistance
from vestige.recording.assistance.growing_assistance import GrowingAssistance
from vestige.recording.samples.test_vector_csv import HEADER
from vestige.records import Assistance, ChipSequence, EncryptedSegment, GroupDelay, ReceivedOsnma
from vestige.time import GalileoTime

START = GalileoTime(1251, 604_700)  # the week ends within the segments
SERVER_KEY = ec.derive_private_key(0x1234567, ec.SECP256R1())
TRUST = "osnma.pem"


def random_chips(svid: int, time: GalileoTime) -> ChipSequence:
    chips = np.random.default_rng(svid).choice(np.array([-1, 1], np.int8), 5115)
    return ChipSequence.of(svid=svid, transmit_time=time, chip_rate_hz=5.115e6, chips=chips)


def segment_of(chain: SimulatedChain, svid: int, time: GalileoTime, key_delay: int = 0) -> EncryptedSegment:
    keys = {key.time: key.data for key in chain.keys}
    return recs.encrypt(random_chips(svid, time), keys[recs.key_time(time, key_delay)], key_delay=key_delay)


@pytest.fixture(scope="module")
def chain() -> SimulatedChain:
    return make_chain(b"test of the assistance folder", START, 12)


@pytest.fixture(scope="module")
def assistance(chain: SimulatedChain) -> Assistance:
    segments = [segment_of(chain, svid, START + 30 * i + 0.5) for i in range(5) for svid in (3, 11)]
    segments.append(segment_of(chain, 11, START + 203, key_delay=1))  # stands alone: a unitary file
    return Assistance(
        segments=tuple(segments),
        group_delays=tuple(GroupDelay(svid=svid, bgd_e1_e6_s=svid * 2.0**-32, valid_from=START) for svid in (3, 11)),
        keys=chain.validated_keys(),
        received=tuple(ReceivedOsnma(svid=None, time=key.time, key=key.data) for key in chain.keys),
        hardware_bias_e1_e6_s=-6.87e-8,
        ionosphere_e1_m={3: 2.5, 11: 4.0},
    )


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory, chain: SimulatedChain, assistance: Assistance) -> Path:
    folder = tmp_path_factory.mktemp("original")
    sign_files(write_assistance(folder, assistance, roots=[chain.root]), SERVER_KEY)
    point = chain.private_key.public_key()
    (folder / TRUST).write_bytes(point.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    return folder


@pytest.fixture
def folder(original: Path, tmp_path: Path) -> Path:
    """Return a folder that the test may damage."""
    return Path(shutil.copytree(original, tmp_path / "folder"))


@pytest.fixture
def certificate(tmp_path: Path) -> Path:
    path = tmp_path / "server.pem"
    path.write_bytes(SERVER_KEY.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    return path


def complete(result: AssistanceFolder, assistance: Assistance) -> bool:
    return result.assistance == assistance and not result.problems


def test_write_and_read(folder: Path, assistance: Assistance) -> None:
    names = sorted(path.name for path in folder.iterdir() if not path.name.endswith(".p256"))
    assert [name for name in names if name.endswith((".bin", ".RCS", ".BGD"))] == [
        "01_232312358205_000150_00300_03_0_0_0_01.bin",
        "01_232312358205_000150_00300_11_0_0_0_01.bin",
        "GSCX01_232312358200.BGD",
        "GSCX01_232320001430_11_1_0_01.RCS",
    ]
    result = read_assistance(folder)
    assert complete(result, assistance)
    assert result.missing == ("signatures: 4 files have no verified signature of the server",)


def write_pages(path: Path, pages: Sequence[InavPage]) -> None:
    digits = {svid: "".join(page.data.hex() for page in pages if page.svid == svid) for svid in {p.svid for p in pages}}
    lines = [f"{svid:02d},{4 * len(text)},{text}" for svid, text in sorted(digits.items())]
    path.write_text("\n".join([HEADER, *lines]))


def test_a_withdrawal_in_the_pages_holds_for_the_key_file_too(folder: Path, chain: SimulatedChain) -> None:
    """`keys.csv` has all keys of a chain of which the pages tell that it must not be used: signed, in subframe 7."""
    header = NmaHeader(0xC0 | chain.header.value)
    kroot = sign_kroot(chain.kroot, header, chain.private_key).serialise()
    first = chain.keys[0].time
    true, told = Broadcast(chain), Broadcast(chain, header=header.value, dsm_of=lambda _svid: kroot)
    pages = [page for page in true.pages() if page.time < first + 120]
    pages += [page for page in told.pages() if page.time >= first + 120]
    write_pages(folder / "pages.csv", pages)
    result = read_assistance(folder)
    # The headers of subframes 4 to 6 are not signed. They withhold keys in the pages, but prove nothing of the file.
    assert [key.time for key in result.assistance.keys] == [first + 30 * k for k in range(7)]
    assert any("keys.csv: 5 keys are not used" in str(problem) for problem in result.problems)
    # Whoever follows the recording reads the folder again and again: no key of then comes back with later headers.
    forged = Broadcast(chain, header=chain.header.value, dsm_of=lambda _svid: kroot)
    write_pages(folder / "pages.csv", [*(p for p in pages if p.time < first + 240),
                                       *(p for p in forged.pages() if p.time >= first + 240)])  # fmt: skip
    growing = GrowingAssistance(folder, warn=lambda _error: None)
    growing.look(first, first + 300)
    assert {key.time for key in growing.found.assistance.keys} == {first + 30 * k for k in range(7)}


@pytest.mark.parametrize("received_in", [0, 3, 4, 5, 200])
def test_a_revoked_public_key_brings_no_chain_back(tmp_path: Path, received_in: int) -> None:
    """A folder below has keys and the root key of a new public key, which revokes the old one from subframe 4 on.

    Above lies the old chain. Its root key is genuine, and nobody signs when it was received: so that may be later.
    """
    start = GalileoTime(1400, 7200)
    old, new = make_chain(b"old", start, 12, chain_id=1), make_chain(b"new", start, 12, chain_id=2)
    header = NmaHeader(0xAA)  # operational, chain 2, public key revoked
    revocation = dataclasses.replace(
        new.root, kroot=sign_kroot(new.kroot, header, new.private_key), header=header, received_at=start + 4 * 30
    )
    (tmp_path / "new").mkdir()
    write_key_file(tmp_path / "new" / "keys.csv", new.validated_keys()[6:9], [revocation])
    root = dataclasses.replace(old.root, received_at=start + received_in * 30)
    write_key_file(tmp_path / "keys.csv", old.validated_keys()[2:], [root])
    for name, chain in (("old.pem", old), ("new.pem", new)):
        point = chain.private_key.public_key()
        (tmp_path / name).write_bytes(point.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    result = read_assistance(tmp_path)
    assert result.assistance.keys == (*old.validated_keys()[2:4], *new.validated_keys()[6:9])
    (problem,) = result.problems
    assert "keys.csv: 8 keys are not used" in str(problem)
    assert "public key revoked" in str(problem)


def test_segments_are_in_the_order_of_time_and_decrypt(folder: Path) -> None:
    result = read_assistance(folder).assistance
    times = [segment.transmit_time for segment in result.segments]
    assert times == sorted(times)
    keys = {key.time: key for key in result.keys}
    for segment in result.segments:
        chips = recs.decrypt(segment, keys[segment.key_time]).chips
        np.testing.assert_array_equal(chips, random_chips(segment.svid, START).chips)


def test_files_may_lie_one_folder_below(folder: Path, assistance: Assistance) -> None:
    (folder / "recs").mkdir()
    for path in folder.glob("*.bin*"):
        path.rename(folder / "recs" / path.name)
    assert complete(read_assistance(folder), assistance)


def test_what_is_no_assistance_is_passed_over(folder: Path, assistance: Assistance) -> None:
    (folder / "samples.bin").write_bytes(np.random.default_rng(1).bytes(25 + 640))
    (folder / "observations.csv").write_text("gst_week,gst_second,svid,pseudorange_m\n")
    (folder / "other.xml").write_text("<a/>")
    (folder / ".hidden.RCS").write_text("garbage")
    assert complete(read_assistance(folder), assistance)


def test_renamed_recs_are_found_by_their_content(folder: Path, assistance: Assistance) -> None:
    for number, path in enumerate([*folder.glob("*.bin"), *folder.glob("*.RCS")]):
        path.rename(folder / f"{number}.bin")
    assert complete(read_assistance(folder, reference=START), assistance)


def test_window(folder: Path, assistance: Assistance) -> None:
    result = read_assistance(folder, window=(START + 30.5, START + 90.5))
    assert result.assistance.segments == assistance.segments[2:8]


def test_recs_of_another_time_are_counted_over_all_files(folder: Path, assistance: Assistance) -> None:
    window = (START + -50.0, START + -40.0)
    result = read_assistance(folder, window=window)
    assert result.other_times is not None
    assert result.other_times.n == len(assistance.segments)
    first, *others = result.missing_for(window)
    assert first.startswith(f"no RECS for this time: the assistance folder has {len(assistance.segments)}, sent from")
    assert "RECS: none" in result.missing
    assert "RECS: none" not in others
    assert read_assistance(folder, window=(START, START + 90.5)).other_times is None


def test_empty_folder_says_what_is_missing(tmp_path: Path) -> None:
    result = read_assistance(tmp_path)
    assert result.assistance == Assistance()
    assert [line.split(":")[0] for line in result.missing] == [
        "OSNMA public key or Merkle tree", "RECS", "OSNMA keys", "receiver.toml", "ionosphere.csv",
    ]  # fmt: skip


def test_missing_keys_and_group_delays_are_counted(folder: Path, chain: SimulatedChain, assistance: Assistance) -> None:
    (folder / "keys.csv").unlink()
    next(folder.glob("*.BGD")).unlink()
    first = chain.keys[0].time
    missing = read_assistance(folder).missing
    found = [line for line in missing if line.startswith("OSNMA keys: ")]
    assert found == [
        f"OSNMA keys: the key of {first} and 5 more are missing, and RECS without their key get no verdict; "
        "`vestige osnma verify` writes a key file from navigation pages"
    ]
    assert "group delays: none for E03, E11; taken as 0" in missing


def test_no_folder(tmp_path: Path) -> None:
    for path in (tmp_path / "missing", tmp_path / "file"):
        (tmp_path / "file").touch()
        with pytest.raises(InputFileError, match="expected a readable folder"):
            read_assistance(path)


# --- what is not validated is not used ---


def test_keys_without_trust(folder: Path) -> None:
    (folder / TRUST).unlink()
    result = read_assistance(folder)
    assert result.assistance.keys == ()
    assert [type(problem) for problem in result.problems] == [AuthenticationError]


def test_keys_of_another_chain(folder: Path, original: Path, tmp_path: Path) -> None:
    other = make_chain(b"another", START, 12)
    stranger = tmp_path / "stranger.pem"
    point = other.private_key.public_key()
    stranger.write_bytes(point.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    result = read_assistance(folder, public_key=stranger)
    assert result.assistance.keys == ()
    assert len(result.problems) == 1
    assert read_assistance(folder, public_key=original / TRUST).assistance.keys != ()


def test_trust_that_the_caller_names_must_be_usable(folder: Path, tmp_path: Path) -> None:
    for arguments in (
        {"public_key": tmp_path / "x.pem"},
        {"merkle_tree": tmp_path / "x"},
        {"certificates": [tmp_path / "x"]},
    ):
        with pytest.raises(InputFileError, match="x"):
            read_assistance(folder, **arguments)


def test_signatures(folder: Path, assistance: Assistance, certificate: Path) -> None:
    for name in ("receiver.toml", "ionosphere.csv"):  # nobody signs them, so they are not taken with a certificate
        (folder / name).unlink()
    result = read_assistance(folder, certificates=[certificate])
    assert result.problems == ()
    assert result.assistance.segments == assistance.segments
    signed = [file.signature for file in result.files if file.kind in (FileKind.RECS, FileKind.GROUP_DELAY)]
    assert signed == [SignatureStatus.VERIFIED] * 4


@pytest.mark.parametrize("damage", ["unsigned", "other signature"])
def test_unsigned_files_are_not_used_with_a_certificate(folder: Path, certificate: Path, damage: str) -> None:
    signatures = sorted(folder.glob("*.bin_01.p256"))
    if damage == "unsigned":
        signatures[0].unlink()
    else:
        shutil.copy(signatures[1], signatures[0])
    result = read_assistance(folder, certificates=[certificate])
    kinds = [type(problem) for problem in result.problems]
    assert kinds == [InputFileError, InputFileError, AuthenticationError]  # the corrections, which are never signed
    assert result.assistance.hardware_bias_e1_e6_s == 0.0
    assert not result.assistance.ionosphere_e1_m
    assert {segment.svid for segment in result.assistance.segments} == {11}


def test_certificate_in_the_folder_is_not_trusted(folder: Path, certificate: Path) -> None:
    shutil.copy(certificate, folder / "server.crt")
    statuses = {file.signature for file in read_assistance(folder).files}
    assert SignatureStatus.VERIFIED not in statuses


# --- contradictions ---


def test_what_was_demodulated_is_kept_beside_what_is_valid(folder: Path, chain: SimulatedChain) -> None:
    """Of pages with good checksums, of which one key is forged: it is no key to decrypt with."""
    forged = bytes(16)
    broadcast = Broadcast(chain, n_subframes=12, key_of=lambda svid, k, key: forged if (svid, k) == (7, 6) else key)
    pages, lines = broadcast.pages(), [HEADER]
    for svid in broadcast.svids:
        digits = "".join(page.data.hex() for page in pages if page.svid == svid)
        lines.append(f"{svid},{4 * len(digits)},{digits}")
    (folder / "keys.csv").unlink()
    (folder / "pages.csv").write_text("\n".join(lines))
    found = read_assistance(folder).assistance
    true = [key.data for key in chain.keys]
    assert [key.data for key in found.keys] == true
    assert [one.key for one in found.received if one.svid == 2] == true
    assert [one.key for one in found.received if one.svid == 7] == [*true[:6], forged, *true[7:]]
    assert [one.time for one in found.received] == sorted(one.time for one in found.received)
    sent = {(page.svid, page.time): page.osnma for page in pages}
    for one in found.received:
        assert one.svid is not None
        assert one.fields == tuple(sent[one.svid, one.time + (1 + 2 * k)] for k in range(15))


def test_same_file_twice_is_no_contradiction(folder: Path, assistance: Assistance) -> None:
    for path in [*folder.glob("*.bin"), *folder.glob("*.RCS"), *folder.glob("*.BGD")]:
        shutil.copy(path, folder / f"copy of {path.name}")
    assert complete(read_assistance(folder, reference=START), assistance)


def test_contradicting_recs_are_not_used(folder: Path, chain: SimulatedChain, assistance: Assistance) -> None:
    honest = assistance.segments[0]
    forged = dataclasses.replace(honest, cipher=bytes(640))
    recs_file.write_recs_file(recs_file.from_segments([forged]), folder)
    result = read_assistance(folder)
    assert result.assistance.segments == assistance.segments[1:]
    assert len(result.problems) == 1
    assert "RECS: found 1 that differ from those in" in str(result.problems[0])


def test_two_merkle_trees_are_none(folder: Path, osnma_data: Path) -> None:
    for path in osnma_data.glob("*merkle_tree.xml"):
        shutil.copy(path, folder)
    result = read_assistance(folder)
    assert any("a second tree beside" in str(problem) for problem in result.problems)
    assert result.assistance.keys == ()


# --- damage ---


DAMAGE: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda _: b"",
    "half": lambda data: data[: len(data) // 2],
    "shifted": lambda data: b"\0" + data,
}
GIVES = {
    "*_11_*.bin": "segments", "*.RCS": "segments", "*.BGD": "group_delays", "keys.csv": "keys",
    "receiver.toml": "hardware_bias_e1_e6_s", "ionosphere.csv": "ionosphere_e1_m",
}  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGE)
@pytest.mark.parametrize("pattern", GIVES)
def test_damaged_file_costs_only_itself(folder: Path, assistance: Assistance, pattern: str, damage: str) -> None:
    path = next(folder.glob(pattern))
    path.write_bytes(DAMAGE[damage](path.read_bytes()))
    result = read_assistance(folder)
    for name in set(GIVES.values()) - {GIVES[pattern]}:
        assert getattr(result.assistance, name) == getattr(assistance, name)
    assert set(result.assistance.segments) <= set(assistance.segments)
    assert getattr(result.assistance, GIVES[pattern]) != getattr(assistance, GIVES[pattern])
    assert len(result.problems) == 1
    assert "\n" not in str(result.problems[0])
    with pytest.raises(VestigeError):
        read_assistance(folder, strict=True)


@pytest.mark.parametrize("pattern", ["*.RCS", "*.BGD"])
def test_a_file_of_forty_gigabytes_costs_only_itself(folder: Path, pattern: str) -> None:
    (path, *_) = sorted(folder.glob(pattern))
    os.truncate(path, 40_000_000_000)
    (problem,) = read_assistance(folder).problems
    assert f"{path}: length: found 40000000000 bytes, expected at most" in str(problem)


def test_damaged_trust_costs_the_keys(folder: Path, assistance: Assistance) -> None:
    (folder / TRUST).write_bytes((folder / TRUST).read_bytes()[:100])
    result = read_assistance(folder)
    assert result.assistance == dataclasses.replace(assistance, keys=(), received=())
    assert len(result.problems) == 2


NAMES = [
    "a.bin", "a.RCS", "a.BGD", "keys.csv", "a.sbf", "a.csv", "a.xml", "a.pem", "receiver.toml", "ionosphere.csv",
    "01_232312358205_000150_00300_03_0_0_0_01.bin",
]  # fmt: skip
HEADS = [
    b"", b"$@", b"SVID,NumNavBits,NavBitsHEX\n", b"<MerkleTree", b"<point>", b"-----BEGIN PUBLIC KEY-----",
    b"GSCX\0\0\0\0\x01", b"GSCX\x01", b"# vestige OSNMA keys 1\n",
]  # fmt: skip


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=200)
@given(name=st.sampled_from(NAMES), head=st.sampled_from(HEADS), data=st.binary(max_size=200))
def test_garbage(tmp_path: Path, name: str, head: bytes, data: bytes) -> None:
    shutil.rmtree(tmp_path / "garbage", ignore_errors=True)
    (tmp_path / "garbage").mkdir()
    (tmp_path / "garbage" / name).write_bytes(head + data)
    result = read_assistance(tmp_path / "garbage")
    assert result.assistance == Assistance()
    assert all("\n" not in str(problem) for problem in result.problems)


# --- writing ---


def test_irregular_epochs_are_split_into_files(tmp_path: Path, chain: SimulatedChain) -> None:
    epochs = [time_of_deciseconds(START.week, 10 * START.second + ds) for ds in (0, 300, 600, 915, 1500, 1501, 1502)]
    assistance = Assistance(segments=tuple(segment_of(chain, 5, epoch) for epoch in epochs))
    write_assistance(tmp_path, assistance)
    counts = sorted(
        recs_file.read_recs_file(path).n_segments for path in [*tmp_path.glob("*.bin"), *tmp_path.glob("*.RCS")]
    )
    assert sum(counts) == len(epochs)
    assert read_assistance(tmp_path).assistance.segments == assistance.segments


def test_only_what_is_there_is_written(tmp_path: Path, assistance: Assistance) -> None:
    segments = Assistance(segments=assistance.segments)
    paths = write_assistance(tmp_path / "new" / "folder", segments)
    assert sorted(paths) == sorted((tmp_path / "new" / "folder").iterdir())
    assert {path.suffix for path in paths} == {".bin", ".RCS"}
    assert read_assistance(tmp_path / "new" / "folder").assistance == segments


def test_keys_need_their_root(tmp_path: Path) -> None:
    key = validated_key(START.subframe)
    with pytest.raises(ValueError, match="root keys"):
        write_assistance(tmp_path, Assistance(keys=(key,)))


def test_names_that_would_collide_are_refused(tmp_path: Path) -> None:
    short = EncryptedSegment(
        svid=1, transmit_time=START, n_chips=5115, cipher=bytes(640), key_time=START.subframe, key_delay=0
    )
    long = dataclasses.replace(short, n_chips=10_230, cipher=bytes(1280))
    with pytest.raises(ValueError, match="same file name"):
        write_assistance(tmp_path, Assistance(segments=(short, long)))
