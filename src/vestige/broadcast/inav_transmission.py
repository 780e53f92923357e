"""Make the I/NAV pages and symbols that one satellite sends on E1-B."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from vestige.broadcast.satellite_words import SatelliteWords
from vestige.navigation.inav.coding.channel_coding import page_symbols
from vestige.navigation.inav.page import NO_SSP, OSNMA_BYTES, PAGE_S, InavPage, encode_page, page_ssp
from vestige.time import GalileoTime

OsnmaSource = Callable[[int, GalileoTime], bytes]


def no_osnma(svid: int, start: GalileoTime) -> bytes:  # noqa: ARG001  (the signature of an `OsnmaSource`)
    """Return the OSNMA field of a satellite that sends no OSNMA: 5 zero bytes."""
    return bytes(OSNMA_BYTES)


@dataclass(frozen=True, slots=True, kw_only=True)
class InavTransmission:
    """I/NAV message of one satellite.

    Attributes
    ----------
    words
        Navigation words of the satellite.
    osnma
        Function of SVID and start of a page that returns the 5 bytes of the page's OSNMA field.
    sends_ssp
        Whether the satellite sends secondary synchronisation patterns. None stands for True if the satellite sends
        FEC2, and for False otherwise.

    Examples
    --------
    >>> from vestige.broadcast.satellite_words import EphemerisIssue, SystemData
    >>> from vestige.navigation.ephemeris import Ephemeris
    >>> from vestige.navigation.inav.timing_words import UtcModel
    >>> start = GalileoTime(1372, 480_000)
    >>> orbit = Ephemeris(svid=11, iod_nav=9, toe=start, toc=start, sqrt_a=5440.6, eccentricity=0.0, m0_rad=1.0,
    ...     delta_n_radps=0.0, omega0_rad=0.5, omega_dot_radps=0.0, i0_rad=0.98, i_dot_radps=0.0, omega_rad=0.0)
    >>> words = SatelliteWords([EphemerisIssue(start=start, ephemeris=orbit)], SystemData(utc=UtcModel.at(start)))
    >>> page = InavTransmission(words=words).page(start + 1.0)
    >>> page.svid, page.crc_ok, page.word >> 122
    (11, True, 2)
    """

    words: SatelliteWords
    osnma: OsnmaSource = no_osnma
    sends_ssp: bool | None = None

    def page(self, start: GalileoTime) -> InavPage:
        """Return the page that starts at a time; `SatelliteWords.word` explains parameters and errors.

        The method also raises `ValueError` if the OSNMA source does not return 5 bytes.
        """
        sends_ssp = self.words.fec2 if self.sends_ssp is None else self.sends_ssp
        data = encode_page(
            self.words.word(start),
            osnma=self.osnma(self.words.svid, start),
            ssp=page_ssp(start) if sends_ssp else NO_SSP,
        )
        return InavPage(svid=self.words.svid, time=start, data=data)

    def pages(self, start: GalileoTime, count: int) -> Iterator[InavPage]:
        """Yield successive pages of the satellite.

        Parameters
        ----------
        start
            Start of the first page, an odd whole second.
        count
            Number of pages.
        """
        for index in range(count):
            yield self.page(start + float(PAGE_S * index))

    def symbols(self, start: GalileoTime) -> UInt8[np.ndarray, " 500"]:
        """Return the symbols of the page that starts at a time, 0 or 1, 250 a second.

        Parameters
        ----------
        start
            Start of the page and of its first symbol, an odd whole second of satellite time.
        """
        return page_symbols(self.page(start).data)
