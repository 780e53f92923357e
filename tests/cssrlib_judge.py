"""The independent program cssrlib: what it decodes of I/NAV pages, and what it says of each OSNMA tag in them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from vestige.navigation.ephemeris import Ephemeris
from vestige.navigation.inav.ephemeris_words import ephemeris_words, status_word
from vestige.navigation.inav.page import InavPage
from vestige.time import GalileoTime

cssrlib_osnma, rawnav, gnss = (
    pytest.importorskip(f"cssrlib.{name}", reason="cssrlib is not installed: make judges", exc_type=ImportError)
    for name in ("osnma", "rawnav", "gnss")
)

WEEKS_GPS_GST = 1024
SAME = {  # its attribute -> ours
    "M0": "m0_rad",
    "deln": "delta_n_radps",
    "e": "eccentricity",
    "OMG0": "omega0_rad",
    "i0": "i0_rad",
    "omg": "omega_rad",
    "OMGd": "omega_dot_radps",
    "idot": "i_dot_radps",
    "cuc": "cuc_rad",
    "cus": "cus_rad",
    "crc": "crc_m",
    "crs": "crs_m",
    "cic": "cic_rad",
    "cis": "cis_rad",
    "af0": "af0_s",
    "af1": "af1",
    "af2": "af2_per_s",
    "tgd": "bgd_e1_e5a_s",
    "tgd_b": "bgd_e1_e5b_s",
    "iode": "iod_nav",
}
Tag = tuple[int, int, int, int]  # start of the subframe mod 2^20, PRN_A, CTR, ADKD


class Judge:
    """cssrlib with our Merkle tree; what it says of each tag."""

    def __init__(self, tree: Path | None, log: Path) -> None:
        self.program: Any = cssrlib_osnma.osnma(logfile=str(log))
        self.program.monlevel = 0
        self.program.flg_slowmac = True
        # cssrlib keeps these in the class, so one instance would see what another one received.
        self.program.dsm, self.program.nb = {}, {}
        self.program.hk = [bytearray(15) for _ in range(36)]
        self.program.mack = [bytearray(60) for _ in range(36)]
        self.program.mack_p, self.program.mack_c = bytearray(60 * 36), bytearray(60 * 36)
        if tree is not None:
            self.program.load_mt(str(tree))
        self.tags: dict[Tag, bool] = {}
        self.covered: dict[Tag, int] = {}  # the satellite whose data a tag covers
        self.macseqs: list[bool] = []
        self._wrap()

    def _wrap(self) -> None:
        verify_tag, verify_macseq = self.program.verify_navmsg, self.program.verify_macseq

        def tag(one: Any) -> bool:
            result = bool(verify_tag(one))
            start = int.from_bytes(one.gst_sf, "big") & 0xFFFFF
            if one.navmsg and one.cop:
                key = start, one.prn_a, one.cnt, one.adkd
                self.tags[key] = result
                self.covered[key] = one.prn_a if one.adkd == 4 else one.prn_d
            return result

        def macseq() -> bool:
            self.macseqs.append(bool(verify_macseq()))
            return self.macseqs[-1]

        self.program.verify_navmsg, self.program.verify_macseq = tag, macseq

    def take(self, pages: list[InavPage]) -> Judge:
        """Let cssrlib take pages in the order of time."""
        for page in pages:
            nav, nma = self.program.load_gal_inav(bytearray(page.data))
            self.program.prn_a = page.svid
            self.program.save_gal_inav(nav, page.svid, page.time.second)
            self.program.decode(nma, page.time.week + WEEKS_GPS_GST, page.time.second, page.svid)
        self.program.fh.close()
        return self

    @property
    def root_verified(self) -> bool:
        """Whether the signature of the root key is that of a public key of the tree."""
        return bool(self.program.status & cssrlib_osnma.uOSNMA.ROOTKEY_VERIFIED)

    @property
    def chain_verified(self) -> bool:
        """Whether the last key leads to the root key, or to the key before."""
        return bool(self.program.status & cssrlib_osnma.uOSNMA.KEYCHAIN_VERIFIED)


def decoded_ephemerides(pages: Iterable[InavPage]) -> Iterator[tuple[InavPage, Ephemeris]]:
    """Yield what cssrlib decodes of words 1 to 5, with the page that completes it, as an ephemeris of ours."""
    decoder = rawnav.RawNav()
    for page in pages:
        week = page.time.week + WEEKS_GPS_GST
        satellite = gnss.prn2sat(gnss.uGNSS.GAL, page.svid)
        found = decoder.decode_gal_inav(week, gnss.gpst2time(week, page.time.second), satellite, 0, page.data)
        if found is not None:
            yield page, _ephemeris(page.svid, found)


def _ephemeris(svid: int, found: Any) -> Ephemeris:
    values = {ours: getattr(found, theirs) for theirs, ours in SAME.items()}
    toe, toc = (GalileoTime(*map(int, gnss.time2gst(time))) for time in (found.toe, found.toc))
    return Ephemeris(
        svid=svid, toe=toe, toc=toc, sqrt_a=math.sqrt(found.A), sisa_m=math.nan if found.sva < 0 else found.sva,
        e1b_health=found.svh >> 1 & 3, e1b_data_valid=not found.svh & 1, **values,
    )  # fmt: skip


def broadcast_words(ephemeris: Ephemeris) -> dict[int, int]:
    """Return words 1 to 5 of an ephemeris, word 5 without ionosphere and time: what is to agree to the last bit."""
    return {**ephemeris_words(ephemeris), 5: status_word(ephemeris, ephemeris.toe)}
