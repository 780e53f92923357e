"""OSNMA events that a scenario names: the pages of `vestige simulate`, and what `vestige osnma verify` says of them.

The start is not near a full hour, so nothing but the events changes a root key. The remainders of the SVIDs modulo 8
bring a DSM of 8 blocks within four subframes.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from vestige.cli.services.osnma import verify_command
from vestige.crypto.keys.key_file import load_key_file
from vestige.crypto.keys.public_key_file import load_public_keys
from vestige.crypto.osnma.messages.dsm import NmaHeader
from vestige.crypto.osnma.operator.events import OsnmaEventKind
from vestige.errors import VestigeError
from vestige.recording.navigation.navigation_pages import read_pages
from vestige.recording.observations.sbf import SbfCounts
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import write_companions

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
N = 15  # subframes
FIRST, SECOND, LAST, DSM = 4, 8, 12, 4  # subframes: steps of the events, and how many a DSM needs at most
TIMES = f"start_s={30 * FIRST}"
SETTINGS = (f"epochs={30 * N}", 'start="2026-11-22T22:10:00 GST"', "constellation.svids=[6, 7, 8, 12, 13, 14]")
NOMINAL = (2, 1, 1)  # status operational, chain 1, keys nominal
# by kind: keys beside start_s; status, chain and key status before, from FIRST, from SECOND and from LAST on
EVENTS: dict[str, tuple[dict[str, int], tuple[Any, ...]]] = {
    "chain-renewal": ({"in_force_s": SECOND}, (NOMINAL, (2, 1, 2), (2, 2, 1), (2, 2, 1))),
    "chain-revocation": ({"in_force_s": SECOND, "stop_s": LAST}, (NOMINAL, (3, 1, 3), (2, 2, 3), (2, 2, 1))),
    "key-renewal": ({"in_force_s": SECOND, "stop_s": LAST}, (NOMINAL, (2, 1, 4), (2, 1, 4), NOMINAL)),
    "key-revocation": ({"in_force_s": SECOND, "stop_s": LAST}, (NOMINAL, (3, 1, 5), (2, 2, 5), (2, 2, 1))),
    "alert": ({"stop_s": LAST}, (NOMINAL, (3, 1, 7), (3, 1, 7), None)),
    "dont-use": ({"stop_s": SECOND}, (NOMINAL, (3, 1, 1), NOMINAL, NOMINAL)),
    "silence": ({"stop_s": SECOND}, (NOMINAL, None, NOMINAL, NOMINAL)),
}
BEFORE = list(range(FIRST))


def scenario(*settings: str, path: Path = NIGHT) -> CampaignScenario:
    loaded = load_scenario(path, (*SETTINGS, *settings))
    assert isinstance(loaded, CampaignScenario)
    return loaded


def event(kind: str) -> str:
    keys = "".join(f", {key}={30 * subframe}" for key, subframe in EVENTS[kind][0].items())
    return f'osnma.event=[{{kind="{kind}", {TIMES}{keys}}}]'


def verified(folder: Path) -> dict[str, Any]:
    trust = f"--merkle-tree={folder / 'assistance' / 'merkle_tree.xml'}"
    result = CliRunner().invoke(verify_command, [str(folder / "inav_pages.csv"), trust, "--json"])
    assert result.exit_code == 0, result.output
    said: dict[str, Any] = json.loads(result.stdout)
    return said


def test_every_kind_of_the_operator_is_one_of_a_scenario() -> None:
    assert EVENTS.keys() == {kind.value for kind in OsnmaEventKind}


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=() if kind == "chain-revocation" else pytest.mark.slow) for kind in EVENTS]
)
def test_the_pages_of_an_event_have_the_outcome_of_the_icd(kind: str, tmp_path: Path) -> None:
    loaded = scenario(event(kind))
    start = loaded.start_time
    case = AcasTestCase(scenario=loaded, first=0, end=loaded.epochs)
    write_companions(case, tmp_path)

    def subframe_of(time: dict[str, int]) -> int:
        return (time["week"] * 604_800 + time["second"] - start.gst_seconds) // 30

    # What is on air.
    headers: dict[int, set[Any]] = {}
    for page in read_pages(tmp_path / "inav_pages.csv", start=None, counts=SbfCounts()):
        number, place = divmod(round(page.time - start), 30)
        if place == 1:
            header = NmaHeader(page.osnma[0])
            sent = (header.status, header.chain_id, header.key_status) if any(page.osnma) else None
            headers.setdefault(number, set()).add(sent)
    steps = {0: 0, FIRST - 1: 0, FIRST: 1, SECOND - 1: 1, SECOND: 2, LAST - 1: 2, LAST: 3, N - 1: 3}
    assert {number: headers[number] for number in steps} == {
        number: {EVENTS[kind][1][step]} for number, step in steps.items()
    }

    # What a receiver makes of it that knows the Merkle tree.
    said = verified(tmp_path)
    assert said["failures"] == []
    assert {adkd: count["failed"] for adkd, count in said["tags"].items()} == {"0": 0, "4": 0, "12": 0}
    keys: dict[int, list[int]] = {}
    for key in said["keys"]:
        number = subframe_of(key["time"])
        if 0 <= number < N:
            keys.setdefault(key["chain_id"], []).append(number)
    withheld = [number for one in said["withheld"] if (number := subframe_of(one["time"])) < N]
    signers = {root["pkid"] for root in said["roots"]}
    if kind == "chain-renewal":
        assert (keys, withheld) == ({1: list(range(SECOND)), 2: list(range(SECOND, N))}, [])
    elif kind in ("chain-revocation", "key-revocation"):
        assert keys[1] == BEFORE
        assert set(range(SECOND + DSM, N)) <= set(keys[2]) <= set(range(SECOND, N))
        assert set(withheld) == set(range(FIRST, N)) - set(keys[2])
    elif kind == "key-renewal":
        assert (keys, withheld) == ({1: list(range(N))}, [])
    elif kind == "silence":
        assert (keys, withheld) == ({1: [*BEFORE, *range(SECOND, N)]}, [])
    else:  # after "don't use" the receiver waits for a root key of a later hour, after an alert for ever
        assert keys == {1: BEFORE}
        assert set(withheld) >= set(range(FIRST, LAST if kind == "alert" else N))
    assert bool(said["alerts"]) == (kind == "alert")
    assert signers == ({1, 2} if kind.startswith("key-") else {1})

    # What the assistance folder holds: the keys of that receiver, in a silence with those that follow from later ones.
    trusted = load_public_keys(None, tmp_path / "assistance" / "merkle_tree.xml")
    written = {
        round(key.time - start) // 30 for key in load_key_file(tmp_path / "assistance" / "keys.csv", trusted).keys
    }
    expected = range(N) if kind == "silence" else {number for of_chain in keys.values() for number in of_chain}
    assert {number for number in written if number < N} == set(expected)


def test_without_an_event_nothing_is_withheld_and_nothing_changes() -> None:
    plain, named = scenario(), scenario("osnma.event=[]")
    assert plain.simulations[0].osnma == named.simulations[0].osnma
    assert AcasTestCase(scenario=plain, first=0, end=2).osnma_receiver is None


@pytest.mark.parametrize(
    ("events", "said"),
    [
        ('{kind="chain_renewal", start_s=120}', "osnma.event.0.kind: found chain_renewal, expected 'chain-renewal', "),
        ("{start_s=120}", "osnma.event.0.kind: found nothing, expected a value: the key is needed"),
        ('{kind="alert", start_s=450}', "start_s: found 450 s, expected a time before the end of the run, 450 s"),
        ('{kind="alert", start_s=-30}', "osnma.event.0.start_s: found -30, expected at least 0"),
        ('{kind="alert", start_s=100}', "start_s: found 100 s, expected the start of a subframe of 30 s: 90 or 120"),
        ('{kind="alert", start_s=90, stop_s=60}', "stop_s: found 60 s, expected more than start_s, 90 s"),
        ('{kind="alert", start_s=90, in_force_s=120}', "in_force_s: found a time, with alert, expected none"),
        ('{kind="chain-renewal", start_s=90, in_force_s=120, stop_s=150}', "stop_s: found a time, with chain-renewal"),
        (
            '{kind="key-renewal", start_s=90, stop_s=120}',
            "in_force_s: found nothing, expected a time before stop_s, 120",
        ),
        ('{kind="alert", start_s=90, svids=[7]}', "svids: found [7] with alert, expected none: only silence has"),
        (
            '{kind="dont-use", start_s=90, stop_s=150}, {kind="alert", start_s=120}',
            "event.1.start_s: found 120 s, within the dont-use of 90 s, expected 150 s or later",
        ),
        (
            '{kind="chain-renewal", start_s=150, in_force_s=180}, {kind="alert", start_s=90}',
            "event.0.start_s: found 150 s, within the alert of 90 s, expected no event after an event without an end",
        ),
    ],
)
def test_events_that_do_not_fit_are_one_line(events: str, said: str) -> None:
    with pytest.raises(VestigeError) as caught:
        scenario(f"osnma.event=[{events}]")
    assert said in str(caught.value)
    assert str(caught.value).startswith(str(NIGHT))
    assert "\n" not in str(caught.value)


def test_events_belong_to_a_sky() -> None:
    with pytest.raises(VestigeError, match=r"osnma: found no \[constellation\], expected one, which this key needs"):
        load_scenario(NIGHT.with_name("quick.toml"), ('osnma.event=[{kind="silence", start_s=0}]',))


@pytest.mark.slow
def test_run_has_no_key_that_is_withheld() -> None:
    """A RECS whose key comes while the status is "don't use" is NOT_AVAILABLE, and is authentic before and after."""
    from vestige.campaign.execution.direct import direct_results
    from vestige.campaign.scenario_plan import ScenarioPlan
    from vestige.records import Status

    results = direct_results(ScenarioPlan(scenario=scenario(event("chain-revocation"), "recs.every=30")))
    rows = range(0, 30 * N, 30)
    said = [{list(Status)[status] for status in results["status"].values[row]} for row in rows]
    withheld = {Status.NOT_AVAILABLE}
    assert [one == withheld for one in said] == [FIRST <= number + 1 < SECOND for number in range(N)]
