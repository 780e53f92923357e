"""Identity of a build: source of vestige, the user's parts and the processor, which all affect the bits of results.

The kind of processor matters for sums of samples alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from vestige.source_version import processor_name, vestige_version

if TYPE_CHECKING:
    from vestige.campaign.plan import Plan

PROCESSOR = "processor"  # attribute of a plan whose bits depend on it
PARTS = "own_parts"  # attribute of a plan with parts of the user's: `module:Name@digest` of each


def build_id(plan: Plan) -> dict[str, str]:
    """Return what must be equal wherever chunks of one plan are measured, by attribute of the store."""
    processor: Mapping[str, str] = {PROCESSOR: processor_name()} if PROCESSOR in plan.attrs else {}
    parts: Mapping[str, str] = {PARTS: str(plan.attrs[PARTS])} if PARTS in plan.attrs else {}
    return {"vestige_version": vestige_version(), **processor, **parts}
