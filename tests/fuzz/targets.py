"""All readers of what comes from outside."""

from __future__ import annotations

from fuzz import crypto_targets, folder_targets, recording_targets, result_targets

TARGETS = (*crypto_targets.TARGETS, *recording_targets.TARGETS, *folder_targets.TARGETS, *result_targets.TARGETS)
