"""Define the objects that `--json` of `vestige process` and `vestige live` prints, and generate their JSON schemas.

Times are text, except week and second of GST. A number that was not measured is null.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, WithJsonSchema
from typing_extensions import TypedDict

from vestige.constants import MAX_SVID
from vestige.records import Outcome, Status

_SCHEMA = "https://json-schema.org/draft/2020-12/schema"

_StatusName = Annotated[str, WithJsonSchema({"type": "string", "enum": [one.name for one in Status]})]
_OutcomeName = Annotated[str, WithJsonSchema({"type": "string", "enum": [one.name for one in Outcome]})]
_Svid = Annotated[int, Field(ge=1, le=MAX_SVID)]
_Count = Annotated[int, Field(ge=0)]


class VerdictRow(TypedDict):
    """A verdict without its checks: a row of the table that `vestige process -o` writes."""

    gst_week: _Count
    gst_second: float
    svid: _Svid
    level: Annotated[int, Field(ge=1, le=3)]
    status: _StatusName
    magnitude_sigma: float | None
    threshold_sigma: float | None
    range_offset_m: float | None
    range_limit_m: float | None
    true_offset_m: float | None
    cn0_e1_dbhz: float | None
    doppler_e6_hz: float | None
    available_at: str | None
    reason: str


class CheckEntry(TypedDict):
    """A check of a verdict. The check fails if the magnitude of the statistic exceeds the threshold."""

    name: str
    outcome: _OutcomeName
    statistic: float | None
    threshold: float | None
    unit: str
    reason: str


class VerdictEntry(VerdictRow):
    """The verdict of one satellite at one RECS."""

    snapshot: _Count
    checks: list[CheckEntry]


class PositionEntry(TypedDict):
    """A position from ranges in use. The position is authentic if the orbits are authenticated, too."""

    snapshot: _Count
    time: str
    available_at: str
    latency_s: float
    latitude_deg: Annotated[float, Field(ge=-90, le=90)]
    longitude_deg: Annotated[float, Field(ge=-180, le=180)]
    height_m: float
    horizontal_sigma_m: Annotated[float, Field(ge=0)]
    vertical_sigma_m: Annotated[float, Field(ge=0)]
    svids: list[_Svid]
    earlier: list[_Svid]
    orbits_authenticated: bool


class VerdictLine(VerdictEntry):
    """A verdict, as a line of `vestige live --json`."""

    kind: Literal["verdict"]


class PositionLine(PositionEntry):
    """A position, as a line of `vestige live --json`."""

    kind: Literal["position"]


class StateLine(TypedDict):
    """A change of the displayed state of a satellite."""

    kind: Literal["state"]
    gst_week: _Count
    gst_second: float
    svid: _Svid
    before: _StatusName
    after: _StatusName
    alarm: bool
    reason: str
    snapshot: _Count


class EndLine(TypedDict):
    """The last line of `vestige live --json`: counts of snapshots, and satellites with RECS never found on E1."""

    kind: Literal["end"]
    snapshots: _Count
    dropped: _Count
    not_seen_on_e1: list[_Svid]


class ProcessObject(TypedDict):
    """The object that `vestige process --json` prints."""

    hardware_bias_m: float
    calibrated_on_itself: bool
    warnings: list[str]
    verdicts: list[VerdictEntry]
    positions: list[PositionEntry]
    not_seen_on_e1: list[_Svid]


_Line = Annotated[VerdictLine | PositionLine | StateLine | EndLine, Field(discriminator="kind")]


def verdict_schema() -> dict[str, Any]:
    """Return the JSON schema of the object that `vestige process --json` prints.

    Examples
    --------
    >>> verdict_schema()["required"][:2]
    ['hardware_bias_m', 'calibrated_on_itself']
    """
    return _schema(ProcessObject, "vestige process --json")


def verdict_line_schema() -> dict[str, Any]:
    """Return the JSON schema of a line that `vestige live --json` prints, and of a line of the file `verdicts.jsonl`.

    Examples
    --------
    >>> sorted(verdict_line_schema()["discriminator"]["mapping"])
    ['end', 'position', 'state', 'verdict']
    """
    return _schema(_Line, "a line of vestige live --json")


def _schema(kind: Any, title: str) -> dict[str, Any]:
    return {"$schema": _SCHEMA} | TypeAdapter(kind).json_schema() | {"title": title}
