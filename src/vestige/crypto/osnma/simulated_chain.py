"""A TESLA chain of our own, for simulations and tests: the operator's side of OSNMA.

Everything follows from a seed: the last key, the chain down to its root, an ECDSA key pair, a Merkle tree with the
public key in it and the signed DSM-KROOT. A receiver that is given the Merkle tree treats it like the real one.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace

from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.utils import decode_dss_signature

from vestige.constants import SUBFRAME_S
from vestige.crypto.keys.merkle_tree import HEIGHT, LEAVES, MerkleTree, leaf_hash, verify_public_key
from vestige.crypto.keys.public_key import ClaimedPublicKey, PublicKey, compressed_point
from vestige.crypto.keys.signature_scheme import P256, SignatureScheme, scheme_of_curve
from vestige.crypto.osnma.messages.chain_parameters import ALPHA_BYTES, ChainParameters
from vestige.crypto.osnma.messages.dsm import BLOCK_BYTES, KROOT_BLOCKS, DsmKroot, NmaHeader
from vestige.crypto.osnma.messages.root_key import RootKey, verify_root_key
from vestige.crypto.osnma.messages.tesla import Chain, Key, one_way, validate
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

_P256_ORDER = 0xFFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551  # [FIPS 186-4, D.1.2.3]
_HOUR_S = 3600


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedChain:
    """A chain with everything that its operator knows."""

    keys: tuple[Key, ...]  # the keys in time order, the first one in the subframe that was asked for
    kroot: DsmKroot  # signed
    header: NmaHeader  # signed with it
    tree: MerkleTree  # a Merkle tree with the public key as one of its leaves
    private_key: ec.EllipticCurvePrivateKey  # signs further DSM-KROOTs

    @property
    def public_key(self) -> PublicKey:
        """The public key, verified against the tree."""
        return verify_public_key(self.tree.public_keys[0], self.tree)

    @property
    def root(self) -> RootKey:
        """The root key, verified with the public key."""
        return verify_root_key(self.kroot, self.header, (self.public_key,), near=self.keys[0].time)

    def validated_keys(self) -> tuple[ValidatedKey, ...]:
        """Return all keys, each validated along the chain."""
        chain = Chain(self.root)
        return tuple(validate(key, chain) for key in self.keys)


def make_chain(
    seed: bytes,
    start: GalileoTime,
    n_keys: int,
    *,
    chain_id: int = 0,
    pkid: int = 1,
    parameters: ChainParameters | None = None,
    scheme: SignatureScheme = P256,
    last_key: bytes | None = None,
) -> SimulatedChain:
    """Return a chain whose keys cover `n_keys` subframes from the one of `start` on; the same seed, the same chain.

    Parameters
    ----------
    seed
        Any bytes; a secret if the chain is to be one.
    start
        A time in the first subframe. The root key is the one of 30 s before the full hour before it.
    n_keys
        Number of keys, 30 s apart.
    chain_id, pkid
        CID 0 … 3 and PKID 0 … 15.
    parameters
        Parameters of the chain; without them the operational ones, with an alpha from the seed.
    scheme
        What the root key is signed with.
    last_key
        The key of the last subframe, which all others follow from; drawn from the seed if it is not given.
    """
    if n_keys < 1:
        raise ValueError(f"a chain needs at least one key, not {n_keys}")
    if parameters is None:
        parameters = ChainParameters(alpha=_expand(seed, "alpha", ALPHA_BYTES))
    first = start.subframe
    hour = first + -(first.second % _HOUR_S)
    root_time = hour + -SUBFRAME_S
    data = _expand(seed, "last key", parameters.key_bytes) if last_key is None else last_key
    key = Key(time=first + SUBFRAME_S * (n_keys - 1), data=data)
    keys = [key]
    while key.time > root_time:
        time = key.time + -SUBFRAME_S
        key = Key(time=time, data=one_way(key.data, time, parameters))
        keys.append(key)
    # The order of P-256 is the smaller one, so its numbers are private keys on P-521 too.
    secret = 1 + int.from_bytes(_expand(seed, "private key", 32), "big") % (_P256_ORDER - 1)
    private_key = ec.derive_private_key(secret, scheme.curve)
    header = NmaHeader(2 << 6 | chain_id << 4 | 1 << 1)  # operational, keys nominal
    unsigned = DsmKroot(
        n_blocks=min(KROOT_BLOCKS.values()),
        public_key_id=pkid,
        chain_id=chain_id,
        parameters=parameters,
        root_week=hour.week % 4096,
        root_hour=hour.second // _HOUR_S,
        root_key=key.data,
        signature=bytes(scheme.signature_bytes),
        padding=b"",
    )
    return SimulatedChain(
        keys=tuple(reversed([key for key in keys if key.time >= first])),
        kroot=sign_kroot(unsigned, header, private_key),
        header=header,
        tree=_tree_of(seed, ClaimedPublicKey(pkid=pkid, leaf=pkid, point=compressed_point(private_key.public_key()))),
        private_key=private_key,
    )


def sign_kroot(kroot: DsmKroot, header: NmaHeader, private_key: ec.EllipticCurvePrivateKey) -> DsmKroot:
    """Return the DSM-KROOT with signature and padding for its header, in as many blocks as it needs."""
    scheme = scheme_of_curve(private_key.curve)
    assert scheme is not None  # noqa: S101  (ours)
    algorithm = ec.ECDSA(scheme.hash, deterministic_signing=True)
    numbers = decode_dss_signature(private_key.sign(kroot.signed_message(header), algorithm))
    signature = b"".join(number.to_bytes(scheme.coordinate_bytes, "big") for number in numbers)
    signed = replace(kroot, signature=signature, padding=b"")
    length = len(signed.serialise())
    n_blocks = max(min(KROOT_BLOCKS.values()), -(-length // BLOCK_BYTES))
    signed = replace(signed, n_blocks=n_blocks, padding=bytes(n_blocks * BLOCK_BYTES - length))
    return replace(signed, padding=signed.expected_padding(header))


def _tree_of(seed: bytes, claim: ClaimedPublicKey) -> MerkleTree:
    """Return a Merkle tree with one public key; the other leaves are drawn from the seed."""
    assert claim.pkid is not None  # noqa: S101  (ours)
    assert claim.leaf is not None  # noqa: S101
    level = [_expand(seed, f"leaf {i}", 32) for i in range(LEAVES)]
    level[claim.leaf] = leaf_hash(claim.pkid, claim.point)
    nodes: dict[tuple[int, int], bytes] = {}
    for height in range(HEIGHT + 1):
        nodes |= {(height, i): value for i, value in enumerate(level)}
        level = [hashlib.sha256(level[i] + level[i + 1]).digest() for i in range(0, len(level) - 1, 2)]
    return MerkleTree(nodes=nodes, public_keys=(claim,))


def _expand(seed: bytes, name: str, n_bytes: int) -> bytes:
    """Return `n_bytes` (at most 32) that follow from the seed and the name of what they are for."""
    return hashlib.sha256(b"vestige simulated OSNMA chain\0" + name.encode() + b"\0" + seed).digest()[:n_bytes]
