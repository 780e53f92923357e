"""Draw the figure of `vestige search` with `--plot`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vestige.cli.terminal import echo
from vestige.errors import VestigeError

if TYPE_CHECKING:
    from vestige.acas_processor.searches.vestigial import VestigialDecision
    from vestige.records import ChipSequence, SampleBatch
    from vestige.sample_processor.acquisition import Acquisition, CellPowers
    from vestige.theory.search_budget import SearchBudget
    from vestige.time import GalileoTime

FIGURE_SUFFIXES = (".png", ".pdf", ".svg")


@dataclass(slots=True)
class SearchFigure:
    """Collector that draws the magnitudes of a search in E6; without a file the collector does nothing."""

    file: Path | None
    codes: Sequence[ChipSequence]
    title: str
    _points: list[tuple[GalileoTime, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.file is not None:
            _check(self.file, {code.svid for code in self.codes})
            if len(self.codes) > 1:
                raise VestigeError(f"--plot draws the search for one RECS, found {len(self.codes)}")

    def add(self, at: GalileoTime, magnitude: float) -> None:
        """Store the magnitude at the arrival time `at`, or the largest magnitude of a block that begins at `at`."""
        if self.file is not None:
            self._points.append((at, magnitude))

    def write(self, decisions: Sequence[tuple[VestigialDecision, SearchBudget]]) -> None:
        """Draw the magnitudes of the search and the peaks of the first decision into the file."""
        if self.file is None or not decisions:
            return
        from vestige import plots

        (decision, budget), sent = decisions[0], self.codes[0].transmit_time
        trace = plots.SearchTrace(
            time_s=[at - sent for at, _ in self._points],
            magnitude=[magnitude for _, magnitude in self._points],
            threshold=budget.threshold,
            peaks=[(peak.start_time - sent, peak.magnitude) for peak in decision.peaks],
        )
        plots.write(plots.vestigial_search(trace, title=f"{self.title}, E{decision.svid:02d}"), self.file)
        echo(str(self.file), err=True)


def draw_e1(
    file: Path,
    batch: SampleBatch,
    svids: Iterable[int],
    found: Sequence[Acquisition],
    *,
    overall_pfa: float,
    periods: int,
    doppler_span_hz: float,
) -> None:
    """Draw the largest power of all Doppler bins at each code phase of a code period, for one satellite."""
    import numpy as np

    from vestige import plots
    from vestige.sample_processor.acquisition import search_cells
    from vestige.signals.definitions import E1B, E1C

    own = set(svids)
    _check(file, own)
    profiles: list[tuple[CellPowers, np.ndarray]] = []

    def keep(powers: CellPowers) -> tuple[Acquisition, ...]:
        profiles.append((powers, np.max(powers.powers, axis=0)))
        return ()

    search_cells(
        batch,
        tuple(own),
        keep,
        signals=(E1C, E1B),
        overall_pfa=overall_pfa,
        max_stretches=periods,
        doppler_span_hz=doppler_span_hz,
    )
    ((powers, profile),) = profiles
    ax = plots.code_phases(
        np.arange(profile.size) / powers.rate_hz * 1e3,
        profile / powers.threshold,
        [(one.code_start_s * 1e3, one.statistic / one.threshold) for one in found],
        title=f"E1, E{powers.svid:02d}",
    )
    plots.write(ax, file)
    echo(str(file), err=True)


def _check(file: Path, svids: set[int]) -> None:
    if file.suffix.lower() not in FIGURE_SUFFIXES:
        raise click.BadParameter(
            f"{file}: the suffix of a figure is one of {', '.join(FIGURE_SUFFIXES)}", param_hint="--plot"
        )
    if len(svids) != 1:
        raise click.UsageError("--plot draws one satellite: choose it with --svids")
