"""Checks of a user that look at one field of the evidence each: the file of parts, and the fields that there are."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

from vestige.acas_processor.checks.osnma_subframes import Subframes
from vestige.acas_processor.evidence import Evidence
from vestige.acas_processor.measurement import DetectedBlock, FixBlock, MeasurementBlock
from vestige.navigation.position_fix import Fix, Transmission
from vestige.records.recs_block import RecsBlock
from vestige.records.snapshot_block import BankBlock, E1Block, OsnmaBlock, SnapshotBlock, VelocityIncrements

PAGE = Path(__file__).resolve().parents[1] / "docs" / "extend.md"
NOT_OFFERED = {"measured.snapshots.e6", "measured.snapshots.searches", "measured.fixes"}  # `fix` is offered for `fixes`
_INNER = {
    "measured": MeasurementBlock, "measured.snapshots": SnapshotBlock, "measured.snapshots.e1": E1Block,
    "measured.snapshots.osnma": OsnmaBlock, "measured.snapshots.increments": VelocityIncrements,
    "measured.recs": RecsBlock, "measured.banks": BankBlock, "measured.detected": DetectedBlock,
    "measured.fix": FixBlock, "measured.fix.fix": Fix, "measured.fix.sent": Transmission, "subframes": Subframes,
}  # fmt: skip
_ROW = re.compile(r"^\| `([a-z0-9_.]*)` \| (.*?) \|", re.MULTILINE)

SOURCE = '''
"""Probes: each check looks at one field of the evidence, whatever it is."""

import zlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass

import numpy as np

from vestige.records.checks import CheckSeries

LATE_S = {late_s!r}  # nothing fails before, so that usual levels are learned
FIELDS = {fields!r}


def raw(value):
    if isinstance(value, np.ndarray):
        if value.dtype.kind in "fc":  # the sign of a NaN says nothing
            value = np.where(np.isnan(value), np.nan, value)
        return f"{{value.dtype}} {{value.shape}}".encode() + value.tobytes()
    if isinstance(value, Mapping):
        return b"".join(raw(str(key)) + raw(value[key]) for key in sorted(value, key=str))
    if isinstance(value, tuple):
        return str(len(value)).encode() + b"".join(raw(one) for one in value)
    if is_dataclass(value):
        return b"".join(raw(getattr(value, field.name)) for field in fields(value))
    return repr(value).encode()


class Probe:
    unit = "1"
    p_fa = 0.5

    def series(self, evidence):
        value = evidence
        for name in self.path.split("."):
            value = None if value is None else getattr(value, name)
        late = (evidence.time_s >= LATE_S)[:, None]
        if isinstance(value, np.ndarray) and value.dtype == np.float64 and value.shape == evidence.shape:
            statistic = value
            threshold = np.abs(value) * (0.5 + np.floor(1e3 * np.abs(value)) % 2)
        else:
            statistic = np.full(evidence.shape, float(zlib.crc32(raw(value)) & 0xFFFFFF))
            threshold = np.full(evidence.shape, 2.0**23)
        return CheckSeries(
            name=self.name, unit=self.unit, p_fa=self.p_fa, statistic=statistic,
            threshold=np.where(late, threshold, np.inf), explain=lambda epoch, satellite: self.path,
        )


for number, path in enumerate(FIELDS):
    name = f"Probe{{number}}"
    globals()[name] = type(name, (Probe,), {{"path": path, "name": path, "__module__": __name__}})
'''


def all_fields() -> set[str]:
    """Return every field that the evidence has, as a path of names."""

    def inside(path: str, kind: type) -> set[str]:
        found: set[str] = set()
        for field in dataclasses.fields(kind):
            here = f"{path}.{field.name}".lstrip(".").replace("measured.fixes", "measured.fix")
            found |= inside(here, _INNER[here]) if here in _INNER else {here}
        return found

    return {path for path in inside("", Evidence) if path not in NOT_OFFERED}


def documented_fields() -> set[str]:
    """Return the fields that docs/extend.md offers: a row of its table has an object and the names in it."""
    found = set()
    for path, cell in _ROW.findall(PAGE.read_text(encoding="utf-8")):
        start = path.removeprefix("evidence").lstrip(".")
        found |= {f"{start}.{name}".lstrip(".") for name in re.findall(r"`([a-z0-9_]+)`", cell)}
    return found


def write_probes(folder: Path, *, late_s: float) -> tuple[str, ...]:
    """Write a module with a check for every field into a folder, and return how a scenario names them."""
    names = sorted(all_fields())
    (folder / "probes.py").write_text(SOURCE.format(late_s=late_s, fields=names), encoding="utf-8")
    return tuple(f"probes:Probe{number}" for number in range(len(names)))
