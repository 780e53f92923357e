"""Files of a test case beside its samples: observations, assistance, truth, README.txt."""

from __future__ import annotations

import math
from pathlib import Path

from vestige.crypto.recs.recs_segment import CipherMode
from vestige.recording.assistance.assistance_writer import write_assistance
from vestige.recording.navigation.rinex_navigation import write_rinex_navigation
from vestige.recording.observations.csv_observations import write_csv_observations
from vestige.recording.observations.rinex_writer import write_rinex_observations
from vestige.recording.samples.test_vector_csv import write_test_vector
from vestige.records import Band
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.simulated_recording import SimulatedRecording

_README = """\
ACAS test case, written by vestige. docs/test_cases.md of vestige explains every file.

  recording.sigmf-collection, e1.sigmf-*, e6.sigmf-*   {seconds:.3f} s of I,Q samples at {rate:.10g} Hz
{observed}  assistance/                                          RECS, group delays, OSNMA keys and who signs them
  scenario.toml                                        how it was made
  truth.csv                                            what a receiver must not know
{place}
{satellites}, epochs {first} to {last}, seed {seed}. Per component: E1 {e1:g} dBHz, E6 {e6}.
Check it: vestige inspect FOLDER; vestige process FOLDER{mode}
"""

_PLACE = "  receiver_truth.csv                                   where the receiver truly is, and its clock\n"
_MESSAGE = """\
  rinex/navigation.rnx                                 ephemerides, as they are broadcast
  inav_pages.csv                                       I/NAV pages of E1-B, a line a satellite, as official test vectors
"""


def simulated(case: AcasTestCase) -> SimulatedRecording:
    """Return the recording of a test case, including all its files."""
    simulation, atmosphere = case.simulation, case.scenario.atmosphere
    return SimulatedRecording(
        sky={band: case.sky(band) for band in Band},
        reference=simulation.start,
        front_end=simulation.front_end,
        samples=case.samples,
        seed=simulation.seed,
        time_uncertainty_s=simulation.time_uncertainty_s,
        description="simulated by vestige, encrypted E6-C",
        companions=lambda folder: write_companions(case, folder),
        interference=case.interference,
        own_parts=tuple(case.scenario.own_parts),
        troposphere=atmosphere.troposphere is not None,
        ionosphere=atmosphere.ionosphere is not None,
    )


def write_companions(case: AcasTestCase, folder: Path) -> None:
    """Write observations, assistance, truth and README.txt."""
    epochs, rinex = case.observations(), folder / "rinex"
    if epochs or case.message is not None:
        rinex.mkdir()
    if epochs:
        write_csv_observations(folder / "observations.csv", epochs)
        # in a separate folder, because a recording has only one file of observations; CSV loses no digit
        place_m = (0.0, 0.0, 0.0) if case.receiver is None else case.receiver.first_place_m
        write_rinex_observations(rinex / "observations.rnx", epochs, approximate_position_m=place_m)
    report = None if case.osnma_receiver is None else case.osnma_receiver.report()
    write_assistance(
        folder / "assistance",
        case.assistance(),
        roots=case.operator.roots if report is None else report.verified_roots,
        alerts=() if report is None else report.alerts,
    )
    case.operator.write_files(folder / "assistance")
    if case.message is not None:
        issued = [issue.ephemeris for one in case.message.transmissions.values() for issue in one.words.issues]
        ionosphere = case.scenario.atmosphere.models().ionosphere
        write_rinex_navigation(rinex / "navigation.rnx", issued, ionosphere=ionosphere)
        write_test_vector(folder / "inav_pages.csv", case.message.pages)
    _write_table(folder / "truth.csv", case.truth_table())
    if case.receiver is not None:
        _write_table(folder / "receiver_truth.csv", case.receiver.table())
    (folder / "README.txt").write_text(_readme(case), encoding="ascii", newline="\n")


def _write_table(path: Path, table: dict[str, list[str]]) -> None:
    rows = [",".join(row) for row in zip(*table.values(), strict=True)]
    path.write_text("\n".join([",".join(table), *rows]) + "\n", encoding="ascii", newline="\n")


def _readme(case: AcasTestCase) -> str:
    simulation = case.simulation
    observed = "  observations.csv, rinex/observations.rnx             E1 observations of every epoch\n"
    return _README.format(
        seconds=len(case.samples) / simulation.front_end.sample_rate_hz,
        rate=simulation.front_end.sample_rate_hz,
        satellites=" ".join(f"E{one.svid:02d}" for one in case.satellites),
        observed=(observed if case.observations() else "") + (_MESSAGE if case.message is not None else ""),
        place="" if case.receiver is None else _PLACE,
        first=case.first,
        last=case.end - 1,
        seed=simulation.seed,
        e1=simulation.cn0_e1_dbhz,
        mode="" if simulation.cipher_mode is CipherMode.CBC else f" --cipher-mode {simulation.cipher_mode.value}",
        e6="without signal" if simulation.cn0_dbhz == -math.inf else f"{simulation.cn0_dbhz:g} dBHz",
    )
