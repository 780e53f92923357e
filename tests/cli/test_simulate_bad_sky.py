"""What `vestige simulate` refuses of a sky: one line with file, place, what was found and what was expected."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

from vestige.cli.main import main
from vestige.cli.recordings.simulate import command as simulate
from vestige.cli.services.osnma import verify_command
from vestige.crypto.keys.public_key_writer import write_merkle_tree
from vestige.crypto.osnma.operator.key_tree import draw_key_tree
from vestige.receiver.sky.constellation import walker_ephemerides
from vestige.recording.navigation.rinex_navigation import write_rinex_navigation
from vestige.recording.samples.test_vector_csv import write_test_vector
from vestige.scenario.campaign import CampaignScenario
from vestige.scenario.load import load_scenario
from vestige.simulated.exported_case import AcasTestCase
from vestige.time import GalileoTime

NIGHT = Path(__file__).resolve().parents[2] / "scenarios" / "night.toml"
START = GalileoTime.parse("2026-11-22T22:00:00 GST")
RINEX = 'constellation={{kind="rinex", path="day.rnx", mask_deg=9.0, svids=[{}]}}'


@pytest.fixture
def night(tmp_path: Path) -> Path:
    path = tmp_path / "night.toml"
    path.write_text(NIGHT.read_text(encoding="utf-8"), encoding="utf-8")
    return path


def refused(capsys: pytest.CaptureFixture[str], scenario: Path, *settings: str, epochs: str = "0:1") -> str:
    """The line on stderr; the exit status is that of bad input, and nothing is written."""
    output = scenario.parent / "out"
    arguments = [item for one in settings for item in ("--set", one)]
    with pytest.raises(SystemExit) as stop:
        main(["simulate", str(scenario), "-o", str(output), "--epochs", epochs, *arguments])
    assert stop.value.code == 1
    assert not output.exists()
    (line,) = capsys.readouterr().err.strip().splitlines()
    return line


def rinex_of(folder: Path, start: GalileoTime) -> None:
    satellites = [one for one in walker_ephemerides(start) if one.svid != 8]
    write_rinex_navigation(folder / "day.rnx", [replace(one, e1b_health=int(one.svid == 13)) for one in satellites])


def private_key_pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())


@pytest.mark.parametrize(
    ("svids", "said"),
    [
        (
            "7, 8",
            "constellation.svids: found 8, without an ephemeris in day.rnx, expected satellites among 1 2 3 4 5 6 7 "
            "9 10",
        ),
        (
            "7, 13",
            "constellation.svids: found 13, out of service or of another time in day.rnx, expected satellites among "
            "1 2",
        ),
    ],
)
def test_a_satellite_without_ephemeris(night: Path, capsys: pytest.CaptureFixture[str], svids: str, said: str) -> None:
    rinex_of(night.parent, START)
    line = refused(capsys, night, RINEX.format(svids))
    assert f"{night}: {said}" in line


def test_orbits_of_another_day(night: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rinex_of(night.parent, START + -86_400)
    line = refused(capsys, night, RINEX.format(""))
    assert f"{night}: constellation.path: found ephemerides from 2026-11-21 22:00 GST to 2026-11-21 22:00 GST" in line
    assert "expected a RINEX file of the day of the scenario, within 4 h of 2026-11-22 22:00 GST" in line


def test_an_osnma_key_that_does_not_fit_the_tree(night: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_merkle_tree(night.parent / "tree.xml", draw_key_tree(b"theirs", b"").published([1]), START)
    (night.parent / "own.pem").write_bytes(private_key_pem(draw_key_tree(b"ours", b"").private_key(1)))
    line = refused(capsys, night, 'osnma={private_key="own.pem", merkle_tree="tree.xml"}')
    tree = night.parent / "tree.xml"
    assert f"{tree}: leaves: found none of the key own.pem, expected the tree of that key, or no merkle_tree" in line


@pytest.mark.parametrize(
    ("table", "said"),
    [
        (
            '{merkle_tree="tree.xml"}',
            "osnma.private_key: found nothing, expected a key of the tree, beside merkle_tree",
        ),
        ('{private_key="no.pem"}', "no.pem"),
        (
            '{private_key="night.toml"}',
            "PEM block: found no private key, expected a P-256 private key without a password",
        ),
        ('{private_key="p384.pem"}', "p384.pem: the private key is not on P-256"),
        (
            '{private_key="own.pem", merkle_tree="tree.xml", event=[{kind="alert", start_s=60}]}',
            "osnma.event.0.kind: found alert with your own merkle_tree, expected no merkle_tree: ",
        ),
    ],
)
def test_osnma_keys_that_are_none(night: Path, capsys: pytest.CaptureFixture[str], table: str, said: str) -> None:
    tree = draw_key_tree(b"ours", b"")
    write_merkle_tree(night.parent / "tree.xml", tree.published([3]), START)
    (night.parent / "own.pem").write_bytes(private_key_pem(tree.private_key(3)))
    (night.parent / "p384.pem").write_bytes(private_key_pem(ec.generate_private_key(ec.SECP384R1())))
    assert said in refused(capsys, night, f"osnma={table}")


@pytest.mark.parametrize("with_tree", [True, False])
def test_an_osnma_key_of_the_user_signs(night: Path, with_tree: bool) -> None:
    """A receiver that trusts the user's tree verifies the pages; without one the operator makes a tree of that key."""
    tree = draw_key_tree(b"ours", b"")
    published = night.parent / "tree.xml"
    write_merkle_tree(published, tree.published([3]), START)
    (night.parent / "own.pem").write_bytes(private_key_pem(tree.private_key(3)))
    table = '{private_key="own.pem"' + (', merkle_tree="tree.xml"}' if with_tree else "}")
    scenario = load_scenario(night, (f"osnma={table}", "constellation.svids=[6, 7, 8, 12]"))
    assert isinstance(scenario, CampaignScenario)
    case = AcasTestCase(scenario=scenario, first=0, end=1)
    assert case.message is not None
    write_test_vector(night.parent / "pages.csv", case.message.pages)
    case.operator.write_files(night.parent)
    trusted = published if with_tree else night.parent / "merkle_tree.xml"
    pages = [str(night.parent / "pages.csv"), "--merkle-tree", str(trusted)]
    result = CliRunner().invoke(verify_command, pages)
    assert result.exit_code == 0, result.output
    assert f"PKID {3 if with_tree else 1}" in result.output
    assert case.operator.keys.claim(3 if with_tree else 1).point == tree.claim(3).point


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        (
            "receiver.sample_rate_hz=5e6",
            "receiver.sample_rate_hz: found 5 MHz, expected at least 5.115 MHz, the band of",
        ),
        (
            "receiver.front_end.bandwidth_hz=20e6",
            "receiver.front_end: found bandwidth_hz = 20000000.0, expected a bandwidth above 0 and below 12.5 MHz, ",
        ),
        (
            "receiver.front_end.bandwidth_hz=4e6",
            "receiver.front_end.bandwidth_hz: found 4 MHz, expected at least 5.115 MHz, the band of E6-C",
        ),
    ],
)
def test_too_narrow_a_band(night: Path, capsys: pytest.CaptureFixture[str], setting: str, said: str) -> None:
    assert f"{night}: {said}" in refused(capsys, night, setting)


