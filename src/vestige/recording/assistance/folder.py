"""Read the assistance folder: RECS, group delays, OSNMA keys and corrections as input of the processor.

`vestige.recording.assistance.assistance_files` lists the files that may be in the folder or in a direct subfolder. Only
files that pass the following checks are used. A key must lead to the public key or the Merkle tree. If certificates are
given, one of these certificates must have signed each RECS or BGD file. Certificates are never taken from the folder
itself. If two files contradict each other, neither value is used. If a signed root key of any file withdraws a key,
this key is not used. Without `strict`, a damaged file is reported as a problem, and the other files are still read.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from vestige.crypto.file_bytes import list_folder
from vestige.crypto.osnma.chain_register import ChainRegister, RevokedKeyError
from vestige.crypto.osnma.osnma_report import AuthenticatedData
from vestige.crypto.recs.file_signature import SignatureStatus, load_public_key, signatures_in
from vestige.errors import AuthenticationError, InputFileError, VestigeError
from vestige.recording.assistance.assistance_files import (
    READERS,
    Contents,
    FileKind,
    FileTrust,
    Settings,
    assistance_kind,
)
from vestige.recording.assistance.missing_data import NO_RECS, missing_data
from vestige.recording.assistance.other_times import RecsOfOtherTimes
from vestige.records import Assistance
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

T = TypeVar("T")

Message = tuple[Path, Callable[[Settings], Contents | None]]  # source and reader of the message
# stamp and content of each file; the stamp has size, time of change, window and signatures at the time of reading
FileCache = dict[Path, tuple[tuple[object, ...], Contents]]


@dataclass(frozen=True, slots=True, kw_only=True)
class AssistanceFile:
    """An assistance file that was used.

    Attributes
    ----------
    content
        Content of the file in one line.
    signature
        Status of the file's signature; None for kinds of files that are not signed.
    """

    path: Path
    kind: FileKind
    content: str
    signature: SignatureStatus | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class AssistanceFolder:
    """An assistance folder that was read.

    Attributes
    ----------
    assistance
        Input of the processor: segments and keys in the order of time.
    files
        The files that were used.
    problems
        Reasons why other files, or parts of files, were not used.
    missing
        Lines about data that the folder lacks, group delays of another time, and files without a verified signature.
    navigation
        Navigation data from the receiver's own message, if OSNMA tags verified these data.
    other_times
        RECS outside the window, if the folder has RECS only outside the window; None otherwise.
    """

    assistance: Assistance
    files: tuple[AssistanceFile, ...]
    problems: tuple[VestigeError, ...]
    missing: tuple[str, ...]
    navigation: tuple[AuthenticatedData, ...] = ()
    other_times: RecsOfOtherTimes | None = None

    def missing_for(self, span: tuple[GalileoTime, GalileoTime] | None) -> tuple[str, ...]:
        """Return the lines about missing data for a recording with the time span `span`.

        If all RECS of the folder lie outside the window, a line gives the times of these RECS.
        """
        if span is None or self.other_times is None:
            return self.missing
        return (self.other_times.line(*span), *(line for line in self.missing if line != NO_RECS))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about data on which a verdict relies, and for which the folder itself is the only evidence."""
        anchors = [file.path.name for file in self.files if file.kind in (FileKind.PUBLIC_KEY, FileKind.MERKLE_TREE)]
        corrections = [file for file in self.files if file.kind in (FileKind.RECEIVER, FileKind.IONOSPHERE)]
        trust = f"the only proof of the OSNMA keys is in the assistance folder itself ({', '.join(anchors)}); "
        trust += "give your own public key or Merkle tree"
        return (*([trust] if anchors else []), *(f"{file.path}: {file.content}" for file in corrections))


class _Problems:
    """Collector of errors, which raises the first error if `strict` is true."""

    def __init__(self, *, strict: bool) -> None:
        self.collected: list[VestigeError] = []
        self._strict = strict

    def add(self, problems: Iterable[VestigeError]) -> None:
        for problem in problems:
            if self._strict:
                raise problem
            self.collected.append(problem)

    def attempt(self, step: Callable[[], T]) -> T | None:
        """Return the result of `step`, or collect the error of `step` and return None."""
        try:
            return step()
        except VestigeError as error:
            self.add([error])
            return None


