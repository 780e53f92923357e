"""GNSS_INTEGRITY: what of a verdict goes into which field, and that pymavlink reads what was written."""

from __future__ import annotations

import socket
import sys
from dataclasses import replace
from enum import IntEnum
from pathlib import Path

import numpy as np
import pytest

from block_builder import Keys, MadeUpSky, settings
from vestige.acas_processor.levels import POSITION
from vestige.acas_processor.position.authentic_position import AuthenticPosition
from vestige.acas_processor.processor import AcasProcessor, Step
from vestige.acas_processor.verdict_block import VerdictBlock
from vestige.errors import VestigeError
from vestige.recording.outputs.gnss_integrity import (
    AuthenticationState,
    GnssIntegrity,
    InterferenceState,
    MavlinkOutput,
    RaimState,
    gnss_integrity,
)
from vestige.records import Status
from vestige.records.checks import CheckName
from vestige.time import GalileoTime

TIME = GalileoTime(1421, 561_616, 0.25)


def _step(level: int) -> Step:
    block = MadeUpSky(seed=5, n=31, every=10, trouble=0.0).whole
    return AcasProcessor(level=level, monitoring=settings()).step(None, block, Keys())  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def step() -> Step:
    return _step(2)


@pytest.fixture(scope="module")
def here(step: Step) -> AuthenticPosition:
    return replace(step.positions[-1], horizontal_sigma_m=1.234, vertical_sigma_m=1e9)


def _shown(step: Step, *states: Status) -> VerdictBlock:
    """Return the block with these states of its satellites, the first of all others."""
    state = np.full_like(step.block.state, POSITION[states[0]])
    state[-1, : len(states)] = [POSITION[one] for one in states]
    return replace(step.block, state=state)


AUTHENTIC, SUSPECT, SPOOFED = Status.AUTHENTIC, Status.SUSPECT, Status.SPOOFED
MISSED, UNKNOWN = Status.NOT_DETECTED, Status.NOT_AVAILABLE


@pytest.mark.parametrize(
    ("states", "authentication", "with_fix", "without_fix"),
    [
        ((AUTHENTIC,), "OK", "ABSENT", "ABSENT"),
        ((AUTHENTIC, UNKNOWN), "INITIALIZING", "ABSENT", "ABSENT"),
        ((UNKNOWN,), "INITIALIZING", "UNKNOWN", "UNKNOWN"),
        ((AUTHENTIC, MISSED), "ERROR", "UNKNOWN", "UNKNOWN"),
        ((AUTHENTIC, SUSPECT), "ERROR", "MITIGATED", "DETECTED"),
        ((SPOOFED,), "ERROR", "MITIGATED", "DETECTED"),
        ((UNKNOWN, MISSED, SPOOFED), "ERROR", "MITIGATED", "DETECTED"),
    ],
)
def test_states_of_satellites(
    step: Step,
    here: AuthenticPosition,
    states: tuple[Status, ...],
    authentication: str,
    with_fix: str,
    without_fix: str,
) -> None:
    block = _shown(step, *states)
    assert gnss_integrity(block, here).authentication.name == authentication
    assert gnss_integrity(block, here).spoofing.name == with_fix
    assert gnss_integrity(block, None).spoofing.name == without_fix
    assert gnss_integrity(block, replace(here, orbits_authenticated=False)) == gnss_integrity(block, None)


def test_raim_tells_the_accuracy_only_where_it_passed(step: Step, here: AuthenticPosition) -> None:
    passed = gnss_integrity(step.block, here)
    assert (passed.raim, passed.raim_hfom_cm, passed.raim_vfom_cm) == (RaimState.OK, 123, 65534)
    assert gnss_integrity(step.block, None).raim_hfom_cm == 65535
    series = step.block.failed[CheckName.RAIM]
    failed = replace(step.block, failed={**step.block.failed, CheckName.RAIM: np.ones_like(series)})
    assert gnss_integrity(failed, here).raim is RaimState.FAILED
    assert gnss_integrity(failed, here).raim_hfom_cm == 65535
    assert gnss_integrity(_step(1).block, here).raim is RaimState.DISABLED


def test_power_tells_of_jamming(step: Step) -> None:
    assert gnss_integrity(_step(1).block, None).jamming is InterferenceState.UNKNOWN
    for name in (CheckName.E1_RECEIVED_POWER, CheckName.E6_RECEIVED_POWER):
        failed = {**step.block.failed, name: np.ones_like(step.block.failed[name])}
        assert gnss_integrity(replace(step.block, failed=failed), None).jamming is InterferenceState.DETECTED
    run = {name: bool(one.run[-1].any()) for name, one in step.block.checks.items() if "received power" in name}
    expected = InterferenceState.ABSENT if all(run.values()) else InterferenceState.UNKNOWN
    assert gnss_integrity(step.block, None).jamming is expected


