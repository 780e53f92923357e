"""Find the kind of each file of an assistance folder, and read the content of the file.

| file | content |
|---|---|
| `*.RCS`, `*.bin` | RECS, see `vestige.crypto.recs.recs_file`; another `.bin` file is not read |
| `*.BGD` | group delays, see `vestige.crypto.recs.group_delay` |
| `keys.csv` | OSNMA keys, see `vestige.crypto.keys.key_file` |
| `*.sbf`, `*.csv` with navigation pages | OSNMA keys, see `vestige.recording.navigation.navigation_pages` |
| `*.xml`, `*.pem` | public key or Merkle tree of OSNMA |
| `receiver.toml`, `ionosphere.csv` | corrections, see `vestige.recording.assistance.receiver_corrections` |
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path

from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePublicKey

from vestige.crypto.file_bytes import open_file, read_bytes
from vestige.crypto.keys.key_file import load_key_file
from vestige.crypto.keys.merkle_tree import MerkleTree
from vestige.crypto.keys.public_key import PublicKey
from vestige.crypto.keys.public_key_file import load_public_keys, read_merkle_tree
from vestige.crypto.osnma.messages.root_key import RootKey
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.crypto.osnma.osnma_report import AuthenticatedData
from vestige.crypto.recs import group_delay, recs_file
from vestige.crypto.recs.file_signature import SignatureStatus, verify_data
from vestige.crypto.recs.recs_name import parse_name
from vestige.errors import AuthenticationError, VestigeError
from vestige.navigation.inav.page import InavPage
from vestige.recording.assistance.other_times import RecsOfOtherTimes
from vestige.recording.assistance.receiver_corrections import (
    IONOSPHERE_NAME,
    RECEIVER_NAME,
    read_hardware_bias,
    read_ionosphere,
)
from vestige.recording.navigation.navigation_pages import read_pages
from vestige.recording.samples import test_vector_csv
from vestige.records import EncryptedSegment, GroupDelay, ReceivedOsnma
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

KEYS_NAME = "keys.csv"
_HEAD_BYTES = 1 << 16


class FileKind(Enum):
    """Kind of a file in the assistance folder."""

    RECS = "RECS"
    GROUP_DELAY = "BGD"
    KEYS = "OSNMA keys"
    PAGES = "navigation pages"
    PUBLIC_KEY = "OSNMA public key"
    MERKLE_TREE = "OSNMA Merkle tree"
    RECEIVER = "receiver corrections"
    IONOSPHERE = "ionosphere"


_BY_NAME = {KEYS_NAME: FileKind.KEYS, RECEIVER_NAME: FileKind.RECEIVER, IONOSPHERE_NAME: FileKind.IONOSPHERE}
_BY_SUFFIX = {".rcs": FileKind.RECS, ".bgd": FileKind.GROUP_DELAY, ".sbf": FileKind.PAGES}
_BY_HEAD: tuple[tuple[str, FileKind, Callable[[bytes], bool]], ...] = (
    (".bin", FileKind.RECS, recs_file.has_recs_header),
    (".csv", FileKind.PAGES, lambda head: head.startswith(test_vector_csv.HEADER.encode())),
    (".xml", FileKind.MERKLE_TREE, lambda head: b"<MerkleTree" in head),
    (".xml", FileKind.PUBLIC_KEY, lambda head: b"<point>" in head),
    (".pem", FileKind.PUBLIC_KEY, lambda head: b"-----BEGIN PUBLIC KEY-----" in head),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FileTrust:
    """Trust anchors of OSNMA keys: public keys, and the Merkle tree that verified the public keys."""

    public_keys: tuple[PublicKey, ...]  # keys that may sign root keys
    tree: MerkleTree | None  # tree that verified the public keys

    @classmethod
    def load(cls, public_keys: Sequence[Path], merkle_tree: Path | None) -> FileTrust:
        """Return the trust anchors in public key files and in a Merkle tree file.

        If a Merkle tree is given, each public key must lead to the root of the tree. The method raises
        `AuthenticationError` if a key does not lead to the root of the tree. The method raises `InputFileError` or
        `UnsupportedError` if a file is not usable.
        """
        paths: Sequence[Path | None] = public_keys or [None]  # a file of a Merkle tree also contains public keys
        keys = [key for path in paths for key in load_public_keys(path, merkle_tree)]
        return cls(
            public_keys=tuple(dict.fromkeys(keys)), tree=None if merkle_tree is None else read_merkle_tree(merkle_tree)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Settings for the readers of all files of a folder."""

    trust: FileTrust | None = None  # trust anchors to which OSNMA keys must lead; None if there are no trust anchors
    # keys of the assistance server, one of which must have signed each RECS and BGD file; empty for no check
    server_keys: Sequence[EllipticCurvePublicKey] = ()
    # signature files by folder and name of the signed file
    signatures: Mapping[Path, Mapping[str, tuple[Path, ...]]] = field(default_factory=dict)
    reference: GalileoTime | None = None  # approximate time, which resolves the 12-bit weeks in files
    # verified root keys of the folder's key files, to which the keys in the receiver's own message may lead
    roots: tuple[RootKey, ...] = ()
    # first and last time of transmission of the RECS to keep; None to keep all RECS
    window: tuple[GalileoTime, GalileoTime] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Contents:
    """Content of one file."""

    summary: str  # content of the file in one line
    # status of the file's signature; None for kinds of files that are not signed
    signature: SignatureStatus | None = None
    segments: tuple[EncryptedSegment, ...] = ()
    other_times: RecsOfOtherTimes | None = None  # RECS outside the window, if the file has no RECS in the window
    group_delays: tuple[GroupDelay, ...] = ()
    keys: tuple[ValidatedKey, ...] = ()
    roots: tuple[RootKey, ...] = ()
    alerts: tuple[GalileoTime, ...] = ()
    received: tuple[ReceivedOsnma, ...] = ()
    hardware_bias_s: float | None = None
    ionosphere_e1_m: Mapping[int, float] = field(default_factory=dict)
    navigation: tuple[AuthenticatedData, ...] = ()  # navigation data that OSNMA tags verified
    problems: tuple[VestigeError, ...] = ()  # faults of a file that is usable in part


