"""The genuine senders of the inputs, an OSNMA chain and an assistance server, what they sent, and the check for it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

from fuzz.engine import Files, WrongAcceptanceError
from osnma_builder import Broadcast
from simulated_chain import make_chain
from vestige.constants import SECONDS_PER_WEEK
from vestige.crypto.keys.signature_scheme import P521
from vestige.crypto.osnma.messages.dsm import NmaHeader
from vestige.crypto.osnma.operator.signed_messages import sign_kroot
from vestige.crypto.recs import recs_segment as recs
from vestige.records import ChipSequence, EncryptedSegment, GroupDelay, ValidatedKey
from vestige.time import GalileoTime

START = GalileoTime(1372, 478_800)  # a full hour, so the key before the first one is the root key
CHAIN = make_chain(b"fuzz", START, 6)
KEYS = CHAIN.validated_keys()
WIDE_CHAIN = make_chain(b"fuzz wide", START, 6, chain_id=1, pkid=2, scheme=P521)  # signed on the wider curve
CHAINS = (CHAIN, WIDE_CHAIN)
SERVER_KEY = ec.derive_private_key(0x1234567, ec.SECP256R1())
_WEEKS_S = 4096 * SECONDS_PER_WEEK  # OSNMA counts weeks modulo 4096: a receiver knows its time to 39 years

# Two satellites that send all blocks of the DSM-KROOT in four subframes.
PAGES = tuple(Broadcast(CHAIN, svids=(2, 6), n_subframes=5).pages())
_DONT_USE = NmaHeader(0xC2)
WITHDRAWN_PAGES = tuple(
    Broadcast(
        CHAIN,
        svids=(2, 6),
        n_subframes=6,
        header=_DONT_USE.value,
        dsm_of=lambda _svid: sign_kroot(CHAIN.kroot, _DONT_USE, CHAIN.private_key).serialise(),
    ).pages()
)


def pem(key: ec.EllipticCurvePublicKey) -> bytes:
    """Return a public key as PEM."""
    return key.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)


def segment(svid: int, time: GalileoTime, key_delay: int = 0, n_chips: int = 5115) -> EncryptedSegment:
    """Return a genuine RECS."""
    keys = {key.time: key.data for key in CHAIN.keys}
    chips = np.random.default_rng(svid).choice(np.array([-1, 1], np.int8), n_chips)
    sequence = ChipSequence.of(svid=svid, transmit_time=time, chip_rate_hz=5.115e6, chips=chips)
    return recs.encrypt(sequence, keys[recs.key_time(time, key_delay)], key_delay=key_delay)


SEGMENTS = (
    *(segment(svid, START + 30 * k + 0.5) for k in range(4) for svid in (3, 11)),
    segment(11, START + 103, key_delay=1),
)
GROUP_DELAYS = tuple(GroupDelay(svid=svid, bgd_e1_e6_s=svid * 2.0**-32, valid_from=START) for svid in (3, 11))


def files_of(write: Callable[[Path], object]) -> Files:
    """Return what `write` puts into a folder."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        write(folder)
        return {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        }


_TRUE_KEYS = {
    (chain.root.chain_id, key.time.gst_seconds % _WEEKS_S, key.data)
    for chain in CHAINS
    for key in (chain.root, *chain.keys)
}


def require_genuine_keys(keys: Iterable[ValidatedKey]) -> None:
    """Raise WrongAcceptanceError unless each key belongs to the chain, at its own time and time of disclosure."""
    for key in keys:
        delays_s = (key.disclosed_at - key.time, key.complete_at - key.time)
        true_s = (KEYS[0].disclosed_at - KEYS[0].time, KEYS[0].complete_at - KEYS[0].time)
        if (key.chain_id, key.time.gst_seconds % _WEEKS_S, key.data) not in _TRUE_KEYS or delays_s != true_s:
            raise WrongAcceptanceError(f"a false key is valid: {key}")
