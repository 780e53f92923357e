"""An independent receiver, gnss-sdr, on a whole sky: it decodes E1, finds the receiver by it, and locks E6-B.

The recordings are what `vestige simulate` writes, a band each. A fix is compared with the truth in local axes; bars are
those of a single-frequency receiver at 45 dBHz without smoothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from gnss_sdr_dump import tracked_e6
from gnss_sdr_judge import (
    HEIGHT_M,
    LATITUDE_DEG,
    LONGITUDE_DEG,
    Fixes,
    case_of,
    fixes_by_gnss_sdr,
    needs_gnss_sdr,
    record,
    run_until,
)
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.navigation.inav.almanac_words import AlmanacEntry, AlmanacSet
from vestige.navigation.inav.ephemeris_words import ephemeris_words
from vestige.navigation.inav.reduced_ced import NOMINAL_AXIS_M
from vestige.navigation.inav.timing_words import UtcModel
from vestige.recording.assistance.assistance_files import FileTrust, Settings, contents_of_pages
from vestige.recording.navigation.rinex_navigation import read_rinex_navigation
from vestige.recording.observations.observation_file import ObservationTrack, open_observations
from vestige.recording.recording import open_recording
from vestige.recording.tracked.message_navigation import ephemerides_in
from vestige.recording.tracked.track_recording import TrackedRecording, track_recording
from vestige.records import Band
from vestige.simulated.exported_case import AcasTestCase

pytestmark = needs_gnss_sdr

# benchmarks/sky_gnss_sdr.py runs 150 s at 12.5 MHz
STANDING_S, STANDING_RATE = (0, 85), "receiver.sample_rate_hz=6.2e6"
FEWER = "constellation.svids=[6, 7, 8, 13, 14, 20]"  # for the sake of time
E6_SVIDS, E6_RATE_HZ, PULL_IN_S = (6, 8, 12, 13), 10_300_000.0, 5.0


@dataclass(frozen=True, kw_only=True)
class Standing:
    """One recording of a receiver that stands, and what gnss-sdr and vestige made of it."""

    case: AcasTestCase
    folder: Path  # of what gnss-sdr wrote
    fixes: Fixes
    tracked: TrackedRecording


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Standing:
    """Record eight satellites once, for all tests of a receiver that stands."""
    folder = tmp_path_factory.mktemp("standing")
    case = case_of(*STANDING_S, STANDING_RATE)
    fixes = fixes_by_gnss_sdr(folder, case, 500, least=41)
    tracked = track_recording(open_recording(folder / "e1.sigmf-meta"), workers=2)
    (folder / "e1.sigmf-data").unlink()
    return Standing(case=case, folder=folder / "gnss-sdr", fixes=fixes, tracked=tracked)


@pytest.mark.judged(
    by="gnss-sdr",
    what="samples of a whole sky with its message",
    figure="fix within 60 s, mean horizontal error below 2.0 m",
)
def test_the_fix_of_a_receiver_that_stands(standing: Standing) -> None:
    """Six satellites or more, a first fix within a minute of signal, mean and every epoch near the truth."""
    found = standing.fixes
    error_m = found.east_north_up_m(LATITUDE_DEG, LONGITUDE_DEG, HEIGHT_M)
    mean_m = error_m.mean(axis=0)
    assert found.at_s[0] - standing.case.first < 60
    assert found.at_s.size > 40
    assert np.median(found.used) >= 6
    assert np.hypot(*mean_m[:2]) < 2.0
    assert abs(mean_m[2]) < 4.0
    assert np.linalg.norm(error_m, axis=1).max() < 15.0


@pytest.mark.judged(
    by="gnss-sdr",
    what="UTC model and almanac (words 6 to 10)",
    figure="UTC model as sent, almanac within 1e-9 of each value",
)
def test_utc_model_and_almanac(standing: Standing) -> None:
    """Compare what gnss-sdr decoded of words 6 and 7 to 10, UTC and almanac, with what the satellites sent.

    Three satellites make a set, which takes words 7 to 10 of two subframes. gnss-sdr writes those of a set
    that the samples cut off, too, with values of the set before; they do not count.
    """
    case, folder = standing.case, standing.folder
    assert case.message is not None
    start = case.scenario.start_time
    entries: dict[int, tuple[AlmanacSet, AlmanacEntry]] = {}
    utc: UtcModel | None = None
    for pages in case.message.pages.values():
        words: dict[int, int] = {}
        for page in pages:
            if not start + float(case.first) <= page.time < start + float(case.end):
                continue
            words[page.word >> 122] = page.word
            if page.word >> 122 == 6:
                utc = UtcModel.from_word(page.word, page.time)
            elif page.word >> 122 == 10 and (almanac := AlmanacSet.from_words(words, page.time)) is not None:
                entries |= {one.svid: (almanac, one) for one in almanac.entries}
    assert utc is not None
    model = {one.tag: one.text for one in ElementTree.parse(folder / "gal_utc_model.xml").getroot()[0]}  # noqa: S314
    assert (float(model["A0"] or ""), float(model["A1"] or "")) == (utc.a0_s, utc.a1)
    assert {name: int(model[name] or "") for name in ("Delta_tLS", "tot", "WNot", "WN_LSF", "DN", "Delta_tLSF")} == {
        "Delta_tLS": utc.leap_seconds, "tot": utc.reference.second, "WNot": utc.reference.week % 256,
        "WN_LSF": utc.leap_day.week % 256, "DN": utc.leap_day.second // 86_400 + 1,
        "Delta_tLSF": utc.leap_seconds_after,
    }  # fmt: skip
    found = {
        int(item.findtext("PRN", "")): {one.tag: float(one.text or "") for one in item}
        for item in ElementTree.parse(folder / "gal_almanac.xml").getroot().iter("second")  # noqa: S314
    }
    assert len(entries) >= 3
    assert entries.keys() <= found.keys()
    for svid, (almanac, one) in entries.items():
        value = found[svid]
        assert (value["toa"], value["WNa"], value["IODa"]) == (almanac.t0a.second, almanac.t0a.week % 4, almanac.issue)
        assert (value["E5b_HS"], value["E1B_HS"]) == (one.e5b_health, one.e1b_health)
        assert value["sqrtA"] == pytest.approx(math.sqrt(NOMINAL_AXIS_M) + one.delta_sqrt_a, rel=1e-10)
        same = {
            "ecc": one.eccentricity, "af0": one.af0_s, "af1": one.af1, "M_0": one.m0_rad / math.pi,
            "OMEGA_0": one.omega0_rad / math.pi, "OMEGAdot": one.omega_dot_radps / math.pi,
            "omega": one.omega_rad / math.pi, "delta_i": one.delta_i_rad / math.pi,
        }  # fmt: skip
        assert {name: value[name] for name in same} == pytest.approx(same, rel=1e-9, abs=0)


def test_the_root_key_from_the_signal(standing: Standing, tmp_path: Path) -> None:
    """Follow tracked pages to validated keys with the Merkle tree alone, as `vestige process` does.

    With these satellites the root key takes four subframes. Those that begin after the samples are taken as they were
    sent; they hold blocks 0 to 3 and 7 of the DSM-KROOT, so blocks 4 to 6 are the tracked ones.
    """
    case, tracked = case_of(0, 130), standing.tracked.pages
    assert case.message is not None
    end = case.scenario.start_time + 90.0
    later = [page for pages in case.message.pages.values() for page in pages if page.time >= end]
    case.operator.write_files(tmp_path)
    settings = Settings(trust=FileTrust.load((), tmp_path / "merkle_tree.xml"))
    contents = [
        contents_of_pages(Path("tracked"), sorted(pages, key=lambda page: page.time), settings)
        for pages in (tracked, later, [*tracked, *later])
    ]
    assert [len(one.roots) for one in contents] == [0, 0, 1]
    sent = {key.time: key.data for key in case.operator.validated_keys()}
    found = {key.time: key.data for key in contents[2].keys}
    assert {case.scenario.start_time + 30.0 * number for number in (1, 3)} <= set(found)
    assert all(sent[time] == key for time, key in found.items() if time in sent)


def _largest(folder: Path, pattern: str) -> Path:
    """Return the longest of gnss-sdr's files: it begins another one when an hour of our own clock ends."""
    return max(folder.glob(pattern), key=lambda path: path.stat().st_size)


