"""Make the processor of a campaign again, to compute quantities that the results do not contain."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vestige.acas_processor.processor import AcasProcessor
from vestige.campaign.store.attributes import attributes_of, scenario_of
from vestige.scenario.scenario_processor import Overhead, receiver_processor

if TYPE_CHECKING:
    import xarray


def processor_of_results(results: xarray.Dataset) -> AcasProcessor:
    """Return the processor of a campaign's receiver, with the level and the settings of its scenario.

    `VestigeError` is raised if the results have no valid scenario, or if an attribute is missing or out of its range.
    """
    scenario, attributes = scenario_of(results), attributes_of(results)
    overhead = Overhead(attributes.satellites_expected, attributes.cn0_e1_expected_dbhz)
    return receiver_processor(scenario, overhead, attributes.navigation)
