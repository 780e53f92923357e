"""Authenticate Galileo signals with ACAS / SAS.

The names in `__all__` are the public interface. Each name is imported at its first use, so `import vestige` loads no
heavy module. `vestige.__version__` is the version of the installed package.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    __version__: str
    from vestige import plots as plots
    from vestige import threats as threats
    from vestige.acas_processor.detectors import EarlyDetector as EarlyDetector
    from vestige.acas_processor.detectors import MaximumDetector as MaximumDetector
    from vestige.acas_processor.monitoring.calibration import hardware_bias_correction_s as hardware_bias_correction_s
    from vestige.acas_processor.position.error_budget import ErrorBudget as ErrorBudget
    from vestige.acas_processor.processor import AcasProcessor as AcasProcessor
    from vestige.campaign.run_scenario import run_scenario
    from vestige.campaign.store.results import Results as Results
    from vestige.campaign.store.results import open_results as open_results
    from vestige.errors import VestigeError as VestigeError
    from vestige.recording.assistance.folder import read_assistance as read_assistance
    from vestige.recording.recording import open_recording as open_recording
    from vestige.recording.snapshots import RecordingSource as RecordingSource
    from vestige.records import Outcome as Outcome
    from vestige.records import Status as Status
    from vestige.records import Verdict as Verdict
    from vestige.scenario.load import load_scenario as load_scenario
    from vestige.scenario.scenario_processor import processor_of as processor_of
    from vestige.simulated.simulated_source import simulate as simulate
    from vestige.theory.thresholds import probability_of_detection as probability_of_detection
    from vestige.theory.thresholds import required_cn0_dbhz as required_cn0_dbhz
    from vestige.theory.thresholds import threshold as threshold
    from vestige.time import GalileoTime as GalileoTime

    run = run_scenario

# Each entry maps a public name to its module, in the order of use. If the name in the module differs from the public
# name, the module is followed by a colon and the name in the module.
_HOME = {
    "open_recording": "recording.recording",
    "read_assistance": "recording.assistance.folder",
    "RecordingSource": "recording.snapshots",
    "AcasProcessor": "acas_processor.processor",
    "EarlyDetector": "acas_processor.detectors",
    "MaximumDetector": "acas_processor.detectors",
    "ErrorBudget": "acas_processor.position.error_budget",
    "Verdict": "records",
    "Status": "records",
    "Outcome": "records",
    "GalileoTime": "time",
    "VestigeError": "errors",
    "hardware_bias_correction_s": "acas_processor.monitoring.calibration",
    "probability_of_detection": "theory.thresholds",
    "required_cn0_dbhz": "theory.thresholds",
    "threshold": "theory.thresholds",
    "load_scenario": "scenario.load",
    "open_results": "campaign.store.results",
    "Results": "campaign.store.results",
    "run": "campaign.run_scenario:run_scenario",
    "simulate": "simulated.simulated_source",
    "processor_of": "scenario.scenario_processor",
}

# Modules that are public as a whole
_MODULES = ("plots", "threats")

_PUBLIC = (*_HOME, *_MODULES)
__all__ = list(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return importlib.import_module("importlib.metadata").version("vestige")
    if name in _MODULES:
        return importlib.import_module(f"vestige.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'vestige' has no attribute {name!r}")
    module, _, attribute = _HOME[name].partition(":")
    return getattr(importlib.import_module(f"vestige.{module}"), attribute or name)


def __dir__() -> list[str]:
    return __all__
