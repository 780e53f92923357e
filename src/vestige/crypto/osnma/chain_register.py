"""Register TESLA chains, and decide only from the signed status of OSNMA which chains are usable.

The NMA header of a subframe says whether OSNMA may be used, but anybody can forge this header. The NMA header is also
signed together with each DSM-KROOT. So the status follows from verified root keys, in the order of their reception:

* A root key with the status "don't use" withdraws all chains.
* A root key with "chain revoked" or "public key revoked" withdraws all chains. Only the chain of this root key stays
  usable, if the root key says "test" or "operational" and names its own chain as in force. "Public key revoked" also
  revokes the public keys before the key that signed the root key.
* A withdrawn chain becomes usable again only with its own root key. This root key must say "test" or "operational",
  must name its own chain as in force, and must certainly be newer than the withdrawal. A root key with a time after the
  withdrawal is newer, because no key of the chain is public before its time. A root key of the chain that the
  withdrawal announced as next chain is newer, because the next chain was not in force before.
* An alert message is final, because no message that could end the alert is trusted any more [OSNMA-RG, 4.2.3].
* A root key that is signed with a revoked public key is not accepted. The keys of a chain without an accepted root key
  are refused from the first withdrawal on.

The time of reception of a root key is not signed, so an attacker may choose it. Therefore a withdrawal counts from the
earliest of its times of reception. A root key that ends a withdrawal must be later than the latest reception of the
withdrawal and later than the withdrawing root key. The root key must also be later than the root keys of the chain that
were known at the withdrawal. These conditions do not apply to root keys of the chain that the withdrawal announced as
next chain. The times of root keys are signed.

An attacker may record a genuine withdrawal, and send the withdrawal to a receiver that did not receive it before. The
receiver treats the withdrawal as new, and then has no keys until the root key of the next hour. In return, the receiver
also obeys a genuine withdrawal that arrives late.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from vestige.crypto.keys.public_key import PublicKey
from vestige.crypto.osnma.messages.dsm import ALERT, KEY_REVOKED, DsmKroot, NmaHeader
from vestige.crypto.osnma.messages.root_key import RootKey
from vestige.crypto.osnma.messages.tesla import Chain, Key
from vestige.errors import AuthenticationError
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey


class RevokedKeyError(AuthenticationError):
    """A root key is signed with a public key that was revoked."""


@dataclass(slots=True, kw_only=True)
class _Withdrawal:
    """A withdrawal of all chains from `since` on, except `in_force` and chains that became usable again.

    A chain becomes usable again with a root key that is later than `until` and than the root key of the chain in
    `known`. A root key of the chain `successor` need not be later.
    """

    since: GalileoTime  # earliest time of reception, which is not signed
    until: GalileoTime  # latest time of reception, or the signed time of the withdrawal if the signed time is later
    header: NmaHeader | None = None  # signed NMA header with the withdrawal; None for an alert message
    in_force: Chain | None = None
    successor: Chain | None = None  # next chain that the withdrawal announced
    final: bool = False
    known: dict[Chain, GalileoTime] = field(default_factory=dict)  # time of the latest known root key of each chain
    lifted: dict[Chain, GalileoTime] = field(default_factory=dict)

    @property
    def reason(self) -> str:
        if self.header is None:
            return f"alert message of {self.since}: ask the operator (GSC)"
        return f"withdrawn by the signed root key of {self.since}: {self.header}"

    def received(self, time: GalileoTime) -> bool:
        """Note another reception at `time`, and return whether the withdrawal now counts from an earlier time."""
        earlier = time < self.since
        self.since, self.until = min(self.since, time), max(self.until, time)
        return earlier


class ChainRegister:
    """Register of the chains of verified root keys, and of the withdrawals of chains.

    Attributes
    ----------
    chains
        Chains in the order of reception of their first root keys.
    n_changes
        Number of changes that cause the refusal of more keys: new withdrawals, and earlier times of withdrawals.
    """

    def __init__(self) -> None:
        self.chains: list[Chain] = []
        self.n_changes = 0
        self._withdrawals: list[_Withdrawal] = []
        self._withdrawal_of: dict[tuple[NmaHeader, DsmKroot], _Withdrawal] = {}
        self._revoked_by: list[PublicKey] = []
        self._newest: dict[Chain, GalileoTime] = {}

    def add(self, root: RootKey) -> bool:
        """Add a verified root key, and return whether its chain was already known.

        Root keys are added in the order of reception. A root key may be added again with another time of reception.

        The function raises `RevokedKeyError` if an earlier root key revoked the public key that signed this root key.
        """
        for revoker in self._revoked_by:
            if _comes_before(root.public_key, revoker):
                raise RevokedKeyError(f"signed with {root.public_key}, which {revoker} revoked")
        chain = next((chain for chain in self.chains if chain.holds(root)), None)
        known = chain is not None
        if chain is None:
            chain = Chain(root)
            self.chains.append(chain)
        self._newest[chain] = max(self._newest.get(chain, root.time), root.time)
        self._lift(root, chain)
        self._withdraw(root, chain)
        return known

    def add_alert(self, time: GalileoTime) -> None:
        """Withdraw all chains permanently, because an alert message was received in the subframe of `time`."""
        alert = next((withdrawal for withdrawal in self._withdrawals if withdrawal.header is None), None)
        if alert is None:
            self._withdrawals.append(_Withdrawal(since=time, until=time, final=True))
            self.n_changes += 1
        else:
            self.n_changes += alert.received(time)

    def refusal(self, chain: Chain, time: GalileoTime) -> str:
        """Return the reason why a chain's key of a subframe may not be used; "" if the key may be used."""
        for withdrawal in self._withdrawals:
            lifted = withdrawal.lifted.get(chain)
            if time >= withdrawal.since and chain is not withdrawal.in_force and (lifted is None or time < lifted):
                return withdrawal.reason
        return ""

    def refusal_of(self, key: ValidatedKey) -> str:
        """Return the reason why a key that was validated before may not be used; "" if the key may be used.

        The key may come from another run of the program. The key counts as a key of the first chain that contains the
        key. If no chain contains the key, no root key of its chain was accepted. A key without an accepted root key is
        refused from the first withdrawal on.
        """
        if not self._withdrawals:
            return ""
        for chain in self.chains:
            if chain.chain_id == key.chain_id and chain.accepts(Key(time=key.time, data=key.data)):
                return self.refusal(chain, key.time)
        reasons = (withdrawal.reason for withdrawal in reversed(self._withdrawals) if key.time >= withdrawal.since)
        return next(reasons, "")

    def _withdraw(self, root: RootKey, chain: Chain) -> None:
        header = root.header
        if header.key_status == KEY_REVOKED and root.public_key not in self._revoked_by:
            self._revoked_by.append(root.public_key)
        if not header.withdraws:
            return
        identity = header, root.kroot
        if (same := self._withdrawal_of.get(identity)) is not None:
            self.n_changes += same.received(root.received_at)
            return
        own = root.chain_id == header.chain_id
        in_force = chain if header.usable and own else None
        latest = self._withdrawals[-1] if self._withdrawals else None
        if in_force is not None and latest is not None and latest.in_force is in_force and not latest.lifted:
            # The operator repeats the withdrawing root key every hour while the withdrawal lasts.
            self._withdrawal_of[identity] = latest
            self.n_changes += latest.received(root.received_at)
            return
        withdrawal = _Withdrawal(
            since=root.received_at,
            until=max(root.received_at, root.time),
            header=header,
            in_force=in_force,
            successor=None if own or header.usable else chain,
            final=header.key_status == ALERT,
            known=dict(self._newest),
        )
        self._withdrawals.append(withdrawal)
        self._withdrawal_of[identity] = withdrawal
        self.n_changes += 1

    def _lift(self, root: RootKey, chain: Chain) -> None:
        if not root.header.usable or root.chain_id != root.header.chain_id:
            return
        since = max(root.received_at, root.time)  # a root key cannot be received before its time
        for withdrawal in self._withdrawals:
            newer = root.time > max(withdrawal.until, withdrawal.known.get(chain, withdrawal.until))
            if (newer or withdrawal.successor is chain) and not withdrawal.final:
                withdrawal.lifted[chain] = min(withdrawal.lifted.get(chain, since), since)


def _comes_before(key: PublicKey, revoker: PublicKey) -> bool:
    if key == revoker:
        return False
    return key.pkid is None or revoker.pkid is None or key.pkid < revoker.pkid
