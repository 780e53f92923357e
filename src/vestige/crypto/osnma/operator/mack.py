"""Make the MACK message of one satellite and subframe: tags, MACSEQ, and the disclosed key.

`encode_mack` is the inverse of `messages.tags.parse_mack`, and returns the bits of a message from its tags, MACSEQ and
key.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from vestige.crypto.osnma.messages.chain_parameters import TAG_INFO_BITS, ChainParameters
from vestige.crypto.osnma.messages.mac_lookup import slots
from vestige.crypto.osnma.messages.navigation_data import NavigationData
from vestige.crypto.osnma.messages.subframe import MACK_TOTAL_BITS
from vestige.crypto.osnma.messages.tags import KEY_DELAY_S, Mack, Tag, make_macseq, make_tag
from vestige.time import GalileoTime

MACK_BYTES = MACK_TOTAL_BITS // 8


@dataclass(frozen=True, slots=True, kw_only=True)
class TagContent:
    """Content of a tag: the data that the tag authenticates."""

    svid: int  # PRN_D, the satellite whose data the tag authenticates
    adkd: int
    cut_off: int  # COP 1 to 15; 0 for a dummy tag
    data: NavigationData  # data that the tag authenticates; any data for a dummy tag


def encode_mack(mack: Mack, key: bytes, parameters: ChainParameters) -> bytes:
    """Return the 480 bits of a MACK message [OSNMA-ICD, MACK].

    Parameters
    ----------
    mack
        Tags and MACSEQ of the message.
    key
        Key that the message discloses.
    parameters
        Parameters of the key's chain.

    Raises
    ------
    ValueError
        If the number of tags or the length of the key does not agree with the parameters.
    """
    if len(mack.tags) != parameters.n_tags or len(key) != parameters.key_bytes:
        raise ValueError(
            f"{len(mack.tags)} tags and a key of {len(key)} bytes, "
            f"expected {parameters.n_tags} and {parameters.key_bytes}"
        )
    bits = 0
    for tag in mack.tags:
        # The first tag is always for ADKD 0 of the sending satellite, so MACSEQ replaces PRN_D and ADKD of this tag.
        info = mack.macseq << 4 | tag.cut_off if tag.counter == 1 else tag.info
        bits = (bits << parameters.tag_bits | tag.value) << TAG_INFO_BITS | info
    bits = bits << parameters.key_bits | int.from_bytes(key, "big")
    return (bits << MACK_TOTAL_BITS - parameters.key_start_bit - parameters.key_bits).to_bytes(MACK_BYTES, "big")


def authenticate(
    svid: int,
    time: GalileoTime,
    nma_status: int,
    contents: Sequence[TagContent],
    key_of: Callable[[GalileoTime], bytes],
    parameters: ChainParameters,
) -> Mack:
    """Return tags and MACSEQ of one satellite and subframe.

    Parameters
    ----------
    svid
        Satellite that sends the tags, PRN_A.
    time
        Start of the subframe.
    nma_status
        NMAS of the NMA header of the subframe, which the tags cover.
    contents
        Content of each tag, in the order of the slots.
    key_of
        Function that returns the key on air in the subframe that starts at the given time.
    parameters
        Parameters of the chain on air.

    Raises
    ------
    UnsupportedError
        If the MAC look-up table has no row for the parameters.
    """
    tags = tuple(
        Tag(counter=number, value=0, info=content.svid << 8 | content.adkd << 4 | content.cut_off)
        for number, content in enumerate(contents, start=1)
    )
    empty = Mack(svid=svid, time=time, nma_status=nma_status, macseq=0, tags=tags)
    made = tuple(
        replace(tag, value=make_tag(empty, tag, content.data, key_of(time + tag.key_delay_s), parameters))
        for tag, content in zip(tags, contents, strict=True)
    )
    macseq = make_macseq(empty, slots(parameters, time), key_of(time + KEY_DELAY_S), parameters)
    return replace(empty, macseq=macseq, tags=made)
