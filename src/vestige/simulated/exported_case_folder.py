"""Write the files of a test case beside its samples: observations, message, assistance, truth and README.txt."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

from vestige.constants import PAGES_A_SUBFRAME
from vestige.crypto.recs.recs_segment import CipherMode
from vestige.recording.assistance.assistance_writer import write_assistance, write_recs
from vestige.recording.navigation.rinex_navigation import write_rinex_navigation
from vestige.recording.observations.csv_observations import write_csv_observations
from vestige.recording.observations.rinex_writer import write_rinex_observations
from vestige.recording.samples.test_vector_csv import write_test_vector_in_parts
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.simulated_recording import SimulatedRecording
from vestige.simulated.sky_in_blocks import SkyInBlocks

_README = """\
ACAS test case, written by vestige. docs/test_cases.md of vestige explains every file.

  recording.sigmf-collection, e1.sigmf-*, e6.sigmf-*   {seconds:.3f} s of I,Q samples at {rate:.10g} Hz
{observed}  assistance/                                          RECS, group delays, OSNMA keys and their trust anchors
  scenario.toml                                        scenario of these files
  truth.csv                                            true values, which a receiver must not use
{place}
{satellites}, epochs {first} to {last}, seed {seed}. Per component: E1 {e1:g} dBHz, E6 {e6}.
Check it: vestige inspect FOLDER; vestige process FOLDER{mode}
"""

_PLACE = "  receiver_truth.csv                                   true position and clock of the receiver\n"
_MESSAGE = """\
  rinex/navigation.rnx                                 ephemerides, as they are broadcast
  inav_pages.csv                                       I/NAV pages of E1-B, a line a satellite, as OSNMA test vectors
"""


def simulated(case: AcasTestCase) -> SimulatedRecording:
    """Return the recording of a test case, which writes all files of the test case."""
    simulation, atmosphere = case.simulation, case.scenario.atmosphere
    return SimulatedRecording(
        sky=SkyInBlocks(case=case),
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
    """Write observations, navigation message, assistance, truth and README.txt of a test case to `folder`."""
    rinex, observed = folder / "rinex", next(case.observations(), None) is not None
    if observed or case.message is not None:
        rinex.mkdir()
    if observed:
        write_csv_observations(folder / "observations.csv", case.observations())
        # The RINEX observations are in a separate folder, because a recording has only one file of observations. The
        # recording names the CSV file, because the RINEX format rounds the values and CSV does not.
        receiver = next(case.receivers(), None)
        place_m = (0.0, 0.0, 0.0) if receiver is None else receiver.first_place_m
        write_rinex_observations(rinex / "observations.rnx", case.observations(), approximate_position_m=place_m)
    report = None if case.osnma_receiver is None else case.osnma_receiver.report()
    for simulation in case.scenario.simulations:
        write_recs(folder / "assistance", case.segments_of(simulation))
    write_assistance(
        folder / "assistance",
        case.assistance_without_recs(),
        roots=case.operator.roots if report is None else report.verified_roots,
        alerts=() if report is None else report.alerts,
    )
    case.operator.write_files(folder / "assistance")
    if case.message is not None:
        issued = [issue.ephemeris for one in case.message.transmissions.values() for issue in one.words.issues]
        ionosphere = case.scenario.atmosphere.models().ionosphere
        write_rinex_navigation(rinex / "navigation.rnx", issued, ionosphere=ionosphere)
        n_pages = dict.fromkeys(case.message.transmissions, PAGES_A_SUBFRAME * case.message.n_subframes)
        write_test_vector_in_parts(folder / "inav_pages.csv", n_pages, case.message.subframes())
    write_tables(folder / "truth.csv", case.truth_tables())
    if case.scenario.constellation is not None:
        write_tables(folder / "receiver_truth.csv", (one.table() for one in case.receivers()))
    (folder / "README.txt").write_text(_readme(case, observed=observed), encoding="ascii", newline="\n")


def write_tables(path: Path, tables: Iterable[dict[str, list[str]]]) -> None:
    """Write the rows of successive tables, which have equal columns, to one CSV file."""
    with path.open("w", encoding="ascii", newline="\n") as stream:
        for number, table in enumerate(tables):
            if number == 0:
                stream.write(",".join(table) + "\n")
            stream.writelines(",".join(row) + "\n" for row in zip(*table.values(), strict=True))


def _readme(case: AcasTestCase, *, observed: bool) -> str:
    simulation = case.simulation
    observations = "  observations.csv, rinex/observations.rnx             E1 observations of every epoch\n"
    return _README.format(
        seconds=len(case.samples) / simulation.front_end.sample_rate_hz,
        rate=simulation.front_end.sample_rate_hz,
        satellites=" ".join(f"E{one.svid:02d}" for one in case.satellites),
        observed=(observations if observed else "") + (_MESSAGE if case.message is not None else ""),
        place="" if case.scenario.constellation is None else _PLACE,
        first=case.first,
        last=case.end - 1,
        seed=simulation.seed,
        e1=simulation.cn0_e1_dbhz,
        mode="" if simulation.cipher_mode is CipherMode.CBC else f" --cipher-mode {simulation.cipher_mode.value}",
        e6="without signal" if simulation.cn0_dbhz == -math.inf else f"{simulation.cn0_dbhz:g} dBHz",
    )
