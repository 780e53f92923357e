"""`vestige inspect`: print content and faults of a recording, and the data that are missing for ACAS."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.options import PATH, json_option, time_option, trust_options
from vestige.cli.terminal import echo

if TYPE_CHECKING:
    from vestige.recording.doctor.examination import Examination
    from vestige.recording.inspection import BandInspection, Inspection, ObservationCoverage


@click.command()
@click.argument("path", type=PATH)
@click.option(
    "--start", callback=time_option, help="Time of the earliest sample, used in place of the recording's own time tag."
)
@click.option("--time-uncertainty", type=click.FloatRange(0), help="Upper limit of the receiver clock's error in s.")
@click.option(
    "--assistance", type=PATH, help="Folder with RECS, group delays and keys. [default: RECORDING/assistance]"
)
@trust_options
@click.option(
    "--check-hash", is_flag=True, help="Read all samples, and compare their hash with the hash in the description."
)
@click.option(
    "--quick", is_flag=True, help="Do not search for signals. The search takes 10 s, or 40 s if there is none."
)
@json_option
def command(path: Path, **options: Any) -> None:
    """Print the content and the faults of PATH, and the data that are missing for ACAS.

    PATH is a folder, a recording.toml, a SigMF metadata or collection file, an ION metadata file (.sdrx, .xml), or a
    file of E1 observations.

    Unless --quick is given, the satellites found on E1 and E6 are listed. If no satellite is found with the
    description, other descriptions are tried. The other descriptions have exchanged bands, or another sampling rate,
    number format, sense of the spectrum or centre frequency.
    """
    import json

    from vestige.cli.progress import progress
    from vestige.recording.inspection import inspect_recording

    with progress() as report:
        found = inspect_recording(
            path,
            start=options["start"],
            time_uncertainty_s=options["time_uncertainty"],
            assistance=options["assistance"],
            public_key=options["public_key"],
            merkle_tree=options["merkle_tree"],
            check_hash=options["check_hash"],
            signals=not options["quick"],
            progress=report,
        )
    if options["as_json"]:
        echo(json.dumps(_json(found), allow_nan=False))
        return
    for line in _lines(found):
        echo(line)


def _lines(found: Inspection) -> Iterator[str]:
    if found.description is None:
        yield f"{found.path}: no samples"
    else:
        uncertainty = found.description.time_uncertainty_s
        clock = "clock error not stated" if uncertainty == float("inf") else f"clock right to ±{uncertainty:g} s"
        yield f"{found.path}: recording described by {found.description.path.name}, {clock}"
    for band in found.bands:
        yield from _band_lines(band)
    if found.examination is not None:
        yield from _signal_lines(found.examination)
    if found.observations is not None:
        yield from _observation_lines(found.observations)
    if found.assistance.files:
        yield "assistance"
        for file in found.assistance.files:
            yield f"    {file.path.name}: {file.content}"
        if any(band.reader.band.name == "E6" for band in found.bands):
            yield f"    {len(found.recorded_segments)} RECS can be in the E6 samples"
    findings = () if found.examination is None else found.examination.findings
    for title, remarks in (
        ("wrong", [one.line for one in findings if one.is_fault]),
        ("what the signals say", [one.line for one in findings if not one.is_fault]),
        ("not usable", [str(problem) for problem in found.assistance.problems]),
        ("note", found.notes),
        ("missing for ACAS", found.missing),
    ):
        if remarks:
            yield title
            yield from (f"  - {remark}" for remark in remarks)
    if not found.missing:
        yield "nothing is missing for ACAS"


def _band_lines(band: BandInspection) -> Iterator[str]:
    reader, statistics = band.reader, band.adc_statistics
    file = reader.file
    rate = f"{file.sample_rate_hz / 1e6:g} Msps"
    yield f"{reader.band.name}  {file.path.name}: {file.form}, {rate}, {reader.duration_s:g} s"
    if file.start is not None:
        end = reader.time_of(reader.end_sample)
        yield f"    {reader.start} to {end}, from sample {reader.first_sample} of the counter"
    inverted = ", spectrum inverted" if file.spectral_inversion else ""
    width = "" if file.bandwidth_hz is None else f", {file.bandwidth_hz / 1e6:g} MHz wide"
    yield f"    0 Hz is {file.center_frequency_hz / 1e6:g} MHz{inverted}{width}"
    center = statistics.spectral_center_hz
    around = "" if center is None else f", pass band around {center / 1e6:.2f} MHz"
    yield (
        f"    {statistics.n_distinct} distinct values, {statistics.outermost_fraction:.2%} at ±{statistics.outermost:g}"
        f", rms {statistics.rms:.4g}{around}"
    )
    if band.hash_agrees:
        yield "    the samples have the hash that the description states"


def _signal_lines(examination: Examination) -> Iterator[str]:
    if not examination.e1 and not examination.e6:
        yield "no satellite was found"
        return
    yield "satellites"
    e6 = {one.svid: one for one in examination.e6}
    for one in examination.e1:
        other = e6.get(one.svid)
        beside = "" if other is None else f", E6-B {other.cn0_dbhz:4.1f} dBHz, E6-C {_E6C[other.e6c_open]}"
        rough = "" if one.snapshot is not None else " (rough: too few samples)"
        yield f"    E{one.svid:02d}  E1 {one.cn0_dbhz:4.1f} dBHz, Doppler {one.doppler_hz:8.1f} Hz{rough}{beside}"
    if not examination.e1:
        for other in examination.e6:
            yield f"    E{other.svid:02d}  E6-B {other.cn0_dbhz:4.1f} dBHz, E6-C {_E6C[other.e6c_open]}"


_E6C = {True: "open", False: "encrypted or absent"}


def _observation_lines(coverage: ObservationCoverage) -> Iterator[str]:
    yield f"E1 observations  {coverage.file.path.name}: {coverage.file.kind}, {coverage.n_epochs} epochs"
    if coverage.span is not None:
        yield f"    {coverage.span[0]} to {coverage.span[1]}"
        yield f"    satellites {' '.join(map(str, coverage.satellites)) or 'none'}"


def _json(found: Inspection) -> dict[str, Any]:
    uncertainty = found.description.time_uncertainty_s if found.description else float("inf")
    return {
        "path": str(found.path),
        "described_in": str(found.description.path) if found.description else None,
        "time_uncertainty_s": None if uncertainty == float("inf") else uncertainty,
        "bands": {band.reader.band.name: _json_band(band) for band in found.bands},
        "observations": _json_observations(found.observations),
        "assistance": {
            "files": [
                {"path": str(file.path), "kind": file.kind.value, "content": file.content}
                for file in found.assistance.files
            ],
            "problems": [str(problem) for problem in found.assistance.problems],
            "recorded_segments": [
                {"svid": segment.svid, "transmit_time": str(segment.transmit_time)}
                for segment in found.recorded_segments
            ],
        },
        "signals": None if found.examination is None else _json_signals(found.examination),
        "notes": list(found.notes),
        "missing": list(found.missing),
    }


def _json_band(band: BandInspection) -> dict[str, Any]:
    from dataclasses import asdict

    from vestige.recording.exact_time import exact_gst

    reader, statistics = band.reader, band.adc_statistics
    file = reader.file
    return {
        "file": str(file.path),
        "format": str(file.form),
        "sample_rate_hz": file.sample_rate_hz,
        "center_frequency_hz": file.center_frequency_hz,
        "spectral_inversion": file.spectral_inversion,
        "bandwidth_hz": file.bandwidth_hz,
        "first_sample": reader.first_sample,
        "n_samples": reader.n_samples,
        "duration_s": reader.duration_s,
        "start": None if file.start is None else str(file.start),
        "start_gst": None if file.start is None else exact_gst(file.start),
        "hash_agrees": band.hash_agrees,
        "levels": asdict(statistics) | {"mean": [statistics.mean.real, statistics.mean.imag]},
    }


def _json_signals(examination: Examination) -> dict[str, Any]:
    import math

    return {
        "e1": [
            {
                "svid": one.svid,
                "doppler_hz": one.doppler_hz,
                "cn0_dbhz": one.cn0_dbhz if math.isfinite(one.cn0_dbhz) else None,
                "measured": one.snapshot is not None,
            }
            for one in examination.e1
        ],
        "e6": [
            {
                "svid": one.svid,
                "e6b_cn0_dbhz": one.cn0_dbhz if math.isfinite(one.cn0_dbhz) else None,
                "e6c_open": one.e6c_open,
                "secondary_code_fits": one.secondary_fits,
            }
            for one in examination.e6
        ],
        "findings": [
            {
                "kind": one.kind.value,
                "band": None if one.band is None else one.band.value,
                "is_fault": one.is_fault,
                "evidence": one.evidence,
                "advice": one.advice,
            }
            for one in examination.findings
        ],
    }


def _json_observations(coverage: ObservationCoverage | None) -> dict[str, Any] | None:
    if coverage is None:
        return None
    return {
        "file": str(coverage.file.path),
        "kind": coverage.file.kind,
        "n_epochs": coverage.n_epochs,
        "span": None if coverage.span is None else [str(time) for time in coverage.span],
        "satellites": list(coverage.satellites),
    }
