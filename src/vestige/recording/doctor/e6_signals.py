"""Examine E6 with the satellites of E1: whether the description of E6 is right, and whether E6-C is encrypted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from statistics import median

from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, MAX_SVID
from vestige.errors import satellite_names
from vestige.recording.description import BandFile
from vestige.recording.doctor.code_doppler import E1Satellite
from vestige.recording.doctor.finding import Finding, FindingKind, TimeLimit, fault, remark
from vestige.recording.doctor.reading import (
    Reading,
    better_sibling,
    centre_reading,
    format_readings,
    head,
    layout_readings,
    rate_reading,
    reversed_readings,
)
from vestige.records import Band, SampleBatch
from vestige.sample_processor.code_repetition import rates_by_repetition_hz
from vestige.sample_processor.e1_snapshot import E1Snapshot
from vestige.sample_processor.e6_acquisition import (
    OPEN_SHARE,
    E6Acquisition,
    acquire_e6,
    cn0_on_the_peak_dbhz,
    secondary_share,
)
from vestige.signals.definitions import E6B, E6C

E6_WINDOW_S = 0.1  # duration in s of the examined samples, one period of the secondary code
BAND_OFFSET_S = 2e-6  # delay in s between E1 and E6 that is too large for ionosphere, satellite and receiver hardware
_LOOKED_AT = 6  # number of satellites to search for, which are the strongest on E1
_TRIED = 3  # number of satellites that are searched for with each changed description
_TRY_S = 0.012
PREDICTED_SPAN_HZ = 400.0  # Doppler span around the Doppler that E1 predicts
_WIDE_HZ = 60_000.0  # Doppler span if the centre frequency may be wrong
_BLIND_SPAN_HZ = 5000.0  # Doppler span without E1
_BLIND_STRETCHES = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class E6Satellite:
    """The signals of one satellite in the E6 samples."""

    svid: int
    cn0_dbhz: float  # C/N0 of E6-B; NaN if the samples contain no complete code period
    e6c_open: bool  # whether the primary code of E6-C repeats every millisecond
    # whether the signs of E6-C are the secondary code of E6-C; None if `e6c_open` is False or the samples are too short
    secondary_fits: bool | None


@dataclass(frozen=True, slots=True, kw_only=True)
class E6Result:
    """Result of the examination of E6: the file with the description that fits, satellites, and findings."""

    file: BandFile
    satellites: tuple[E6Satellite, ...]
    findings: tuple[Finding, ...]


def examine_e6(
    files: Sequence[BandFile], e1: Sequence[E1Satellite], try_s: float, *, span_hz: float = PREDICTED_SPAN_HZ
) -> E6Result:
    """Return the satellites on E6, the description that fits the samples, and the findings.

    Parameters
    ----------
    files
        The samples of E6 as described, or several possible descriptions if the search of E1 has found swapped bands.
    e1
        Satellites on E1, the strongest first. If `e1` is empty, all satellites are searched for.
    try_s
        Processor time in s for the trials of other descriptions.
    span_hz
        Largest difference in Hz between the Dopplers on E6 and the predictions of E1.
    """
    findings: list[Finding] = []
    sky = [(one.svid, one.doppler_hz * E6_CARRIER_HZ / E1_CARRIER_HZ) for one in e1[:_LOOKED_AT]]
    file = next((one for one in files if _shown(one, sky, span_hz)), files[0])
    sibling = better_sibling(file)
    if sibling is not None:
        findings.append(sibling.fault(sibling.says))
        file = sibling.file
    turned = _reversed(file, sky, span_hz)
    if turned is not None:
        evidence = "the Dopplers have the other sign than on E1, so the spectrum is reversed"
        findings.append(turned.fault(evidence))
        file = turned.file
    if sky and not _shown(file, sky, span_hz):
        limit = TimeLimit(try_s)
        reading = _reading_that_fits(file, sky[:_TRIED], limit, span_hz)
        if reading is None:
            findings.append(_nothing(sky))
            return E6Result(file=file, satellites=(), findings=tuple(findings))
        names = satellite_names(one.svid for one in _shown(reading.file, sky, span_hz))
        findings.append(reading.fault(f"no signal was found as described, but {names} {reading.says}"))
        file = reading.file
    batch = head(file, E6_WINDOW_S)
    if batch is None:
        return E6Result(file=file, satellites=(), findings=tuple(findings))
    satellites, acquired = _satellites(batch, sky, span_hz)
    if not sky and not satellites:
        findings.append(_nothing(sky))
    findings.extend(_offset(batch, e1, acquired))
    findings.extend(_encryption(satellites))
    return E6Result(file=file, satellites=tuple(satellites), findings=tuple(findings))


def expected_start_s(snapshot: E1Snapshot, batch: SampleBatch) -> float:
    """Return the time in s from the first E6 sample to the next start of a code period, as E1 predicts, modulo 1 ms."""
    ahead_s = batch.start - snapshot.time
    phase_s = snapshot.transmit_phase_s + ahead_s * (1 + snapshot.doppler_hz / E1_CARRIER_HZ)
    return -phase_s % E6B.period_s


def _shown(file: BandFile, sky: list[tuple[int, float]], span_hz: float) -> list[E6Acquisition]:
    """Return the acquired E6-B signals of the first satellites of `sky` in the first samples of a file."""
    batch = head(file, _TRY_S)
    if batch is None:
        return []
    found = (
        acquire_e6(batch, E6B, svid, doppler_hz=doppler_hz, doppler_span_hz=span_hz)
        for svid, doppler_hz in sky[:_TRIED]
    )
    return [one for one in found if one is not None]


def _readings(file: BandFile) -> Iterator[Iterable[Reading]]:
    """Yield the readings for a reversed spectrum, then for other formats, then for other sampling rates."""
    yield reversed_readings(file)
    yield chain(layout_readings(file), format_readings(file))
    batch = head(file, E6_WINDOW_S)
    if batch is not None:
        carrier = (E6_CARRIER_HZ - file.center_frequency_hz) / file.sample_rate_hz
        rates = rates_by_repetition_hz(batch.samples, E6B.period_s, carrier=carrier)
        yield (rate_reading(file, rate_hz) for rate_hz in rates if rate_hz != file.sample_rate_hz)


def _reading_that_fits(
    file: BandFile, sky: list[tuple[int, float]], limit: TimeLimit, span_hz: float
) -> Reading | None:
    for readings in _readings(file):
        strongest, strength = None, 0.0
        for reading in readings:
            if limit.is_over:
                return strongest
            total = sum(one.statistic for one in _shown(reading.file, sky, span_hz))
            if total > strength:
                strongest, strength = reading, total
        if strongest is not None:
            return strongest
    batch = head(file, _TRY_S)
    if batch is None or limit.is_over:
        return None
    for svid, doppler_hz in sky[:1]:
        found = acquire_e6(batch, E6B, svid, doppler_hz=doppler_hz, doppler_span_hz=_WIDE_HZ)
        if found:
            return centre_reading(file, round(found.doppler_hz - doppler_hz, -2))
    return None


def _satellites(
    batch: SampleBatch, sky: list[tuple[int, float]], span_hz: float
) -> tuple[list[E6Satellite], dict[int, E6Acquisition]]:
    acquired: dict[int, E6Acquisition] = {}
    if sky:
        for svid, doppler_hz in sky:
            found = acquire_e6(batch, E6B, svid, doppler_hz=doppler_hz, doppler_span_hz=span_hz)
            if found:
                acquired[svid] = found
    else:
        for svid in range(1, MAX_SVID + 1):
            found = acquire_e6(batch, E6B, svid, doppler_span_hz=_BLIND_SPAN_HZ, max_stretches=_BLIND_STRETCHES)
            if found:
                acquired[svid] = found
    dopplers = dict(sky)
    satellites = []
    for svid, found in acquired.items():
        doppler_hz = dopplers.get(svid, found.doppler_hz)
        pilot = acquire_e6(batch, E6C, svid, doppler_hz=doppler_hz, doppler_span_hz=span_hz)
        share = None if pilot is None else secondary_share(batch, pilot, doppler_hz)
        satellites.append(
            E6Satellite(
                svid=svid,
                cn0_dbhz=cn0_on_the_peak_dbhz(batch, E6B, found),
                e6c_open=pilot is not None,
                secondary_fits=None if share is None else share[0] > OPEN_SHARE,
            )
        )
    return satellites, acquired


def _offset(batch: SampleBatch, e1: Sequence[E1Satellite], acquired: dict[int, E6Acquisition]) -> Iterator[Finding]:
    """Yield a finding if E6 is over `BAND_OFFSET_S` plus one sample away from the delay that E1 predicts."""
    period_s = E6B.period_s
    apart = [
        (acquired[one.svid].code_start_s - expected_start_s(one.snapshot, batch) + period_s / 2) % period_s
        - period_s / 2
        for one in e1
        if one.snapshot is not None and one.svid in acquired
    ]
    if apart and abs(median(apart)) > BAND_OFFSET_S + 1 / batch.sample_rate_hz:
        by_s = median(apart)
        yield fault(
            FindingKind.BAND_OFFSET, Band.E6,
            f"E6 is {by_s * 1e6:+.1f} µs ({by_s * batch.sample_rate_hz:+.0f} samples, modulo 1 ms) away from the "
            "delay that E1 predicts",
            "check first_sample and the start of both bands; samples may be missing at the beginning of one of them",
        )  # fmt: skip


def _encryption(satellites: list[E6Satellite]) -> Iterator[Finding]:
    opened = [one for one in satellites if one.e6c_open and one.secondary_fits is not False]
    if opened:
        fits = all(one.secondary_fits for one in opened)
        signs = "with the signs of its secondary code" if fits else "the samples are too short for its secondary code"
        yield remark(
            FindingKind.E6C_OPEN, Band.E6,
            f"E6-C is not encrypted: {satellite_names(one.svid for one in opened)} repeat its open primary code every "
            f"millisecond, {signs}",
            "RECS made from this recording test the processing only; they prove nothing against a signal from another "
            "place, because everybody knows the chips",
        )  # fmt: skip
    closed = [one for one in satellites if not one.e6c_open]
    if closed:
        yield remark(
            FindingKind.E6C_ENCRYPTED, Band.E6,
            f"E6-C is encrypted or absent: {satellite_names(one.svid for one in closed)} show E6-B and no open E6-C",
            "RECS of the service are needed for a verdict",
        )  # fmt: skip


def _reversed(file: BandFile, sky: list[tuple[int, float]], span_hz: float) -> Reading | None:
    """Return the reading with the reversed spectrum if more satellites are found with this reading than with `file`."""
    telling = sorted(sky, key=lambda one: -abs(one[1]))[:_TRIED]
    if not telling or abs(telling[0][1]) < 3 * span_hz:
        return None
    for reading in reversed_readings(file):
        if len(_shown(reading.file, telling, span_hz)) > len(_shown(file, telling, span_hz)):
            return reading
    return None


def _nothing(sky: list[tuple[int, float]]) -> Finding:
    names = satellite_names(svid for svid, _ in sky[:_TRIED])
    seen = f"{names}, the strongest on E1, are not found" if sky else "E1 has no satellite"
    return fault(
        FindingKind.NO_SIGNAL,
        Band.E6,
        f"E6: no E6-B signal was found, as described or with one value changed: {seen}",
        "check centre frequency, antenna and filters of the E6 front end",
    )
