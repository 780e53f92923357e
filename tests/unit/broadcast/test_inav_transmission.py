from __future__ import annotations

import pytest

from vestige.broadcast.inav_transmission import InavTransmission
from vestige.broadcast.satellite_words import EphemerisIssue, SatelliteWords, SystemData
from vestige.navigation.inav.coding.channel_coding import page_from_symbols
from vestige.navigation.inav.ephemeris_words import as_broadcast
from vestige.navigation.inav.timing_words import UtcModel
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.time import GalileoTime

START = GalileoTime(1372, 480_000)
EPHEMERIS = as_broadcast(walker_ephemerides(START)[6])


def words(*, fec2: bool = True) -> SatelliteWords:
    issue = EphemerisIssue(start=START, ephemeris=EPHEMERIS)
    return SatelliteWords([issue], SystemData(utc=UtcModel.at(START)), fec2=fec2)


def test_pages_carry_words_and_patterns_and_no_osnma() -> None:
    pages = list(InavTransmission(words=words()).pages(START + 1.0, 15))
    assert [page.time.second - START.second for page in pages] == list(range(1, 30, 2))
    assert all(page.crc_ok and page.svid == 7 and page.osnma == bytes(5) and not page.is_alert for page in pages)
    assert [page.word for page in pages] == [words().word(page.time) for page in pages]
    assert [page.field("ssp") for page in pages[:4]] == [0x04, 0x2B, 0x2F, 0x04]


@pytest.mark.parametrize(("fec2", "sends_ssp", "ssp"), [(False, None, 0xFD), (False, True, 0x04), (True, False, 0xFD)])
def test_who_sends_synchronisation_patterns(fec2: bool, sends_ssp: bool | None, ssp: int) -> None:
    page = InavTransmission(words=words(fec2=fec2), sends_ssp=sends_ssp).page(START + 1.0)
    assert page.field("ssp") == ssp


def test_the_osnma_source_is_asked_for_each_page() -> None:
    def osnma(svid: int, start: GalileoTime) -> bytes:
        return bytes([svid]) + start.second.to_bytes(4, "big")

    page = InavTransmission(words=words(), osnma=osnma).page(START + 5.0)
    assert page.osnma == bytes([7]) + (START.second + 5).to_bytes(4, "big")
    with pytest.raises(ValueError, match="4 bytes of OSNMA in a page, expected 5"):
        InavTransmission(words=words(), osnma=lambda *_: bytes(4)).page(START + 1.0)


def test_the_symbols_are_those_of_the_page() -> None:
    transmission = InavTransmission(words=words())
    symbols = transmission.symbols(START + 3.0)
    assert page_from_symbols(1.0 - 2.0 * symbols) == transmission.page(START + 3.0).data
