"""ION GNSS SDR metadata: written and read back, published examples, and what is refused."""

from __future__ import annotations

import math
import re
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from vestige.errors import InputFileError, UnsupportedError
from vestige.recording.description import BandFile, RecordingDescription
from vestige.recording.recording import describe_recording, find_recording, open_recording
from vestige.recording.samples.ion_metadata import read_ion_metadata
from vestige.recording.samples.ion_metadata_writer import has_ion_encoding, write_ion_metadata
from vestige.recording.samples.sample_format import SampleFormat
from vestige.records import Band
from vestige.time import GalileoTime

START = GalileoTime(1422, 79250, 0.1234567890123)

# The shape of the published single-frequency bladeRF example: references by id, lower case, `format` for units.
PUBLISHED = """<?xml version="1.0" encoding="UTF-8"?>
<metadata xmlns="http://www.ion.org/standards/sdrwg/schema/metadata.xsd">
  <lane id="SingleFreqE6">
    <bandsrc idband="E6" idsrc="PatchAntenna"/>
    <system id="BladeRF"/>
    <block>
      <cycles>0</cycles><sizeheader>0</sizeheader><sizefooter>0</sizefooter>
      <chunk>
        <sizeword>2</sizeword><countwords>2</countwords><endian>Little</endian>
        <lump>
          <stream id="E6">
            <ratefactor>4</ratefactor><quantization>16</quantization><packedbits>128</packedbits>
            <format>IQ</format><encoding>TC</encoding><band id="E6"/>
          </stream>
        </lump>
      </chunk>
    </block>
  </lane>
  <!-- the front end -->
  <system id="BladeRF"><freqbase format="MHz">5.0</freqbase><source id="PatchAntenna"/></system>
  <band id="E6">
    <centerfreq format="GHz">1.27875</centerfreq><translatedfreq format="kHz">-250</translatedfreq>
    <delaybias format="sec">0.0</delaybias><bandwidth format="MHz">3.84</bandwidth>
  </band>
  <session id="0"><toa>2026-11-22T11:18:00Z</toa></session>
  <file>
    <url>e6.dat</url><timestamp>2026-11-22T11:18:00Z</timestamp><owner>CODC</owner><offset>4</offset>
    <lane id="SingleFreqE6"/>
  </file>
</metadata>
""".replace("<countwords>2</countwords>", "<countwords>8</countwords>")


@pytest.fixture
def published(tmp_path: Path) -> Path:
    (tmp_path / "e6.dat").write_bytes(b"head" + np.arange(80, dtype="<i2").tobytes())
    return tmp_path / "recording.xml"


def read(path: Path, *changes: tuple[str, str]) -> RecordingDescription:
    text = PUBLISHED
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text)
    return read_ion_metadata(path)


def test_a_published_shape_is_read(published: Path) -> None:
    (file,) = read(published).bands.values()
    assert file == BandFile(
        band=Band.E6, path=published.parent / "e6.dat", described_in=published,
        form=SampleFormat(component="int16", layout="iq"), sample_rate_hz=20e6,
        # the carrier stands at −250 kHz, so 0 Hz is above it
        center_frequency_hz=1279.0e6, start=GalileoTime.parse("2026-11-22T11:18:00Z"), bandwidth_hz=3.84e6,
        header_bytes=4,
    )  # fmt: skip
    assert read(published).time_uncertainty_s == math.inf
    recording = open_recording(published)
    assert recording.e6 is not None
    assert recording.e6.samples(0, 2).tolist() == [0 + 1j, 2 + 3j]


