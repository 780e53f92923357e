"""Make a TESLA chain of the operator with all keys, including keys that are still secret."""

from __future__ import annotations

from dataclasses import dataclass, replace

from cryptography.hazmat.primitives.asymmetric import ec

from vestige.constants import HOUR_S, SUBFRAME_S
from vestige.crypto.osnma.messages.chain_parameters import ALPHA_BYTES, ChainParameters
from vestige.crypto.osnma.messages.dsm import DsmKroot, NmaHeader
from vestige.crypto.osnma.messages.tesla import Key, one_way
from vestige.crypto.osnma.operator.seeded_secrets import draw_bytes
from vestige.crypto.osnma.operator.signed_messages import sign_kroot, unsigned_kroot
from vestige.errors import VestigeError
from vestige.time import GalileoTime

_FIXED_BYTES = 7  # bytes of a DSM-KROOT before alpha; these bytes cannot be changed to avoid a zero byte
_MAX_DRAWS = 32
_HOURS_SEEN = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class OperatorChain:
    """All keys of a chain from its first root key on, 30 s apart and without gaps."""

    chain_id: int  # CID 0 to 3
    parameters: ChainParameters
    keys: tuple[Key, ...]  # keys in time order, beginning with the first root key

    def key_at(self, time: GalileoTime) -> Key:
        """Return the key that is disclosed in the subframe of `time`.

        The function raises `VestigeError` if the chain has no key for this subframe.
        """
        index, rest = divmod(time.gst_seconds - self.keys[0].time.gst_seconds, SUBFRAME_S)
        if rest or not 0 <= index < len(self.keys):
            first, last = self.keys[0].time, self.keys[-1].time
            raise VestigeError(f"OSNMA chain {self.chain_id} has keys from {first} to {last}, and none for {time}")
        return self.keys[index]

    def signed_root(
        self, time: GalileoTime, header: NmaHeader, pkid: int, private_key: ec.EllipticCurvePrivateKey
    ) -> DsmKroot:
        """Sign the root key that is the newest at a time, and return the DSM-KROOT with the root key.

        Parameters
        ----------
        time
            Any time from the chain's first hour on.
        header
            NMA header that is broadcast with the DSM-KROOT.
        pkid
            PKID of the public key that verifies the DSM-KROOT.
        private_key
            Private key with this PKID.
        """
        root = self.key_at(root_key_time(time))
        kroot = unsigned_kroot(root, self.parameters, chain_id=self.chain_id, pkid=pkid)
        return sign_kroot(kroot, header, private_key)


def root_key_time(time: GalileoTime) -> GalileoTime:
    """Return the subframe of the newest root key at a time: 30 s before the last full hour.

    The key of this subframe has been disclosed, so the root key reveals no secret.

    Examples
    --------
    >>> root_key_time(GalileoTime(1400, 7325))
    GalileoTime(week=1400, second=7170, fraction=0.0)
    """
    return GalileoTime(time.week, time.second - time.second % HOUR_S) + -SUBFRAME_S


def chain_keys(last: Key, first: GalileoTime, parameters: ChainParameters) -> tuple[Key, ...]:
    """Return the keys of a chain from the subframe `first` to the key `last`, in time order.

    Each key is the hash of the next key [OSNMA-ICD, 6.4].

    Parameters
    ----------
    last
        The last key of the chain, at the start of a subframe.
    first
        Start of the subframe of the first key.
    parameters
        Parameters of the chain.
    """
    keys = [last]
    while keys[-1].time > first:
        time = keys[-1].time + -SUBFRAME_S
        keys.append(Key(time=time, data=one_way(keys[-1].data, time, parameters)))
    return tuple(reversed(keys))


def draw_keys(seed: bytes, start: GalileoTime, n_keys: int, parameters: ChainParameters) -> tuple[Key, ...]:
    """Return the keys of a chain from the root key of the hour of `start` on; the keys follow from a seed.

    Parameters
    ----------
    seed
        Secret from which the last key follows.
    start
        A time in the first subframe whose key is needed.
    n_keys
        Number of needed keys from the subframe of `start` on, 30 s apart; 1 or more.
    parameters
        Parameters of the chain.
    """
    last_time = start.subframe + SUBFRAME_S * (n_keys - 1)
    last = Key(time=last_time, data=draw_bytes(seed, "last key", parameters.key_bytes))
    return chain_keys(last, root_key_time(start), parameters)


def draw_chain(
    seed: bytes,
    start: GalileoTime,
    n_keys: int,
    chain_id: int,
    parameters: ChainParameters,
    header: NmaHeader,
    pkid: int,
    private_key: ec.EllipticCurvePrivateKey,
    *,
    redraw: bool = True,
) -> OperatorChain:
    """Draw a chain, if possible with DSM-KROOTs that have no zero byte from alpha on, and return the chain.

    Some receivers treat a page with a zero HKROOT byte as lost. So the alpha of `parameters` and then random patterns
    from the seed are tried. A pattern is good if alpha, root key, signature and padding have no zero byte over the
    first four hours. The first good pattern is used. If none of 32 patterns is good, the pattern with the fewest zero
    bytes is used.

    Parameters
    ----------
    seed, start, n_keys, parameters
        Arguments of `draw_keys`.
    chain_id
        CID of the chain, 0 to 3.
    header, pkid, private_key
        NMA header, PKID and private key of the first signatures, as for `OperatorChain.signed_root`.
    redraw
        Whether alpha may be replaced. False keeps the alpha of `parameters`.
    """
    best: tuple[int, OperatorChain] | None = None
    for draw in range(_MAX_DRAWS if redraw else 1):
        tried = parameters if draw == 0 else replace(parameters, alpha=draw_bytes(seed, f"alpha {draw}", ALPHA_BYTES))
        chain = OperatorChain(chain_id=chain_id, parameters=tried, keys=draw_keys(seed, start, n_keys, tried))
        n_zero = sum(
            chain.signed_root(start + shift, header, pkid, private_key).serialise()[_FIXED_BYTES:].count(0)
            for shift in range(0, min(SUBFRAME_S * n_keys, _HOURS_SEEN * HOUR_S), HOUR_S)
        )
        if best is None or n_zero < best[0]:
            best = n_zero, chain
        if n_zero == 0:
            break
    assert best is not None  # noqa: S101  (the loop runs)
    return best[1]
