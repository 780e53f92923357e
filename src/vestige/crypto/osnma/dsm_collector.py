"""Collect digital signature messages from the blocks that the satellites send.

Blocks are collected in two ways. The collection from all satellites together is fast. The separate collection from each
satellite ensures that a satellite with false blocks cannot prevent the completion of another satellite's message. A
complete message is not trusted before its signature, or its path in the Merkle tree (DSM-PKR), is verified.

A message is returned again when it comes with an earlier time of reception than before. The time of reception is not
signed, so the time that was stored first may be false. The withdrawal of a chain has to count from the earliest time of
reception. The verifier stores its results, so a message that is returned again needs no second signature check.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from vestige.crypto.osnma.messages.dsm import FIRST_PKR_ID, NmaHeader, kroot_blocks, pkr_blocks
from vestige.crypto.osnma.messages.subframe import SatelliteSubframe
from vestige.errors import UnsupportedError
from vestige.time import GalileoTime

# Our choice of the largest time in s between two blocks of a DSM. A DSM is repeated every few minutes, and its number
# is reused only after hours.
MAX_AGE_S = 1800

_ALL = 0  # number in place of an SVID for the collection from all satellites together


@dataclass(frozen=True, slots=True, kw_only=True)
class DsmMessage:
    """A complete DSM as received, before verification."""

    header: NmaHeader  # NMA header that was sent with every block
    dsm_id: int  # number of the DSM, 0 to 11 for a DSM-KROOT and 12 to 15 for a DSM-PKR
    data: bytes  # all blocks in the order of their numbers

    @property
    def is_root_key(self) -> bool:
        """Whether the message is a DSM-KROOT."""
        return self.dsm_id < FIRST_PKR_ID


@dataclass(slots=True)
class _Collection:
    blocks: dict[int, bytes] = field(default_factory=dict)
    last_s: int = 0

    def add(self, number: int, block: bytes, time_s: int) -> None:
        # If the block with this number has changed, a new message replaced the old message.
        if time_s - self.last_s > MAX_AGE_S or self.blocks.get(number, block) != block:
            self.blocks.clear()
        self.blocks[number] = block
        self.last_s = time_s

    def message(self, dsm_id: int) -> bytes | None:
        if 0 not in self.blocks:
            return None
        first_byte = self.blocks[0][0]
        n_blocks = kroot_blocks(first_byte) if dsm_id < FIRST_PKR_ID else pkr_blocks(first_byte)
        if any(number not in self.blocks for number in range(n_blocks)):
            return None
        return b"".join(self.blocks[number] for number in range(n_blocks))

    def root_key_progress(self) -> str:
        """Return the number of received blocks of a DSM-KROOT as text, with the total number if block 0 gave it."""
        n = len(self.blocks)
        if 0 not in self.blocks:
            return f"{n} block{'s' * (n != 1)}, but not block 0, which gives their number"
        try:
            return f"{n} of {kroot_blocks(self.blocks[0][0])} blocks"
        except UnsupportedError:
            return f"{n} block{'s' * (n != 1)} of an unknown number"


class DsmCollector:
    """Collector that joins received DSM blocks into complete messages.

    `add` returns every different message once, and again with each earlier time of reception.
    """

    def __init__(self) -> None:
        self._collections: dict[tuple[int, int, int], _Collection] = {}
        self._handed_out: dict[DsmMessage, GalileoTime] = {}  # earliest time of reception of each returned message
        # time of the first reception of each HKROOT message whose last OSNMA field is zero
        self._unsure: dict[bytes, GalileoTime] = {}

    def add(self, subframe: SatelliteSubframe) -> list[DsmMessage]:
        """Return the messages that this subframe of one satellite completes.

        The function raises `UnsupportedError` if block 0 gives a reserved number of blocks, and no message is returned.
        """
        hkroot = subframe.hkroot
        if hkroot is None and subframe.hkroot_if_sent is not None:
            # A zero in the last page counts as transmitted if a subframe at another time has the same HKROOT message.
            first = self._unsure.setdefault(subframe.hkroot_if_sent, subframe.time)
            hkroot = subframe.hkroot_if_sent if first != subframe.time else None
        return [] if hkroot is None else self._add(subframe, hkroot)

    def _add(self, subframe: SatelliteSubframe, hkroot: bytes) -> list[DsmMessage]:
        header, dsm_id, number, block = hkroot[0], hkroot[1] >> 4, hkroot[1] & 15, hkroot[2:]
        messages, unsupported = [], None
        for source in (_ALL, subframe.svid):
            collection = self._collections.setdefault((source, header, dsm_id), _Collection())
            collection.add(number, block, subframe.time.gst_seconds)
            try:
                data = collection.message(dsm_id)
            except UnsupportedError as error:
                unsupported = error
                continue
            if data is not None:
                message = DsmMessage(header=NmaHeader(header), dsm_id=dsm_id, data=data)
                if message not in self._handed_out or subframe.time < self._handed_out[message]:
                    self._handed_out[message] = subframe.time
                    messages.append(message)
        if unsupported is not None and not messages:
            raise unsupported
        return messages

    def progress(self) -> str:
        """Return a text with the number of received blocks of each DSM-KROOT, such as `DSM 7: 5 of 8 blocks`."""
        parts = {
            dsm_id: collection.root_key_progress()
            for (source, _, dsm_id), collection in sorted(self._collections.items())
            if source == _ALL and dsm_id < FIRST_PKR_ID
        }
        return ", ".join(f"DSM {dsm_id}: {progress}" for dsm_id, progress in parts.items()) or "no block was received"
