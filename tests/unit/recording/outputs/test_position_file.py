"""Files of authentic positions, read by other programs: pynmea2, pandas, json by the rules of RFC 7946, fastkml."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pandas
import pynmea2
import pytest
from defusedxml import ElementTree

from vestige.acas_processor.position.authentic_position import AuthenticPosition
from vestige.cli.outputs.other_programs import ENDINGS
from vestige.errors import InputFileError
from vestige.recording.outputs.position_file import POSITION_COLUMNS, POSITION_FORMATS, PositionFile
from vestige.time import GalileoTime

TIME = GalileoTime(1421, 561_616, 0.25)
HERE = AuthenticPosition(
    index=0,
    time=TIME,
    available_at=TIME + 60.0,
    latitude_deg=-33.512345678,
    longitude_deg=-70.25,
    height_m=545.4321,
    horizontal_sigma_m=1.25,
    vertical_sigma_m=2.5,
    svids=(3, 7, 11, 24),
    earlier=(7,),
    orbits_authenticated=True,
)
UNPROVEN = replace(HERE, latitude_deg=10.0, orbits_authenticated=False)
KML = "{http://www.opengis.net/kml/2.2}"


@pytest.fixture(params=sorted(POSITION_FORMATS))
def written(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Four snapshots: a fix, none, one with orbits that nobody proved, a fix; the file is closed between them."""
    path = tmp_path / f"night{request.param}"
    for snapshots in ((HERE, None), (UNPROVEN, replace(HERE, latitude_deg=33.0))):
        with PositionFile(path) as file:
            for number, position in enumerate(snapshots):
                file.write(TIME + 30.0 * number, position)
    return path


def test_the_option_names_every_format() -> None:
    assert set(ENDINGS) == set(POSITION_FORMATS)


def test_an_independent_reader_finds_the_authentic_positions_alone(written: Path) -> None:
    found = {".nmea": _nmea, ".csv": _csv, ".geojson": _geojson, ".kml": _kml}[written.suffix](written)
    assert [latitude for latitude, _ in found] == pytest.approx([-33.512345678, 33.0], abs=1e-7)
    assert {longitude for _, longitude in found} == {-70.25}


def _nmea(path: Path) -> list[tuple[float, float]]:
    messages = [pynmea2.parse(line, check=True) for line in path.read_text().splitlines()]
    assert [one.gps_qual for one in messages[::2]] == [1, 0, 0, 1]
    assert [one.status for one in messages[1::2]] == ["A", "V", "V", "A"]
    assert [one.is_valid for one in messages] == [True, True, False, False, False, False, True, True]
    assert messages[1].datetime.replace(tzinfo=UTC) == TIME.utc.replace(tzinfo=UTC)
    assert all(not one.lat and not one.lon for one in messages[2:6])
    return [(one.latitude, one.longitude) for one in messages[::2] if one.gps_qual]


def _csv(path: Path) -> list[tuple[float, float]]:
    table = pandas.read_csv(path)
    assert tuple(table.columns) == POSITION_COLUMNS
    assert table["gst_second"].tolist() == [561_616.25, 561_646.25]
    assert table["svids"].tolist() == ["3 7 11 24"] * 2
    assert pandas.to_datetime(table["utc"])[0].to_pydatetime() == TIME.utc.replace(tzinfo=UTC)
    return list(zip(table["latitude_deg"], table["longitude_deg"], strict=True))


def _geojson(path: Path) -> list[tuple[float, float]]:
    """Read it by the rules of RFC 7946 for a collection of points (sections 3, 3.1.1, 3.2, 4 and 11.2)."""
    content = json.loads(path.read_text(encoding="utf-8"))
    assert content.keys() == {"type", "features"}  # no "crs": WGS 84 is the only one (4)
    assert content["type"] == "FeatureCollection"
    for feature in content["features"]:
        assert {"type", "geometry", "properties"} == feature.keys()
        assert feature["type"] == "Feature"
        assert feature["geometry"]["type"] == "Point"
        assert feature["properties"]["vertical_sigma_m"] == 2.5
        longitude, latitude, height = feature["geometry"]["coordinates"]  # in this order (3.1.1)
        assert -180 <= longitude <= 180
        assert -90 <= latitude <= 90
        assert height == pytest.approx(545.432)  # over the ellipsoid of WGS 84 (4)
        moment = datetime.fromisoformat(feature["properties"]["time"])
        assert moment.tzinfo is not None
    points = [one["geometry"]["coordinates"] for one in content["features"]]
    return [(latitude, longitude) for longitude, latitude, _ in points]


def _kml(path: Path) -> list[tuple[float, float]]:
    root = ElementTree.fromstring(path.read_bytes())
    assert root.tag == f"{KML}kml"
    placemarks = root.findall(f"{KML}Document/{KML}Placemark")
    # the order is that of the schema: name, time, data, geometry
    tags = ["name", "TimeStamp", "ExtendedData", "Point"]
    assert [[child.tag for child in one] for one in placemarks] == [[KML + tag for tag in tags]] * len(placemarks)
    assert {one.findtext(f"{KML}Point/{KML}altitudeMode") for one in placemarks} == {"clampToGround"}
    pairs = [one.findtext(f"{KML}Point/{KML}coordinates", "").split(",") for one in placemarks]
    return [(float(latitude), float(longitude)) for longitude, latitude in pairs]


def test_fastkml_reads_it(tmp_path: Path) -> None:
    kml = pytest.importorskip("fastkml.kml", reason="fastkml is not installed")
    with PositionFile(tmp_path / "night.kml") as file:
        file.write(TIME, HERE)
    (document,) = kml.KML.parse(tmp_path / "night.kml", validate=True).features
    (placemark,) = document.features
    assert (placemark.geometry.x, placemark.geometry.y) == (-70.25, -33.51234568)
    assert placemark.times.timestamp.dt.astimezone(UTC) == TIME.utc.replace(tzinfo=UTC)
    assert placemark.extended_data.elements[0].value == "545.432"


@pytest.mark.parametrize("ending", [one for one, kind in POSITION_FORMATS.items() if kind.head])
@pytest.mark.parametrize("content", ["[]\n", '{"type": "FeatureCollection", "features": [\n', "a" * 400])
def test_another_file_is_left_as_it_is(tmp_path: Path, ending: str, content: str) -> None:
    path = tmp_path / f"night{ending}"
    path.write_text(content)
    with pytest.raises(InputFileError, match="positions that vestige wrote"):
        PositionFile(path)
    assert path.read_text() == content


def test_it_is_complete_after_every_position(tmp_path: Path) -> None:
    with PositionFile(tmp_path / "night.geojson") as file:
        for number in range(3):
            assert len(json.loads(file.path.read_text())["features"]) == number
            file.write(TIME, HERE)
