"""Show the progress of long work on stderr: a bar on a terminal, otherwise lines of text.

With `--quiet` no progress is printed. With `-v` the time that each step took is printed.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from vestige.cli.terminal import detail, echo, is_quiet
from vestige.errors import printable

if TYPE_CHECKING:
    from vestige.campaign.run import RunProgress

LINE_EVERY_S = 30.0  # time between two progress lines if stderr is no terminal
REDRAWS_PER_S = 4.0

ProgressReport = Callable[[str, int, int], None]


@contextmanager
def progress() -> Iterator[ProgressReport]:
    """Yield a function `report(step, done, total)` that shows progress, and may be called at any rate."""
    with _step_times() as begin, _shown_progress() as show:

        def report(step: str, done: int, total: int) -> None:
            begin(step)
            show(step, done, total)

        yield report


@contextmanager
def _shown_progress() -> Iterator[ProgressReport]:
    if is_quiet():
        yield lambda _step, _done, _total: None
    elif sys.stderr.isatty():
        yield from _bar()
    else:
        yield from _lines()


@contextmanager
def _step_times() -> Iterator[Callable[[str], None]]:
    """Yield a function `begin(step)` that starts to measure the duration of a step.

    The next step or the exit of the context ends the measurement, and `-v` prints the duration.
    """
    step, begin_s = "", 0.0

    def end() -> None:
        if step:
            detail(f"{step}: took {time.monotonic() - begin_s:.2f} s")

    def begin(name: str) -> None:
        nonlocal step, begin_s
        if name != step:
            end()
            step, begin_s = name, time.monotonic()

    try:
        yield begin
    finally:
        end()


def _lines() -> Iterator[ProgressReport]:
    began: dict[str, tuple[float, int]] = {}  # time and amount of finished work at the first report of each step
    last_s = time.monotonic()

    def report(step: str, done: int, total: int) -> None:
        nonlocal last_s
        now_s = time.monotonic()
        if step not in began:
            began[step] = now_s, done
            echo(step, err=True)
        elif now_s - last_s >= LINE_EVERY_S and done < total:
            begin_s, at_begin = began[step]
            rate_hz = (done - at_begin) / (now_s - begin_s)
            left = f", {_duration((total - done) / rate_hz)} left" if rate_hz > 0 else ""
            echo(f"{step}: {done} of {total}{left}", err=True)
        else:
            return
        last_s = now_s

    yield report


def _bar() -> Iterator[ProgressReport]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    # rich redirects results for a terminal, so that these results appear above the bar. Results for a file must not go
    # to stderr.
    console, above = Console(stderr=True), sys.stdout.isatty()
    with Progress(*columns, console=console, transient=True, redirect_stdout=above) as bar:
        tasks: dict[str, TaskID] = {}

        def report(step: str, done: int, total: int) -> None:
            if step not in tasks:
                tasks[step] = bar.add_task(printable(step), total=total)
            bar.update(tasks[step], completed=done)

        yield report


@contextmanager
def campaign_progress() -> Iterator[Callable[[str, RunProgress], None]]:
    """Yield a function `report(name, progress)` that shows rate and remaining time of a running campaign."""
    with _step_times() as begin, _shown_campaign() as show:

        def report(name: str, now: RunProgress) -> None:
            begin(name)
            show(name, now)

        yield report


@contextmanager
def _shown_campaign() -> Iterator[Callable[[str, RunProgress], None]]:
    if is_quiet():
        yield lambda _name, _now: None
    elif sys.stderr.isatty():
        yield from _campaign_bar()
    else:
        yield from _campaign_lines()


def _campaign_lines() -> Iterator[Callable[[str, RunProgress], None]]:
    last_s = time.monotonic()

    def report(name: str, now: RunProgress) -> None:
        nonlocal last_s
        if time.monotonic() - last_s >= LINE_EVERY_S:
            last_s = time.monotonic()
            echo(f"{name}: {now.epochs_done} of {now.epochs_total} epochs, {_pace(now)}", err=True)

    yield report


def _campaign_bar() -> Iterator[Callable[[str, RunProgress], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    name, pace = TextColumn("{task.description}", markup=False), TextColumn("{task.fields[pace]}")
    columns = (name, BarColumn(), MofNCompleteColumn(), pace)
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, refresh_per_second=REDRAWS_PER_S) as bar:
        task = bar.add_task("", total=None, pace="")

        def report(name: str, now: RunProgress) -> None:
            done, total = now.epochs_done, now.epochs_total
            bar.update(task, description=printable(name), completed=done, total=total, pace=_pace(now))

        yield report


def _pace(now: RunProgress) -> str:
    """Return rate and remaining time of a run as text; the text is "starting" as long as the rate is not known."""
    if now.rate_epochs_per_s != now.rate_epochs_per_s:
        return "starting"
    return f"{now.rate_epochs_per_s:.0f} epochs/s, {_duration(now.remaining_s)} left"


def _duration(time_s: float) -> str:
    minutes, seconds = divmod(round(time_s), 60)
    return f"{minutes} min {seconds} s" if minutes else f"{seconds} s"
