"""Decide whether an unsigned "don't use" in a satellite's header is true, from the tags of the subframe.

Without this decision, the receiver would lose a key with each forged header. But every tag also covers the status in
the header [OSNMA-ICD, 6.7]. The key of the next subframe verifies all tags except the tags of the slow MAC (ADKD 12).
If a tag verifies with "test" or "operational", the satellite sent this status, and the header is forged. The receiver
then uses the key of the subframe, 30 s late.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from vestige.crypto.osnma.messages.dsm import OPERATIONAL, TEST
from vestige.crypto.osnma.messages.mac_lookup import slots
from vestige.crypto.osnma.messages.navigation_data import NavigationData, NavigationWords
from vestige.crypto.osnma.messages.subframe import SatelliteSubframe
from vestige.crypto.osnma.messages.tags import KEY_DELAY_S, Mack, Tag, make_tag, parse_mack
from vestige.crypto.osnma.messages.tesla import Chain
from vestige.errors import AuthenticationError, UnsupportedError


def proven_status(subframe: SatelliteSubframe, navigation: Mapping[int, NavigationWords], chain: Chain) -> int | None:
    """Return the NMA status other than "don't use" that a tag proves; 0 if no tag proves such a status.

    The result is None if the key of the next subframe, which verifies the tags, is not known. `navigation` contains the
    words by SVID that were received before the subframe. `chain` is the chain of the subframe's key.
    """
    try:
        key = chain.derive(subframe.time + KEY_DELAY_S).data
    except AuthenticationError:
        return None
    mack = parse_mack(subframe, chain.parameters)
    if mack is None:
        return 0
    for tag, data in _covered(mack, chain, navigation):
        for status in (TEST, OPERATIONAL):
            if make_tag(replace(mack, nma_status=status), tag, data, key, chain.parameters) == tag.value:
                return status
    return 0


def _covered(
    mack: Mack, chain: Chain, navigation: Mapping[int, NavigationWords]
) -> Iterator[tuple[Tag, NavigationData]]:
    """Yield tags outside flexible slots that the next subframe's key can verify, with each candidate of their data."""
    try:
        row = slots(chain.parameters, mack.time)
    except UnsupportedError:
        return
    for tag, slot in zip(mack.tags, row, strict=True):
        if tag.supported and tag.cut_off and tag.key_delay_s == KEY_DELAY_S and not slot.flexible:
            for data in navigation.get(tag.svid, NavigationWords()).candidates(tag.svid, tag.adkd, mack.time):
                yield tag, data
