"""Read ION GNSS SDR Metadata, revision 1.0 [IONSDR]: an `.sdrx` or `.xml` file beside the samples of a recording.

The standard describes samples by nested elements: `file` → `lane` → `block` → `chunk` → `lump` → `stream` → `band`. An
element without content refers to the top-level element of the same name and `id`. The table shows which contents
vestige reads:

======================= ==========================================================================================
element                 contents that vestige reads
======================= ==========================================================================================
`file`                  one file for each band, or one file for both bands; with `offset`; no sequence of files
`lane`                  one block of one chunk of one lump, without header and footer
`lump`                  one stream, or several equal streams with `ratefactor` 1: a sample of each stream in turn
`stream`                8 or 16 bits, `TC` or `INT8` (two's complement), `OB` (offset binary); `IF`, `IQ`, `QI`, `IQn`
`chunk`                 one number in each word; `ratefactor` samples of each stream; no padding
`band`                  `centerfreq` of the signal stands at `translatedfreq` in the samples; `inverted`, `bandwidth`
======================= ==========================================================================================

The schema, the working group's library and the published files write some names with different capital letters. The
attribute of a unit is `format` in some files and `units` in others. The reader accepts all these forms. The writer uses
the library's form, because other programs use the library.

The standard has no sample counter and no upper limit of the clock's error. Files of two bands must have the same time
tag, so the first samples of both files belong to the same moment. The option `--time-uncertainty` gives the upper
limit of the clock's error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import Element

from defusedxml import ElementTree
from defusedxml.common import DefusedXmlException

from vestige.crypto.file_bytes import read_bytes
from vestige.errors import InputFileError, UnsupportedError
from vestige.recording.description import SAMPLE_RATE_RANGE_HZ, BandFile, RecordingDescription, band_of, sample_file
from vestige.recording.samples.sample_format import Layout, SampleFormat, SampleType
from vestige.records import Band
from vestige.time import GalileoTime

ION_SUFFIX = ".sdrx"
ION_SUFFIXES = (ION_SUFFIX, ".xml")
ION_NAMESPACE = "http://www.ion.org/standards/sdrwg/schema/metadata.xsd"
SUPPORTED = (
    "streams of one band each, alike if a file has several, 8 or 16 bits (TC, INT8 or OB), IF, IQ, QI or IQn, without "
    "header, footer and padding"
)

ION_NUMBERS: dict[tuple[str, int], SampleType] = {
    ("TC", 8): "int8",
    ("TC", 16): "int16",
    ("OB", 8): "uint8",
    ("OB", 16): "uint16",
    ("INT8", 8): "int8",
}
# layout of the samples, and whether Q is stored negated
_LAYOUTS: dict[str, tuple[Layout, bool]] = {
    "IF": ("real", False),
    "IQ": ("iq", False),
    "QI": ("qi", False),
    "IQn": ("iq", True),
}
_HZ = {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "GHz": 1e9}
_MAX_BYTES = 1 << 22
_MAX_COUNT = 1 << 40


def read_ion_metadata(path: Path) -> RecordingDescription:
    """Return the recording that an ION metadata file describes, with at most one file for each band.

    Files or streams whose spectrum contains neither the E1 nor the E6 carrier are left out, with a note.

    Parameters
    ----------
    path
        The `.sdrx` or `.xml` file; the names of sample files are relative to the folder of this file.

    Raises
    ------
    InputFileError
        If the file is not ION metadata, lacks a required element, has an unusable value, describes no samples of E1 or
        E6, or names samples that do not exist.
    UnsupportedError
        If the file is valid and describes samples that vestige does not read.

    Examples
    --------
    ::

        description = read_ion_metadata(Path("night/recording.sdrx"))
    """
    document = _Document(path)
    bands: dict[Band, BandFile] = {}
    notes = []
    for element in document.root:
        if _name(element) == "file" and len(element):
            for file in _band_files(document, element):
                if file is None:
                    url = document.text(element, "url")
                    notes.append(f"{url}: neither the E1 nor the E6 carrier lies in its spectrum; not used")
                elif file.band in bands:
                    document.refuse(element, f"two files or streams of {file.band.value}")
                else:
                    bands[file.band] = file
    if not bands:
        raise InputFileError(path, "file", "no E1 or E6 samples", "a recording of E1 or E6")
    times = {str(file.start): file.start for file in bands.values()}
    if len({file.start for file in bands.values()}) > 1:
        found = " and ".join(times)
        raise UnsupportedError(f"{path}: timestamp: found {found}; supported are bands that begin at the same time")
    return RecordingDescription(path=path, bands=bands, time_uncertainty_s=math.inf, notes=tuple(notes))


@dataclass(slots=True)
class _Document:
    """A metadata file, and its elements by name and id."""

    path: Path
    root: Element

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.root = ElementTree.fromstring(read_bytes(path, at_most=_MAX_BYTES).lstrip())
        except (ElementTree.ParseError, DefusedXmlException, ValueError, LookupError) as error:
            raise InputFileError(path, "document", str(error), "well-formed XML without entities") from None
        if _name(self.root) != "metadata":
            raise InputFileError(path, "root element", self.root.tag, "metadata, of the ION GNSS SDR standard")

    def refuse(self, element: Element, found: str) -> NoReturn:
        """Raise `UnsupportedError` about an element."""
        raise UnsupportedError(f"{self.path}: {self._place(element)}: found {found}; supported is {SUPPORTED}")

    def one(self, parent: Element, name: str) -> Element:
        """Return the only child of `parent` that has the name `name`, or the element to which this child refers."""
        found = self._children(parent, name)
        if len(found) > 1:
            self.refuse(parent, f"{len(found)} of {name}")
        return self._referred(parent, found[0])

    def several(self, parent: Element, name: str) -> list[Element]:
        """Return the children with the name `name`, at least one, or the elements to which these children refer."""
        return [self._referred(parent, child) for child in self._children(parent, name)]

    def _children(self, parent: Element, name: str) -> list[Element]:
        found = [child for child in parent if _name(child) == name]
        if not found:
            raise InputFileError(self.path, self._place(parent), f"no {name}", "one")
        return found

    def _referred(self, parent: Element, child: Element) -> Element:
        name = _name(child)
        if len(child) or (child.text or "").strip():
            return child
        number = child.get("id")
        same = [one for one in self.root if _name(one) == name and one.get("id") == number and len(one)]
        if len(same) != 1:
            raise InputFileError(self.path, self._place(parent), f"{len(same)} of {name} {number}", "one to refer to")
        return same[0]

    def text(self, parent: Element, name: str, default: str | None = None) -> str:
        """Return the text of the only child with the name `name`; `default` if there is no such child."""
        if default is not None and all(_name(child) != name for child in parent):
            return default
        return (self.one(parent, name).text or "").strip()

    def count(self, parent: Element, name: str, default: str | None = None) -> int:
        """Return the whole number in the only child with the name `name`; `default` if there is no such child."""
        text = self.text(parent, name, default)
        if not (text.isascii() and text.isdecimal() and len(text) <= 13 and int(text) <= _MAX_COUNT):
            raise InputFileError(self.path, f"{self._place(parent)}.{name}", text, "a whole number")
        return int(text)

    def hertz(self, parent: Element, name: str, default: float | None = None) -> float:
        """Return the frequency in Hz in the only child with the name `name`; `default` if there is no such child."""
        if default is not None and all(_name(child) != name for child in parent):
            return default
        element = self.one(parent, name)
        unit, place = element.get("format", element.get("units")), f"{self._place(parent)}.{name}"
        if unit not in _HZ:
            raise InputFileError(self.path, place, f"the unit {unit}", f"one of {', '.join(_HZ)}")
        try:
            value = float(element.text or "") * _HZ[unit]
        except ValueError:
            value = math.nan
        if not abs(value) <= 1e12:
            raise InputFileError(self.path, place, element.text, "a frequency")
        return value

    def _place(self, element: Element) -> str:
        number = element.get("id")
        return _name(element) + ("" if number is None else f" {number[:40]}")


def _name(element: Element) -> str:
    """Return the name of an element without namespace, in lower case, or an empty text for a comment."""
    return element.tag.rpartition("}")[2].lower() if isinstance(element.tag, str) else ""


def _band_files(document: _Document, element: Element) -> list[BandFile | None]:
    """Return the band file of each stream of a `file`; None for a stream with neither the E1 nor the E6 carrier."""
    for name in ("next", "previous"):
        if document.text(element, name, ""):
            document.refuse(element, f"a sequence of files ({name})")
    lane = document.one(element, "lane")
    block = document.one(lane, "block")
    for name in ("sizeheader", "sizefooter"):
        if document.count(block, name, "0"):
            document.refuse(block, name)
    chunk = document.one(block, "chunk")
    streams = document.several(document.one(chunk, "lump"), "stream")
    kinds = {
        tuple(document.text(one, name, "") for name in ("ratefactor", "quantization", "encoding", "format"))
        for one in streams
    }
    if len(streams) > 1 and (len(kinds) > 1 or next(iter(kinds))[0] != "1"):
        document.refuse(lane, f"{len(streams)} streams that are not alike, or not one sample of each in turn")
    return [
        _band_file(document, element, lane, chunk, stream, (place, len(streams)))
        for place, stream in enumerate(streams)
    ]


def _band_file(
    document: _Document, element: Element, lane: Element, chunk: Element, stream: Element, place: tuple[int, int]
) -> BandFile | None:
    """Return the band file of a stream, or None if the stream contains neither the E1 nor the E6 carrier.

    `place` is the number of the stream in its lump, and the number of all streams in the lump.
    """
    path = document.path
    form, q_negated = _form(document, chunk, stream, place)
    rate_hz = document.hertz(document.one(lane, "system"), "freqbase") * document.count(stream, "ratefactor")
    low, high = SAMPLE_RATE_RANGE_HZ
    if not low <= rate_hz <= high:
        raise InputFileError(path, "freqbase times ratefactor", f"{rate_hz:g} Hz", f"{low:g} to {high:g} Hz")
    band_element = document.one(stream, "band")
    inverted = document.text(band_element, "inverted", "false").lower() in ("true", "1")
    translated_hz = document.hertz(band_element, "translatedfreq", 0.0)
    # In an inverted spectrum the radio frequency falls as the frequency of the samples rises. Real samples also contain
    # the spectrum that is not inverted.
    turned = inverted and form.is_complex
    center_hz = document.hertz(band_element, "centerfreq") + (translated_hz if turned else -translated_hz)
    band = band_of(center_hz, rate_hz)
    if band is None:
        return None
    width_hz = document.hertz(band_element, "bandwidth", 0.0)
    return BandFile(
        band=band,
        path=sample_file(path, "file.url", document.text(element, "url")),
        described_in=path,
        form=form,
        sample_rate_hz=rate_hz,
        center_frequency_hz=center_hz,
        spectral_inversion=turned != q_negated,
        start=_time(document, element),
        bandwidth_hz=width_hz if width_hz > 0 else None,
        header_bytes=document.count(element, "offset", "0"),
    )


def _form(document: _Document, chunk: Element, stream: Element, place: tuple[int, int]) -> tuple[SampleFormat, bool]:
    """Return the format of the samples, and whether Q is negated."""
    encoding, bits = document.text(stream, "encoding"), document.count(stream, "quantization")
    component = ION_NUMBERS.get((encoding, bits))
    if component is None:
        document.refuse(stream, f"{bits} bits in {encoding}")
    order = document.text(stream, "format")
    if order not in _LAYOUTS:
        document.refuse(stream, f"the format {order}")
    layout, q_negated = _LAYOUTS[order]
    endian = document.text(chunk, "endian", "Undefined")
    form = SampleFormat(
        component=component, layout=layout, big_endian=endian == "Big" and bits > 8, channel=place[0], channels=place[1]
    )
    numbers = document.count(stream, "ratefactor") * form.components_per_sample
    if document.count(stream, "packedbits", str(numbers * bits)) != numbers * bits:
        document.refuse(
            stream, f"{document.text(stream, 'packedbits')} packed bits for {numbers} numbers of {bits} bits"
        )
    word_bits = 8 * document.count(chunk, "sizeword")
    if word_bits != bits or document.count(chunk, "countwords") != numbers * place[1]:
        expected = f"{numbers * place[1]} numbers of {bits} bits"
        found = f"{document.text(chunk, 'countwords')} words of {word_bits} bits for {expected}"
        document.refuse(chunk, found)
    if bits > 8 and endian not in ("Little", "Big"):
        raise InputFileError(document.path, "chunk.endian", endian, "Little or Big")
    return form, q_negated


def _time(document: _Document, element: Element) -> GalileoTime | None:
    """Return the time tag of a file, or None."""
    text = document.text(element, "timestamp", "")
    if not text:
        return None
    try:
        return GalileoTime.parse(text.upper().removesuffix("+00:00"), default_scale="UTC")
    except (ValueError, OverflowError) as error:
        expected = "a time in UTC, such as 2026-11-22T22:00:28.5Z"
        raise InputFileError(document.path, "file.timestamp", text, expected) from error
