"""Judge recordings of a whole sky with gnss-sdr, at full size: 12.5 MHz, eight satellites, up to 150 s.

Each case is a recording that `vestige simulate scenarios/night.toml --export gnss-sdr` writes. gnss-sdr runs on it with
the options that the export wrote. The script compares fixes and tracking with `receiver_truth.csv` and `truth.csv` of
the recording. The tests of `tests/agreement/test_sky_gnss_sdr.py` judge smaller recordings with the same helpers.

standing   150 s of a receiver that stands; number of satellites, first fix, mean and largest error
circle     70 s of a receiver on a circle of 400 m at 20 m/s; error that 95 % of the fixes keep
meaconer   96 s under a meaconer 1.9 km away and 20 dB stronger; error relative to the meaconer's antenna
e6         10 s; Doppler and C/N0 of E6-B of every satellite

    python benchmarks/sky_gnss_sdr.py [--case standing] [--seconds 150] [--rate 12.5e6] [--json FILE]

A second of signal takes 50 MB in the folder for temporary files. gnss-sdr now and then does not pull in a channel; then
it is started again on the same samples, and the column "runs" says how often. The exit status is 1 if a limit is not
met, or if gnss-sdr is not installed.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import argparse
import csv
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))  # helpers that the tests and this script share

from gnss_sdr_dump import tracked_e6
from gnss_sdr_judge import Fixes, fix_count, fixes_of, run_until
from vestige.navigation.earth import local_axes_at
from vestige.time import GalileoTime

NIGHT = Path(__file__).resolve().parents[1] / "scenarios" / "night.toml"
START = GalileoTime.parse("2026-11-22T22:00:00 GST")  # of the scenario
PLACE = "latitude_deg=48.1, longitude_deg=11.6, height_m=500.0"
CN0_DBHZ = 45.0  # of E6-B in the scenario
ANTENNA = (48.11, 11.62, 520.0)  # the meaconer's: latitude and longitude in degrees, height in m
_PULL_IN_S = 5.0
_FIRST_FIX_S = 60.0
_TIMEOUT_S = 7200.0
_AT_MOST = 3  # runs of gnss-sdr on the same samples


@dataclass(frozen=True, kw_only=True)
class Figure:
    """One measured value and its limit, both in `unit`."""

    what: str
    measured: float
    bar: float
    unit: str
    at_least: bool = False  # whether the bar is a lower limit

    @property
    def met(self) -> bool:
        """Whether the limit is met; NaN, for what could not be measured, is not."""
        return self.measured >= self.bar if self.at_least else self.measured <= self.bar


@dataclass(frozen=True, kw_only=True)
class Case:
    """A recording, and what gnss-sdr must make of it."""

    seconds: int  # at full size
    settings: tuple[str, ...]
    judge: Callable[[Path], tuple[list[Figure], int]]  # returns figures, and the number of runs of gnss-sdr


def columns_of(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a table of the truth."""
    with path.open() as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def elapsed_s(truth: dict[str, np.ndarray]) -> np.ndarray:
    """Return the times of a table of the truth in s after the scenario's start."""
    return np.array(
        [
            GalileoTime(week=int(week), second=int(second), fraction=float(second % 1.0)) - START
            for week, second in zip(truth["gst_week"], truth["gst_second"], strict=True)
        ]
    )


def error_m(fixes: Fixes, folder: Path) -> np.ndarray:
    """Return the errors of fixes in m, east, north and up of the true position at their times."""
    truth = columns_of(folder / "receiver_truth.csv")
    way = CubicSpline(elapsed_s(truth), np.stack([truth[f"{axis}_m"] for axis in "xyz"], axis=1))
    there_m = way(fixes.at_s)
    return np.array(
        [
            local_axes_at(at_m[np.newaxis])[0] @ (fix_m - at_m)
            for at_m, fix_m in zip(there_m, fixes.position_m, strict=True)
        ]
    )


