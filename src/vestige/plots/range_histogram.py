"""Draw the histogram of the range offset in log scale [WFO, Sec. VI-A, fourth figure]."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray
from jaxtyping import Float
from matplotlib.axes import Axes

from vestige.plots.bank_edge import LIMIT_LINE, mark_bank_edge
from vestige.plots.epochs import column, select, title_of
from vestige.plots.figure import BLACK, BLUE, ORANGE, dress, legend, new_axes
from vestige.plots.histogram import bin_edges, log_counts, width_of

BIN_M = 0.5
# Offset in taps at which detections on the early flank cluster. The offset is the second tap before the prediction plus
# half a tap, which is the largest correction of the s-curve. With taps of 15 m the cluster is at −22.5 m ± 4.5 m [WFO,
# VI-A].
CLUSTER_TAPS = -1.5
CLUSTER_REACH_TAPS = 0.3
_LEAST_M = 30.0  # least extent of the axis in m on both sides, so that the position of the cluster is visible


@dataclass(frozen=True, slots=True, kw_only=True)
class RightFlank:
    """Exponential law for the offsets beyond `start_m`: events · e^{−(x − start)/scale} offsets lie beyond x."""

    start_m: float  # offset in m beyond which the law is valid
    scale_m: float  # mean distance in m of the offsets beyond `start_m` from `start_m`
    events: int  # number of offsets beyond `start_m`

    def __post_init__(self) -> None:
        if not (self.scale_m > 0 and self.events > 0):
            raise ValueError(f"{self.events} events with a scale of {self.scale_m} m")

    @classmethod
    def fitted(cls, offsets_m: Float[np.ndarray, " n"], start_m: float) -> RightFlank | None:
        """Return the law with the largest likelihood for the offsets beyond `start_m`; None without such offsets."""
        excess_m = offsets_m[offsets_m > start_m] - start_m
        if not excess_m.size:
            return None
        return cls(start_m=start_m, scale_m=float(np.mean(excess_m, dtype=np.float64)), events=excess_m.size)

    def expected(self, x_m: Float[np.ndarray, " n"], bin_m: float) -> Float[np.ndarray, " n"]:
        """Return the expected count of a narrow bin at each offset x."""
        return self.events * bin_m / self.scale_m * np.exp(-(x_m - self.start_m) / self.scale_m)

    def last_m(self, bin_m: float, count: float = 0.5) -> float:
        """Return the offset in m, beyond `start_m`, at which the expected count of a bin is at most `count`."""
        return self.start_m + self.scale_m * float(np.log(max(self.events * bin_m / self.scale_m / count, 1.1)))


def range_histogram(
    results: xarray.Dataset,
    *,
    detector: str = "early",
    svid: int | None = None,
    bin_m: float = BIN_M,
    mark_cluster: bool = True,
    right_flank: RightFlank | float | None = None,
    limit_m: float | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Return axes with the histogram of the range offset in log scale.

    A dashed line marks the edge of the bank of correlators if offsets come near this edge.

    Parameters
    ----------
    bin_m
        Width of a bin in m. The width is doubled until at most 600 bins are needed. If the width is not doubled, 0 m is
        the middle of a bin.
    mark_cluster
        Whether to mark the cluster of detections on the early flank for a detector's spacing of 1 tap. The cluster is
        at −22.5 m for taps of 15 m. The mark gives the number of epochs within 0.3 taps of the cluster, 4.5 m for taps
        of 15 m.
    right_flank
        Law to draw over the right flank. The law is a straight line in log scale. If the value is a number, a law is
        fitted to the offsets beyond this number in m.
    limit_m
        Largest range offset in m that passes the range check. Dashed lines mark plus and minus this limit.

    Raises
    ------
    VestigeError
        If a variable of the results is missing or invalid, or the results lack the detector or the satellite. If `svid`
        is None for several satellites.
    """
    shown = select(results, detector=detector, svid=svid)
    offset_m = column(shown, "range_offset_m")
    offset_m = offset_m[np.isfinite(offset_m)]
    edges_m = bin_edges(np.append(offset_m, [-_LEAST_M, _LEAST_M]), border=-bin_m / 2, width=bin_m)
    bin_m = width_of(edges_m)
    if isinstance(right_flank, (int, float)):
        right_flank = RightFlank.fitted(offset_m, right_flank)
    ax = new_axes() if ax is None else ax
    counts = np.histogram(offset_m, edges_m)[0]
    ax.stairs(counts, edges_m, fill=True, color=BLUE, label=f"{offset_m.size} detections")
    if mark_cluster and shown.sizes["tap"] > 1:
        _mark_cluster(ax, offset_m, float(np.diff(column(shown, "tap_offset_m"))[0]))
    if right_flank is not None:
        x_m = np.array([right_flank.start_m, right_flank.last_m(bin_m)])
        name = f"exponential, {right_flank.scale_m:.2f} m"
        ax.plot(x_m, right_flank.expected(x_m, bin_m), color=BLACK, linewidth=1.0, label=name)
    if limit_m is not None:
        ax.axvline(-limit_m, **LIMIT_LINE)
        ax.axvline(limit_m, label=f"range check ±{limit_m:.1f} m", **LIMIT_LINE)
    mark_bank_edge(ax, shown, offset_m, upright=True)
    log_counts(ax, float(counts.max()), rows=len(ax.get_legend_handles_labels()[1]))
    dress(ax, title=title_of("Range offset", shown), x="range offset (m)", y=f"epochs per {bin_m:g} m")
    legend(ax, "upper right")
    return ax


def _mark_cluster(ax: Axes, offset_m: Float[np.ndarray, " n"], tap_m: float) -> None:
    centre_m, reach_m = CLUSTER_TAPS * tap_m, CLUSTER_REACH_TAPS * tap_m
    count = int(np.sum(np.abs(offset_m - centre_m) <= reach_m))
    label = f"early flank, {centre_m:g} m: {count}".replace("-", "−")
    band = (centre_m - reach_m, centre_m + reach_m)
    ax.axvspan(*band, color=ORANGE, alpha=0.3, linewidth=0, zorder=0, label=label)