@pytest.mark.judged(by="gnss-sdr", what="ephemerides that tracking decodes", figure="all 7 or more to the last bit")
def test_ephemerides(standing: Standing) -> None:
    """Compare ephemerides to the last bit of the message.

    gnss-sdr also writes orbits out of word 16, of a satellite E00, and the index of the SISA in place of its value.
    """
    ours, theirs = ephemerides_in(standing.tracked.pages), _largest(standing.folder, "GSDR*.??L")
    lines = theirs.read_text().splitlines()
    begin = next(number for number, line in enumerate(lines) if "END OF HEADER" in line) + 1
    kept = [
        line for first in range(begin, len(lines), 8) if lines[first][:3] != "E00" for line in lines[first : first + 8]
    ]
    theirs.write_text("\n".join(lines[:begin] + kept) + "\n")
    told = {(one.svid, one.iod_nav): one for one in read_rinex_navigation(theirs)}
    assert len(ours) >= 7
    for one in ours:
        other = replace(told[one.svid, one.iod_nav], sisa_m=one.sisa_m)
        assert ephemeris_words(other) == ephemeris_words(one)


@pytest.mark.judged(
    by="gnss-sdr",
    what="observations of tracked samples at 45 dBHz",
    figure="pseudorange within 1.0 m rms, Doppler 0.5 Hz, carrier phase from epoch to epoch 0.01 m",
)
def test_observations_of_tracking(standing: Standing) -> None:
    """Compare pseudorange, Doppler, and the carrier phase from epoch to epoch, less what is common to all satellites.

    Both loops see the same noise, with code loops of 1 Hz. At 12.5 MHz the rms of ours against the truth is 0.21 m, and
    that of gnss-sdr, whose correlators lie farther from the prompt, 0.53 m.
    """
    track, wavelength_m = ObservationTrack(standing.tracked.epochs), SPEED_OF_LIGHT_MPS / E1_CARRIER_HZ
    ranges, dopplers, steps = [], [], []
    before: tuple[list[int], np.ndarray] | None = None
    for epoch in open_observations(_largest(standing.folder, "GSDR*.??O")):
        here = track.at(epoch.time)
        common = [svid for svid in epoch.observations if svid in here]
        if len(common) < 6:
            continue
        pairs = [(epoch.observations[svid], here[svid]) for svid in common]
        for kept, name in ((ranges, "pseudorange_m"), (dopplers, "doppler_hz")):
            difference = np.array([getattr(a, name) - getattr(b, name) for a, b in pairs])
            kept += list(difference - difference.mean())
        phase = np.array([a.carrier_phase_cycles - b.carrier_phase_cycles for a, b in pairs]) * wavelength_m
        if before is not None and before[0] == common:
            step = phase - before[1]
            steps += list(step - step.mean())
        before = common, phase
    assert len(ranges) > 6 * 30
    assert np.sqrt(np.mean(np.square(ranges))) < 1.0
    assert np.sqrt(np.mean(np.square(dopplers))) < 0.5
    assert np.sqrt(np.mean(np.square(steps))) < 0.01