def common(fixes: Fixes) -> list[Figure]:
    """Return the number of satellites and the time of the first fix, of which every case has a limit."""
    return [
        Figure(what="fewest satellites of a fix", measured=float(fixes.used.min()), bar=6, unit="", at_least=True),
        Figure(what="first fix", measured=float(fixes.at_s[0]), bar=_FIRST_FIX_S, unit="s"),
    ]


def mean(error: np.ndarray) -> list[Figure]:
    """Return the mean error horizontally and vertically."""
    mean_m = error.mean(axis=0)
    return [
        Figure(
            what=f"mean of {len(error)} fixes, horizontally", measured=float(np.hypot(*mean_m[:2])), bar=2, unit="m"
        ),
        Figure(what=f"mean of {len(error)} fixes, vertically", measured=float(abs(mean_m[2])), bar=4, unit="m"),
    ]


def within(error: np.ndarray, share: float, bar: float) -> Figure:
    """Return the error that a share of the fixes keeps."""
    at_m = float(np.quantile(np.linalg.norm(error, axis=1), share))
    what = "largest error" if share == 1.0 else f"error that {100 * share:g} % of {len(error)} fixes keep"
    return Figure(what=what, measured=at_m, bar=bar, unit="m")


def standing(fixes: Fixes, folder: Path) -> list[Figure]:
    """Judge a receiver that stands."""
    error = error_m(fixes, folder)
    return [*mean(error), within(error, 1.0, 15.0)]


def circle(fixes: Fixes, folder: Path) -> list[Figure]:
    """Judge a receiver that moves."""
    return [within(error_m(fixes, folder), 0.95, 10.0)]


def meaconer(fixes: Fixes, _folder: Path) -> list[Figure]:
    """Judge a sky that a meaconer receives and sends again: the fixes are at its antenna, not at the receiver."""
    error = fixes.east_north_up_m(*ANTENNA)
    return [*mean(error), within(error, 1.0, 15.0)]


def judged_fixes(folder: Path, judge: Callable[[Fixes, Path], list[Figure]]) -> tuple[list[Figure], int]:
    """Return what a case makes of the fixes of gnss-sdr on E1, and the number of runs."""

    def enough(printed: str) -> bool:
        return fix_count(printed) > 0 and bool(fixes_of(printed).at_s[0] < _FIRST_FIX_S)

    printed, runs = run_until(folder / "gnss-sdr", "e1", _TIMEOUT_S, enough, at_most=_AT_MOST)
    if not fix_count(printed):
        return [Figure(what="fixes", measured=0, bar=1, unit="", at_least=True)], runs
    fixes = fixes_of(printed)
    return [*common(fixes), *judge(fixes, folder)], runs


def judged_e6(folder: Path) -> tuple[list[Figure], int]:
    """Return errors of E6-B of every satellite after the pull-in, and the number of runs."""
    truth = columns_of(folder / "truth.csv")
    svids = {int(svid) for svid in truth["svid"]}
    rate_hz = float(json.loads((folder / "e6.sigmf-meta").read_text())["global"]["core:sample_rate"])

    def tracked() -> dict[int, np.ndarray]:
        return tracked_e6(folder / "gnss-sdr", len(svids), _PULL_IN_S * rate_hz)

    _, runs = run_until(folder / "gnss-sdr", "e6", _TIMEOUT_S, lambda _: set(tracked()) == svids, at_most=_AT_MOST)
    found, doppler_hz, cn0_db = tracked(), [], []
    for svid, track in found.items():
        one = {name: values[truth["svid"] == svid] for name, values in truth.items()}
        true_hz = np.interp(track["sample"] / rate_hz, elapsed_s(one) + one["received_s"], one["doppler_e6_hz"])
        doppler_hz.append(abs(float(np.mean(track["doppler_hz"] - true_hz))))
        cn0_db.append(abs(float(np.mean(track["cn0_dbhz"])) - CN0_DBHZ))
    worst_hz, worst_db = (max(values, default=np.nan) for values in (doppler_hz, cn0_db))
    return [
        Figure(what="satellites with E6-B locked", measured=len(found), bar=len(svids), unit="", at_least=True),
        Figure(what="largest error of a mean Doppler", measured=worst_hz, bar=0.5, unit="Hz"),
        Figure(what="largest error of a mean C/N0", measured=worst_db, bar=1.0, unit="dB"),
    ], runs


