"""Write authentic positions for other programs as NMEA 0183, CSV, GeoJSON or KML, as the suffix of the file says.

Only an authentic position, from ranges in use and authentic orbits, is written as a fix. For all other snapshots, an
NMEA file gets sentences without a fix, and a file in another format gets nothing. The file is complete after every
position, so a program may read the file while it grows.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from io import StringIO
from pathlib import Path
from types import TracebackType

from vestige.acas_processor.position.authentic_position import AuthenticPosition
from vestige.errors import InputFileError
from vestige.navigation.nmea import NmeaFix, sentences
from vestige.output import naming
from vestige.time import GalileoTime

POSITION_COLUMNS = (
    "gst_week",
    "gst_second",
    "utc",
    "latitude_deg",
    "longitude_deg",
    "height_m",
    "horizontal_sigma_m",
    "vertical_sigma_m",
    "svids",
    "earlier",
    "available_at",
)


def authentic_fix(position: AuthenticPosition | None) -> AuthenticPosition | None:
    """Return a position if its orbits are authentic, else None.

    The ranges of an `AuthenticPosition` are always ranges in use.
    """
    return position if position is not None and position.orbits_authenticated else None


def nmea(time: GalileoTime, fix: AuthenticPosition | None) -> str:
    """Return the NMEA sentences GGA and RMC of one snapshot, with line ends.

    Parameters
    ----------
    time
        Time of the snapshot.
    fix
        Position of the snapshot; None if there is no valid fix.
    """
    found = None
    if fix is not None:
        found = NmeaFix(
            latitude_deg=fix.latitude_deg,
            longitude_deg=fix.longitude_deg,
            height_m=fix.height_m,
            n_satellites=len(fix.svids),
        )
    return "".join(f"{line}\r\n" for line in sentences(time.utc, found))


def _csv(time: GalileoTime, fix: AuthenticPosition) -> str:
    text = StringIO()
    seconds = time.second + time.fraction
    row = [time.week, f"{seconds:.9f}", _iso(time.utc)]
    row += [f"{fix.latitude_deg:.8f}", f"{fix.longitude_deg:.8f}", f"{fix.height_m:.3f}"]
    row += [f"{fix.horizontal_sigma_m:.3f}", f"{fix.vertical_sigma_m:.3f}"]
    row += [" ".join(map(str, fix.svids)), " ".join(map(str, fix.earlier)), str(fix.available_at)]
    csv.writer(text, lineterminator="\n").writerow(row)
    return text.getvalue()


def _feature(time: GalileoTime, fix: AuthenticPosition) -> str:
    """Return a Feature of GeoJSON (RFC 7946): longitude, latitude, height over the WGS 84 ellipsoid."""
    coordinates = [round(fix.longitude_deg, 8), round(fix.latitude_deg, 8), round(fix.height_m, 3)]
    properties = {
        "time": _iso(time.utc),
        "available_at": _iso(fix.available_at.utc),
        "horizontal_sigma_m": round(fix.horizontal_sigma_m, 3),
        "vertical_sigma_m": round(fix.vertical_sigma_m, 3),
        "svids": fix.svids,
        "earlier": fix.earlier,
    }
    point = {"type": "Point", "coordinates": coordinates}
    return json.dumps({"type": "Feature", "geometry": point, "properties": properties}, allow_nan=False)


def _placemark(time: GalileoTime, fix: AuthenticPosition) -> str:
    """Return a Placemark of KML 2.2 on the ground.

    KML heights refer to the sea level, and vestige has no geoid.
    """
    values = {
        "height_over_ellipsoid_m": f"{fix.height_m:.3f}",
        "horizontal_sigma_m": f"{fix.horizontal_sigma_m:.3f}",
        "vertical_sigma_m": f"{fix.vertical_sigma_m:.3f}",
        "svids": " ".join(map(str, fix.svids)),
        "available_at": _iso(fix.available_at.utc),
    }
    data = "".join(f'<Data name="{name}"><value>{value}</value></Data>' for name, value in values.items())
    return (
        f"<Placemark><name>{_iso(time.utc)}</name><TimeStamp><when>{_iso(time.utc)}</when></TimeStamp>"
        f"<ExtendedData>{data}</ExtendedData><Point><altitudeMode>clampToGround</altitudeMode>"
        f"<coordinates>{fix.longitude_deg:.8f},{fix.latitude_deg:.8f}</coordinates></Point></Placemark>\n"
    )


def _iso(utc: datetime) -> str:
    return f"{utc:%Y-%m-%dT%H:%M:%S.%f}"[:-3] + "Z"


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionFormat:
    """A format of position files: head, separator and tail of a file, and the text of a position.

    Attributes
    ----------
    entry
        Function that returns the text of a snapshot. The function gets None as the position only if `without_fix` is
        true.
    head
        Text before the first position.
    separator
        Text between two positions.
    tail
        Text after the last position.
    without_fix
        Whether a snapshot without a valid position also gets a text.
    """

    entry: Callable[[GalileoTime, AuthenticPosition], str] | Callable[[GalileoTime, AuthenticPosition | None], str]
    head: str = ""
    separator: str = ""
    tail: str = ""
    without_fix: bool = False

    def text(self, time: GalileoTime, position: AuthenticPosition | None) -> str:
        """Return the text of a snapshot, or "" if the format has no text for the snapshot.

        Parameters
        ----------
        time
            Time of the snapshot in Galileo System Time.
        position
            Position of the snapshot, or None.
        """
        fix = authentic_fix(position)
        return "" if fix is None and not self.without_fix else self.entry(time, fix)  # type: ignore[arg-type]


POSITION_FORMATS = {
    ".nmea": PositionFormat(entry=nmea, without_fix=True),
    ".csv": PositionFormat(entry=_csv, head=",".join(POSITION_COLUMNS) + "\n"),
    ".geojson": PositionFormat(
        entry=_feature, head='{"type": "FeatureCollection", "features": [\n', separator=",\n", tail="\n]}\n"
    ),
    ".kml": PositionFormat(
        entry=_placemark,
        head='<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
        "<name>Authentic positions</name>\n",
        tail="</Document></kml>\n",
    ),
}


class PositionFile:
    """Context manager of a growing file of authentic positions.

    New positions are appended to an existing file.

    Parameters
    ----------
    path
        Name of the file, with an ending of `POSITION_FORMATS`.

    Raises
    ------
    InputFileError
        If an existing file does not begin and end like a position file of this format.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder, PositionFile(Path(folder) / "night.geojson") as file:
    ...     file.write(GalileoTime(1421, 561_616), None)
    ...     print(file.path.read_text())
    {"type": "FeatureCollection", "features": [
    <BLANKLINE>
    ]}
    <BLANKLINE>
    """

    def __init__(self, path: Path) -> None:
        self.path, self._format = path, POSITION_FORMATS[path.suffix]
        head, tail = self._format.head.encode(), self._format.tail.encode()
        with naming(path):
            path.touch()
            self._stream = path.open("r+b", buffering=0)
            size = self._stream.seek(0, 2)
            if size == 0:
                size = self._stream.write(head + tail)
            elif not self._is_continued(head, tail, size):
                self._stream.close()
                expected = "positions that vestige wrote in this format, or a new name"
                raise InputFileError(path, "positions", "other contents", expected)
        self._end = size - len(tail)  # byte offset of the next position
        self._first = self._end == len(head)

    def _is_continued(self, head: bytes, tail: bytes, size: int) -> bool:
        if size < len(head) + len(tail):
            return False
        self._stream.seek(0)
        begins = self._stream.read(len(head)) == head
        self._stream.seek(size - len(tail))
        return begins and self._stream.read() == tail

    def write(self, time: GalileoTime, position: AuthenticPosition | None) -> None:
        """Write one snapshot.

        `PositionFormat.text` explains the parameters.
        """
        text = self._format.text(time, position)
        if not text:
            return
        data = (("" if self._first else self._format.separator) + text).encode()
        with naming(self.path):
            self._stream.seek(self._end)
            self._stream.write(data + self._format.tail.encode())
        self._end += len(data)
        self._first = False

    def __enter__(self) -> PositionFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stream.close()
