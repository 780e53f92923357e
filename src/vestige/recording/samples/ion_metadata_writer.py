"""Write ION GNSS SDR Metadata, revision 1.0 [IONSDR]: an `.sdrx` file beside the samples of an existing recording.

Names and units have the form of the working group's library, which other programs use. `ion_metadata` can read the file
if all bands begin at the same time. The sample counter and the upper limit of the clock's error are lost, because the
standard has no elements for counter and limit.
"""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import escape

from vestige.errors import UnsupportedError
from vestige.output import replacement
from vestige.recording.description import BandFile, RecordingDescription
from vestige.recording.exact_time import exact_second
from vestige.recording.samples.ion_metadata import ION_NAMESPACE, ION_NUMBERS
from vestige.recording.samples.sample_format import SampleType
from vestige.time import GalileoTime

_ENCODINGS: dict[SampleType, tuple[str, int]] = {
    component: written for written, component in ION_NUMBERS.items() if written[0] != "INT8"
}
_FORMATS = {"real": "IF", "iq": "IQ", "qi": "QI"}

_BAND = """\
  <system id="front end {name}">
    <freqbase format="Hz">{rate}</freqbase>
    <equipment>vestige</equipment>
    <source id="antenna {name}"><type>Undefined</type><polarization>RHCP</polarization></source>
  </system>
  <band id="{name}">
    <centerfreq format="Hz">{center}</centerfreq>
    <translatedfreq format="Hz">0.0</translatedfreq>
    <inverted>{inverted}</inverted>
    <delaybias format="sec">0.0</delaybias>
{bandwidth}  </band>
  <lane id="lane {name}">
    <bandsrc idband="{name}" idsrc="antenna {name}"/>
    <system id="front end {name}"/>
    <block>
      <chunk>
        <sizeword>{word}</sizeword>
        <countwords>{words}</countwords>
        <endian>{endian}</endian>
        <padding>None</padding>
        <wordshift>Left</wordshift>
        <lump>
          <stream id="stream {name}">
            <ratefactor>1</ratefactor>
            <quantization>{bits}</quantization>
            <packedbits>{packed}</packedbits>
            <alignment>Undefined</alignment>
            <shift>Left</shift>
            <format>{layout}</format>
            <encoding>{encoding}</encoding>
            <band id="{name}"/>
          </stream>
        </lump>
      </chunk>
      <cycles>0</cycles>
      <sizeheader>0</sizeheader>
      <sizefooter>0</sizefooter>
    </block>
  </lane>
  <file>
    <url>{url}</url>
    <timestamp>{time}</timestamp>
    <offset>{offset}</offset>
    <lane id="lane {name}"/>
  </file>
"""


def has_ion_encoding(component: SampleType) -> bool:
    """Return whether the standard's library has a code for numbers of a type.

    The library has no code for float32.

    Examples
    --------
    >>> from vestige.recording.samples.ion_metadata_writer import has_ion_encoding
    >>> has_ion_encoding("int8"), has_ion_encoding("float32")
    (True, False)
    """
    return component in _ENCODINGS


def write_ion_metadata(path: Path, description: RecordingDescription) -> None:
    """Write the metadata file of a recording.

    Parameters
    ----------
    path
        The `.sdrx` file, in the folder of the sample files.
    description
        Description of the recording. Each band needs a time tag.

    Raises
    ------
    UnsupportedError
        If the standard has no encoding for the samples (float32), a band has no time tag, bytes follow the samples, or
        the sample files lie in another folder.
    OSError
        If the file cannot be written.
    """
    bands = "".join(_band(path, file) for file in description.bands.values())
    first = min(_time(path, file) for file in description.bands.values())
    session = f'  <session id="recording">\n    <toa>{_utc(first)}</toa>\n  </session>\n'
    text = f'<?xml version="1.0" encoding="UTF-8"?>\n<metadata xmlns="{ION_NAMESPACE}">\n{session}{bands}</metadata>\n'
    with replacement(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8", newline="\n")


def _band(path: Path, file: BandFile) -> str:
    form = file.form
    if not has_ion_encoding(form.component):
        raise UnsupportedError(f"{file.path}: ION metadata has no encoding for {form.component}, only 8 and 16 bits")
    if file.trailing_bytes or file.path.parent != path.parent:
        raise UnsupportedError(
            f"{file.path}: ION metadata must be in the folder of the samples, and no other data may follow the samples"
        )
    encoding, bits = _ENCODINGS[form.component]
    width = "" if file.bandwidth_hz is None else f'    <bandwidth format="Hz">{file.bandwidth_hz!r}</bandwidth>\n'
    return _BAND.format(
        name=file.band.value,
        rate=repr(file.sample_rate_hz),
        center=repr(file.center_frequency_hz),
        inverted="true" if file.spectral_inversion else "false",
        bandwidth=width,
        word=bits // 8,
        words=form.components_per_sample,
        endian="Big" if form.big_endian else "Little",
        bits=bits,
        packed=bits * form.components_per_sample,
        layout=_FORMATS[form.layout],
        encoding=encoding,
        url=escape(file.path.name),
        time=_utc(_time(path, file)),
        offset=file.header_bytes,
    )


def _time(path: Path, file: BandFile) -> GalileoTime:
    if file.start is None:
        raise UnsupportedError(f"{path}: ION metadata need a time tag, and {file.path.name} has none")
    return file.start


def _utc(time: GalileoTime) -> str:
    """Return a time as `xs:dateTime` in UTC, with all digits of its fraction."""
    digits = exact_second(time).partition(".")[2]
    return f"{time.utc:%Y-%m-%dT%H:%M:%S}{'.' + digits if digits else ''}Z"