def read_assistance(
    folder: Path | str,
    *,
    public_key: Path | None = None,
    merkle_tree: Path | None = None,
    certificates: Sequence[Path] = (),
    reference: GalileoTime | None = None,
    window: tuple[GalileoTime, GalileoTime] | None = None,
    strict: bool = False,
    cache: FileCache | None = None,
    message: Message | None = None,
) -> AssistanceFolder:
    """Return all usable assistance in `folder`, and the problems of the files that are not usable.

    Parameters
    ----------
    folder
        Folder of RECS, group delays, OSNMA keys and corrections; its direct subfolders are also read.
    public_key, merkle_tree
        Files of OSNMA's public key (XML or PEM) and Merkle tree (XML). If such a file is given, the public keys and
        Merkle trees in the folder are not used.
    certificates
        PEM public keys or X.509 certificates of the assistance server. If any key or certificate is given, RECS and BGD
        files without a valid signature are not used, and `receiver.toml` and `ionosphere.csv` are not used.
    reference
        Approximate time with an error of at most 39 years, which resolves 12-bit weeks if a file's name does not.
    window
        First and last time of transmission of the RECS to keep; None to keep all RECS. A week of RECS fills gigabytes.
    strict
        Whether the first problem is raised as an error; if false, problems are collected.
    cache
        Cache of the files that an earlier call read. The cache is updated. A RECS or BGD file is not read again if the
        file, the window and the list of its signature files are unchanged.
    message
        Path of the recording, and a function that reads the message that the receiver itself decoded from the
        recording. Keys in the message are used like keys of a file of navigation pages. Keys in the message may lead to
        the signed root keys of a key file.

    Raises
    ------
    InputFileError
        The folder does not exist, or a file that the caller names is not usable.
    AuthenticationError
        The public key that the caller names does not lead to the Merkle tree that the caller names.
    VestigeError
        A file is not usable or contradicts another file, and `strict` is true. A file that the caller names is not
        supported.

    Returns
    -------
    AssistanceFolder
        Assistance for the processor, and the faults and gaps of the folder.

    Examples
    --------
    >>> import vestige as vs
    >>> folder = vs.read_assistance("night/assistance")
    >>> len(folder.assistance.segments), folder.problems
    (1, ())
    """
    problems = _Problems(strict=strict)
    by_kind = _sorted_files(Path(folder), problems)
    trust_files = {
        FileKind.PUBLIC_KEY: by_kind.pop(FileKind.PUBLIC_KEY),
        FileKind.MERKLE_TREE: by_kind.pop(FileKind.MERKLE_TREE),
    }
    files: list[AssistanceFile] = []
    if public_key is not None or merkle_tree is not None:
        trust: FileTrust | None = FileTrust.load([public_key] if public_key else [], merkle_tree)
    else:
        trust = problems.attempt(partial(_folder_trust, trust_files))
        if trust is not None:
            files += _trust_content(trust_files)
    parents = {path.parent for paths in by_kind.values() for path in paths}
    settings = Settings(
        trust=trust,
        server_keys=tuple(load_public_key(path) for path in certificates),
        signatures={parent: signatures_in(parent) for parent in parents},
        reference=reference,
        window=window,
    )
    if settings.server_keys:
        for kind in (FileKind.RECEIVER, FileKind.IONOSPHERE):
            problems.add(
                InputFileError(path, "signature", "a correction, which has no signature", "signed files only")
                for path in by_kind[kind]
            )
            by_kind[kind] = []
    read: list[tuple[Path, Contents]] = []
    for kind, reader in READERS.items():
        for path in by_kind[kind]:
            contents = problems.attempt(partial(_contents, reader, path, settings, cache))
            if contents is not None:
                problems.add(contents.problems)
                read.append((path, contents))
                files.append(
                    AssistanceFile(path=path, kind=kind, content=contents.summary, signature=contents.signature)
                )
    navigation: tuple[AuthenticatedData, ...] = ()
    if message is not None:
        path, contents_of = message
        roots = tuple(root for _, contents in read for root in contents.roots)
        contents = problems.attempt(partial(contents_of, replace(settings, roots=roots)))
        if contents is not None:
            problems.add(contents.problems)
            read.append((path, contents))
            files.append(AssistanceFile(path=path, kind=FileKind.PAGES, content=contents.summary))
            navigation = contents.navigation
    if cache is not None:
        for path in cache.keys() - {path for path, _ in read}:
            del cache[path]
    assistance = _joined(read, problems)
    return AssistanceFolder(
        assistance=assistance,
        files=tuple(files),
        problems=tuple(problems.collected),
        missing=missing_data(assistance, files, trust),
        navigation=navigation,
        other_times=_other_times(contents for _, contents in read),
    )


def _contents(
    reader: Callable[[Path, Settings], Contents], path: Path, settings: Settings, cache: FileCache | None
) -> Contents:
    if cache is None or reader not in (READERS[FileKind.RECS], READERS[FileKind.GROUP_DELAY]):
        return reader(path, settings)
    state = path.stat()
    signatures = settings.signatures.get(path.parent, {}).get(path.name, ())
    stamp = (state.st_size, state.st_mtime_ns, settings.window, signatures)
    if path not in cache or cache[path][0] != stamp:
        cache[path] = stamp, reader(path, settings)
    return cache[path][1]


def _sorted_files(folder: Path, problems: _Problems) -> dict[FileKind, list[Path]]:
    """Return by kind the assistance files in a folder and in its direct subfolders."""
    found = list(list_folder(folder))
    for path in tuple(found):
        if path.is_dir() and not path.name.startswith("."):
            found += problems.attempt(partial(list_folder, path)) or ()
    by_kind: dict[FileKind, list[Path]] = {kind: [] for kind in FileKind}
    for path in found:
        if path.is_file() and not path.name.startswith("."):
            kind = problems.attempt(partial(assistance_kind, path))
            if kind is not None:
                by_kind[kind].append(path)
    return by_kind


