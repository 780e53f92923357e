"""Readers of what has to be authentic: RECS, group delays, signatures, keys, navigation pages. None may be fooled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from random import Random

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

from fuzz.authority import (
    CHAIN,
    CHAINS,
    GROUP_DELAYS,
    KEYS,
    PAGES,
    SEGMENTS,
    SERVER_KEY,
    START,
    WIDE_CHAIN,
    WITHDRAWN_PAGES,
    files_of,
    pem,
    require_genuine_keys,
)
from fuzz.engine import Files, Target, WrongAcceptanceError, spoil_files
from fuzz.mutation import NUMBERS, spoil_bytes
from page_files import inav_block, sbf_block, vector_csv
from signed_files import sign, verify_file
from simulated_chain import SimulatedChain
from vestige.crypto.file_bytes import read_bytes
from vestige.crypto.keys.key_file import read_key_file, write_key_file
from vestige.crypto.keys.merkle_tree import verify_public_key
from vestige.crypto.keys.public_key import PublicKey
from vestige.crypto.keys.public_key_file import load_public_keys, read_merkle_tree, read_public_key
from vestige.crypto.osnma.operator.key_tree import read_private_key
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.crypto.recs import group_delay, recs_file
from vestige.crypto.recs.file_signature import SignatureStatus, load_public_key
from vestige.crypto.recs.recs_name import parse_name
from vestige.crypto.recs.recs_segment import LENGTHS
from vestige.navigation.inav.page import InavPage, page_checksum
from vestige.recording.navigation.navigation_pages import read_pages
from vestige.recording.observations.sbf import SbfCounts
from vestige.records import ValidatedKey

# --- RECS, their names and signatures


def _recs_files() -> Sequence[Files]:
    unitary, aggregated = recs_file.from_segments(SEGMENTS[-1:]), recs_file.from_segments(SEGMENTS[:8:2])
    return [{str(one.name): recs_file.serialize_recs_file(one)} for one in (unitary, aggregated)] + [
        {"renamed.bin": recs_file.serialize_recs_file(aggregated)}
    ]


def _spoil_recs(rng: Random, files: Files) -> Files:
    """Spoil the bytes; or state fields anew, with a body of the length that follows and the name that says the same."""
    if rng.random() < 0.5:
        return spoil_files(rng, files)
    (data,) = files.values()
    assert isinstance(data, bytes)
    unitary = data[4] == 1
    header = bytearray(data[: 16 if unitary else 25])
    for _ in range(rng.choice((1, 2, 3))):
        at = rng.randrange(len(header))
        header[at] = rng.choice((0, 1, 2, 5, 36, 37, 255, rng.randrange(256)))
    n_segments = rng.choice((0, 1, 2, 7, 7, 200))
    length = rng.choice(LENGTHS)
    body = (rng.randbytes(64) * 160)[: length.n_bytes] * (1 if unitary else n_segments)
    if not unitary:
        period = rng.choice((0, 1, 300, 65535))
        header[14:17] = min(n_segments * period, (1 << 24) - 1).to_bytes(3, "big")
        header[20], header[21], header[22:24] = header[20], length.code, period.to_bytes(2, "big")
    content = bytes(header) + body
    try:
        name = str(recs_file.parse_recs_file(content, Path("no name")).name)
    except Exception:
        name = next(iter(files))
    return {rng.choice((name, name, name.swapcase(), "x.RCS")): content}


def _read_recs(folder: Path) -> None:
    for path in sorted(folder.iterdir()):
        file = recs_file.read_recs_file(path)
        segments = file.segments
        if recs_file.serialize_recs_file(file) != path.read_bytes():
            raise WrongAcceptanceError("a RECS file is not what was read of it")
        if len(segments) != file.n_segments or any(len(one.cipher) != len(segments[0].cipher) for one in segments):
            raise WrongAcceptanceError("RECS of unequal length")
        recs_file.read_recs_file(path, reference=START)


def _names() -> Sequence[Files]:
    names = [str(recs_file.from_segments(one).name) for one in (SEGMENTS[-1:], SEGMENTS[:8:2])]
    return [{"name.txt": name.encode()} for name in names]


def _read_name(folder: Path) -> None:
    text = (folder / "name.txt").read_bytes().decode("utf-8", "surrogateescape")
    name = parse_name(text)
    if name is not None and str(name).lower() != text.lower() and parse_name(str(name)) != name:
        raise WrongAcceptanceError(f"{text!r} is read as {name}")


def _signed() -> Sequence[Files]:
    def write(folder: Path) -> None:
        sign(recs_file.write_recs_file(recs_file.from_segments(SEGMENTS[:8:2]), folder), SERVER_KEY)
        sign(group_delay.write_group_delay_file(GROUP_DELAYS, folder), SERVER_KEY, certificate=2)
        (folder / "server.pem").write_bytes(pem(SERVER_KEY.public_key()))

    return [files_of(write)]


def _read_signed(folder: Path) -> None:
    """A changed file is refused, or known to be unsigned; the key is the true one."""
    genuine = {name: data for name, data in SIGNED.corpus[0].items() if "p256" not in name}
    keys = (SERVER_KEY.public_key(),)
    for path in sorted(folder.iterdir()):
        verified = path.name in genuine and verify_file(path, keys) is SignatureStatus.VERIFIED
        if verified and path.read_bytes() != genuine[path.name]:
            raise WrongAcceptanceError(f"{path.name} was changed and its signature verifies")


def _certificates() -> Sequence[Files]:
    def write(folder: Path) -> None:
        name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "server")])
        builder = x509.CertificateBuilder().subject_name(name).issuer_name(name).serial_number(7)
        builder = builder.not_valid_before(datetime(2025, 1, 1, tzinfo=UTC))
        builder = builder.not_valid_after(datetime(2035, 1, 1, tzinfo=UTC)).public_key(SERVER_KEY.public_key())
        certificate = builder.sign(SERVER_KEY, hashes.SHA256())
        (folder / "a.pem").write_bytes(certificate.public_bytes(Encoding.PEM))
        (folder / "b.der").write_bytes(certificate.public_bytes(Encoding.DER))
        for number, curve in enumerate((ec.SECP256R1(), ec.SECP384R1(), ec.SECP521R1())):
            (folder / f"{number}.pem").write_bytes(pem(ec.derive_private_key(5, curve).public_key()))

    return [{name: data} for name, data in files_of(write).items()]


def _read_certificate(folder: Path) -> None:
    for path in sorted(folder.iterdir()):
        load_public_key(path)


# --- group delays


def _group_delays() -> Sequence[Files]:
    return [files_of(lambda folder: group_delay.write_group_delay_file(GROUP_DELAYS, folder))]


def _read_group_delays(folder: Path) -> None:
    for path in sorted(folder.iterdir()):
        data = read_bytes(path, at_most=group_delay.MAX_GROUP_DELAY_FILE_BYTES)
        file = group_delay.parse_group_delay_file(data, path, reference=START)
        again = group_delay.parse_group_delay_file(group_delay.serialize_group_delay_file(file), path, reference=START)
        if again.delays != file.delays:
            raise WrongAcceptanceError("group delays are not what was read of them")


# --- OSNMA: public keys, trees, keys, pages


def _tree_xml(chain: SimulatedChain) -> bytes:
    (claim,) = chain.tree.public_keys
    nodes = "".join(
        f"<TreeNode><j>{j}</j><i>{i}</i><lengthInBits>256</lengthInBits><x_ji>{value.hex()}</x_ji></TreeNode>"
        for (j, i), value in chain.tree.nodes.items()
        if j == 4 or i == (claim.leaf or 0) >> j ^ 1
    )
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><signalData><MerkleTree><N>16</N><HashFunction>SHA-256</HashFunction>'
        f"<PublicKey>{_key_elements(chain)}</PublicKey>{nodes}</MerkleTree></signalData>"
    ).encode()


def _key_elements(chain: SimulatedChain) -> str:
    (claim,) = chain.tree.public_keys
    kind = "ECDSA P-521/SHA-512" if chain is WIDE_CHAIN else "ECDSA P-256/SHA-256"
    return (
        f"<i>{claim.leaf}</i><PKID>{claim.pkid}</PKID><lengthInBits>{8 * len(claim.point)}</lengthInBits>"
        f"<point>{claim.point.hex()}</point><PKType>{kind}</PKType>"
    )


def _public_keys() -> Sequence[Files]:
    return [
        files
        for chain in CHAINS
        for files in (
            {"key.xml": f"<body>{_key_elements(chain)}</body>".encode()},
            {"key.pem": pem(chain.private_key.public_key())},
        )
    ]


def _read_public_key(folder: Path) -> None:
    """A claimed key that a true tree takes has the true point and number."""
    for path in sorted(folder.iterdir()):
        load_public_keys(path, None)
        claim = read_public_key(path)
        chain = WIDE_CHAIN if len(claim.point) > 33 else CHAIN
        _require_true(verify_public_key(claim, chain.tree), chain)


def _require_true(key: PublicKey, chain: SimulatedChain) -> None:
    (true,) = chain.tree.public_keys
    if (key.point, key.pkid) != (true.point, true.pkid):
        raise WrongAcceptanceError(f"the tree takes {key}")


def _private_keys() -> Sequence[Files]:
    form = PrivateFormat.PKCS8, NoEncryption()
    return [{"own.pem": ec.derive_private_key(5, ec.SECP256R1()).private_bytes(Encoding.PEM, *form)}]


def _read_private_key(folder: Path) -> None:
    """An operator takes keys on P-256 only."""
    key = read_private_key(folder / "own.pem")
    if key.curve.name != "secp256r1":
        raise WrongAcceptanceError(f"an operator takes a key on {key.curve.name}")


def _trees() -> Sequence[Files]:
    return [
        {"tree.xml": _tree_xml(chain)} | own
        for chain in CHAINS
        for own in ({}, {"key.pem": pem(chain.private_key.public_key())})
    ]


def _read_tree(folder: Path) -> None:
    """The user trusts the root: a tree with a true root gives its true key only."""
    tree = folder / "tree.xml"
    keys = load_public_keys(folder / "key.pem" if (folder / "key.pem").exists() else None, tree)
    root = read_merkle_tree(tree).root
    for chain in CHAINS:
        if root == chain.tree.root:
            for key in keys:
                _require_true(key, chain)


def _key_files() -> Sequence[Files]:
    renewed = (*KEYS[:3], *WIDE_CHAIN.validated_keys()[3:])
    return [
        files_of(lambda folder: write_key_file(folder / "keys.csv", KEYS, (CHAIN.root,))),
        files_of(lambda folder: write_key_file(folder / "keys.csv", renewed, (CHAIN.root, WIDE_CHAIN.root))),
    ]


def _spoil_keys(rng: Random, files: Files) -> Files:
    """Spoil the file; or change one field of the rows and of the root, each in its own form."""
    data = files["keys.csv"]
    assert isinstance(data, bytes)
    if rng.random() < 0.5:
        return spoil_files(rng, files)
    lines = data.decode().splitlines()
    at = rng.randrange(1, len(lines))
    fields = lines[at].split(",")
    place = rng.randrange(len(fields))
    digits = fields[place]
    if digits and all(digit in "0123456789abcdef" for digit in digits):
        k = rng.randrange(len(digits))
        fields[place] = (
            digits[:k] + rng.choice("0123456789" if digits.isdigit() else "0123456789abcdef") + digits[k + 1 :]
        )
    else:
        fields[place] = rng.choice(NUMBERS)
    lines[at] = ",".join(fields)
    return {"keys.csv": ("\n".join(lines) + "\n").encode()}


def _read_keys(folder: Path) -> None:
    require_genuine_keys(read_key_file(folder / "keys.csv", [chain.public_key for chain in CHAINS]))


def spoil_pages(rng: Random, pages: Sequence[InavPage]) -> list[InavPage]:
    """Return pages of which some were changed, with their checksums repaired, removed, repeated or swapped."""
    changed = list(pages)
    for _ in range(rng.choice((1, 1, 3, 30))):
        at, other = rng.randrange(len(changed)), rng.randrange(len(changed))
        choice = rng.random()
        if choice < 0.05 and len(changed) > 1:
            del changed[at]
        elif choice < 0.10:
            changed.insert(other, changed[at])
        elif choice < 0.15:
            changed[at], changed[other] = replace(changed[at], time=changed[other].time), changed[other]
        else:
            changed[at] = _changed_page(rng, changed[at])
    return changed


def _forged_headers(rng: Random, pages: Sequence[InavPage]) -> list[InavPage]:
    """Return pages with another NMA header, the first byte of OSNMA, from some subframe on in some subframes."""
    since, share = rng.choice(pages[len(pages) // 2 :]).time, rng.choice((0.5, 1.0, 1.0))
    header = rng.choice((0x82, 0x82, 0x92, 0xA2, 0xC2, 0xEE, rng.randrange(256)))
    return [
        _with_bits(page, 138, 8, header)
        if page.time.second % 30 == 1 and page.time >= since and rng.random() < share
        else page
        for page in pages
    ]


def _with_bits(page: InavPage, first: int, length: int, value: int) -> InavPage:
    """Return a page with bits replaced and its checksum repaired."""
    at = 240 - first - length
    bits = int.from_bytes(page.data, "big") & ~((1 << length) - 1 << at) | value << at
    checksum = page_checksum(bits.to_bytes(30, "big"))
    return replace(page, data=(bits & ~(0xFFFFFF << 14) | checksum << 14).to_bytes(30, "big"))


def _changed_page(rng: Random, page: InavPage) -> InavPage:
    """Return a page with its OSNMA, its word or any bits changed; nine times of ten the checksum is right."""
    first, length = rng.choice(((138, 8), (146, 32), (2, 6), (75, 34), (98, 16), (rng.randrange(214), 1)))
    whole = int.from_bytes(page.data, "big") >> 240 - first - length & (1 << length) - 1
    value = rng.choice((0, (1 << length) - 1, whole ^ 1 << rng.randrange(length), rng.getrandbits(length)))
    changed = _with_bits(page, first, length, value)
    return changed if rng.random() < 0.9 else replace(page, data=spoil_bytes(rng, page.data).ljust(30, b"\0")[:30])


def _page_files() -> Sequence[Files]:
    return [
        {"pages.csv": vector_csv(PAGES).encode()},
        {"pages.sbf": b"".join(map(inav_block, PAGES))},
    ]


def _spoil_page_file(rng: Random, files: Files) -> Files:
    (name,) = files
    data = files[name]
    assert isinstance(data, bytes)
    choice = rng.random()
    if choice < 0.25:
        return spoil_files(rng, files)
    pages = spoil_pages(rng, PAGES)
    if name.endswith("csv"):
        return {name: vector_csv(pages).encode()}
    blocks = [inav_block(page) for page in pages]
    if choice < 0.5:  # any bytes of a block, its checksum repaired
        at = rng.randrange(len(blocks))
        blocks[at] = sbf_block(spoil_bytes(rng, blocks[at][8:]), number=rng.choice((4023, 4023, 4023, 4007)))
    return {name: b"".join(blocks)}


def _read_page_file(folder: Path) -> None:
    for path in sorted(folder.iterdir()):
        require_genuine_keys(_keys_of_pages(path))


def _keys_of_pages(path: Path) -> tuple[ValidatedKey, ...]:
    receiver = OsnmaReceiver((CHAIN.public_key,), CHAIN.tree)
    for page in read_pages(path, counts=SbfCounts()):
        receiver.process(page)
    receiver.finish()
    return (*receiver.report().keys, *receiver.filled_keys())


def _withdrawn() -> Sequence[Files]:
    return [{"withdrawn.sbf": b"".join(map(inav_block, WITHDRAWN_PAGES))}]


def _spoil_withdrawn(rng: Random, _files: Files) -> Files:
    pages = _forged_headers(rng, WITHDRAWN_PAGES)
    if rng.random() < 0.5:
        pages = spoil_pages(rng, pages)
    return {"withdrawn.sbf": b"".join(map(inav_block, pages))}


def _read_withdrawn(folder: Path) -> None:
    """The only signed status says: do not use. No unsigned byte may change that."""
    if keys := _keys_of_pages(folder / "withdrawn.sbf"):
        raise WrongAcceptanceError(f"{len(keys)} keys of a chain that was withdrawn")


SIGNED = Target(name="signed", make=_signed, read=_read_signed, share=60)
TARGETS = (
    Target(name="recs", make=_recs_files, read=_read_recs, spoil=_spoil_recs, share=80),
    Target(name="recs-name", make=_names, read=_read_name, share=20),
    SIGNED,
    Target(name="certificate", make=_certificates, read=_read_certificate, share=30),
    Target(name="group-delay", make=_group_delays, read=_read_group_delays, share=40),
    Target(name="public-key", make=_public_keys, read=_read_public_key, share=40),
    Target(name="private-key", make=_private_keys, read=_read_private_key, share=20),
    Target(name="merkle-tree", make=_trees, read=_read_tree, share=60),
    Target(name="keys-csv", make=_key_files, read=_read_keys, spoil=_spoil_keys, share=60),
    Target(name="pages", make=_page_files, read=_read_page_file, spoil=_spoil_page_file, share=25),
    Target(name="withdrawn-chain", make=_withdrawn, read=_read_withdrawn, spoil=_spoil_withdrawn, share=12),
)