def assistance_kind(path: Path) -> FileKind | None:
    """Return the kind of a file by its name, suffix or first bytes, or None if the file is not an assistance file.

    The function raises `InputFileError` if the first bytes are needed and cannot be read. The function also raises
    `InputFileError` if a `.bin` file has the name of a RECS file with a date that does not exist.
    """
    suffix = path.suffix.lower()
    named = _BY_NAME.get(path.name.lower()) or _BY_SUFFIX.get(suffix)
    if named is not None:
        return named
    if suffix == ".bin" and parse_name(path.name) is not None:
        return FileKind.RECS
    candidates = [(kind, test) for ending, kind, test in _BY_HEAD if ending == suffix]
    if not candidates:
        return None
    with open_file(path) as file:
        head = file.read(_HEAD_BYTES)
    return next((kind for kind, test in candidates if test(head)), None)


def read_recs(path: Path, settings: Settings) -> Contents:
    """Return the RECS of a file that are sent within the window of the settings, or all RECS if there is no window."""
    data, signature = _signed(path, settings, recs_file.MAX_RECS_FILE_BYTES)
    file = recs_file.parse_recs_file(data, path, reference=settings.reference)
    segments = file.segments
    if settings.window is not None:
        first, last = settings.window
        segments = tuple(segment for segment in segments if first <= segment.transmit_time <= last)
    summary = f"E{file.svid:02d}, {len(segments)} RECS" + (f" of {file.n_segments}" if settings.window else "")
    others = None
    if settings.window is not None and not segments:
        others = RecsOfOtherTimes.of((segment.transmit_time for segment in file.segments), settings.window)
    return Contents(summary=f"{summary}, from {file.start}", signature=signature, segments=segments, other_times=others)


def read_group_delays(path: Path, settings: Settings) -> Contents:
    """Return the group delays of a file."""
    data, signature = _signed(path, settings, group_delay.MAX_GROUP_DELAY_FILE_BYTES)
    file = group_delay.parse_group_delay_file(data, path, reference=settings.reference)
    summary = f"group delays of {len(file.delays)} satellites, from {file.valid_from}"
    return Contents(summary=summary, signature=signature, group_delays=file.delays)


