"""Write the receiver's integrity as the MAVLink message GNSS_INTEGRITY, for autopilots and ground stations.

Message 441 of the dialect `development` has fields for authentication, spoofing, jamming and RAIM. `gnss_integrity`
fills these fields from the states of the satellites, the checks and the position. pymavlink encodes the message.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC
from enum import IntEnum
from importlib import import_module
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Any

from vestige.acas_processor.position.authentic_position import AuthenticPosition
from vestige.acas_processor.verdict_block import STATUSES, VerdictBlock
from vestige.errors import VestigeError
from vestige.output import naming
from vestige.recording.outputs.position_file import authentic_fix
from vestige.records import Status
from vestige.records.checks import CheckName
from vestige.time import GalileoTime

LOG_SUFFIX = ".tlog"
_SYSTEM, _COMPONENT = 1, 220  # component 220 is a GNSS receiver, MAV_COMP_ID_GPS
_UNKNOWN_CM, _UNKNOWN_QUALITY = 0xFFFF, 0xFF


class AuthenticationState(IntEnum):
    """`GPS_AUTHENTICATION_STATE` of MAVLink."""

    UNKNOWN = 0
    INITIALIZING = 1
    ERROR = 2
    OK = 3
    DISABLED = 4


class InterferenceState(IntEnum):
    """`GPS_SPOOFING_STATE` and `GPS_JAMMING_STATE` of MAVLink, which have the same values."""

    UNKNOWN = 0
    ABSENT = 1  # NOT_SPOOFED or NOT_JAMMED in MAVLink
    MITIGATED = 2
    DETECTED = 3


class RaimState(IntEnum):
    """`GPS_RAIM_STATE` of MAVLink."""

    UNKNOWN = 0
    DISABLED = 1
    OK = 2
    FAILED = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class GnssIntegrity:
    """The fields of GNSS_INTEGRITY that vestige fills.

    Attributes
    ----------
    raim_hfom_cm, raim_vfom_cm
        Standard deviations of the authentic position in cm, horizontal and vertical; 65535 means unknown.
    """

    authentication: AuthenticationState
    spoofing: InterferenceState
    jamming: InterferenceState
    raim: RaimState
    raim_hfom_cm: int = _UNKNOWN_CM
    raim_vfom_cm: int = _UNKNOWN_CM


def gnss_integrity(block: VerdictBlock, position: AuthenticPosition | None) -> GnssIntegrity:
    """Return the integrity after the last epoch of a block.

    Parameters
    ----------
    block
        Verdicts, with the displayed state of each satellite, which is the gravest verdict of the last 90 s.
    position
        Authentic position of the last epoch, or None.
    """
    states = {STATUSES[one] for one in block.state[-1].tolist()}
    fix, raim = authentic_fix(position), _raim(block)
    measured = fix if raim is RaimState.OK else None
    return GnssIntegrity(
        authentication=_authentication(states),
        spoofing=_spoofing(states, fixed=fix is not None),
        jamming=_jamming(block),
        raim=raim,
        raim_hfom_cm=_UNKNOWN_CM if measured is None else _centimetres(measured.horizontal_sigma_m),
        raim_vfom_cm=_UNKNOWN_CM if measured is None else _centimetres(measured.vertical_sigma_m),
    )


def _authentication(states: set[Status]) -> AuthenticationState:
    if not states:
        return AuthenticationState.UNKNOWN
    if states - {Status.AUTHENTIC, Status.NOT_AVAILABLE}:
        return AuthenticationState.ERROR
    return AuthenticationState.OK if states == {Status.AUTHENTIC} else AuthenticationState.INITIALIZING


def _spoofing(states: set[Status], *, fixed: bool) -> InterferenceState:
    if states & {Status.SPOOFED, Status.SUSPECT}:
        return InterferenceState.MITIGATED if fixed else InterferenceState.DETECTED
    known = Status.AUTHENTIC in states and Status.NOT_DETECTED not in states
    return InterferenceState.ABSENT if known else InterferenceState.UNKNOWN


def _jamming(block: VerdictBlock) -> InterferenceState:
    run, failed = _outcome(block, CheckName.E1_RECEIVED_POWER)
    run_e6, failed_e6 = _outcome(block, CheckName.E6_RECEIVED_POWER)
    if failed or failed_e6:
        return InterferenceState.DETECTED
    return InterferenceState.ABSENT if run and run_e6 else InterferenceState.UNKNOWN


def _raim(block: VerdictBlock) -> RaimState:
    if CheckName.RAIM not in block.checks:
        return RaimState.DISABLED
    run, failed = _outcome(block, CheckName.RAIM)
    return RaimState.FAILED if failed else RaimState.OK if run else RaimState.UNKNOWN


def _outcome(block: VerdictBlock, name: CheckName) -> tuple[bool, bool]:
    """Return whether a check was run in the last epoch, and whether the check failed in this epoch."""
    if name not in block.checks:
        return False, False
    return bool(block.checks[name].run[-1].any()), bool(block.failed[name][-1].any())


def _centimetres(sigma_m: float) -> int:
    return min(round(100 * sigma_m), _UNKNOWN_CM - 1)


class MavlinkOutput:
    """Context manager that sends GNSS_INTEGRITY by pymavlink, or writes a telemetry log.

    Parameters
    ----------
    target
        Name of a file that ends in `.tlog`, to which messages are appended, or an address of pymavlink, such as
        `udpout:127.0.0.1:14550`.

    Raises
    ------
    VestigeError
        If pymavlink is not installed, does not know the message or the address, or cannot open the address.
    OSError
        If the file cannot be opened.
    """

    def __init__(self, target: str) -> None:
        self._dialect = _dialect()
        self._held = ExitStack()
        self._mav = self._dialect.MAVLink(None, srcSystem=_SYSTEM, srcComponent=_COMPONENT)
        self._path = Path(target) if target.endswith(LOG_SUFFIX) else None
        self._write: Callable[[bytes], Any]
        if self._path is not None:
            with naming(self._path):
                self._write = self._held.enter_context(self._path.open("ab", buffering=0)).write
        else:
            self._write = self._connected(target)

    def _connected(self, address: str) -> Callable[[bytes], Any]:
        try:
            connection = import_module("pymavlink.mavutil").mavlink_connection(address, dialect="development")
            self._held.callback(connection.close)
            connection.write(b"")  # pymavlink checks the port of a UDP address only when pymavlink sends
        except (ValueError, IndexError, OverflowError) as error:  # pymavlink cannot read the address
            self._held.close()
            expected = f"a file {LOG_SUFFIX}, or an address such as udpout:127.0.0.1:14550"
            raise VestigeError(f"--mavlink: found {address!r}, expected {expected}") from error
        except ModuleNotFoundError as error:  # pymavlink takes the address for a serial port, and pyserial is missing
            expected = f"a file {LOG_SUFFIX}, an address such as udpout:127.0.0.1:14550, or pyserial for a serial port"
            raise VestigeError(f"--mavlink: found {address!r}, expected {expected}: pip install pyserial") from error
        except OSError as error:  # the host is unknown, or the port is in use or missing
            self._held.close()
            expected = f"a file {LOG_SUFFIX}, or an address that can be reached, such as udpout:127.0.0.1:14550"
            why = error.strerror or str(error)
            raise VestigeError(f"--mavlink: found {address!r} ({why}), expected {expected}") from error
        return connection.write

    def write(self, time: GalileoTime, integrity: GnssIntegrity) -> None:
        """Write the message of one snapshot.

        Parameters
        ----------
        time
            Time of the snapshot, which is written into the log.
        integrity
            Fields of the message.
        """
        message = self._dialect.MAVLink_gnss_integrity_message(
            id=0,
            system_errors=0,
            authentication_state=integrity.authentication,
            jamming_state=integrity.jamming,
            spoofing_state=integrity.spoofing,
            raim_state=integrity.raim,
            raim_hfom=integrity.raim_hfom_cm,
            raim_vfom=integrity.raim_vfom_cm,
            corrections_quality=_UNKNOWN_QUALITY,
            system_status_summary=_UNKNOWN_QUALITY,
            gnss_signal_quality=_UNKNOWN_QUALITY,
            post_processing_quality=_UNKNOWN_QUALITY,
        )
        data = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        if self._path is None:
            self._write(data)
            return
        microseconds = round(time.utc.replace(tzinfo=UTC).timestamp() * 1e6)
        with naming(self._path):
            self._write(struct.pack(">Q", microseconds) + data)

    def __enter__(self) -> MavlinkOutput:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._held.close()


def _dialect() -> ModuleType:
    try:
        development = import_module("pymavlink.dialects.v20.development")
    except ImportError as error:
        raise VestigeError("--mavlink needs pymavlink: pip install 'vestige[mavlink]'") from error
    if not hasattr(development, "MAVLink_gnss_integrity_message"):
        raise VestigeError("--mavlink: this pymavlink has no GNSS_INTEGRITY: pip install -U 'vestige[mavlink]'")
    return development
