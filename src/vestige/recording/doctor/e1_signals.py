"""Find the satellites on E1, and the faults in the description of the samples."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain

from vestige.constants import E1_CODE_PERIOD_S, MAX_SVID
from vestige.errors import satellite_names
from vestige.recording.description import BandFile
from vestige.recording.doctor.code_doppler import E1Satellite, code_runs_backwards
from vestige.recording.doctor.finding import Finding, FindingKind, TimeLimit, fault
from vestige.recording.doctor.reading import (
    Reading,
    better_sibling,
    centre_reading,
    format_readings,
    head,
    layout_readings,
    rate_reading,
    reversed_readings,
    swapped_readings,
)
from vestige.records import Band, SampleBatch
from vestige.sample_processor.acquisition import Acquisition, acquire
from vestige.sample_processor.code_repetition import rates_by_repetition_hz
from vestige.sample_processor.e1_snapshot import E1_WINDOW_S, measure_e1
from vestige.signals.definitions import CARRIER_HZ

SVIDS = range(1, MAX_SVID + 1)
READING_PFA = 1e-4  # probability that noise alone looks like a satellite in a single reading of the samples
WIDE_STEP_HZ = 10_000.0  # step of the Doppler centre if no satellite is found within ±5 kHz
WIDE_HZ = 60_000.0  # largest Doppler centre in a trial
STANDING_HZ = 3_500.0  # largest median Doppler of all satellites if the receiver's clock is good
_STRETCHES = 8  # number of code periods for the list of satellites, which finds signals down to about 33 dBHz
_TRY_STRETCHES = 2  # number of code periods for each trial of a reading, which finds signals down to about 38 dBHz
_STRONGER_DB = 0.5  # smallest gain in C/N0 with which a reading replaces an earlier, simpler reading
_TRY_BINS = 2  # step of the Doppler bins in a trial; every second bin takes half of the time and loses 1 dB on average
_RATES = 8  # largest number of sampling rates to try

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class E1Result:
    """Result of the examination of E1: the file with the description that fits, satellites, and findings."""

    file: BandFile
    satellites: tuple[E1Satellite, ...]  # satellites, the strongest first
    findings: tuple[Finding, ...]


def examine_e1(file: BandFile, other: BandFile | None, try_s: float, progress: Progress) -> E1Result:
    """Return the satellites in the first 100 ms of E1, the description that fits the samples, and the findings.

    Parameters
    ----------
    file
        File of the E1 samples, with the given description.
    other
        File of the E6 samples, which may contain E1 by mistake; None without E6.
    try_s
        Processor time in s for the trials of other descriptions.
    progress
        Function that is called with the name of the step, the number of finished parts and the number of all parts.
    """
    findings: list[Finding] = []
    sibling = better_sibling(file)
    if sibling is not None:
        findings.append(sibling.fault(sibling.says))
        file = sibling.file
    batch = head(file, E1_WINDOW_S)
    if batch is None:
        return E1Result(file=file, satellites=(), findings=tuple(findings))
    found = _acquire(batch, _STRETCHES, progress=lambda done, total: progress("E1 satellites", done, total))
    if found:
        better = _stronger_layout(file, found)
        if better is not None:
            findings.append(better.fault(f"the signals are stronger {better.says} than as described"))
            file = better.file
            batch = head(file, E1_WINDOW_S) or batch
            found = _acquire(batch, _STRETCHES) or found
        findings.extend(_standing_offset(file, found))
    else:
        limit = TimeLimit(try_s)
        hit, trials = _first_that_fits(file, other, limit, progress)
        if hit is None:
            findings.append(_nothing(trials, limit))
            return E1Result(file=file, satellites=(), findings=tuple(findings))
        reading, found = hit
        names = satellite_names(one.svid for one in found)
        findings.append(reading.fault(f"no signal was found as described, but {names} {reading.says}"))
        file = reading.file
        batch = head(file, E1_WINDOW_S) or batch
        found = _acquire(batch, _STRETCHES) or found
    satellites = tuple(_satellite(batch, one) for one in found)
    turned = next(reversed_readings(file), None)
    if turned is not None and code_runs_backwards(file, satellites):
        evidence = "the codes run as if all Dopplers had the other sign, so the spectrum is reversed"
        findings.append(turned.fault(evidence))
        file = turned.file
        batch = head(file, E1_WINDOW_S) or batch
        satellites = tuple(_satellite(batch, replace(one, doppler_hz=-one.doppler_hz)) for one in found)
    ranked = sorted(satellites, key=lambda one: -one.cn0_dbhz)
    return E1Result(file=file, satellites=tuple(ranked), findings=tuple(findings))


def _acquire(
    batch: SampleBatch | None,
    stretches: int,
    svids: Iterable[int] | None = None,
    *,
    middle_hz: float = 0.0,
    bin_step: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[Acquisition, ...]:
    if batch is None:
        return ()
    return acquire(
        batch,
        SVIDS if svids is None else svids,
        overall_pfa=READING_PFA,
        max_stretches=stretches,
        doppler_center_hz=middle_hz,
        bin_step=bin_step,
        progress=progress,
    )


def _strength(found: tuple[Acquisition, ...]) -> float:
    return max((one.cn0_dbhz for one in found), default=-1.0)


def _satellite(batch: SampleBatch, found: Acquisition) -> E1Satellite:
    measured = measure_e1(batch, found)
    doppler_hz, cn0_dbhz = (
        (found.doppler_hz, found.cn0_dbhz) if measured is None else (measured.doppler_hz, measured.cn0_dbhz)
    )
    return E1Satellite(svid=found.svid, doppler_hz=doppler_hz, cn0_dbhz=cn0_dbhz, snapshot=measured)


def _stronger_layout(file: BandFile, found: tuple[Acquisition, ...]) -> Reading | None:
    """Return the reading as real instead of complex samples, or the reverse, if C/N0 rises by more than 1 dB."""
    best = max(found, key=lambda one: one.cn0_dbhz)
    # if I and Q are read as real samples at twice the rate, half of the signal's power is lost
    least = best.cn0_dbhz + 1.0
    stronger = None
    for reading in layout_readings(file):
        strength = _strength(_acquire(head(reading.file, _window_s(_STRETCHES)), _STRETCHES, (best.svid,)))
        if strength > least:
            least, stronger = strength + _STRONGER_DB, reading
    return stronger


def _standing_offset(file: BandFile, found: tuple[Acquisition, ...]) -> Iterator[Finding]:
    """Yield a finding if three or more Dopplers, all of one sign, have a median magnitude above `STANDING_HZ`."""
    dopplers = sorted(one.doppler_hz for one in found)
    middle = dopplers[len(dopplers) // 2]
    if len(dopplers) >= 3 and abs(middle) > STANDING_HZ and dopplers[0] * dopplers[-1] > 0:
        reading = centre_reading(file, round(middle, -2))
        yield reading.fault(f"the signals lie {reading.says}, some beyond ±5 kHz may be missed")


def _window_s(stretches: int) -> float:
    return (stretches + 1) * E1_CODE_PERIOD_S + 1e-3


_Hit = tuple[Reading, tuple[Acquisition, ...]]


def _first_that_fits(
    file: BandFile, other: BandFile | None, limit: TimeLimit, progress: Progress
) -> tuple[_Hit | None, list[str]]:
    """Return the reading with signals, these signals, and the kinds of mistakes of which no reading has signals."""
    tried: list[str] = []
    for name, tells, hits in _groups(file, other):
        strongest: _Hit | None = None
        number = 0
        for number, hit in enumerate(hits):
            if hit is not None and (strongest is None or _strength(hit[1]) > _strength(strongest[1]) + _STRONGER_DB):
                strongest = hit
            progress(f"E1: {name}", number, number + 1)
            if limit.is_over:
                return strongest, tried
        if strongest is not None:
            return strongest, tried
        tried.append(tells())
    return None, tried


def _groups(file: BandFile, other: BandFile | None) -> Iterator[tuple[str, Callable[[], str], Iterator[_Hit | None]]]:
    """Yield the trials of each kind of mistake: name of the kind, a function for the text of the finding, and results.

    Each result is a changed description of the samples with the signals that were found, or None without signals. The
    function for the text returns the right text only after all changed descriptions were tried.
    """

    def named(name: str, hits: Iterator[_Hit | None]) -> tuple[str, Callable[[], str], Iterator[_Hit | None]]:
        return name, lambda: name, hits

    yield named("reversed spectrum", _tried(reversed_readings(file)))
    if other is not None:
        yield named("swapped bands", _tried(swapped_readings(file, other)))
    # All formats are tried, and the strongest result counts. If int16 samples are read as int8, their high bytes also
    # give signals, but weaker signals.
    formats = chain(layout_readings(file), format_readings(file))
    yield named("real or complex and number formats", _tried(formats))
    rates_hz: list[float] = []
    yield (
        "the likeliest sampling rates",
        lambda: f"sampling rates {', '.join(f'{rate / 1e6:g}' for rate in rates_hz) or 'none'} Msps",
        _rates(file, rates_hz),
    )
    yield named(f"centre frequencies to ±{(WIDE_HZ + 5e3) / 1e3:.0f} kHz", _centres(file))


def _tried(readings: Iterable[Reading]) -> Iterator[_Hit | None]:
    for reading in readings:
        found = _acquire(head(reading.file, _window_s(_TRY_STRETCHES)), _TRY_STRETCHES, bin_step=_TRY_BINS)
        yield (reading, found) if found else None


def _rates(file: BandFile, rates_hz: list[float]) -> Iterator[_Hit | None]:
    """Yield the signals at the sampling rates that the repetition of the codes suggests, until a rate fits.

    The likeliest rate is tried first, and at most `_RATES` rates are tried. None is yielded for a rate without signals.
    Each rate that is tried is appended to `rates_hz`.
    """
    batch = head(file, E1_WINDOW_S)
    if batch is None:
        return
    carrier = (CARRIER_HZ[Band.E1] - file.center_frequency_hz) / file.sample_rate_hz
    for rate_hz in rates_by_repetition_hz(batch.samples, E1_CODE_PERIOD_S, carrier=carrier)[:_RATES]:
        if rate_hz == file.sample_rate_hz:
            continue
        rates_hz.append(rate_hz)
        reading = rate_reading(file, rate_hz)
        found = _acquire(head(reading.file, _window_s(_TRY_STRETCHES)), _TRY_STRETCHES, bin_step=_TRY_BINS)
        if found:
            yield reading, found
            return
        yield None


def _centres(file: BandFile) -> Iterator[_Hit | None]:
    """Yield the signals around each centre frequency, until a centre frequency fits.

    None is yielded for a centre frequency without signals.
    """
    batch = head(file, _window_s(_TRY_STRETCHES))
    for number in range(2 * int(WIDE_HZ / WIDE_STEP_HZ)):
        middle_hz = WIDE_STEP_HZ * (number // 2 + 1) * (-1) ** number
        found = _acquire(batch, _TRY_STRETCHES, middle_hz=middle_hz, bin_step=_TRY_BINS)
        if found:
            dopplers = sorted(one.doppler_hz for one in found)
            yield (centre_reading(file, round(dopplers[len(dopplers) // 2], -2)), found)
            return
        yield None


def _nothing(tried: list[str], limit: TimeLimit) -> Finding:
    ended = f"; the rest was not tried within {limit.seconds:g} s of processor time" if limit.is_over else ""
    return fault(
        FindingKind.NO_SIGNAL,
        Band.E1,
        f"E1: no Galileo signal, neither as described nor with one other value "
        f"({', '.join(tried) or 'nothing'} tried{ended})",
        "check antenna, gain and centre frequency; values may be wrong in several places at once",
    )
