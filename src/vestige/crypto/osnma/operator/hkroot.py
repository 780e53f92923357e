"""Make the HKROOT message of one satellite and subframe, and choose its DSM block.

The satellites send different blocks of a DSM at the same time, so a receiver with many satellites soon completes the
DSM. The block index is the number of the subframe since the start of GST, plus an offset of the satellite, modulo the
number of blocks. The offset is the SVID, as in the official test vectors. Several DSMs are sent in turn. Each DSM stays
on air for as many subframes as it has blocks. So a receiver with a single satellite also gets all blocks of all DSMs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vestige.constants import SUBFRAME_S
from vestige.crypto.osnma.messages.dsm import DSM_BLOCK_BYTES, NmaHeader
from vestige.time import GalileoTime


@dataclass(frozen=True, slots=True, kw_only=True)
class SignedMessage:
    """A digital signature message (DSM) with its number."""

    dsm_id: int  # number of the DSM, 0 to 11 for a DSM-KROOT and 12 to 15 for a DSM-PKR
    data: bytes  # all blocks of 13 bytes

    @property
    def n_blocks(self) -> int:
        """Number of blocks of the message."""
        return len(self.data) // DSM_BLOCK_BYTES

    def block(self, index: int) -> bytes:
        """Return the block with an index, which counts from 0; a block has 13 bytes."""
        return self.data[DSM_BLOCK_BYTES * index : DSM_BLOCK_BYTES * (index + 1)]


def hkroot_message(header: NmaHeader, message: SignedMessage, block: int) -> bytes:
    """Return the HKROOT message `NMA header 8 | DSM header 8 | DSM block 104`, 15 bytes [OSNMA-ICD, 3.2].

    Parameters
    ----------
    header
        NMA header of the subframe.
    message
        DSM that contains the block.
    block
        Index of the block, 0 to `message.n_blocks` - 1.
    """
    return bytes([header.value, message.dsm_id << 4 | block]) + message.block(block)


def message_in_turn(messages: Sequence[SignedMessage], number: int) -> SignedMessage:
    """Return the DSM that is on air in a subframe, if several DSMs are sent in turn.

    Parameters
    ----------
    messages
        One or more DSMs, in the order in which they are sent.
    number
        Number of the subframe since the first turn of the first DSM, 0 or more.
    """
    position = number % sum(message.n_blocks for message in messages)
    for message in messages:
        if position < message.n_blocks:
            return message
        position -= message.n_blocks
    raise AssertionError("the position is below the sum")


def block_index(svid: int, time: GalileoTime, n_blocks: int) -> int:
    """Return the index of the DSM block that a satellite sends in the subframe of `time`.

    Examples
    --------
    >>> [block_index(svid, GalileoTime(1251, 277_200), 8) for svid in (2, 4, 7, 8)]
    [2, 4, 7, 0]
    """
    return (time.gst_seconds // SUBFRAME_S + svid) % n_blocks
