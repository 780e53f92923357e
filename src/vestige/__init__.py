"""vestige: Galileo ACAS / SAS signal authentication.

The names below are the public interface. Each is imported when it is first used, so `import vestige` loads nothing
heavy.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vestige.acas_processor.detectors import EarlyDetector, MaximumDetector
    from vestige.acas_processor.monitoring.calibration import hardware_bias_correction_s
    from vestige.acas_processor.position.error_budget import ErrorBudget
    from vestige.acas_processor.processor import AcasProcessor
    from vestige.campaign.store.results import Results, open_results
    from vestige.errors import VestigeError
    from vestige.recording.assistance.folder import read_assistance
    from vestige.recording.recording import open_recording
    from vestige.recording.snapshots import RecordingSource
    from vestige.records import Outcome, Status, Verdict
    from vestige.scenario.load import load_scenario
    from vestige.scenario.scenario_processor import processor_of
    from vestige.simulated.simulated_source import simulate
    from vestige.theory.thresholds import probability_of_detection, required_cn0_dbhz, threshold
    from vestige.time import GalileoTime

_HOME = {
    "AcasProcessor": "acas_processor.processor",
    "EarlyDetector": "acas_processor.detectors",
    "ErrorBudget": "acas_processor.position.error_budget",
    "GalileoTime": "time",
    "MaximumDetector": "acas_processor.detectors",
    "Outcome": "records",
    "Results": "campaign.store.results",
    "RecordingSource": "recording.snapshots",
    "Status": "records",
    "Verdict": "records",
    "VestigeError": "errors",
    "hardware_bias_correction_s": "acas_processor.monitoring.calibration",
    "load_scenario": "scenario.load",
    "processor_of": "scenario.scenario_processor",
    "open_recording": "recording.recording",
    "open_results": "campaign.store.results",
    "probability_of_detection": "theory.thresholds",
    "read_assistance": "recording.assistance.folder",
    "required_cn0_dbhz": "theory.thresholds",
    "simulate": "simulated.simulated_source",
    "threshold": "theory.thresholds",
}

__all__ = [  # noqa: RUF022  (the order of use)
    "open_recording",
    "read_assistance",
    "RecordingSource",
    "AcasProcessor",
    "EarlyDetector",
    "MaximumDetector",
    "ErrorBudget",
    "Verdict",
    "Status",
    "Outcome",
    "GalileoTime",
    "VestigeError",
    "hardware_bias_correction_s",
    "probability_of_detection",
    "required_cn0_dbhz",
    "threshold",
    "load_scenario",
    "open_results",
    "Results",
    "simulate",
    "processor_of",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'vestige' has no attribute {name!r}")
    return getattr(importlib.import_module(f"vestige.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return __all__
