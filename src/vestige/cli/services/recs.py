"""`vestige recs`: describe RECS files, decrypt their chips with validated OSNMA keys, and make RECS."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.options import PATH, check_trust, json_option, time_option
from vestige.cli.services.recs_make import command as make_command
from vestige.cli.terminal import echo, raise_last
from vestige.errors import VestigeError
from vestige.output import check_output, replacement

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from vestige.crypto.recs.recs_file import RecsFile
    from vestige.records import EncryptedSegment
    from vestige.time import GalileoTime
    from vestige.validated_key import ValidatedKey

_reference = click.option(
    "--reference",
    callback=time_option,
    help="A time within 39 years of the RECS; resolves the 12-bit week of unitary files.",
)


@click.group()
def command() -> None:
    """Inspect, decrypt or make RECS files (re-encrypted code sequences of E6-C)."""


command.add_command(make_command, "make")


@command.command()
@click.argument("files", nargs=-1, required=True, type=PATH)
@click.option("--certificate", "certificates", multiple=True, type=PATH, help="PEM key or X.509 certificate you trust.")
@_reference
@json_option
def info(files: tuple[Path, ...], certificates: tuple[Path, ...], reference: GalileoTime | None, as_json: bool) -> None:
    """Print header, times of transmission, required keys and signature status of each file in FILES.

    The signature of a file is expected in the same folder, and is verified with the given certificates. Every file is
    read. If some files are invalid, the exit code is 1, and the errors are printed after the content of the valid
    files.
    """
    import json

    from vestige.crypto.file_bytes import read_bytes
    from vestige.crypto.recs.file_signature import load_public_key, signatures_in, verify_data
    from vestige.crypto.recs.recs_file import MAX_RECS_FILE_BYTES, parse_recs_file

    public_keys = [load_public_key(path) for path in certificates]
    signatures: dict[Path, Mapping[str, tuple[Path, ...]]] = {}
    described: list[dict[str, Any]] = []
    errors: list[VestigeError] = []
    for path in files:
        try:
            data = read_bytes(path, at_most=MAX_RECS_FILE_BYTES)
            file = parse_recs_file(data, path, reference=reference)
            if path.parent not in signatures:
                signatures[path.parent] = signatures_in(path.parent)
            status = verify_data(data, path, signatures[path.parent].get(path.name, ()), public_keys)
            described.append({"path": str(path), "signature": status.value, **_describe(file)})
        except VestigeError as error:
            errors.append(error)
            continue
        if not as_json:
            _print_description(described[-1])
    if as_json:
        echo(json.dumps({"files": described}))
    raise_last(errors)


@command.command(name="decrypt")
@click.argument("file", type=PATH)
@click.option("--keys", "key_file", required=True, type=PATH, help="Key file, as `vestige osnma verify` writes it.")
@click.option("--public-key", type=PATH, help="OSNMA public key (XML or PEM) that the key file must lead to.")
@click.option("--merkle-tree", type=PATH, help="OSNMA Merkle tree (XML) that the public key must lead to.")
@click.option("-o", "--output", type=PATH, help="File for the chips: one bit each, most significant first, 0 is +1.")
@click.option("--mode", type=click.Choice(["cbc", "ctr"]), default="cbc", help="AES mode; see the docs.")
@_reference
@json_option
def decrypt_command(
    file: Path, key_file: Path, public_key: Path | None, merkle_tree: Path | None, output: Path | None, mode: str,
    reference: GalileoTime | None, as_json: bool,
) -> None:  # fmt: skip
    """Decrypt the RECS in FILE with validated OSNMA keys.

    The output contains the transmitted chips of every RECS whose key is in the key file, one RECS after another. The
    chips of each RECS are padded to a whole byte. The report lists every RECS. For a decrypted RECS, the report has the
    first byte and the number of bytes of the chips in the output. Without -o only the report is printed.
    """
    import json

    from vestige.crypto.keys.key_file import read_key_file
    from vestige.crypto.keys.public_key_file import load_public_keys, read_merkle_tree
    from vestige.crypto.recs.recs_file import read_recs_file
    from vestige.crypto.recs.recs_segment import CipherMode

    check_trust(public_key, merkle_tree)
    check_output(output, (file, key_file, public_key, merkle_tree))
    recs = read_recs_file(file, reference=reference)
    public_keys = load_public_keys(public_key, merkle_tree)
    tree = None if merkle_tree is None else read_merkle_tree(merkle_tree)
    keys = {key.time: key for key in read_key_file(key_file, public_keys, tree)}
    packed, rows = _decrypt_segments(recs.segments, keys, CipherMode(mode))
    if not packed:
        times = sorted({segment.key_time for segment in recs.segments})
        raise VestigeError(f"{file}: {key_file} has none of the keys that the RECS need: {times[0]} to {times[-1]}")
    if output is not None:
        with replacement(output) as part:
            part.write_bytes(packed)
    if as_json:
        echo(json.dumps({"file": str(file), "output": output and str(output), "mode": mode, "segments": rows}))
        return
    for row in rows:
        state = (
            f"bytes {row['offset']}+{row['n_bytes']}  SHA-256 {row['sha256'][:16]}…" if row["decrypted"] else "no key"
        )
        echo(f"E{row['svid']:02d}  {row['transmit_time']}  key {row['key_time']}  {state}")


def _describe(file: RecsFile) -> dict[str, Any]:
    """Return the content of a RECS file as values for JSON."""
    from vestige.crypto.recs.recs_segment import LENGTHS

    length = LENGTHS[file.n_chip_code]
    return {
        "kind": file.kind.value,
        "provider": file.provider,
        "interface_version": file.interface_version,
        "file_version": file.file_version,
        "svid": file.svid,
        "start": str(file.start),
        "start_week": file.start.week,
        "duration_s": file.duration_ds / 10,
        "period_s": file.period_ds / 10,
        "key_delay": file.key_delay,
        "random_offset": file.random_offset,
        "n_chip_code": file.n_chip_code,
        "n_chips": length.n_chips,
        "segment_ms": length.duration_ms,
        "reserved": file.reserved,
        "segments": [{"transmit_time": str(s.transmit_time), "key_time": str(s.key_time)} for s in file.segments],
    }


def _print_description(file: dict[str, Any]) -> None:
    first, last = file["segments"][0], file["segments"][-1]
    length = f"{file['segment_ms']} ms ({file['n_chips']} chips, NChip {file['n_chip_code']})"
    lines = [
        f"{file['path']}: {file['kind']} RECS file of E{file['svid']:02d}, {file['signature']}",
        f"  provider {file['provider']}, interface version {file['interface_version']}, "
        f"file version {file['file_version']}, reserved bits {file['reserved']}",
        f"  {len(file['segments'])} RECS of {length}, KDI {file['key_delay']}, RAND {file['random_offset']}",
        f"  first at {first['transmit_time']}, key of {first['key_time']}",
    ]
    if last is not first:
        lines.append(f"  last  at {last['transmit_time']}, key of {last['key_time']}; every {file['period_s']:g} s")
    echo(*lines)


def _decrypt_segments(
    segments: Sequence[EncryptedSegment], keys: dict[GalileoTime, ValidatedKey], mode: Any
) -> tuple[bytes, list[dict[str, Any]]]:
    """Return the packed chips of all segments whose key is in `keys`, and a row of the report for each segment."""
    import hashlib

    from vestige.crypto.recs.recs_segment import decrypt as decrypt_segment
    from vestige.records.packed_chips import bits_of_packed

    packed, rows = bytearray(), []
    for segment in segments:
        row = {
            "svid": segment.svid,
            "transmit_time": str(segment.transmit_time),
            "key_time": str(segment.key_time),
            "n_chips": segment.n_chips,
            "decrypted": segment.key_time in keys,
        }
        if key := keys.get(segment.key_time):
            sequence = decrypt_segment(segment, key, mode=mode)
            chips = bits_of_packed(sequence.packed, -(-sequence.n_chips // 8))
            row |= {"offset": len(packed), "n_bytes": len(chips), "sha256": hashlib.sha256(chips).hexdigest()}
            packed += chips
        rows.append(row)
    return bytes(packed), rows
