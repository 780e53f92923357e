"""What the results hold beside the ordinary columns where a level above 1 can be judged: searches, E6 power, E1.

At both fidelities the searches are drawn from the model of their detection (`receiver/search_outcome.py`): on samples
an exhaustive search of 30 s takes minutes. The columns say what a search would find if it were made with that RECS;
when it is made is for the level to say. The power of the E6 band is that of the samples, or drawn where there are none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from vestige.campaign.plan import Column
from vestige.receiver.e1_taps import e6_power_rise_db, power_noise_db
from vestige.receiver.search_outcome import search_outcome
from vestige.receiver.simulation import Simulation
from vestige.receiver.truth import TruthBlock
from vestige.records import Band
from vestige.signals.definitions import E6C

_SATELLITE = ("epoch", "satellite")

# name: dims, dtype, units, meaning
LEVEL_COLUMNS = {
    name: Column(dims=dims, dtype="float32", units=units, long_name=text)
    for name, dims, units, text in (
        ("e6_power_db", ("epoch",), "dB", "power of the E6 band over that without attack; NaN without RECS"),
        ("e1_signals", _SATELLITE, "1", "signals that the search of E1 finds; NaN without RECS"),
        ("handover_signals", _SATELLITE, "1", "signals that the hand-over search counts"),
        ("handover_error_m", _SATELLITE, "m", "error of the range of the earliest signal that it finds in E6"),
        ("exhaustive_signals", _SATELLITE, "1", "signals that an exhaustive search of E6 finds"),
        ("exhaustive_error_m", _SATELLITE, "m", "error of the range of the earliest of them"),
    )
}


def e6_bandwidth_hz(simulation: Simulation) -> float:
    """Return the bandwidth in which the power of E6 is measured: the filter's, or all that the samples have."""
    return simulation.front_end.bandwidth_hz or simulation.front_end.sample_rate_hz


def level_columns(
    simulations: Sequence[Simulation],
    first: int,
    truth: Sequence[TruthBlock],
    *,
    every: int,
    total_power_db: Float[np.ndarray, " n"],
) -> Mapping[str, np.ndarray]:
    """Return the values of `LEVEL_COLUMNS`, NaN in epochs without RECS and for satellites out of view.

    Parameters
    ----------
    simulations, truth
        Of each satellite.
    first, every
        Number of the first epoch, and every how many epochs there is a RECS.
    total_power_db
        Of the E6 samples over that of noise alone; NaN without samples.
    """
    n = truth[0].time_s.size
    rows = slice(-first % every, n, every)
    columns = {
        name: np.full((n, len(simulations)) if "satellite" in column.dims else n, np.nan)
        for name, column in LEVEL_COLUMNS.items()
    }
    if rows.start >= n:
        return columns
    first_recs, some = (first + rows.start) // every, [one.part(rows) for one in truth]
    columns["e6_power_db"][rows] = _e6_power_db(simulations, first_recs, some, total_power_db[rows])
    for number, (simulation, own) in enumerate(zip(simulations, some, strict=True)):
        found = search_outcome(
            own,
            cn0_e1_dbhz=simulation.cn0_e1_dbhz,
            cn0_e6_dbhz=simulation.cn0_dbhz,
            integration_s=simulation.n_chips / E6C.chip_rate_hz,
            seed=simulation.seed,
            svid=simulation.svid,
            first=first_recs,
        )
        for name in columns.keys() - {"e6_power_db"}:
            columns[name][rows, number] = np.where(own.view.in_view, getattr(found, name), np.nan)
    return columns


def _e6_power_db(
    simulations: Sequence[Simulation],
    first: int,
    truth: Sequence[TruthBlock],
    total_power_db: Float[np.ndarray, " n"],
) -> Float[np.ndarray, " n"]:
    bandwidth_hz = e6_bandwidth_hz(simulations[0])
    cn0_dbhz = np.stack(
        [
            np.where(one.view.in_view, simulation.cn0_dbhz + 20 * np.log10(one.view.amplitude), np.nan)
            for simulation, one in zip(simulations, truth, strict=True)
        ],
        axis=1,
    )
    if np.any(np.isfinite(total_power_db)):
        share = np.where(np.isfinite(cn0_dbhz), 10 ** (cn0_dbhz / 10) / bandwidth_hz, np.nan)
        return total_power_db - 10 * np.log10(1 + np.nanmean(share, axis=1))  # each satellite has samples of its own
    rise_db = e6_power_rise_db(truth, cn0_dbhz, bandwidth_hz=bandwidth_hz)
    return rise_db + power_noise_db(
        simulations[0].seed,
        first,
        rise_db.size,
        band=Band.E6,
        bandwidth_hz=bandwidth_hz,
        averaging_s=simulations[0].n_chips / E6C.chip_rate_hz,
    )
