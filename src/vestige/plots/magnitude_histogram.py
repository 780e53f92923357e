"""Draw the histogram of the magnitude of the detecting or strongest correlator [WFO, Sec. VI-A, third figure]."""

from __future__ import annotations

import numpy as np
import xarray
from matplotlib.axes import Axes

from vestige.plots.epochs import attribute, column, is_detected, is_missed, magnitudes_sigma, select, title_of
from vestige.plots.figure import BLACK, BLUE, RED, dress, legend, new_axes
from vestige.plots.histogram import bin_edges, log_counts, width_of
from vestige.theory.marcum_q import marcum_q
from vestige.theory.thresholds import correlator_amplitude

BIN_SIGMA = 0.25
_BELOW_LEGEND = 0.84  # share of the height of the axes below the legend


def magnitude_histogram(
    results: xarray.Dataset,
    *,
    detector: str = "early",
    svid: int | None = None,
    bin_sigma: float = BIN_SIGMA,
    log: bool = True,
    ax: Axes | None = None,
) -> Axes:
    """Return axes with the histogram of the detecting correlator's magnitude, split into detected and not detected.

    Detections begin at the threshold, which is a border of two bins. Epochs without a detection have no detecting
    correlator and are counted by their strongest correlator. The line is the Rice distribution of a single correlator
    that is aligned with the signal. The Rice distribution follows from C/N0 and integration time of the results. The
    detecting correlator has another distribution because of misalignment, multipath, and the selection of the
    correlator.

    Parameters
    ----------
    bin_sigma
        Width of a bin in standard deviations of the noise per dimension. The width is doubled until at most 600 bins
        are needed.
    log
        Whether counts are in log scale. In linear scale some tens of misses among 100,000 epochs are invisible.

    Raises
    ------
    VestigeError
        If a variable of the results is missing or invalid, or the results lack the detector or the satellite. If `svid`
        is None for several satellites.
    """
    shown = select(results, detector=detector, svid=svid)
    threshold = attribute(shown, "threshold_sigma")
    magnitude = column(shown, "magnitude_sigma")
    magnitude = magnitude[is_detected(shown) & np.isfinite(magnitude)]
    strongest = magnitudes_sigma(shown.isel(epoch=np.flatnonzero(is_missed(shown)))).max(axis=1, initial=0.0)
    edges = bin_edges(np.concatenate([magnitude, strongest]), border=threshold or 0.0, width=bin_sigma)
    edges = edges[edges >= 0]

    ax = new_axes() if ax is None else ax
    hits, misses = (np.histogram(values, edges)[0] for values in (magnitude, strongest))
    ax.stairs(hits, edges, fill=True, color=BLUE, label=f"detected: {magnitude.size}")
    ax.stairs(
        misses, edges, fill=True, facecolor=RED, hatch="/////", edgecolor="white", linewidth=0,
        label=f"not detected: {strongest.size}, strongest",
    )  # fmt: skip
    if threshold is not None:
        ax.axvline(
            threshold, ymax=_BELOW_LEGEND, color=BLACK, linewidth=0.7, linestyle="--",
            label=f"threshold {threshold:.2f} σ",
        )  # fmt: skip
    cn0_dbhz, integration_s = attribute(shown, "cn0_dbhz"), attribute(shown, "integration_s")
    if cn0_dbhz is not None and integration_s is not None:
        signal = float(correlator_amplitude(cn0_dbhz, integration_s))
        expected = -np.diff(marcum_q(np.full(edges.shape, signal), edges)) * (magnitude.size + strongest.size)
        ax.plot((edges[:-1] + edges[1:]) / 2, expected, color=BLACK, linewidth=0.8, label=f"Rice, A = {signal:.2f} σ")
    if log:
        log_counts(ax, float(max(hits.max(), misses.max())))
    dress(ax, title=title_of("Magnitude", shown), x="magnitude (σ)", y=f"epochs per {width_of(edges):g} σ")
    legend(ax, "upper center", columns=2)
    return ax
