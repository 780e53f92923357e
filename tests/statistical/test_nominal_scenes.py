"""False alarms of every check in the five nominal scenes: an hour of a sky each, against its budget.

Two-sided where the budget is exact, one-sided where it is a bound; a hundred tests at 10⁻⁵: all of them together err
once in a thousand seeds. `benchmarks/false_alarms.py` makes the longer table of docs/checks/README.md.
"""

from __future__ import annotations

import pytest

from campaign_checks import chance, checks_of, results_of
from vestige.campaign.levels import failures

NO_RAYS = ("receiver.multipath=none", "receiver.e1_multipath=false", "position.multipath_sigma_m=0.0")
NO_IONOSPHERE = ("receiver.ionosphere=none", "position.ionosphere_sigma_m=0.0")
STRONG_IONOSPHERE = ('receiver.ionosphere.preset="2014"', "position.ionosphere_sigma_m=2.7")
P_FA = 3e-3


@pytest.mark.judged(
    by="theory",
    what="false alarms of each check in five nominal scenes",
    figure="P_fa 0.003, binomial test at 1e-5",
)
@pytest.mark.parametrize(
    ("settings", "exact"),
    [
        ((*NO_RAYS, *NO_IONOSPHERE, "position.floor_sigma_m=0.001"), True),
        (STRONG_IONOSPHERE, False),
        ((*NO_RAYS, *STRONG_IONOSPHERE), False),
        (NO_RAYS, False),
        (NO_IONOSPHERE, False),
    ],
    ids=["clean", "harsh", "iono 2014", "iono 2017", "multipath"],
)
def test_false_alarms_meet_their_budget(settings: tuple[str, ...], exact: bool) -> None:
    """Pseudoranges of the clean scene have the errors that the receiver expects; in the others it expects more."""
    found = checks_of(results_of("epochs=3600", "recs.every=10", "seed=77", *settings), P_FA)
    assert len(found) == 21
    for name, check in found.items():
        failed = failures(check)
        if name == "inertial range rate":  # its satellites share an oscillator, all epochs the sensors' bias
            assert failed.value < 5 * check.p_fa
            continue
        assert failed.trials > 100, name
        likely = chance(check, 2 if name.startswith("clock") else 1)  # neighbouring epochs share a drift
        if name in ("RAIM", "clock consistency"):
            assert check.exact == exact
        assert likely > 1e-5 or (not check.exact and failed.value < check.p_fa), name
