"""Forged and stale RECS and BGD files: what `vestige process` makes of each, and what only a signature tells.

The E6 signal of the recording carries chips that the attacker knows. The RECS of `recs make` decrypt to them.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

from night import TWO_SATELLITES, invoke
from signed_files import sign
from vestige.cli.recordings.process import command as process
from vestige.cli.recordings.simulate import command as simulate
from vestige.cli.services.recs_make import command as recs_make
from vestige.constants import DAY_S, SPEED_OF_LIGHT_MPS
from vestige.crypto.recs.group_delay import inter_frequency_delay_s, parse_group_delay_file, write_group_delay_file
from vestige.crypto.recs.recs_file import RecsFile, read_recs_file, serialize_recs_file, write_recs_file
from vestige.recording.assistance.folder import read_assistance
from vestige.records import GroupDelay

SERVER = ec.derive_private_key(0x1234567, ec.SECP256R1())
BIAS = ("--hardware-bias-m", -18.0)
LARGEST_BGD_S = 511 * 2.0**-32


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    room = tmp_path_factory.mktemp("forged")
    (room / "scenario.toml").write_text(TWO_SATELLITES)
    night = room / "night"
    assert invoke(simulate, room / "scenario.toml", "-o", night).exception is None
    keys = ("--keys", night / "osnma" / "keys.csv", "--public-key", night / "osnma" / "public_key.pem")
    made = invoke(recs_make, "--from-recording", night, *keys, "-o", night / "assistance", "--svids", "3,8")
    assert made.exception is None
    (night / "assistance" / "OPEN_CODE.txt").unlink()
    return night


@pytest.fixture
def assistance(recording: Path, tmp_path: Path) -> Path:
    """A copy of the folder with the RECS of the satellites 3 and 8."""
    return Path(shutil.copytree(recording / "assistance", tmp_path / "assistance"))


@pytest.fixture
def certificate(tmp_path: Path) -> Path:
    path = tmp_path / "server.pem"
    path.write_bytes(SERVER.public_key().public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo))
    return path


def verdicts(recording: Path, assistance: Path, *options: object) -> dict[int, dict[str, object]]:
    result = invoke(process, recording, "--assistance", assistance, *BIAS, *options, "--json")
    assert result.exception is None, result.exception
    return {one["svid"]: one for one in json.loads(result.stdout)["verdicts"]}


def statuses(recording: Path, assistance: Path, *options: object) -> dict[int, object]:
    return {svid: one["status"] for svid, one in verdicts(recording, assistance, *options).items()}


def files(assistance: Path) -> list[tuple[Path, RecsFile]]:
    return [(path, read_recs_file(path)) for path in sorted(assistance.glob("*.RCS"))]


def random_body(file: RecsFile, seed: int) -> bytes:
    return np.random.default_rng(seed).bytes(len(file.body))


def other_day(assistance: Path) -> None:
    for path, file in files(assistance):
        path.unlink()
        write_recs_file(replace(file, start=file.start + -DAY_S), assistance)


def other_key(assistance: Path) -> None:
    for path, file in files(assistance):
        path.unlink()
        write_recs_file(replace(file, key_delay=1), assistance)


def swapped(assistance: Path) -> None:
    (first, one), (second, other) = files(assistance)
    first.write_bytes(serialize_recs_file(replace(one, body=other.body)))
    second.write_bytes(serialize_recs_file(replace(other, body=one.body)))


def random_chips(assistance: Path) -> None:
    for seed, (path, file) in enumerate(files(assistance)):
        path.write_bytes(serialize_recs_file(replace(file, body=random_body(file, seed))))


def other_rand(assistance: Path) -> None:
    for path, file in files(assistance):
        path.unlink()
        write_recs_file(replace(file, random_offset=1), assistance)


def contradicted(assistance: Path) -> None:
    for seed, (_, file) in enumerate(files(assistance)):
        write_recs_file(replace(file, file_version=2, body=random_body(file, seed)), assistance)


def truncated(assistance: Path) -> None:
    for path, _ in files(assistance):
        path.write_bytes(path.read_bytes()[:-7])


def other_interface(assistance: Path) -> None:
    for path, _ in files(assistance):
        data = path.read_bytes()
        path.write_bytes(data[:4] + b"\x02" + data[5:])


def exchanged_names(assistance: Path) -> None:
    first, second = (path for path, _ in files(assistance))
    data = first.read_bytes()
    shutil.copy(second, first)
    second.write_bytes(data)


NOT_FOUND: dict[int, object] = {3: "NOT_DETECTED", 8: "NOT_DETECTED"}


def test_the_recs_of_the_time_are_authentic(recording: Path, assistance: Path) -> None:
    assert statuses(recording, assistance) == {3: "AUTHENTIC", 8: "AUTHENTIC"}


@pytest.mark.parametrize(
    ("forge", "expected"),
    [
        (other_day, {}),  # no RECS was transmitted during this recording
        (other_key, NOT_FOUND),
        (swapped, NOT_FOUND),
        (random_chips, NOT_FOUND),
        (other_rand, {3: "AUTHENTIC", 8: "AUTHENTIC"}),  # the IV alone: 128 of 81,840 chips
    ],
    ids=lambda one: getattr(one, "__name__", None),
)
def test_files_that_can_be_read(
    recording: Path, assistance: Path, forge: Callable[[Path], None], expected: dict[int, object]
) -> None:
    forge(assistance)
    folder = read_assistance(assistance)
    assert folder.problems == ()
    assert statuses(recording, assistance) == expected


@pytest.mark.parametrize(
    ("forge", "lines", "said"),
    [
        (contradicted, 2, "1 that differ from those in"),
        (truncated, 2, "one RECS of"),
        (other_interface, 2, "RECS interface version 2 is not known, only 1 is"),
        (exchanged_names, 2, "as the header says"),
    ],
    ids=lambda one: getattr(one, "__name__", None),
)
def test_files_that_are_refused(assistance: Path, forge: Callable[[Path], None], lines: int, said: str) -> None:
    """One line for each file, and none of its RECS is used."""
    forge(assistance)
    folder = read_assistance(assistance)
    assert folder.assistance.segments == ()
    assert len(folder.problems) == lines
    for problem in folder.problems:
        assert said in str(problem)
        assert "\n" not in str(problem)


def test_chips_of_the_attackers_own_need_the_certificate_of_the_server(
    recording: Path, assistance: Path, certificate: Path
) -> None:
    """The attacker knows the chips that he sends, waits for the key, and encrypts them as the server would.

    The RECS of the server hold what the satellites send, so the attacker's signal is not found. Without a certificate
    his own RECS in their place are AUTHENTIC: nothing in a RECS says who made it.
    """
    forged = {path: path.read_bytes() for path, _ in files(assistance)}
    random_chips(assistance)  # those of the satellites, which the attacker does not know
    for path in (*forged, *assistance.glob("*.BGD")):
        sign(path, SERVER)
    signed = ("--certificate", certificate)
    assert statuses(recording, assistance, *signed) == NOT_FOUND
    for path, data in forged.items():
        path.write_bytes(data)
    assert statuses(recording, assistance) == {3: "AUTHENTIC", 8: "AUTHENTIC"}
    assert statuses(recording, assistance, *signed) == {}
    problems = [str(one) for one in read_assistance(assistance, certificates=[certificate]).problems]
    assert len(problems) == 2
    assert all("no given key verifies the signature" in one for one in problems)


def test_a_file_that_nobody_signed_is_named(recording: Path, assistance: Path) -> None:
    found = invoke(process, recording, "--assistance", assistance, *BIAS)
    assert "signatures: 3 files have no verified signature of the server" in found.stderr


@pytest.mark.parametrize(
    ("start", "time_uncertainty_s", "expected"),
    [
        ("2026-11-21T12:00:56 GST", 1.0, {}),  # the clock is right: no RECS was sent at that time
        (
            "2026-11-21T12:00:56 GST",
            41.0,
            {3: "NOT_AVAILABLE", 8: "NOT_AVAILABLE"},
        ),  # it finds the 40 s, and that is all
        ("2026-11-21T12:00:16 GST", 1.0, {3: "AUTHENTIC", 8: "AUTHENTIC"}),  # the clock is 40 s late: nothing tells
    ],
)
def test_samples_of_40_s_ago_are_told_by_the_clock_alone(
    recording: Path, assistance: Path, start: str, time_uncertainty_s: float, expected: dict[int, object]
) -> None:
    """A forger with the disclosed key sends the samples of 12:00:16 at 12:00:56; the key is on air from 12:00:22."""
    found = verdicts(recording, assistance, "--start", start, "--time-uncertainty", time_uncertainty_s)
    assert {svid: one["status"] for svid, one in found.items()} == expected
    for one in found.values():
        if one["status"] == "NOT_AVAILABLE":
            assert "not provably received before the key's disclosure" in str(one["reason"])
            assert "key on air from 2026-11-21T12:00:22.000 GST" in str(one["reason"])


def forge_group_delays(assistance: Path, bgd_s: float, later_s: float = 0.0) -> None:
    (path,) = assistance.glob("*.BGD")
    delays = parse_group_delay_file(path.read_bytes(), path).delays
    path.unlink()
    write_group_delay_file(
        [GroupDelay(svid=one.svid, bgd_e1_e6_s=bgd_s, valid_from=one.valid_from + later_s) for one in delays],
        assistance,
    )


@pytest.mark.parametrize("sign", [1, -1])
def test_a_forged_group_delay_moves_the_range_by_at_most_18_and_a_half_metres(
    recording: Path, assistance: Path, sign: int
) -> None:
    """10 bits of 2⁻³² s [OS-ICD, 5.1.5]. A range pulled by 26.6 + 18.5 m can pass with it; more cannot."""
    before = verdicts(recording, assistance)
    forge_group_delays(assistance, sign * LARGEST_BGD_S)
    after = verdicts(recording, assistance)
    moved_m = SPEED_OF_LIGHT_MPS * inter_frequency_delay_s(LARGEST_BGD_S)
    assert moved_m == pytest.approx(18.47, abs=0.01)
    for svid, one in after.items():
        assert one["status"] == "AUTHENTIC"
        change_m = float(str(one["range_offset_m"])) - float(str(before[svid]["range_offset_m"]))
        assert change_m == pytest.approx(-sign * moved_m, abs=1.5)  # the correlators stand elsewhere


def test_a_group_delay_that_no_satellite_can_have_is_refused(assistance: Path) -> None:
    (path,) = assistance.glob("*.BGD")
    data = bytearray(path.read_bytes())
    data[72 + 2 * 2 : 72 + 2 * 2 + 2] = (512).to_bytes(2, "little")
    path.write_bytes(data)
    folder = read_assistance(assistance)
    assert folder.assistance.group_delays == ()
    (problem,) = folder.problems
    assert "value of SVID 3: found 512, expected -512 to 511" in str(problem)


@pytest.mark.parametrize(
    ("later_s", "said"),
    [
        (-6 * DAY_S, None),
        (-400 * DAY_S, "are 400 days older than its RECS, expected at most 7"),
        (60.0, "are valid from 2026-11-21T12:01:16.000 GST on, after its RECS; taken as 0"),
    ],
)
def test_group_delays_of_another_time_are_named(assistance: Path, later_s: float, said: str | None) -> None:
    forge_group_delays(assistance, 1e-9, later_s)
    lines = [line for line in read_assistance(assistance).missing if line.startswith("group delays")]
    expected = [] if said is None else [f"group delays of E{svid:02d} {said}" for svid in (3, 8)]
    assert [line[: len(begin)] for line, begin in zip(lines, expected, strict=True)] == expected
