from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vestige.recording.observations.observation_epoch import read_epochs
from vestige.recording.observations.rinex_observations import RinexParser
from vestige.recording.observations.rinex_writer import write_rinex_observations
from vestige.records import E1Observation
from vestige.records.observation_epoch import ObservationEpoch
from vestige.time import GalileoTime


def _read(path: Path) -> Iterator[ObservationEpoch]:
    return read_epochs(path, RinexParser(path))


def thousandths(limit: int) -> st.SearchStrategy[float]:
    """Values that RINEX holds exactly, but for zero, which means that nothing was measured."""
    return st.integers(-limit, limit).filter(bool).map(lambda n: n / 1000)


def maybe(values: st.SearchStrategy[float]) -> st.SearchStrategy[float]:
    return st.one_of(st.just(math.nan), values)


observations = st.builds(
    E1Observation,
    svid=st.integers(1, 36),
    pseudorange_m=thousandths(40_000_000_000),
    carrier_phase_cycles=maybe(thousandths(900_000_000_000)),
    doppler_hz=maybe(thousandths(10_000_000)),
    doppler_rate_hz_per_s=st.just(math.nan),
    cn0_dbhz=maybe(st.integers(1, 70_000).map(lambda n: n / 1000)),
)


@st.composite
def epochs(draw: st.DrawFn) -> list[ObservationEpoch]:
    ticks = draw(st.lists(st.integers(0, 10**12), min_size=1, max_size=4, unique=True))
    result = []
    for tick in sorted(ticks):
        second, rest = divmod(tick, 10_000_000)
        seen = {o.svid: o for o in draw(st.lists(observations, max_size=4))}
        slipped = frozenset(draw(st.sets(st.sampled_from(sorted(seen))))) if seen else frozenset()
        time = GalileoTime.normalized(1161, second, rest / 10_000_000)
        result.append(ObservationEpoch(time=time, observations=seen, slipped=slipped))
    return result


@pytest.mark.parametrize(("version", "signal"), [("3.05", "1C"), ("4.00", "1B")])  # the reader takes both
@given(original=epochs())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
def test_what_is_written_is_read(tmp_path: Path, version: str, signal: str, original: list[ObservationEpoch]) -> None:
    path = tmp_path / "observations.rnx"
    write_rinex_observations(path, original)
    header, *body = path.read_text(encoding="ascii").partition("END OF HEADER")
    path.write_text("".join([header.replace("3.05", version, 1).replace("1C", signal), *body]), encoding="ascii")
    again = list(_read(path))
    for before, after in zip(original, again, strict=True):
        assert before.time == after.time
        assert before.slipped == after.slipped
        assert {s: repr(o) for s, o in before.observations.items()} == {
            s: repr(o) for s, o in after.observations.items()
        }


def test_columns_are_those_of_the_standard(tmp_path: Path) -> None:
    observation = E1Observation(
        svid=3, pseudorange_m=24563187.25, carrier_phase_cycles=129081234.0625, doppler_hz=-993.0,
        doppler_rate_hz_per_s=1.0, cn0_dbhz=45.1,
    )  # fmt: skip
    epoch = ObservationEpoch(
        time=GalileoTime(1161, 348018, 0.9999999), observations={3: observation}, slipped=frozenset({3})
    )
    path = tmp_path / "o.rnx"
    write_rinex_observations(path, [epoch], approximate_position_m=(4e6, -1e5, 3e6))
    lines = path.read_text().splitlines()
    labels = [line[60:] for line in lines[: lines.index(" " * 60 + "END OF HEADER")]]
    assert {  # mandatory records of RINEX 3.05, Table A2
        "RINEX VERSION / TYPE", "PGM / RUN BY / DATE", "MARKER NAME", "OBSERVER / AGENCY", "REC # / TYPE / VERS",
        "ANT # / TYPE", "APPROX POSITION XYZ", "ANTENNA: DELTA H/E/N", "SYS / # / OBS TYPES", "TIME OF FIRST OBS",
        "SYS / PHASE SHIFT",
    } <= set(labels)  # fmt: skip
    assert all(len(line) <= 80 for line in lines)
    assert lines[0] == "     3.05           OBSERVATION DATA    E: Galileo          RINEX VERSION / TYPE"
    assert lines[1] == "vestige                                                     PGM / RUN BY / DATE"
    assert "  4000000.0000  -100000.0000  3000000.0000                  APPROX POSITION XYZ" in lines
    assert "E    4 C1C L1C D1C S1C                                      SYS / # / OBS TYPES" in lines
    assert "  2021    11    25     0    40   18.9999999     GAL         TIME OF FIRST OBS" in lines
    assert lines[-2] == "> 2021 11 25 00 40 18.9999999  0  1"
    assert lines[-1] == "E03  24563187.250   129081234.0621       -993.000          45.100"


def test_an_epoch_that_is_written_as_the_next_second(tmp_path: Path) -> None:
    epoch = ObservationEpoch(time=GalileoTime(1161, 604_799, 1 - 2**-53), observations={})
    write_rinex_observations(tmp_path / "o.rnx", [epoch])
    assert [e.time for e in _read(tmp_path / "o.rnx")] == [GalileoTime(1162, 0)]


def test_epochs_of_a_week_may_be_counted_in_float64(tmp_path: Path) -> None:
    """Hours after the start, the fraction of a second has the rounding of all seconds before."""
    start, path = GalileoTime(1421, 0), tmp_path / "week.rnx"
    tags_s = [0.086 + hour * 3600.0 for hour in range(0, 168, 7)]
    assert max(abs((start + tag_s).fraction - 0.086) for tag_s in tags_s) > 1e-11
    write_rinex_observations(path, [ObservationEpoch(time=start + tag_s, observations={}) for tag_s in tags_s])
    assert [epoch.time.fraction for epoch in _read(path)] == [0.086] * len(tags_s)


def test_what_rinex_cannot_hold_is_our_mistake(tmp_path: Path) -> None:
    path = tmp_path / "o.rnx"
    with pytest.raises(ValueError, match="time of its first observation"):
        write_rinex_observations(path, [])
    with pytest.raises(ValueError, match="multiple of"):
        write_rinex_observations(path, [ObservationEpoch(time=GalileoTime(1, 1, 1.5e-7), observations={})])
    huge = E1Observation(
        svid=3,
        pseudorange_m=1e10,
        carrier_phase_cycles=math.nan,
        doppler_hz=0.0,
        doppler_rate_hz_per_s=0.0,
        cn0_dbhz=1.0,
    )
    with pytest.raises(ValueError, match="pseudorange_m of E03"):
        write_rinex_observations(path, [ObservationEpoch(time=GalileoTime(1, 1), observations={3: huge})])