def read_keys(path: Path, settings: Settings) -> Contents:
    """Return the validated keys, the root keys and the alerts of a key file.

    The keys of the file also count as received OSNMA keys, because the writer of the file received these keys.
    """
    trust = _trust(path, settings)
    file = load_key_file(path, trust.public_keys, trust.tree)
    return Contents(
        summary=f"{len(file.keys)} validated keys",
        keys=file.keys,
        roots=file.roots,
        alerts=file.alerts,
        received=tuple(ReceivedOsnma(svid=None, time=key.time, key=key.data) for key in file.keys),
    )


def read_navigation_pages(path: Path, settings: Settings) -> Contents:
    """Return the keys that OSNMA in recorded navigation pages validates, including the keys of lost subframes.

    The demodulated keys are also returned, because a forged key would be among the demodulated keys. The root keys are
    returned, because a root key may withdraw keys of other files.
    """
    return contents_of_pages(path, read_pages(path), settings)


def contents_of_pages(path: Path, pages: Iterable[InavPage], settings: Settings) -> Contents:
    """Return the contents of navigation pages of any source, as `read_navigation_pages` does for a file.

    Error messages name `path` as the source of the pages.
    """
    trust = _trust(path, settings)
    receiver = OsnmaReceiver(trust.public_keys, trust.tree)
    receiver.learn(settings.roots)
    report = receiver.process_all(pages)
    problems = tuple(AuthenticationError(f"{path}: {failure}") for failure in report.failures)
    return replace(contents_of_receiver(receiver), problems=problems)


def contents_of_receiver(receiver: OsnmaReceiver) -> Contents:
    """Return the contents of the pages that an OSNMA receiver has processed so far.

    The contents are keys, root keys, alerts, demodulated OSNMA, and navigation data that OSNMA tags verified.
    """
    report, keys = receiver.report(), receiver.filled_keys()
    return Contents(
        summary=f"{report.n_pages} pages, {len(keys)} validated keys",
        keys=keys,
        roots=report.verified_roots,
        alerts=report.alerts,
        received=receiver.received(),
        navigation=report.navigation,
    )


def read_receiver(path: Path, _settings: Settings) -> Contents:
    """Return the hardware bias in a file of receiver corrections."""
    bias_s = read_hardware_bias(path)
    summary = f"delay of the E6 front end minus the E1 front end: {bias_s * 1e9:+.3f} ns"
    return Contents(summary=summary, hardware_bias_s=bias_s)


def read_ionosphere_delays(path: Path, _settings: Settings) -> Contents:
    """Return the ionospheric delays in a file of predicted delays."""
    delays = read_ionosphere(path)
    return Contents(summary=f"predicted delays of {len(delays)} satellites", ionosphere_e1_m=delays)


# `READERS` has no reader of trust anchors, because `FileTrust.load` reads the files of trust anchors before all other
# files.
READERS: Mapping[FileKind, Callable[[Path, Settings], Contents]] = {
    FileKind.RECS: read_recs,
    FileKind.GROUP_DELAY: read_group_delays,
    FileKind.KEYS: read_keys,
    FileKind.PAGES: read_navigation_pages,
    FileKind.RECEIVER: read_receiver,
    FileKind.IONOSPHERE: read_ionosphere_delays,
}


def _signed(path: Path, settings: Settings, at_most: int) -> tuple[bytes, SignatureStatus]:
    """Return the bytes of a file, and the status of the signature of exactly these bytes."""
    data = read_bytes(path, at_most=at_most)
    signatures = settings.signatures.get(path.parent, {}).get(path.name, ())
    status = verify_data(data, path, signatures, settings.server_keys)
    if settings.server_keys and status is not SignatureStatus.VERIFIED:
        raise AuthenticationError(f"{path}: {status.value}; not used, because a certificate was given")
    return data, status


def _trust(path: Path, settings: Settings) -> FileTrust:
    if settings.trust is None:
        raise AuthenticationError(f"{path}: its keys prove nothing without an OSNMA public key or Merkle tree")
    return settings.trust
