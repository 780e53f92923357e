"""Write files with which independent receivers read a recording, into a subfolder for each receiver.

| program | files |
|---|---|
| gnss-sdr | a configuration for each band; gnss-sdr reads the SigMF samples, and computes a position fix from E1 |
| PocketSDR | rescaled samples, I and −Q, a tag file for each band, options of the loops; command lines in README.txt |
| GalileoSASlib | unchanged int16 samples, named by their start time, and a table of keys; see `saslib_export` |

The options in the files avoid several faults of gnss-sdr and PocketSDR. gnss-sdr acquires E6 only by E6-B. gnss-sdr
must also track E6-B, because E6-C is encrypted. Without `bit_transition_flag` the Doppler on E6 is mostly wrong by 500
Hz, because E6-B may change its sign every millisecond. With a Doppler step of 125 Hz in the acquisition of E1, gnss-sdr
locks with a Doppler error of 125 Hz. PocketSDR accepts no sample beyond ±7 and conjugates its input. The default phase
loop of PocketSDR has a bandwidth of 5 Hz. A loop with a bandwidth of 5 Hz loses a satellite whose range oscillates with
an acceleration of up to 5 m/s², as in `scenarios/quick.toml`. A loop with a bandwidth of 10 Hz keeps lock.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vestige.errors import UnsupportedError
from vestige.recording.adc_statistics import adc_statistics
from vestige.recording.recording import Recording
from vestige.recording.samples.sample_file import SampleReader
from vestige.recording.samples.sample_format import SampleFormat, encode
from vestige.recording.samples.saslib_export import check_saslib_form, export_saslib
from vestige.records import Band


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedSky:
    """Satellites and atmosphere of the signals in a recording, which the recording's own files do not state.

    Attributes
    ----------
    svids
        Space vehicle identifiers of the satellites.
    troposphere
        Whether the signals are delayed by a troposphere.
    ionosphere
        Whether the signals are delayed by the ionosphere that word 5 of the message describes.
    """

    svids: tuple[int, ...]
    troposphere: bool = False
    ionosphere: bool = False


Export = Callable[[Recording, Path, ExportedSky], tuple[Path, ...]]

_CHUNK = 1 << 22  # number of samples that are converted at once
_POCKETSDR_RMS, _POCKETSDR_LIMIT = 2.0, 7.0
_POCKETSDR_OPTIONS = (  # name and content; all other options keep PocketSDR's defaults
    "pocket_trk.conf",
    """\
# options of pocket_trk for recordings of vestige
b_pll = 10.0  # bandwidth of the PLL (Hz); a PLL of 5 Hz loses a range that oscillates with 5 m/s^2
""",
)

# number type: item type and data type adapter of gnss-sdr
_ITEMS = {
    "int8": ("ibyte", "Ibyte_To_Complex"),
    "int16": ("ishort", "Ishort_To_Complex"),
    "float32": ("gr_complex", "Pass_Through"),
}

_GNSS_SDR_COMMON = """\
[GNSS-SDR]
GNSS-SDR.internal_fs_sps={rate}
SignalSource.implementation=File_Signal_Source
SignalSource.filename={samples}
SignalSource.item_type={item}
SignalSource.sampling_frequency={rate}
SignalSource.samples=0
SignalSource.repeat=false
SignalSource.enable_throttle_control=false
SignalConditioner.implementation=Signal_Conditioner
DataTypeAdapter.implementation={adapter}
DataTypeAdapter.item_type={item}
InputFilter.implementation=Pass_Through
InputFilter.item_type=gr_complex
Resampler.implementation=Pass_Through
Resampler.item_type=gr_complex
; all channels search at the same time, so that their start does not depend on the scheduler
Channels.in_acquisition={count}
Channels_{signal}.count={count}
{channels}
Observables.implementation=Hybrid_Observables
PVT.implementation=RTKLIB_PVT
PVT.positioning_mode=Single
PVT.output_rate_ms=100
PVT.display_rate_ms=1000
{atmosphere}
PVT.output_enabled={fix}
PVT.rinex_output_enabled={fix}
PVT.rinex_version=3
PVT.nmea_output_file_enabled={fix}
PVT.gpx_output_enabled=false
PVT.geojson_output_enabled=false
PVT.kml_output_enabled=false
PVT.xml_output_enabled=false
PVT.rtcm_output_file_enabled=false
"""

# lines for gnss-sdr if the signals have no delay by troposphere or ionosphere (False), or have this delay (True)
_GNSS_SDR_TROPOSPHERE = {
    False: """\
; the signals have no troposphere
PVT.trop_model=OFF""",
    True: """\
; the signals have a troposphere, with the zenith delays of Saastamoinen
PVT.trop_model=Saastamoinen""",
}
_GNSS_SDR_IONOSPHERE = {
    False: """\