@pytest.mark.judged(by="gnss-sdr", what="samples of a receiver that moves", figure="95 % of the fixes within 10.0 m")
def test_the_fix_of_a_receiver_on_a_circle(tmp_path: Path) -> None:
    """20 m/s round a radius of 400 m: within 10 m in 95 % of the epochs."""
    place = "latitude_deg=48.1, longitude_deg=11.6, height_m=500.0"
    circle = f'trajectory={{kind="circle", {place}, radius_m=400.0, speed_mps=20.0}}'
    case = case_of(0, 56, circle, FEWER, "receiver.sample_rate_hz=5.2e6")
    found = fixes_by_gnss_sdr(tmp_path, case, 300, least=16)
    (tmp_path / "e1.sigmf-data").unlink()
    path = case.satellites[0].simulation.elevation.path.trajectory
    there_m = path.motion(found.at_s).position_m
    error_m = np.linalg.norm(found.position_m - there_m, axis=1)
    assert found.at_s.size >= 16
    assert np.quantile(error_m, 0.95) < 10.0


@pytest.mark.judged(
    by="gnss-sdr",
    what="samples of a sky under a meaconer",
    figure="fix at the meaconer's antenna within 5.0 m horizontally",
)
def test_a_meaconer_moves_the_fix_to_its_antenna(tmp_path: Path) -> None:
    """An antenna 1.8 km away, received 20 dB over the true signals from the start. At 5.2 MHz, for the sake of time."""
    antenna = (48.11, 11.62, 520.0)
    attack = (
        'attack=[{kind="meaconing", start_s=0, power_db=20, delay_s=1e-6, reception_gain_db=30, antenna='
        "{latitude_deg=48.11, longitude_deg=11.62, height_m=520.0}}]"
    )
    case = case_of(0, 48, attack, FEWER, "receiver.sample_rate_hz=5.2e6")
    found = fixes_by_gnss_sdr(tmp_path, case, 300, least=5)
    (tmp_path / "e1.sigmf-data").unlink()
    error_m = found.east_north_up_m(*antenna).mean(axis=0)
    assert np.linalg.norm(found.east_north_up_m(LATITUDE_DEG, LONGITUDE_DEG, HEIGHT_M).mean(axis=0)) > 1500
    assert np.hypot(*error_m[:2]) < 5.0
    assert abs(error_m[2]) < 10.0