def test_two_streams_in_a_lump_are_both_bands(published: Path) -> None:
    """A recorder of two bands writes a sample of each in turn, in the order of the streams."""
    e1 = '<stream id="E1"><ratefactor>1</ratefactor><quantization>16</quantization><packedbits>32</packedbits>'
    e1 += "<format>IQ</format><encoding>TC</encoding><band id='E1'><centerfreq format='GHz'>1.57542</centerfreq></band>"
    both = [
        ("<lump>", f"<lump>{e1}</stream>"), (">4</ratefactor>", ">1</ratefactor>"), (">128<", ">32<"),
        (">8</countwords>", ">4</countwords>"), (">5.0<", ">20.0<"),
    ]  # fmt: skip
    bands = read(published, *both).bands
    assert [(band, file.form.channel, file.form.channels) for band, file in bands.items()] == [
        (Band.E1, 0, 2), (Band.E6, 1, 2)
    ]  # fmt: skip
    recording = open_recording(published)
    assert recording.e1 is not None
    assert recording.e6 is not None
    assert recording.e1.n_samples == recording.e6.n_samples == 20
    assert recording.e1.samples(1, 1).tolist() == [4 + 5j]
    assert recording.e6.samples(1, 1).tolist() == [6 + 7j]


def test_the_names_of_the_schema_are_read_too(published: Path) -> None:
    """Its element names have capitals and its units another attribute; elements may stand where they are used."""
    changes = [("format=", "units="), ("sizeword", "sizeWord"), ("countwords", "countWords"), ("freqbase", "freqBase")]
    band = re.search(r"<band id=\"E6\">.*?</band>", PUBLISHED, re.DOTALL)
    assert band is not None
    found = read(published, *changes).bands
    assert found == read(published).bands
    inside = PUBLISHED.replace(band[0], "").replace('<band id="E6"/>', band[0])
    published.write_text(inside)
    assert read_ion_metadata(published).bands == found


@pytest.mark.parametrize(
    ("inverted", "order", "center_hz", "conjugate"),
    [
        ("false", "IQ", 1279.0e6, False),
        ("true", "IQ", 1278.5e6, True),
        ("false", "IQn", 1279.0e6, True),
        ("true", "IQn", 1278.5e6, False),
    ],
)
def test_a_carrier_comes_out_at_the_same_place(
    published: Path, inverted: str, order: str, center_hz: float, conjugate: bool
) -> None:
    """A carrier 1 MHz above the centre, as the samples hold it, stands 1 MHz above the centre after reading."""
    rate_hz, n = 20e6, 4000
    stored_hz = -250e3 + (-1e6 if inverted == "true" else 1e6)
    tone = 1000 * np.exp(2j * np.pi * stored_hz / rate_hz * np.arange(n))
    numbers = np.stack([tone.real, -tone.imag if order == "IQn" else tone.imag], axis=1)
    (published.parent / "tone.dat").write_bytes(np.rint(numbers).astype("<i2").tobytes())
    changes = [("<delaybias", f"<inverted>{inverted}</inverted><delaybias"), (">IQ<", f">{order}<")]
    file = read(published, *changes, ("<offset>4", "<offset>0"), ("e6.dat", "tone.dat")).bands[Band.E6]
    assert (file.center_frequency_hz, file.spectral_inversion) == (center_hz, conjugate)
    reader = open_recording(published).e6
    assert reader is not None
    spectrum = np.abs(np.fft.fft(reader.samples(0, n)))
    found_hz = center_hz + np.fft.fftfreq(n, 1 / rate_hz)[int(np.argmax(spectrum))]
    assert found_hz == pytest.approx(1278.75e6 + 1e6, abs=rate_hz / n)


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    for number, (component, layout, turned, big) in enumerate(
        product(("int8", "uint8", "int16", "uint16"), ("real", "iq", "qi"), (False, True), (False, True))
    ):
        form = SampleFormat(component=component, layout=layout, big_endian=big and component.endswith("16"))  # type: ignore[arg-type]
        folder = tmp_path / str(number)
        folder.mkdir()
        bands = {}
        for band, center_hz in ((Band.E1, 1572.42e6), (Band.E6, 1278.7500001e6)):
            data = folder / f"{band.value} & <more>.bin"
            data.write_bytes(bytes(100))
            bands[band] = BandFile(
                band=band, path=data, described_in=folder / "a.sdrx", form=form, sample_rate_hz=12.5e6 + number / 3,
                center_frequency_hz=center_hz, spectral_inversion=turned and form.is_complex, start=START,
                bandwidth_hz=8.7e6, header_bytes=7,
            )  # fmt: skip
        written = RecordingDescription(path=folder / "a.sdrx", bands=bands)
        write_ion_metadata(folder / "a.sdrx", written)
        assert read_ion_metadata(folder / "a.sdrx") == written
        assert find_recording(folder) == folder / "a.sdrx"
        assert describe_recording(folder) == written


