"""Verify the alert message of OSNMA, which is a DSM-PKR with a notice in place of a public key.

The notice is a leaf of the Merkle tree, as a public key is. The leaf is SHA-256 of `type 4 | PKID 4 | notice`, with
lengths in bits. The type is 4, and the notice fills the message up to its end [OSNMA-ICD, DSM-PKR]. A notice leads to
the root of the tree only if the operator put the notice into the tree. After a verified notice, the receiver must stop
the use of OSNMA, and the user must ask the operator [OSNMA-RG, 4.2.3].
"""

from __future__ import annotations

import hashlib

from vestige.crypto.keys.merkle_tree import LEAF_AT, MerkleTree, path_root, siblings_in
from vestige.crypto.osnma.messages.dsm import DSM_BLOCK_BYTES, pkr_blocks
from vestige.errors import AuthenticationError

ALERT_TYPE = 4  # NPKT of an alert message [OSNMA-ICD, DSM-PKR]


def is_alert(message: bytes) -> bool:
    """Return whether a complete DSM-PKR has the type of an alert message."""
    return len(message) > LEAF_AT and message[LEAF_AT] >> 4 == ALERT_TYPE


def verify_alert(message: bytes, tree: MerkleTree) -> None:
    """Check that an alert message leads to the root of the tree.

    `message` contains all blocks of the DSM-PKR.

    The function raises `AuthenticationError` if the message is malformed or leads to another root. The function raises
    `UnsupportedError` if the code of the number of blocks is reserved.
    """
    if not is_alert(message) or len(message) != pkr_blocks(message[0]) * DSM_BLOCK_BYTES:
        raise AuthenticationError(f"DSM-PKR: {len(message)} bytes are no alert message")
    found = path_root(message[0] & 15, hashlib.sha256(message[LEAF_AT:]).digest(), siblings_in(message))
    if found != tree.root:
        raise AuthenticationError(
            f"alert message: gives the root {found.hex()[:16]}…, not the trusted {tree.root.hex()[:16]}…"
        )