@pytest.mark.judged(
    by="gnss-sdr", what="E6-B in the E6 samples of a whole sky", figure="Doppler within 0.5 Hz, C/N0 within 1.0 dB"
)
def test_it_locks_e6_b_of_every_satellite(tmp_path: Path) -> None:
    """Doppler within 0.5 Hz, C/N0 within 1 dB, with the encrypted E6-C and three other satellites beside each."""
    case = case_of(0, 10, f"constellation.svids={list(E6_SVIDS)}", f"receiver.sample_rate_hz={E6_RATE_HZ}")
    assert tuple(one.svid for one in case.satellites) == E6_SVIDS
    record(tmp_path, case, Band.E6)
    folder, first_sample = tmp_path / "gnss-sdr", PULL_IN_S * E6_RATE_HZ

    def tracked() -> dict[int, np.ndarray]:
        return tracked_e6(folder, len(E6_SVIDS), first_sample)

    printed, _ = run_until(folder, "e6", 300, lambda _: set(tracked()) == set(E6_SVIDS), at_most=4)
    assert set(tracked()) == set(E6_SVIDS), printed[-2000:]
    for satellite in case.satellites:
        track = tracked()[satellite.svid]
        truth = satellite.truth_table()
        at_s = satellite.truth.time_s + np.array(truth["received_s"], float)
        true_hz = np.interp(track["sample"] / E6_RATE_HZ, at_s, np.array(truth["doppler_e6_hz"], float))
        assert np.mean(track["doppler_hz"] - true_hz) == pytest.approx(0, abs=0.5)
        assert np.mean(track["cn0_dbhz"]) == pytest.approx(satellite.simulation.cn0_dbhz, abs=1.0)
