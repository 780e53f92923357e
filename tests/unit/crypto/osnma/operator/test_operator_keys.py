"""The operator's key pairs, its tree, and what its DSMs are made of."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    NoEncryption,
    PrivateFormat,
    PublicFormat,
)

from vestige.crypto.keys.merkle_tree import nodes_over, verify_broadcast_key, verify_tree
from vestige.crypto.osnma.messages.alert_message import is_alert, verify_alert
from vestige.crypto.osnma.messages.chain_parameters import ChainParameters
from vestige.crypto.osnma.messages.tags import Mack
from vestige.crypto.osnma.messages.tesla import Key
from vestige.crypto.osnma.operator.key_tree import draw_key_tree, read_private_key
from vestige.crypto.osnma.operator.mack import encode_mack
from vestige.crypto.osnma.operator.seeded_secrets import draw_bytes
from vestige.crypto.osnma.operator.signed_messages import alert_dsm, public_key_dsm, unsigned_kroot
from vestige.errors import AuthenticationError, InputFileError, UnsupportedError, VestigeError
from vestige.time import GalileoTime

TREE = draw_key_tree(b"tree", b"notice")
ROOT = TREE.published(()).root


def test_all_fifteen_keys_and_the_notice_are_leaves_of_one_tree() -> None:
    published = TREE.published(range(1, 16))
    assert [key.pkid for key in verify_tree(published)] == list(range(1, 16))
    for pkid in range(1, 16):
        data = public_key_dsm(TREE.claim(pkid).point, pkid, pkid - 1, TREE.siblings(pkid - 1), ROOT)
        assert verify_broadcast_key(data, published) == TREE.public_key(pkid)
        # NB, leaf, four nodes, type and PKID, point, padding [OSNMA-ICD, DSM-PKR]
        content = bytes([1 << 4 | pkid]) + TREE.claim(pkid).point
        padding = hashlib.sha256(ROOT + content).digest()[:6]
        assert data == bytes([7 << 4 | pkid - 1]) + b"".join(TREE.siblings(pkid - 1)) + content + padding
    alert = alert_dsm(b"notice", 15, TREE.siblings(15))
    assert is_alert(alert)
    verify_alert(alert, published)
    with pytest.raises(AuthenticationError, match="alert message: gives the root"):
        verify_alert(alert_dsm(b"another", 15, TREE.siblings(15)), published)


def test_a_p521_key_has_the_blocks_that_it_needs() -> None:
    private_key = ec.derive_private_key(99, ec.SECP521R1())
    point = private_key.public_key().public_bytes(Encoding.X962, PublicFormat.CompressedPoint)
    data = public_key_dsm(point, 9, 3, TREE.siblings(3), ROOT)
    assert (len(data), data[0]) == (16 * 13, 10 << 4 | 3)


def test_an_own_key_is_read_from_pem(tmp_path: Path) -> None:
    private_key = ec.derive_private_key(4711, ec.SECP256R1())
    path = tmp_path / "own.pem"
    path.write_bytes(private_key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    own = read_private_key(path)
    assert own.private_numbers() == private_key.private_numbers()
    tree = draw_key_tree(b"tree", b"notice", (2, own))
    assert tree.private_key(2) is own
    assert tree.claim(3) == TREE.claim(3)
    path.write_bytes(private_key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, BestAvailableEncryption(b"x")))
    for content in (path.read_bytes(), b"no key", b""):
        path.write_bytes(content)
        with pytest.raises(InputFileError, match=r"own\.pem: PEM block: found no private key"):
            read_private_key(path)
    other = ec.derive_private_key(1, ec.SECP521R1())
    path.write_bytes(other.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    with pytest.raises(UnsupportedError, match="not on P-256"):
        read_private_key(path)


def test_what_is_not_possible() -> None:
    with pytest.raises(VestigeError, match="PKID 0, expected 1 to 15"):
        draw_key_tree(b"", b"", (0, ec.derive_private_key(1, ec.SECP256R1())))
    with pytest.raises(VestigeError, match="no private key of PKID 16"):
        TREE.public_key(16)
    with pytest.raises(ValueError, match="16 leaves"):
        nodes_over([bytes(32)] * 15)
    with pytest.raises(ValueError, match="33 bytes cannot be drawn"):
        draw_bytes(b"", "", 33)
    parameters = ChainParameters(alpha=bytes(6))
    with pytest.raises(ValueError, match="30 s before a full hour"):
        unsigned_kroot(Key(time=GalileoTime(1400, 0), data=bytes(16)), parameters, chain_id=0, pkid=1)
    mack = Mack(svid=2, time=GalileoTime(1400, 0), nma_status=2, macseq=0, tags=())
    with pytest.raises(ValueError, match="0 tags and a key of 16 bytes, expected 6 and 16"):
        encode_mack(mack, bytes(16), parameters)
