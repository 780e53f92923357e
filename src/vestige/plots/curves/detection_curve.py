"""Draw detection, miss and false-alarm rates against C/N0, with the theoretical curve [WFO, Sec. III]."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import xarray
from jaxtyping import Float, Int
from matplotlib.axes import Axes

from vestige.campaign.statistics import CONFIDENCE, binomial_intervals
from vestige.errors import VestigeError
from vestige.plots.curves.sweep_curves import CN0, COLOURS, abscissa, curves
from vestige.plots.epochs import attribute
from vestige.plots.figure import BLACK, PD_TEXT, PFA_TEXT, dress, legend, new_axes, typeset
from vestige.theory.thresholds import miss_probability, probability_of_detection

_CURVE_POINTS = 300
_MARGIN_DB = 1.0  # extension of the theoretical curve beyond the outermost points


class _Kind(NamedTuple):
    """Kind of event: names of its counts, and its probability as a function of C/N0, integration time and P_fa."""

    title: str
    label: str
    trials: str
    counted: str
    theory: Callable[[Float[np.ndarray, " n"], float, float], Float[np.ndarray, " n"]]
    theory_label: str
    log: bool = True
    of_others: bool = False  # whether the events are the trials that `counted` does not count


def _as_asked(cn0_dbhz: Float[np.ndarray, " n"], _: float, p_fa: float) -> Float[np.ndarray, " n"]:
    return np.full(cn0_dbhz.shape, p_fa)


_DETECTED, _ALIGNED = ("trials", "detections"), "Marcum Q, aligned"
COUNTED_EVENTS = {
    "detections": _Kind("Detection", PD_TEXT, *_DETECTED, probability_of_detection, _ALIGNED, log=False),
    "misses": _Kind(
        "Missed detection", f"1 − {PD_TEXT}", *_DETECTED, miss_probability, f"1 − {_ALIGNED}", of_others=True
    ),
    "false_alarms": _Kind(
        "False alarm", PFA_TEXT, "false_alarm_trials", "false_alarms", _as_asked, f"required {PFA_TEXT}"
    ),
}


def detection_curve(sweep: xarray.Dataset, *, count: str = "detections", ax: Axes | None = None) -> Axes:
    """Draw the relative frequency of an event against C/N0 with confidence intervals and theory, and return the axes.

    The confidence interval is the Clopper–Pearson interval, which contains the true probability in at least 95 % of all
    sweeps. In log scale an arrow that points down from the upper end of the interval stands for a count of 0. Theory
    applies to a single correlator that is aligned with the signal. A sweep that does not vary C/N0 is drawn against the
    first varied key of the scenario whose values are numbers. A sweep of several keys has a curve for each combination
    of values of the keys that are not the abscissa.

    Parameters
    ----------
    sweep
        Sweep with the variables `cn0_dbhz`, `trials` and `detections` along one dimension (see `sweep.sweep_of`). For
        false alarms the counts are `false_alarm_trials` and `false_alarms`, from decisions on noise alone. Theory needs
        the attributes `integration_s` and `p_fa`.
    count
        Event to draw: `detections`, `misses` or `false_alarms`.

    Raises
    ------
    VestigeError
        If the sweep lacks a C/N0 or a count, or has an impossible count, such as more events than trials. If the sweep
        has more curves than colours.
    """
    kind = COUNTED_EVENTS[count]
    cn0_dbhz, trials, events = _counts(sweep, kind)
    label, x = abscissa(sweep)
    shown = curves(sweep)
    low, high = binomial_intervals(events, trials)
    ax = new_axes() if ax is None else ax

    integration_s, p_fa = attribute(sweep, "integration_s"), attribute(sweep, "p_fa")
    floor = min(0.3 / trials.max(), 0.1)  # lower end of the log scale
    margin = _MARGIN_DB if label == CN0 or np.ptp(x) == 0 else 0.05 * float(np.ptp(x))
    ends = x.min() - margin, x.max() + margin
    if integration_s is not None and p_fa is not None:
        along = np.linspace(*ends, _CURVE_POINTS)
        strength_dbhz = along if label == CN0 else np.full(_CURVE_POINTS, cn0_dbhz[0])
        ax.plot(
            along, kind.theory(strength_dbhz, integration_s, p_fa), color=BLACK, linewidth=0.8, label=kind.theory_label
        )
        floor = min(floor, 0.3 * p_fa) if count == "false_alarms" else floor
    start = np.maximum(low, floor) if kind.log else low
    seen = (events > 0) | (not kind.log)
    for curve, colour in zip(shown, COLOURS, strict=False):
        interval = "" if curve.label else f"{CONFIDENCE * 100:g} % interval"
        ax.vlines(x[curve.rows], start[curve.rows], high[curve.rows], color=colour, linewidth=1.0, label=interval)
        some, none = curve.rows[seen[curve.rows]], curve.rows[~seen[curve.rows]]
        dots: dict[str, Any] = {"color": colour, "markeredgewidth": 0}
        ax.plot(x[some], events[some] / trials[some], "o", markersize=3, label=curve.label or "counted", **dots)
        if none.size:
            ax.plot(x[none], high[none], "v", markersize=3.5, label="" if curve.label else "none counted", **dots)
    if kind.log:
        ax.set_ylim(floor, min(2.0, 30 * high.max()))
        ax.set_yscale("log")
    else:
        ax.set_ylim(-0.03, 1.03)
    ax.set_xlim(*ends)
    dress(ax, title=_title(kind, integration_s, p_fa), x=label, y=f"probability ({kind.label})")
    legend(ax)
    return ax


def _counts(
    sweep: xarray.Dataset, kind: _Kind
) -> tuple[Float[np.ndarray, " n"], Int[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """Return the C/N0 in dBHz, the number of trials and the number of events of each row of a sweep."""
    for name in ("cn0_dbhz", kind.trials, kind.counted):
        if name not in sweep.variables or sweep[name].dtype.kind not in "fiu":
            raise VestigeError(f"sweep: found no {name}, expected numbers of it")
    counted = sweep[kind.counted] if not kind.of_others else sweep[kind.trials] - sweep[kind.counted]
    columns = (sweep["cn0_dbhz"], sweep[kind.trials], counted)
    cn0_dbhz, trials, events = (np.atleast_1d(column.values) for column in columns)
    if not (cn0_dbhz.ndim == 1 and cn0_dbhz.size and cn0_dbhz.shape == trials.shape == events.shape):
        raise VestigeError(
            f"sweep: found shapes {cn0_dbhz.shape}, {trials.shape}, {events.shape}, expected one row a C/N0"
        )
    bad = ~(np.isfinite(cn0_dbhz) & (trials >= 1) & (events >= 0) & (events <= trials))
    if bad.any():
        row = int(np.argmax(bad))
        found = f"{events[row]} of {trials[row]} at {cn0_dbhz[row]} dBHz"
        raise VestigeError(f"sweep: row {row + 1}: found {found}, expected 0 to as many events as trials")
    return cn0_dbhz.astype(np.float64), trials.astype(np.int64), events.astype(np.int64)


def _title(kind: _Kind, integration_s: float | None, p_fa: float | None) -> str:
    parts = [kind.title]
    if integration_s is not None:
        parts.append(f"{integration_s * 1e3:g} ms")
    if p_fa is not None:
        parts.append(f"{PFA_TEXT} {typeset(p_fa)}")
    return ", ".join(parts)