CASES = {
    "standing": Case(seconds=150, settings=(), judge=partial(judged_fixes, judge=standing)),
    "circle": Case(
        seconds=70,
        settings=(f'trajectory={{kind="circle", {PLACE}, radius_m=400.0, speed_mps=20.0}}',),
        judge=partial(judged_fixes, judge=circle),
    ),
    "meaconer": Case(
        seconds=96,
        settings=(
            'attack=[{kind="meaconing", start_s=0, power_db=20, delay_s=1e-6, reception_gain_db=30, antenna='
            f"{{latitude_deg={ANTENNA[0]}, longitude_deg={ANTENNA[1]}, height_m={ANTENNA[2]}}}}}]",
        ),
        judge=partial(judged_fixes, judge=meaconer),
    ),
    "e6": Case(seconds=10, settings=(), judge=judged_e6),
}


def judged(name: str, folder: Path, seconds: int | None, settings: Sequence[str]) -> tuple[list[Figure], int]:
    """Write the recording of a case into a folder, which must not exist, and return what gnss-sdr makes of it."""
    case = CASES[name]
    length = case.seconds if seconds is None else min(seconds, case.seconds)
    words = [sys.executable, "-m", "vestige.cli.main", "simulate", NIGHT, "-o", folder, "--epochs", f"0:{length}"]
    words += ["--export", "gnss-sdr", *(f"--set={one}" for one in (*case.settings, *settings))]
    subprocess.run(list(map(str, words)), check=True, stdout=subprocess.DEVNULL)  # noqa: S603  (ours)
    return case.judge(folder)


def row(case: str, figure: Figure, runs: int) -> str:
    """Return a row of the table."""
    sign, unit = "at least" if figure.at_least else "at most", f" {figure.unit}".rstrip()
    verdict = "" if figure.met else "MISSED"
    return (
        f"| {case} | {figure.what} | {figure.measured:.3g}{unit} | {sign} {figure.bar:g}{unit} | {runs} | {verdict} |"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and print; exit with status 1 if a limit is not met."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", choices=CASES, action="append", help="only this case; may be given several times")
    parser.add_argument("--seconds", type=int, help="at most this length; a fix takes about 40 s")
    parser.add_argument("--rate", type=float, default=12.5e6, help="sampling rate in Hz")
    parser.add_argument("--svids", default="", help="only these satellites, as 6,7,8")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args(arguments)
    if shutil.which("gnss-sdr") is None:
        sys.exit("gnss-sdr is not installed (Debian: apt-get install gnss-sdr)")
    settings = [f"receiver.sample_rate_hz={options.rate}"]
    settings += [f"constellation.svids=[{options.svids}]"] if options.svids else []
    print("| case | what | measured | bar | runs | |\n" + "|---" * 6 + "|", flush=True)
    found = []
    for name in options.case or CASES:
        with tempfile.TemporaryDirectory() as folder:
            figures, runs = judged(name, Path(folder) / name, options.seconds, settings)
        found += [{"case": name, "runs": runs, **asdict(one), "met": bool(one.met)} for one in figures]
        print("\n".join(row(name, one, runs) for one in figures), flush=True)
    if options.json is not None:
        options.json.write_text(json.dumps({"rate_hz": options.rate, "figures": found}, indent=1) + "\n")
    sys.exit(0 if all(one["met"] for one in found) else 1)


if __name__ == "__main__":
    main()