def test_the_order_of_the_written_elements(tmp_path: Path) -> None:
    """Readers that follow references need the ids that are referred to, once each."""
    (tmp_path / "e6.bin").write_bytes(bytes(2))
    file = BandFile(
        band=Band.E6, path=tmp_path / "e6.bin", described_in=tmp_path, form=SampleFormat(component="int8", layout="iq"),
        sample_rate_hz=1e7, center_frequency_hz=1278.75e6, start=START,
    )  # fmt: skip
    write_ion_metadata(tmp_path / "a.sdrx", RecordingDescription(path=tmp_path, bands={Band.E6: file}))
    root = ElementTree.parse(tmp_path / "a.sdrx").getroot()  # noqa: S314
    space = "{http://www.ion.org/standards/sdrwg/schema/metadata.xsd}"
    assert root.tag == f"{space}metadata"
    assert [child.tag.removeprefix(space) for child in root] == ["session", "system", "band", "lane", "file"]
    ids = {child.tag.removeprefix(space): child.get("id") for child in root}
    reference = {"bandsrc": "idband", "system": "id", "lane": "id", "band": "id"}
    used = {
        element.tag.removeprefix(space): element.get(reference[element.tag.removeprefix(space)])
        for element in root.iter()
        if not len(element) and element.tag.removeprefix(space) in reference
    }
    assert used == {"bandsrc": ids["band"], "system": ids["system"], "lane": ids["lane"], "band": ids["band"]}
    assert root.findtext(f"{space}file/{space}timestamp") == "2026-11-22T22:00:32.1234567890123Z"
    # names and order in which the working group's library writes them
    names = {
        parent: [child.tag.removeprefix(space) for child in next(root.iter(f"{space}{parent}"))]
        for parent in ("chunk", "stream")
    }
    assert names == {
        "chunk": ["sizeword", "countwords", "endian", "padding", "wordshift", "lump"],
        "stream": [
            "ratefactor", "quantization", "packedbits", "alignment", "shift", "format", "encoding", "band",
        ],
    }  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        (
            "<lump>",
            '<lump><stream id="L1"><ratefactor>1</ratefactor></stream>',
            "lane SingleFreqE6: found 2 streams that are not alike, or not one sample of each in turn",
        ),
        ("</lump>", "</lump><lump/>", "chunk: found 2 of lump"),
        (">16<", ">12<", "stream E6: found 12 bits in TC"),
        (">TC<", ">SIGN<", "stream E6: found 16 bits in SIGN"),
        (">IQ<", ">QnIn<", "stream E6: found the format QnIn"),
        (">128<", ">64<", "stream E6: found 64 packed bits for 8 numbers of 16 bits"),
        ("<sizeheader>0", "<sizeheader>62", "block: found sizeheader"),
        ("<sizeword>2", "<sizeword>4", "chunk: found 8 words of 32 bits for 8 numbers of 16 bits"),
        ('<band id="E6"/>', '<band id="E6"/><band id="E6"/>', "stream E6: found 2 of band"),
        ("<owner>", "<next>more.xml</next><owner>", "file: found a sequence of files (next)"),
    ],
)
def test_what_is_not_supported_is_refused_with_what_is(published: Path, old: str, new: str, found: str) -> None:
    with pytest.raises(UnsupportedError) as refused:
        read(published, (old, new))
    assert str(refused.value) == (
        f"{published}: {found}; supported is streams of one band each, alike if a file has several, 8 or 16 bits "
        "(TC, INT8 or OB), IF, IQ, QI or IQn, without header, footer and padding"
    )


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('<lane id="SingleFreqE6"/>', "", "file: found no lane, expected one"),
        ('<lane id="SingleFreqE6"/>', '<lane id="x"/>', "file: found 0 of lane x, expected one to refer to"),
        ('format="GHz"', "", "band E6.centerfreq: found the unit None, expected one of Hz, kHz, MHz, GHz"),
        ("1.27875", "nan", "band E6.centerfreq: found nan, expected a frequency"),
        ("<ratefactor>4", "<ratefactor>-4", "stream E6.ratefactor: found -4, expected a whole number"),
        (
            "2026-11-22T11:18:00Z</timestamp>",
            "22-Nov-2026</timestamp>",
            "file.timestamp: found 22-Nov-2026, expected a",
        ),
        ("e6.dat", "other.dat", "file.url: found other.dat, which is not there"),
        ("1.27875", "1.1", "file: found no E1 or E6 samples"),
        ("Little", "Undefined", "chunk.endian: found Undefined, expected Little or Big"),
        (">5.0<", ">0.0<", "freqbase times ratefactor: found 0 Hz"),
        ("metadata", "other", "root element: found"),
        ("</metadata>", "", "document: found"),
        ("<lane id", "<!DOCTYPE a [<!ENTITY b 'c'>]><lane id", "document: found"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(published: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(InputFileError) as refused:
        read(published, (old, new))
    assert message in str(refused.value)
    assert str(refused.value).startswith(f"{published}: ")
    assert "\n" not in str(refused.value)


def test_bands_that_begin_at_different_times_are_refused(tmp_path: Path) -> None:
    bands = {}
    for band, center_hz in ((Band.E1, 1575.42e6), (Band.E6, 1278.75e6)):
        (tmp_path / band.value).write_bytes(bytes(8))
        bands[band] = BandFile(
            band=band, path=tmp_path / band.value, described_in=tmp_path, sample_rate_hz=1e7, start=START,
            form=SampleFormat(component="int8", layout="iq"), center_frequency_hz=center_hz,
        )  # fmt: skip
    write_ion_metadata(tmp_path / "a.sdrx", RecordingDescription(path=tmp_path, bands=bands))
    text = (tmp_path / "a.sdrx").read_text()
    head, _, tail = text.rpartition("32.1234567890123Z")
    (tmp_path / "a.sdrx").write_text(f"{head}32.1234567890124Z{tail}")
    with pytest.raises(UnsupportedError, match="supported are bands that begin at the same time"):
        read_ion_metadata(tmp_path / "a.sdrx")


def test_what_the_standard_cannot_hold_is_not_written(tmp_path: Path) -> None:
    def written(**options: object) -> None:
        values: dict[str, object] = {
            "band": Band.E6, "path": tmp_path / "a.bin", "described_in": tmp_path, "sample_rate_hz": 1e7,
            "start": START, "form": SampleFormat(component="int8", layout="iq"), "center_frequency_hz": 1278.75e6,
        }  # fmt: skip
        file = BandFile(**(values | options))  # type: ignore[arg-type]
        write_ion_metadata(tmp_path / "a.sdrx", RecordingDescription(path=tmp_path, bands={Band.E6: file}))

    assert not has_ion_encoding("float32")
    for wrong in (
        {"form": SampleFormat(component="float32", layout="iq")}, {"start": None}, {"trailing_bytes": 1},
        {"path": tmp_path.parent / "a.bin"},
    ):  # fmt: skip
        with pytest.raises(UnsupportedError):
            written(**wrong)
        assert not (tmp_path / "a.sdrx").exists()
    written()
