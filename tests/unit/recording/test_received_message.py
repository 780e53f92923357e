"""The message of a growing recording: its keys come one by one, and it forgets what is old."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from operator_sky import OperatorSky
from vestige.crypto.osnma.operator.configuration import OperatorConfiguration
from vestige.errors import AuthenticationError
from vestige.navigation.inav.page import InavPage
from vestige.recording.assistance.assistance_files import FileTrust, Settings, contents_of_pages
from vestige.recording.live.received_message import ReceivedMessage
from vestige.time import GalileoTime

START = GalileoTime(1400, 7200)
PATH = Path("night")


@pytest.fixture(scope="module")
def sky() -> OperatorSky:
    return OperatorSky(OperatorConfiguration(seed=b"live", start=START, n_subframes=14))


@pytest.fixture(scope="module")
def pages(sky: OperatorSky) -> list[InavPage]:
    return sky.pages()


@pytest.fixture(scope="module")
def settings(sky: OperatorSky, tmp_path_factory: pytest.TempPathFactory) -> Settings:
    folder = tmp_path_factory.mktemp("trust")
    sky.operator.write_files(folder)
    return Settings(trust=FileTrust.load([], folder / "merkle_tree.xml"))


def test_all_at_once_and_page_by_page_are_the_same_keys(pages: list[InavPage], settings: Settings) -> None:
    message = ReceivedMessage(PATH, kept_s=1e6)
    assert message.contents(settings) is None
    versions = set()
    for page in pages:
        message.take([page])
        assert message.contents(settings) is not None
        versions.add(message.version)
    message.finish()
    found, expected = message.contents(settings), contents_of_pages(PATH, pages, settings)
    assert found is not None
    assert len(found.keys) == 14
    assert (found.keys, found.roots, found.received) == (expected.keys, expected.roots, expected.received)
    assert len(versions) == 14  # the last subframe is open until the end


def test_what_is_old_is_forgotten_and_new_keys_come_on(pages: list[InavPage], settings: Settings) -> None:
    message = ReceivedMessage(PATH, kept_s=100.0)
    sizes = []
    for page in pages:
        message.take([page])
        found = message.contents(settings)
        assert found is not None
        sizes.append((len(message._pages), len(found.keys), len(found.received)))
    assert found is not None
    last = found.keys[-1].time
    assert last - START == 12 * 30
    assert all(last - key.time <= 100 for key in found.keys)
    assert len(found.keys) == 2
    middle, end = sizes[len(sizes) // 2], sizes[-1]
    assert max(end[0] - middle[0], end[2] - middle[2]) <= 8 * 15
    assert end[0] <= 8 * 51  # pages of 100 s


def test_another_trust_anchor_starts_anew_with_the_pages_that_are_kept(
    pages: list[InavPage], settings: Settings
) -> None:
    assert settings.trust is not None
    message = ReceivedMessage(PATH, kept_s=1e6)
    message.take(pages)
    before = message.version
    first = message.contents(settings)
    again = message.contents(Settings(trust=FileTrust(public_keys=settings.trust.public_keys, tree=None)))
    assert first is not None
    assert again is not None
    assert first.keys == again.keys
    assert message.version > before


def test_keys_without_anything_to_lead_to_are_refused(pages: list[InavPage]) -> None:
    message = ReceivedMessage(PATH)
    message.take(pages[:1])
    with pytest.raises(AuthenticationError, match="prove nothing without"):
        message.contents(Settings())


def test_a_chain_that_is_known_before(sky: OperatorSky, pages: list[InavPage], settings: Settings) -> None:
    """A subframe of a satellite has no whole DSM-KROOT. Its key leads to the root key of a key file."""
    first = [page for page in pages if page.svid == pages[0].svid and page.time < START + 31.0]
    known = replace(settings, roots=sky.operator.roots)
    assert contents_of_pages(PATH, first, settings).keys == ()
    (key,) = contents_of_pages(PATH, first, known).keys
    message = ReceivedMessage(PATH)
    message.take(first)
    assert message.contents(settings).keys == ()  # type: ignore[union-attr]
    message.finish()
    assert message.contents(known).keys == (key,)  # type: ignore[union-attr]