@pytest.mark.parametrize(
    ("epochs", "advice"),
    [
        ("1:2", "the next one is at epoch 30; take --epochs 1:31"),
        ("151:170", "the last one is at epoch 150; take --epochs 150:170"),
    ],
)
def test_epochs_without_recs(night: Path, capsys: pytest.CaptureFixture[str], epochs: str, advice: str) -> None:
    assert refused(capsys, night, epochs=epochs) == (
        f"vestige: {night}: --epochs {epochs}: found no RECS, expected at least one; RECS come every 30 s, and {advice}"
    )


def test_a_satellite_below_the_mask_is_named(night: Path) -> None:
    """The recording is made without it, and a line says so."""
    settings = ("--set", "constellation.svids=[7, 1]", "--epochs", "0:1", "-o", str(night.parent / "out"))
    result = CliRunner().invoke(simulate, [str(night), *settings], standalone_mode=False)
    assert result.exception is None
    lines = [line for line in result.stderr.splitlines() if line.startswith("warning")]
    assert lines == [
        "warning: constellation.svids: E01 left out, because never above mask_deg = 9 in this run; the scenario has E07"
    ]


@pytest.mark.slow
def test_a_single_line_of_sight_takes_any_band(tmp_path: Path) -> None:
    """The limit is one of recordings of a sky, which other receivers track."""
    settings = ("--set", "receiver.sample_rate_hz=4.1e6", "--epochs", "0:1", "-o", str(tmp_path / "out"))
    result = CliRunner().invoke(simulate, [str(NIGHT.with_name("quick.toml")), *settings], standalone_mode=False)
    assert result.exception is None