; the signals have no ionosphere except the errors of the scenario
PVT.iono_model=OFF""",
    True: """\
; the signals have the ionosphere of word 5 (NTCM-G). gnss-sdr has only Klobuchar's model, and takes its own
; coefficients, because a Galileo message has none. The difference is an error of the fix, mostly of the height.
PVT.iono_model=Broadcast""",
}

_GNSS_SDR_BAND = {
    Band.E1: (
        "1B",
        """\
Acquisition_1B.implementation=Galileo_E1_PCPS_Ambiguous_Acquisition
Acquisition_1B.item_type=gr_complex
Acquisition_1B.coherent_integration_time_ms=4
Acquisition_1B.acquire_pilot=true
Acquisition_1B.pfa=0.000001
Acquisition_1B.doppler_max=5000
; with a step of 125 Hz the loop locks 125 Hz off, half a cycle in 4 ms
Acquisition_1B.doppler_step=50
Acquisition_1B.max_dwells=5
Acquisition_1B.blocking=true
Tracking_1B.implementation=Galileo_E1_DLL_PLL_VEML_Tracking
Tracking_1B.item_type=gr_complex
Tracking_1B.track_pilot=true
; the phase loop alone loses some satellites within the first seconds
Tracking_1B.enable_fll_pull_in=true
Tracking_1B.fll_bw_hz=10
Tracking_1B.pull_in_time_s=2
Tracking_1B.pll_bw_hz=15
; with these correlators the code discriminator has 5.2 times the slope that the loop assumes,
; so the noise bandwidth is 3.8 times this setting: 1 Hz
Tracking_1B.dll_bw_hz=0.26
Tracking_1B.early_late_space_chips=0.25
Tracking_1B.very_early_late_space_chips=0.6
Tracking_1B.dump=true
Tracking_1B.dump_filename=./e1_track
Tracking_1B.dump_mat=true
TelemetryDecoder_1B.implementation=Galileo_E1B_Telemetry_Decoder
""",
    ),
    Band.E6: (
        "E6",
        """\
