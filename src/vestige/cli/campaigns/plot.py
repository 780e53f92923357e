"""`vestige plot`: draw figures of the results of campaigns; the argument KIND chooses the figure."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vestige.cli.options import DETECTOR_NAMES, PATH, FiniteNumber, detector_option, number_option, parts_option
from vestige.cli.terminal import echo, warn
from vestige.errors import InputFileError, VestigeError

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

FORMATS = ("png", "pdf", "svg")


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureKind:
    """Kind of a figure, with the results that the figure needs, and the options that apply to the figure."""

    help: str
    of_sweep: bool = False  # whether the figure shows several campaigns, or a table of counts
    of_attack: bool = False  # whether the figure needs a campaign with an attack
    of_threats: bool = False  # whether the figure shows a threat table from the folder that `vestige threats` writes
    of_sky: bool = False  # whether the figure shows all satellites of a campaign with a constellation
    with_detector: bool = True
    compared: bool = False  # whether the figure is drawn for each detector if there is an attack
    formats: tuple[str, ...] = FORMATS


KINDS = {
    "detecting-correlator": FigureKind(help="magnitude, phase and detection against time", compared=True),
    "waterfall": FigureKind(help="all correlators against time, as a landscape", with_detector=False),
    "waterfall-map": FigureKind(help="all correlators against time, as a map", with_detector=False),
    "magnitude-histogram": FigureKind(help="magnitude of the detecting correlator, split by detected or not"),
    "range-histogram": FigureKind(help="range offset, in log scale"),
    "range-offset": FigureKind(help="range offset against time", compared=True),
    "attack-comparison": FigureKind(
        help="range offset of both detectors, with the true offset of the spoofing signal",
        of_attack=True,
        with_detector=False,
    ),
    "animation": FigureKind(
        help="correlators and detections as an animated GIF", with_detector=False, formats=("gif",)
    ),
    "sky": FigureKind(help="positions of the satellites (needs [constellation])", of_sky=True),
    "position": FigureKind(help="error of the position fixes against time (needs [constellation])", of_sky=True),
    "monitors": FigureKind(
        help="times at which each check was run and failed (needs [constellation] or own checks)", of_sky=True
    ),
    "decision-map": FigureKind(
        help="power and distortion on E1, and their classes (needs [constellation])", of_sky=True
    ),
    "detection-curve": FigureKind(help="probability of detection against C/N0", of_sweep=True),
    "miss-curve": FigureKind(help="probability of a miss against C/N0, in log scale", of_sweep=True),
    "false-alarm-curve": FigureKind(help="probability of a false alarm against C/N0, in log scale", of_sweep=True),
    "threats": FigureKind(help="outcome of each attack at each mitigation level", of_threats=True),
}
_COUNT = {"detection-curve": "detections", "miss-curve": "misses", "false-alarm-curve": "false_alarms"}
_ALL = "all"


_EPILOG = "\b\nKINDs of one campaign:\n" + "\n".join(
    [f"  {name:21} {kind.help}" for name, kind in KINDS.items() if not kind.of_sweep and not kind.of_threats]
    + [f"  {_ALL:21} all but the animation and those that need [constellation], as PNG files in a folder"]
    + ["KINDs of a sweep, of several campaigns that differ in C/N0, or of a CSV table of counts:"]
    + [f"  {name:21} {kind.help}" for name, kind in KINDS.items() if kind.of_sweep]
    + ["KINDs of a threat table:"]
    + [f"  {name:21} {kind.help}" for name, kind in KINDS.items() if kind.of_threats]
)


@click.command(epilog=_EPILOG)
@click.argument("kind", type=click.Choice([*KINDS, _ALL]), metavar="KIND")
@click.argument("results", nargs=-1, required=True, type=PATH)
@click.option("-o", "--output", required=True, type=PATH, help="File (.png, .pdf, .svg, .gif) or folder.")
@detector_option
@click.option("--svid", type=int, help="Satellite to draw. Required if there are several satellites.")
@number_option("--width-cm", (4, 60), default=8.0, help="Width of the figure.")
@click.option("--from", "start_s", type=FiniteNumber(), help="Start of the figure in s after the campaign's start.")
@click.option("--to", "stop_s", type=FiniteNumber(), help="End of the figure in s after the campaign's start.")
@click.option(
    "--flank-from",
    "flank_from_m",
    type=FiniteNumber(),
    help="For range-histogram: fit an exponential law beyond this offset, in m.",
)
@parts_option
def command(
    kind: str,
    results: tuple[Path, ...],
    output: Path,
    detector: str,
    svid: int | None,
    width_cm: float,
    start_s: float | None,
    stop_s: float | None,
    flank_from_m: float | None,
) -> None:
    """Draw a figure of RESULTS, and print the name of each file written.

    RESULTS is the store of `vestige run`, the folder of a sweep or of `vestige threats`, or a CSV table of counts. The
    figures of a sweep also take several stores. A campaign that has not ended is drawn up to its last stored epoch.
    """
    chosen = KINDS.get(kind)
    if chosen is None and output.suffix.lower().lstrip(".") in (*FORMATS, "gif"):
        raise click.BadParameter(f"{output}: {_ALL} writes a folder of figures; give its name", param_hint="-o")
    if chosen is not None and output.suffix.lower().lstrip(".") not in chosen.formats:
        allowed = ", .".join(chosen.formats)
        raise click.BadParameter(f"{output}: the suffix of a figure of this kind is one of .{allowed}", param_hint="-o")
    if chosen is not None and chosen.of_threats:
        _draw_threats(results, output)
        return
    if chosen is None or not chosen.of_sweep:
        if len(results) > 1:
            raise click.UsageError(f"{kind} draws one campaign, found {len(results)}")
        choice = _Choice(detector=detector, svid=svid, flank_from_m=flank_from_m, width_cm=width_cm)
        _draw_campaign(kind, results[0], _open(results[0], start_s, stop_s), output, choice)
        return

    from vestige import plots

    sweep = _read_sweep(results, detector, svid, start_s, stop_s)
    axes = plots.detection_curve(sweep, count=_COUNT[kind])
    with _folder_of(output):
        plots.write(axes, output, width_cm=width_cm)
    echo(str(output))


def _draw_threats(folders: tuple[Path, ...], output: Path) -> None:
    """Draw the map of a threat table into a file, and print the name of the file."""
    from vestige import plots
    from vestige.threats.table import read_threat_dataset

    if len(folders) > 1:
        raise click.UsageError(f"threats draws one table, found {len(folders)}")
    axes = plots.threat_map(read_threat_dataset(folders[0]))
    with _folder_of(output):
        plots.write(axes, output)
    echo(str(output))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Choice:
    """Options of `vestige plot` that choose the content and the size of a figure."""

    detector: str
    svid: int | None
    flank_from_m: float | None
    width_cm: float


def _draw_campaign(kind: str, path: Path, results: xarray.Dataset, output: Path, choice: _Choice) -> None:
    """Draw a figure into a file, or all figures of a campaign into a folder, and print the names of the files."""
    from vestige import plots

    figures = _all_of(plots.is_attacked(results), output, choice) if kind == _ALL else [(kind, output, choice)]
    for name, file, of in figures:
        try:
            with _folder_of(file):
                if name == "animation":
                    plots.write_animation(results, file, svid=of.svid, width_cm=of.width_cm)
                else:
                    plots.write(_axes(name, results, of), file, width_cm=of.width_cm)
        except InputFileError:
            raise
        except VestigeError as error:
            raise VestigeError(f"{path}: {error}") from error
        echo(str(file))


@contextmanager
def _folder_of(file: Path) -> Iterator[None]:
    """Make the missing folders of a file; if writing the file fails, remove the new folders that are empty."""
    made = [folder for folder in file.parents if not folder.exists()]
    file.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        for folder in made:
            with suppress(OSError):
                folder.rmdir()
        raise


def _all_of(attacked: bool, folder: Path, choice: _Choice) -> list[tuple[str, Path, _Choice]]:
    """Return kind, file and options of each figure that the KIND `all` draws.

    Under attack, some kinds have a second figure, for another detector than the chosen detector.
    """
    other = replace(choice, detector=next(name for name in DETECTOR_NAMES if name != choice.detector))
    figures = []
    for name, kind in KINDS.items():
        if (
            kind.of_sweep
            or kind.of_sky
            or kind.of_threats
            or "png" not in kind.formats
            or (kind.of_attack and not attacked)
        ):
            continue
        figures.append((name, folder / f"{name}.png", choice))
        if kind.compared and attacked:
            figures.append((name, folder / f"{name}-{other.detector}.png", other))
    return figures


def _open(path: Path, start_s: float | None, stop_s: float | None) -> xarray.Dataset:
    from vestige import plots
    from vestige.campaign.store.results import open_results

    results = open_results(path, partial=True).dataset
    if "epoch" in results.coords:
        warn(f"{path}: the campaign has not ended; only its first {results.sizes['epoch']} epochs are drawn")
    try:
        return plots.between(results, start_s, stop_s)
    except VestigeError as error:
        raise VestigeError(f"{path}: {error}") from error


def _axes(name: str, results: xarray.Dataset, of: _Choice) -> Axes:
    """Return the axes of the figure of kind `name`."""
    from vestige import plots
    from vestige.campaign.verdicts import range_limit_m

    if KINDS[name].of_sky:
        return _sky_axes(name, results, of.svid)
    choice: dict[str, int | float | str | None] = {"svid": of.svid}
    if KINDS[name].with_detector:
        choice["detector"] = of.detector
    if name in ("range-histogram", "range-offset"):
        with suppress(VestigeError):  # results without the range check have no limit
            choice["limit_m"] = range_limit_m(results)
    if name == "range-histogram" and of.flank_from_m is not None:
        choice["right_flank"] = of.flank_from_m
    return getattr(plots, name.replace("-", "_"))(results, **choice)


def _sky_axes(name: str, results: xarray.Dataset, svid: int | None) -> Axes:
    """Return the axes of the figure of kind `name`: sky, position, monitors or decision map."""
    import numpy as np

    from vestige import plots
    from vestige.campaign.levels import highest_level, level_verdicts

    if name == "sky":
        return plots.sky_plot(results)
    if name == "position":
        return plots.position_error(results)
    if name == "decision-map":
        return _decision_map(results, svid)
    n = results.sizes["epoch"]
    lines = [
        plots.MonitorLine(
            name=check.name,
            run=np.any(check.run.reshape(n, -1), axis=1),
            failed=np.any(check.failed.reshape(n, -1), axis=1),
        )
        for check in level_verdicts(results, (highest_level(results),))[0].checks.values()
    ]
    return plots.monitor_timeline(results["time_s"].values, lines)


def _decision_map(results: xarray.Dataset, svid: int | None) -> Axes:
    """Return the axes of the decision map for the most frequent C/N0, with the measurements at this C/N0 as dots."""
    import numpy as np

    from vestige import plots
    from vestige.acas_processor.levels import LEVELS
    from vestige.campaign.levels import level_verdicts
    from vestige.campaign.outcomes import attacked_epochs

    (of_level,) = level_verdicts(results, (max(LEVELS),))
    monitor = of_level.processor.monitoring.power_distortion
    measured = monitor.measured(of_level.evidence)
    svids = results["svid"].values.tolist()
    if svid is not None and svid not in svids:
        raise VestigeError(f"satellite: found no {svid}, expected one of {', '.join(map(str, svids))}")
    of = np.isin(svids, svids if svid is None else [svid]) & np.isfinite(measured.map_dbhz)
    levels, counts = np.unique(measured.map_dbhz[of], return_counts=True)
    if not levels.size:
        raise VestigeError("results of a sky: found no satellite in view")
    level = float(levels[np.argmax(counts)])
    here = of & (measured.map_dbhz == level)
    whose = "power and distortion" if svid is None else f"E{svid:02d}, power and distortion"
    return plots.decision_map(
        monitor.map_for(level),
        title=f"{whose}, about {level:g} dBHz",
        power_db=measured.rise_db[here],
        distortion=measured.distortion[here],
        attacked=attacked_epochs(results)[here],
    )


def _read_sweep(
    paths: tuple[Path, ...], detector: str, svid: int | None, start_s: float | None, stop_s: float | None
) -> xarray.Dataset:
    from vestige import plots

    if len(paths) == 1 and (table := _table_of(paths[0])) is not None:
        if (svid, start_s, stop_s) != (None, None, None):
            raise click.UsageError(f"{table} is a table of counts: --svid, --from and --to choose nothing in it")
        return plots.read_sweep(table, detector=detector)
    return plots.sweep_of([_open(path, start_s, stop_s) for path in paths], detector=detector, svid=svid)


def _table_of(path: Path) -> Path | None:
    """Return the path of a CSV table of counts; None if `path` is neither a folder of a sweep nor a CSV file."""
    from vestige.campaign.sweep.sweep import SWEEP_TABLE

    if path.is_dir() and (path / SWEEP_TABLE).is_file():
        return path / SWEEP_TABLE
    return path if path.suffix.lower() == ".csv" else None