def _folder_trust(files: Mapping[FileKind, Sequence[Path]]) -> FileTrust | None:
    """Return the trust anchors in the folder itself, or None without trust anchors.

    Two Merkle trees in the folder are an error.
    """
    public_keys, trees = files[FileKind.PUBLIC_KEY], files[FileKind.MERKLE_TREE]
    if len(trees) > 1:
        raise InputFileError(trees[1], "Merkle tree", f"a second tree beside {trees[0]}", "one tree; give yours")
    return FileTrust.load(public_keys, trees[0] if trees else None) if public_keys or trees else None


def _trust_content(files: Mapping[FileKind, Sequence[Path]]) -> Iterator[AssistanceFile]:
    """Yield an `AssistanceFile` for each file of trust anchors.

    A key that an earlier file also contains is described by the name of the earlier file.
    """
    tree = next(iter(files[FileKind.MERKLE_TREE]), None)
    named: dict[bytes, Path] = {}
    for kind, paths in files.items():
        for path in paths:
            keys = FileTrust.load([path] if kind is FileKind.PUBLIC_KEY else [], tree).public_keys
            texts = [f"the same key as in {named[key.point].name}" if key.point in named else str(key) for key in keys]
            named |= {key.point: path for key in keys if key.point not in named}
            yield AssistanceFile(path=path, kind=kind, content=", ".join(dict.fromkeys(texts)))


def _joined(read: Sequence[tuple[Path, Contents]], problems: _Problems) -> Assistance:
    """Return the joint content of all files, with RECS and keys in the order of time."""
    segments = (
        ((s.transmit_time, s.svid, -s.n_chips, s.key_delay, s.random_offset), s, path)
        for path, contents in read
        for s in contents.segments
    )
    delays = (((d.svid, d.valid_from), d, path) for path, contents in read for d in contents.group_delays)
    keys = ((key.time, key, path) for path, key in _usable_keys(read, problems))
    ionosphere = ((svid, (svid, m), path) for path, contents in read for svid, m in contents.ionosphere_e1_m.items())
    biases = ((0, c.hardware_bias_s, path) for path, c in read if c.hardware_bias_s is not None)
    return Assistance(
        segments=_agreed("RECS", segments, problems),
        group_delays=_agreed("group delays", delays, problems),
        keys=_agreed("OSNMA keys", keys, problems),
        received=tuple(sorted({one for _, contents in read for one in contents.received}, key=lambda one: one.time)),
        # `_agreed` returns at most one hardware bias
        hardware_bias_e1_e6_s=sum(_agreed("hardware bias", biases, problems), 0.0),
        ionosphere_e1_m=dict(_agreed("ionospheric delays", ionosphere, problems)),
    )


def _other_times(read: Iterable[Contents]) -> RecsOfOtherTimes | None:
    """Return the RECS outside the window, or None if there are no such RECS, or a file has RECS in the window."""
    found = None
    for one in read:
        if one.segments:
            return None
        if one.other_times is not None:
            found = one.other_times if found is None else found | one.other_times
    return found


def _usable_keys(read: Sequence[tuple[Path, Contents]], problems: _Problems) -> list[tuple[Path, ValidatedKey]]:
    """Return the keys that no signed root key of any file withdraws."""
    register = ChainRegister()
    roots = (root for _, contents in read for root in contents.roots)
    for root in sorted(roots, key=lambda root: root.received_at):
        with suppress(RevokedKeyError):  # another file may revoke the key that signed this root key
            register.add(root)
    for _, contents in read:
        for time in contents.alerts:
            register.add_alert(time)
    usable = []
    for path, contents in read:
        refused = []
        for key in contents.keys:
            refusal = register.refusal_of(key)
            if refusal:
                refused.append(f"key of {key.time}: {refusal}")
            else:
                usable.append((path, key))
        if refused:
            problems.add([AuthenticationError(f"{path}: {len(refused)} keys are not used, the first: {refused[0]}")])
    return usable


def _agreed(what: str, things: Iterable[tuple[Any, T, Path]], problems: _Problems) -> tuple[T, ...]:
    """Return values in the order of their sort keys, and no value for a sort key for which two files disagree."""
    found: dict[Any, tuple[T, Path]] = {}
    contradicted = set()
    between: Counter[tuple[Path, Path]] = Counter()
    for key, thing, path in things:
        earlier, earlier_path = found.setdefault(key, (thing, path))
        if earlier != thing:
            contradicted.add(key)
            between[path, earlier_path] += 1
    problems.add(
        InputFileError(
            path, what, f"{count} that differ from those in {earlier_path.name}", "the same; neither is used"
        )
        for (path, earlier_path), count in between.items()
    )
    return tuple(found[key][0] for key in sorted(found) if key not in contradicted)
