"""Identity of a build: source code of vestige, user's parts and kind of CPU, which affect the bits of results.

The kind of CPU affects only sums of samples.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from vestige.source_version import processor_name, vestige_version

if TYPE_CHECKING:
    from vestige.campaign.plan import Plan

PROCESSOR = "processor"  # attribute with the kind of CPU; only a plan whose bits depend on the CPU has this attribute
PARTS = "own_parts"  # attribute of a plan with user's parts, each as `module:Name@digest`


def build_id(plan: Plan) -> dict[str, str]:
    """Return the attributes that must be equal on all machines that measure chunks of one plan."""
    processor: Mapping[str, str] = {PROCESSOR: processor_name()} if PROCESSOR in plan.attrs else {}
    parts: Mapping[str, str] = {PARTS: str(plan.attrs[PARTS])} if PARTS in plan.attrs else {}
    return {"vestige_version": vestige_version(), **processor, **parts}
