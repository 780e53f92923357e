"""A TESLA chain of our own whose settings a test chooses: lengths, signature scheme, last key.

Everything follows from a seed: the last key, the chain down to its root, an ECDSA key pair, a Merkle tree with the
public key in it and the signed DSM-KROOT. A receiver that is given the Merkle tree treats it like the real one.
"""

from __future__ import annotations

from dataclasses import dataclass

from cryptography.hazmat.primitives.asymmetric import ec

from vestige.constants import SUBFRAME_S
from vestige.crypto.keys.merkle_tree import LEAVES, NODE_BYTES, MerkleTree, leaf_hash, nodes_over, verify_public_key
from vestige.crypto.keys.public_key import ClaimedPublicKey, PublicKey, compressed_point
from vestige.crypto.keys.signature_scheme import P256, SignatureScheme
from vestige.crypto.osnma.messages.chain_parameters import ALPHA_BYTES, ChainParameters
from vestige.crypto.osnma.messages.dsm import DsmKroot, NmaHeader
from vestige.crypto.osnma.messages.root_key import RootKey, verify_root_key
from vestige.crypto.osnma.messages.tesla import Chain, Key, validate
from vestige.crypto.osnma.operator.operator_chain import chain_keys, draw_keys, root_key_time
from vestige.crypto.osnma.operator.seeded_secrets import draw_bytes, draw_private_key
from vestige.crypto.osnma.operator.signed_messages import sign_kroot, unsigned_kroot
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey


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

    The first key is that of the subframe of `start`, the root key the one of 30 s before the full hour before it. All
    but the given `last_key` follows from the seed.
    """
    if n_keys < 1:
        raise ValueError(f"a chain needs at least one key, not {n_keys}")
    if parameters is None:
        parameters = ChainParameters(alpha=draw_bytes(seed, "alpha", ALPHA_BYTES))
    first = start.subframe
    if last_key is None:
        keys = draw_keys(seed, start, n_keys, parameters)
    else:
        last = Key(time=first + SUBFRAME_S * (n_keys - 1), data=last_key)
        keys = chain_keys(last, root_key_time(start), parameters)
    # The order of P-256 is the smaller one, so its numbers are private keys on P-521 too.
    secret = draw_private_key(seed, "private key").private_numbers().private_value
    private_key = ec.derive_private_key(secret, scheme.curve)
    header = NmaHeader(2 << 6 | chain_id << 4 | 1 << 1)  # operational, keys nominal
    unsigned = unsigned_kroot(keys[0], parameters, chain_id=chain_id, pkid=pkid)
    return SimulatedChain(
        keys=tuple(key for key in keys if key.time >= first),
        kroot=sign_kroot(unsigned, header, private_key),
        header=header,
        tree=_tree_of(seed, ClaimedPublicKey(pkid=pkid, leaf=pkid, point=compressed_point(private_key.public_key()))),
        private_key=private_key,
    )


def _tree_of(seed: bytes, claim: ClaimedPublicKey) -> MerkleTree:
    """Return a Merkle tree with one public key; the other leaves are drawn from the seed."""
    assert claim.pkid is not None
    assert claim.leaf is not None
    leaves = [draw_bytes(seed, f"leaf {i}", NODE_BYTES) for i in range(LEAVES)]
    leaves[claim.leaf] = leaf_hash(claim.pkid, claim.point)
    return MerkleTree(nodes=nodes_over(leaves), public_keys=(claim,))
