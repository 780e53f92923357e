"""NMEA 0183: fields and checksums by hand, and by pynmea2."""

from __future__ import annotations

from datetime import UTC, datetime

import pynmea2
import pytest

from vestige.navigation.nmea import NmeaFix, _sentence, sentences

NOON = datetime(2026, 11, 22, 12, 0, 5, 250_000, tzinfo=UTC)
MUNICH = NmeaFix(latitude_deg=48.1, longitude_deg=11.6, height_m=500.25, n_satellites=8)


def test_the_checksum_is_that_of_a_published_sentence() -> None:
    body = "GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"
    assert _sentence(body) == f"${body}*47"


def test_a_fix() -> None:
    gga, rmc = (line.split("*")[0].split(",") for line in sentences(NOON, MUNICH))
    assert gga == ["$GAGGA", "120005.25", "4806.00000", "N", "01136.00000", "E", "1", "08", "", "500.25", "M", "0.0",
                   "M", "", ""]  # fmt: skip
    assert rmc == ["$GARMC", "120005.25", "A", "4806.00000", "N", "01136.00000", "E", "", "", "221126", "", "",
                   "A"]  # fmt: skip


def test_no_fix_has_no_position() -> None:
    gga, rmc = (line.split("*")[0].split(",") for line in sentences(NOON, None))
    assert gga[2:8] == ["", "", "", "", "0", "00"]
    assert gga[9] == ""
    assert rmc[2] == "V"
    assert rmc[3:7] == ["", "", "", ""]
    assert rmc[12] == "N"


@pytest.mark.parametrize(
    ("latitude_deg", "longitude_deg", "found"),
    [
        (-33.5, -70.25, ["3330.00000", "S", "07015.00000", "W"]),
        (0.0, 179.999999999, ["0000.00000", "N", "18000.00000", "E"]),  # never 60 minutes
        (5 + 59.999999 / 60, -0.5 / 60, ["0600.00000", "N", "00000.50000", "W"]),
    ],
)
def test_angles(latitude_deg: float, longitude_deg: float, found: list[str]) -> None:
    fix = NmeaFix(latitude_deg=latitude_deg, longitude_deg=longitude_deg, height_m=-3.0, n_satellites=14)
    gga = sentences(NOON, fix)[0].split(",")
    assert gga[2:6] == found
    assert gga[7:10] == ["12", "", "-3.00"]


@pytest.mark.parametrize("fix", [MUNICH, None])
def test_pynmea2_reads_it(fix: NmeaFix | None) -> None:
    gga, rmc = (pynmea2.parse(line, check=True) for line in sentences(NOON, fix))
    assert gga.gps_qual == (1 if fix else 0)
    assert rmc.status == ("A" if fix else "V")
    assert gga.is_valid == rmc.is_valid == (fix is not None)
    assert rmc.datetime.replace(tzinfo=UTC) == NOON
    if fix:
        assert gga.latitude == pytest.approx(48.1, abs=1e-7)
        assert gga.altitude == 500.25
