from __future__ import annotations

import numpy as np
import pytest

from vestige.navigation.inav.page import encode_page
from vestige.navigation.inav.words import WORD_LAYOUTS
from vestige.sample_processor.tracking.channel import Channel
from vestige.sample_processor.tracking.channel_track import ChannelTrack
from vestige.sample_processor.tracking.page_sync import ReceivedPage
from vestige.time import GalileoTime


@pytest.fixture
def track() -> ChannelTrack:
    """A track whose channel is only a name: the time of a page needs no samples."""
    channel = Channel.__new__(Channel)
    channel.svid, channel.lags = 11, np.zeros(1)  # type: ignore[attr-defined]
    return ChannelTrack(channel, 12.5e6, 1575.42e6)


@pytest.mark.parametrize(
    ("second", "near", "sent"),
    [
        (604_795, GalileoTime(1421, 604_790), GalileoTime(1421, 604_795)),
        (604_795, GalileoTime(1422, 3), GalileoTime(1421, 604_795)),
        (3, GalileoTime(1421, 604_790), GalileoTime(1422, 3)),
        (3, GalileoTime(1422, 200_000), GalileoTime(1422, 3)),
    ],
)
def test_a_time_without_week_is_the_nearest(
    track: ChannelTrack, second: int, near: GalileoTime, sent: GalileoTime
) -> None:
    layout = WORD_LAYOUTS[6]
    word = layout.pack({field.name: 0 for field in layout.fields} | {"type": 6, "tow_s": second})
    assert track.learn_time(ReceivedPage(period=500, data=encode_page(word, osnma=bytes(5))), near) == sent
    assert track.zero is not None
    assert (sent - track.zero) == pytest.approx(2.0)