SAID = GnssIntegrity(
    authentication=AuthenticationState.OK,
    spoofing=InterferenceState.MITIGATED,
    jamming=InterferenceState.ABSENT,
    raim=RaimState.OK,
    raim_hfom_cm=123,
    raim_vfom_cm=456,
)


@pytest.fixture
def mavutil(monkeypatch: pytest.MonkeyPatch) -> object:
    monkeypatch.setenv("MAVLINK20", "1")
    monkeypatch.setenv("MAVLINK_DIALECT", "development")
    return pytest.importorskip("pymavlink.mavutil", reason="pymavlink is not installed: vestige[mavlink]")


def test_our_numbers_are_those_of_the_dialect(mavutil: object) -> None:
    dialect = pytest.importorskip("pymavlink.dialects.v20.development", reason="pymavlink is not installed")
    for ours, theirs in (
        (AuthenticationState, "GPS_AUTHENTICATION_STATE"), (RaimState, "GPS_RAIM_STATE"),
    ):  # fmt: skip
        _same(ours, theirs, dialect.enums[theirs], {})
    for what in ("SPOOF", "JAMM"):
        words = {"ABSENT": f"NOT_{what}ED"}
        _same(InterferenceState, f"GPS_{what}ING_STATE", dialect.enums[f"GPS_{what}ING_STATE"], words)


def _same(ours: type[IntEnum], prefix: str, theirs: dict[int, object], words: dict[str, str]) -> None:
    names = {value: entry.name for value, entry in theirs.items() if not entry.name.endswith("ENUM_END")}  # type: ignore[attr-defined]
    assert names == {int(one): f"{prefix}_{words.get(one.name, one.name)}" for one in ours}


def test_pymavlink_reads_the_log(mavutil: object, tmp_path: Path) -> None:
    for _ in range(2):  # it goes on
        with MavlinkOutput(str(tmp_path / "night.tlog")) as output:
            output.write(TIME, SAID)
    log = mavutil.mavlink_connection(str(tmp_path / "night.tlog"))  # type: ignore[attr-defined]
    found = [log.recv_match(type="GNSS_INTEGRITY") for _ in range(3)]
    log.close()
    assert found[2] is None
    for one in found[:2]:
        _is_what_was_said(one)
        assert one._timestamp == pytest.approx(TIME.utc.timestamp(), abs=1e-3)
        assert (one.get_srcSystem(), one.get_srcComponent()) == (1, 220)


def test_a_ground_station_receives_it(mavutil: object) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    station = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")  # type: ignore[attr-defined]
    with MavlinkOutput(f"udpout:127.0.0.1:{port}") as output:
        for _ in range(3):
            output.write(TIME, SAID)
    found = [station.recv_match(type="GNSS_INTEGRITY", blocking=True, timeout=5) for _ in range(3)]
    station.close()
    for one in found:
        _is_what_was_said(one)
    assert [one.get_seq() for one in found] == [0, 1, 2]


def _is_what_was_said(one: object) -> None:
    told = one.to_dict()  # type: ignore[attr-defined]
    assert told == {
        "mavpackettype": "GNSS_INTEGRITY", "id": 0, "system_errors": 0, "authentication_state": 3, "jamming_state": 1,
        "spoofing_state": 2, "raim_state": 2, "raim_hfom": 123, "raim_vfom": 456, "corrections_quality": 255,
        "system_status_summary": 255, "gnss_signal_quality": 255, "post_processing_quality": 255,
    }  # fmt: skip


@pytest.mark.parametrize("address", ["udpout:nowhere", "udpout:127.0.0.1:99999"])
def test_an_address_that_is_none(mavutil: object, address: str) -> None:
    with pytest.raises(VestigeError, match=rf"^--mavlink: found '{address}', expected a file \.tlog"):
        MavlinkOutput(address)


def test_a_serial_port_needs_pyserial(mavutil: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "serial", None)
    with pytest.raises(
        VestigeError, match=r"^--mavlink: found 'none', expected a file \.tlog.*: pip install pyserial$"
    ):
        MavlinkOutput("none")


def test_without_pymavlink_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pymavlink", None)
    monkeypatch.setitem(sys.modules, "pymavlink.dialects.v20.development", None)
    with pytest.raises(VestigeError, match=r"pip install 'vestige\[mavlink\]'"):
        MavlinkOutput("udpout:127.0.0.1:14550")


def test_an_address_that_cannot_be_reached(mavutil: object, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object, **_options: object) -> None:
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr(mavutil, "mavlink_connection", refuse)
    with pytest.raises(VestigeError, match=r"^--mavlink: found 'nonsense:1' \(Name or service not known\), expected"):
        MavlinkOutput("nonsense:1")