; gnss-sdr acquires E6-B only
Acquisition_E6.implementation=Galileo_E6_PCPS_Acquisition
Acquisition_E6.item_type=gr_complex
Acquisition_E6.coherent_integration_time_ms=1
Acquisition_E6.pfa=0.0001
Acquisition_E6.doppler_max=5000
Acquisition_E6.doppler_step=125
; symbols change within most of the milliseconds that acquisition looks at
Acquisition_E6.bit_transition_flag=true
Acquisition_E6.max_dwells=5
Acquisition_E6.blocking=true
Tracking_E6.implementation=Galileo_E6_DLL_PLL_Tracking
Tracking_E6.item_type=gr_complex
; E6-C is encrypted
Tracking_E6.track_pilot=false
; acquisition over 1 ms leaves about 100 Hz, more than the phase loop pulls in
Tracking_E6.enable_fll_pull_in=true
Tracking_E6.fll_bw_hz=35
Tracking_E6.pull_in_time_s=2
Tracking_E6.pll_bw_hz=20
Tracking_E6.dll_bw_hz=2
Tracking_E6.early_late_space_chips=0.5
Tracking_E6.dump=true
Tracking_E6.dump_filename=./e6_track
Tracking_E6.dump_mat=true
TelemetryDecoder_E6.implementation=Galileo_E6_Telemetry_Decoder
""",
    ),
}


def export_gnss_sdr(recording: Recording, folder: Path, sky: ExportedSky) -> tuple[Path, ...]:
    """Write a configuration of gnss-sdr 0.0.17 for each band (`e1.conf`, `e6.conf`), and return the paths of the files.

    The files are in `folder`, where gnss-sdr must be run. The corrections of troposphere and ionosphere are on if the
    signals have these delays.

    The function raises `UnsupportedError` if gnss-sdr has no item type for the samples, or the rate is not a whole
    number of Hz.
    """
    paths = []
    for band, reader in _bands(recording):
        file = reader.file
        check_export("gnss-sdr", file.form, file.sample_rate_hz)
        signal, settings = _GNSS_SDR_BAND[band]
        item, adapter = _ITEMS[file.form.component]
        channels = "".join(
            f"Channel{number}.signal={signal}\nChannel{number}.satellite={svid}\n"
            for number, svid in enumerate(sky.svids)
        )
        common = _GNSS_SDR_COMMON.format(
            rate=round(file.sample_rate_hz),
            samples=f"../{file.path.name}",
            item=item,
            adapter=adapter,
            signal=signal,
            count=len(sky.svids),
            channels=channels.rstrip(),
            atmosphere="\n".join((_GNSS_SDR_TROPOSPHERE[sky.troposphere], _GNSS_SDR_IONOSPHERE[sky.ionosphere])),
            fix="true" if band is Band.E1 else "false",
        )
        paths.append(folder / f"{band.value.lower()}.conf")
        paths[-1].write_text(common + settings, encoding="ascii", newline="\n")
    return tuple(paths)


def export_pocketsdr(recording: Recording, folder: Path, sky: ExportedSky) -> tuple[Path, ...]:
    """Write samples, tag files, options and a README.txt for PocketSDR into `folder`, and return their paths.

    The samples are int8 I and −Q, each with an rms value of 2, and clipped at ±7.
    """
    satellites = ",".join(str(svid) for svid in sky.svids)
    paths, commands = [], []
    for band, reader in _bands(recording):
        path = folder / f"{band.value.lower()}.bin"
        scale = _POCKETSDR_RMS / adc_statistics(reader).rms
        with path.open("wb") as stream:
            for first in range(reader.first_sample, reader.end_sample, _CHUNK):
                samples = reader.samples(first, min(_CHUNK, reader.end_sample - first))
                clipped = np.clip(scale * samples.view(np.float32), -_POCKETSDR_LIMIT, _POCKETSDR_LIMIT)
                stream.write(encode(clipped.view(np.complex64), _CI8, inverted=True).tobytes())
        rate_mhz, center_mhz = reader.file.sample_rate_hz / 1e6, reader.file.center_frequency_hz / 1e6
        tag = {
            "PROG": "vestige",
            "TIME": f"{reader.start.utc:%Y-%m-%dT%H:%M:%SZ}",
            "FMT": "INT8X2",
            "F_S": f"{rate_mhz:.10g}",
            "F_LO": f"{center_mhz:.10g}",
            "IQ": "2",
        }
        tag_path = path.with_name(path.name + ".tag")
        tag_path.write_text("".join(f"{key:4} = {value}\n" for key, value in tag.items()), "ascii", newline="\n")
        signals = " ".join(f"-sig {band.value}{channel} -prn {satellites}" for channel in "BC"[: _OPEN[band]])
        commands.append(
            f"pocket_trk {signals} -opt {_POCKETSDR_OPTIONS[0]} "
            f"-fmt INT8X2 -f {rate_mhz:.10g} -fo {center_mhz:.10g} -IQ 2 -tscale 1 -ti 1 "
            f"-log {band.value.lower()}.log {path.name}"
        )
        paths += [path, tag_path]
    options = folder / _POCKETSDR_OPTIONS[0]
    options.write_text(_POCKETSDR_OPTIONS[1], "ascii", newline="\n")
    readme = folder / "README.txt"
    readme.write_text("PocketSDR, run in this folder:\n\n" + "\n".join(commands) + "\n", "ascii", newline="\n")
    return (*paths, options, readme)


EXPORTS: Mapping[str, Export] = {
    "gnss-sdr": export_gnss_sdr,
    "pocketsdr": export_pocketsdr,
    "saslib": lambda recording, folder, sky: export_saslib(recording, folder, sky.svids),
}
# number of bytes of each sample in a copy that an export makes
COPY_BYTES = {"gnss-sdr": 0, "pocketsdr": 2, "saslib": 0}

_CI8 = SampleFormat(component="int8", layout="iq")
_OPEN = {Band.E1: 2, Band.E6: 1}  # number of components without encryption in each band, B before C


def check_export(name: str, form: SampleFormat, sample_rate_hz: float) -> None:
    """Raise `UnsupportedError` if the program of an export cannot read samples of a format and rate.

    A simulation calls this function before it makes samples.

    Examples
    --------
    >>> from vestige.recording.samples.exports import check_export
    >>> from vestige.recording.samples.sample_format import SampleFormat
    >>> check_export("saslib", SampleFormat(component="int16", layout="iq"), 12.5e6)
    """
    if name == "saslib":
        check_saslib_form(form)
    if name == "gnss-sdr":
        if form.layout != "iq" or form.component not in _ITEMS or form.big_endian:
            raise UnsupportedError(f"--export gnss-sdr: gnss-sdr reads int8, int16 and float32 I,Q, not {form}")
        if sample_rate_hz % 1:
            raise UnsupportedError(
                f"--export gnss-sdr: found {sample_rate_hz} Hz, expected a whole number of Hz; change "
                "receiver.sample_rate_hz"
            )


def export(name: str, recording: Recording, folder: Path, sky: ExportedSky) -> tuple[Path, ...]:
    """Write the files of the export `name` into the new folder `name` in `folder`, and return their paths."""
    place = folder / name
    place.mkdir()
    return EXPORTS[name](recording, place, sky)


def _bands(recording: Recording) -> tuple[tuple[Band, SampleReader], ...]:
    readers = ((band, recording.reader(band)) for band in Band)
    return tuple((band, reader) for band, reader in readers if reader is not None)
