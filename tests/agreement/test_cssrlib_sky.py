"""The pages that `vestige simulate` writes of a sky: cssrlib decodes them and verifies every tag in them.

Only files go from vestige to cssrlib: `inav_pages.csv` and the Merkle tree of the folder. cssrlib decodes words 1 to 5,
and verifies the tags of words 1 to 6 and 10. It has no decoder for words 0, 6 to 10 and 16 to 20:
gnss-sdr decodes words 6 to 10 (`test_sky_gnss_sdr`) and words 0 and 16 to 20 (`test_sky_gnss_sdr_words`). Real pages
judge all words (tests/golden/test_inav_pages.py).
"""

from __future__ import annotations

from pathlib import Path

import pytest

from cssrlib_judge import Judge, broadcast_words, decoded_ephemerides
from vestige.crypto.osnma.messages.mac_lookup import MAC_LOOKUP
from vestige.recording.navigation.rinex_navigation import read_rinex_navigation
from vestige.recording.samples.test_vector_csv import read_test_vector
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import write_companions

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
SVIDS = (6, 7, 8, 12, 13, 14, 20, 21)
EPOCHS = 120  # of 1 s; the pages begin six minutes before
DSM_SUBFRAMES = 4  # these satellites take for the blocks of a DSM-KROOT


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    scenario = load_scenario(NIGHT, ())
    assert isinstance(scenario, CampaignScenario)
    path = tmp_path_factory.mktemp("night")
    write_companions(AcasTestCase(scenario=scenario, first=0, end=EPOCHS), path)
    return path


@pytest.mark.judged(
    by="cssrlib", what="ephemerides of a simulated sky, two issues each", figure="all come back to the last bit"
)
def test_every_ephemeris_comes_back(folder: Path) -> None:
    """Words 1 to 5 of every page, against the RINEX file of the folder."""
    issued = [one for one in read_rinex_navigation(folder / "rinex" / "navigation.rnx") if one.svid in SVIDS]
    told = {(one.svid, one.iod_nav): broadcast_words(one) for one in issued}
    found = [one for _, one in decoded_ephemerides(read_test_vector(folder / "inav_pages.csv"))]
    assert len(told) == 2 * len(SVIDS)
    assert {(one.svid, one.iod_nav) for one in found} == told.keys()
    assert all(broadcast_words(one) == told[one.svid, one.iod_nav] for one in found)
    # all words 1 to 5, but for those of the first subframe and at the change of issue that miss others
    assert len(found) > 30 * len(SVIDS)


@pytest.mark.judged(by="cssrlib", what="OSNMA of a simulated sky", figure="root key, keys and every tag verify")
def test_every_tag_verifies(folder: Path) -> None:
    """The root key is complete after four subframes. The last one has no key, the last eleven none for ADKD 12."""
    pages = list(read_test_vector(folder / "inav_pages.csv"))
    judge = Judge(folder / "assistance" / "merkle_tree.xml", folder / "log.txt").take(pages)
    assert judge.root_verified
    assert judge.chain_verified
    assert all(judge.macseqs)
    assert all(judge.tags.values())
    start, n_subframes = pages[0].time.second - 1, len(pages) // (15 * len(SVIDS))
    expected = {
        (start + 30 * k, svid, number, 0 if slot.flexible else slot.adkd)
        for k in range(DSM_SUBFRAMES, n_subframes)
        for svid in SVIDS
        for number, slot in enumerate(MAC_LOOKUP[judge.program.maclt][(start // 30 + k) % 2], start=1)
        if k <= (n_subframes - 12 if slot.adkd == 12 else n_subframes - 2)
    }
    assert {tag for tag in judge.tags if tag[0] >= start + 30 * DSM_SUBFRAMES} == expected
    assert {adkd for *_, adkd in expected} == {0, 4, 12}
