"""Configure an OSNMA operator: secrets, the TESLA chain, and the events of the broadcast."""

from __future__ import annotations

from dataclasses import dataclass

from cryptography.hazmat.primitives.asymmetric import ec

from vestige.crypto.osnma.messages.chain_parameters import ALPHA_BYTES, ChainParameters
from vestige.crypto.osnma.messages.dsm import OPERATIONAL, TEST
from vestige.crypto.osnma.messages.mac_lookup import slots
from vestige.crypto.osnma.operator.events import OsnmaEvent
from vestige.crypto.osnma.operator.key_tree import MAX_PKID, KeyTree
from vestige.errors import VestigeError
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorConfiguration:
    """Settings of an `OsnmaOperator`; operators with equal settings make equal bits for equal navigation words.

    Parameters
    ----------
    seed
        Any bytes. All secrets that are not given follow from the seed.
    start
        Start of the first subframe, a multiple of 30 s.
    n_subframes
        Number of broadcast subframes, 1 or more.
    pkid
        PKID 1 to 15 of the key that signs at the start. Each renewal and each revocation of a public key uses the next
        PKID. A renewal or revocation of a chain keeps the PKID.
    own_key
        Private key on P-256 for `pkid`, not used if `tree` is given. If `own_key` and `tree` are None, the key follows
        from the seed.
    tree
        Merkle tree and private keys of the operator. If None, tree and keys follow from the seed, `own_key` and
        `notice`.
    chain_id
        CID 0 to 3 of the first chain. Later chains have the next numbers, modulo 4.
    hash_function, mac_function, key_size, tag_size, mac_lookup
        Codes of the DSM-KROOT, as in `ChainParameters`. A tag size of 9 stands for 40 bits.
    alpha
        Random pattern of the first chain, 6 bytes. If None, the pattern follows from the seed.
    nma_status
        NMAS in nominal operation: 1 for test, 2 for operational.
    events
        Events of the broadcast, in any order.
    notice
        Notice of an alert message, at most 39 bytes.

    Raises
    ------
    UnsupportedError
        If `ChainParameters` refuses a code, or the MAC look-up table has no row `mac_lookup` with the number of tags.
    VestigeError
        If `pkid`, `chain_id`, `nma_status`, `n_subframes`, `start` or the length of `alpha` is invalid, or if an event
        begins before `start`.

    Examples
    --------
    >>> configuration = OperatorConfiguration(seed=b"sky", start=GalileoTime(1400, 3600), n_subframes=20)
    >>> str(configuration.parameters(b"random"))
    'SHA-256, HMAC-SHA-256, 128-bit keys, 40-bit tags, MACLT 34'
    """

    seed: bytes
    start: GalileoTime
    n_subframes: int
    pkid: int = 1
    own_key: ec.EllipticCurvePrivateKey | None = None
    tree: KeyTree | None = None
    chain_id: int = 1
    hash_function: int = 0
    mac_function: int = 0
    key_size: int = 4
    tag_size: int = 9
    mac_lookup: int = 34
    alpha: bytes | None = None
    nma_status: int = OPERATIONAL
    events: tuple[OsnmaEvent, ...] = ()
    notice: bytes = b"OSNMA alert: ask the operator"

    def __post_init__(self) -> None:
        for name, value, values in (
            ("pkid", self.pkid, range(1, MAX_PKID + 1)),
            ("chain_id", self.chain_id, range(4)),
            ("nma_status", self.nma_status, range(TEST, OPERATIONAL + 1)),
            ("n_subframes", self.n_subframes, range(1, 1 << 31)),
        ):
            if value not in values:
                raise VestigeError(
                    f"OSNMA operator: {name}: found {value}, expected {values.start} to {values.stop - 1}"
                )
        if self.start != self.start.subframe:
            raise VestigeError(f"OSNMA operator: start: found {self.start}, expected the start of a subframe")
        if self.alpha is not None and len(self.alpha) != ALPHA_BYTES:
            raise VestigeError(f"OSNMA operator: alpha: found {len(self.alpha)} bytes, expected {ALPHA_BYTES}")
        for event in self.events:
            if event.announced < self.start:
                raise VestigeError(
                    f"OSNMA operator: the {event.kind.value} of {event.announced} begins before the start, {self.start}"
                )
        slots(self.parameters(bytes(ALPHA_BYTES)), self.start)

    def parameters(self, alpha: bytes) -> ChainParameters:
        """Return the parameters of a chain whose random pattern is `alpha`, 6 bytes."""
        return ChainParameters(
            hash_function=self.hash_function,
            mac_function=self.mac_function,
            key_size=self.key_size,
            tag_size=self.tag_size,
            mac_lookup=self.mac_lookup,
            alpha=alpha,
        )
