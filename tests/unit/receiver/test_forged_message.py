"""The message of an attacker's own in a recording: good pages with other words, and OSNMA that does not verify."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.crypto.osnma.osnma_report import OsnmaReport
from vestige.navigation.inav.coding.channel_coding import page_from_symbols
from vestige.navigation.inav.coding.fec2 import parity_words
from vestige.navigation.inav.ephemeris_words import ephemeris_from_words
from vestige.navigation.inav.page import InavPage
from vestige.records import Band
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import simulated

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"
SETTINGS = ("receiver.sample_rate_hz=6.2e6", "constellation.svids=[6, 7, 8, 12]")
N_PAGES = 60  # four subframes, in which these satellites send all blocks of a DSM-KROOT


def case_of(attack: str, *, sky: bool = True) -> AcasTestCase:
    path, settings = (SCENARIOS / "night.toml", SETTINGS) if sky else (SCENARIOS / "vestigial.toml", SETTINGS[:1])
    scenario = load_scenario(path, (*settings, f"attack=[{attack}]"))
    assert isinstance(scenario, CampaignScenario)
    return AcasTestCase(scenario=scenario, first=0, end=2 * N_PAGES if sky else 1)


def asynchronous(*, forged: bool) -> str:
    said = str(forged).lower()
    return f'{{kind="e1-asynchronous", delay_m=3000, power_db=20, forged_nav_data={said}}}'


@cache
def received(*, forged: bool, spoofed: bool = True) -> tuple[tuple[InavPage, ...], OsnmaReport]:
    """Return the pages in the symbols of the spoofing signals, or of the true signals, and the verifier's report."""
    case = case_of(asynchronous(forged=forged))
    pages = []
    for true, spoofing in zip(*[iter(case.sky(Band.E1))] * 2, strict=True):
        symbol = (spoofing if spoofed else true).components[0].symbol
        assert symbol is not None
        start = case.scenario.start_time + 1.0
        values = symbol(250 + np.arange(500 * N_PAGES)).reshape(N_PAGES, 500)
        pages += [
            InavPage(svid=true.svid, time=start + 2.0 * number, data=page_from_symbols(one.astype(np.float64)))
            for number, one in enumerate(values)
        ]
    pages.sort(key=lambda one: one.time)
    return tuple(pages), OsnmaReceiver(case.operator.public_keys, case.operator.merkle_tree).process_all(pages)


@pytest.mark.parametrize(("forged", "spoofed"), [(True, False), (False, False), (False, True)])
def test_the_true_message_and_a_repeated_one_verify(forged: bool, spoofed: bool) -> None:
    pages, report = received(forged=forged, spoofed=spoofed)
    assert all(page.crc_ok for page in pages)
    assert report.failures == ()
    assert {adkd for adkd, count in report.tags.by_adkd.items() if count.ok} >= {0, 4}
    assert all(count.failed == 0 for count in report.tags.by_adkd.values())
    assert {data.svid for data in report.navigation if data.authenticated} == {6, 7, 8, 12}


def test_nothing_of_a_forged_message_is_authenticated() -> None:
    """Every page has a good checksum; the root key is repeated, and its chain refuses the keys in the pages."""
    pages, report = received(forged=True)
    assert all(page.crc_ok for page in pages)
    assert len(report.verified_roots) == 1
    assert report.keys == ()
    assert len([text for text in report.failures if "does not chain" in text]) == 4 * N_PAGES // 15
    assert all(count.ok == 0 for count in report.tags.by_adkd.values())
    assert report.tags.macseq.ok == 0
    assert report.navigation == ()


def test_the_words_of_a_forged_message_are_the_attackers() -> None:
    """One ephemeris with another clock: 2⁻²⁰ s later, in word 4; its parity words are those of the new words."""
    (pages, _), (true, _) = received(forged=True), received(forged=True, spoofed=False)
    for svid in (6, 7, 8, 12):
        words, true_words = ({page.word >> 122: page.word for page in of if page.svid == svid} for of in (pages, true))
        found, expected = (ephemeris_from_words(one, pages[-1].time) for one in (words, true_words))
        assert found is not None
        assert expected is not None
        assert found.af0_s - expected.af0_s == 2.0**-20
        assert replace(found, af0_s=expected.af0_s) == expected
        assert {kind: words[kind] for kind in range(17, 21)} == parity_words(words)


@pytest.mark.parametrize("sky", [True, False])
def test_forged_data_are_in_the_samples(sky: bool) -> None:
    """The samples of E1 differ; on a single line of sight the symbols of both are random, and independent."""
    samples, symbols = [], []
    for forged in (True, False):
        case = case_of(asynchronous(forged=forged), sky=sky)
        samples.append(simulated(case).window(Band.E1, 0.3, 0.35).samples)
        symbols.append(case.sky(Band.E1)[1].components[0].symbol)
    assert np.mean(np.abs(samples[0] - samples[1]) > 0.1) > 0.1
    number = np.arange(20_000 if not sky else 500 * N_PAGES)
    agree = np.mean(symbols[0](number) == symbols[1](number))
    assert 0.45 < agree < (0.9 if sky else 0.55)


@pytest.mark.parametrize("forged", [True, False])
def test_only_the_data_of_e1_are_forged(forged: bool) -> None:
    """A pilot and E6 of the spoofing signal are the true ones in any case, and E1-B if its data are repeated."""
    attack = f'{{kind="lift-off", delay_m=3000, power_db=20, forged_nav_data={str(forged).lower()}}}'
    case = case_of(attack)
    for band in Band:
        for true, spoofing in zip(*[iter(case.sky(band))] * 2, strict=True):
            same = [one is other for one, other in zip(true.components, spoofing.components, strict=True)]
            assert same == [not (forged and band is Band.E1), True]
