"""Identify the build that measures a plan: source code of vestige, classes that the user wrote, and kind of CPU.

Builds with equal identities give results of a plan with equal bits. The kind of CPU belongs to the identity only if the
plan sums samples, because the CPU affects only the bits of these sums.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from vestige.source_version import processor_name, vestige_version

if TYPE_CHECKING:
    from vestige.campaign.plan import Plan

# attribute with the kind of CPU; a plan has this attribute only if the bits of its results depend on the CPU
PROCESSOR = "processor"
PARTS = "own_parts"  # attribute of a plan with the classes that the user wrote, each as `module:Name@digest`


def build_id(plan: Plan) -> dict[str, str]:
    """Return the attributes that must be equal on all machines that measure chunks of one plan."""
    processor: Mapping[str, str] = {PROCESSOR: processor_name()} if PROCESSOR in plan.attrs else {}
    parts: Mapping[str, str] = {PARTS: str(plan.attrs[PARTS])} if PARTS in plan.attrs else {}
    return {"vestige_version": vestige_version(), **processor, **parts}
