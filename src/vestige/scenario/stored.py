"""Read from the results of a campaign the values of its scenario that are needed to evaluate the results.

Results contain the whole scenario as JSON. The JSON alone cannot give a `CampaignScenario`, because JSON cannot express
infinity, and the files of waypoints, profiles and ephemerides may be missing. `campaign_toml` returns the scenario as
TOML text.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from vestige.errors import VestigeError
from vestige.own_parts import is_own, kind_of
from vestige.receiver.errors.accelerometer import Accelerometers
from vestige.receiver.errors.clock import TwoStateClock
from vestige.receiver.simulation import Fidelity
from vestige.scenario.campaign import FrontEndTable, RecsTable
from vestige.scenario.limits import MAX_EPOCHS
from vestige.scenario.tables.error_models import Tracking
from vestige.scenario.tables.own_tables import NamedKind, OrOwn, whose
from vestige.scenario.tables.processor_table import ProcessorTable
from vestige.scenario.tables.sky import PositionTable
from vestige.scenario.toml.toml_file import LARGEST_NUMBER, OURS, OWN, InconsistentSettingsError
from vestige.time import GalileoTime


class _Part(BaseModel):
    """Table from which only the declared keys are used; all other keys are ignored."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class StoredConstellation(NamedKind):
    """Kind of the constellation, and the decrease in dB of C/N0 from the zenith to the horizon."""

    cn0_fall_db: Annotated[float, Field(ge=0, le=40)]


class StoredReceiver(_Part):
    """Values of the table `[receiver]` that are needed to evaluate results; `ReceiverTable` explains the values."""

    cn0_dbhz: Annotated[float, Field(ge=0, le=80)]
    cn0_e1_dbhz: Annotated[float, Field(ge=10, le=80)]
    signal: bool
    sample_rate_hz: Annotated[float, Field(ge=2.6e6, le=100e6)]
    time_uncertainty_s: Annotated[float, Field(ge=0, le=3600)]
    front_end: FrontEndTable
    clock: Annotated[TwoStateClock, OrOwn(None)] | None
    ionosphere: NamedKind | None
    multipath: NamedKind | None
    e1_tracking: Tracking | None
    accelerometers: Accelerometers | None


class StoredAttack(NamedKind):
    """Kind of an attack, and the times of its start and its stop in s after the start of the scenario."""

    start_s: Annotated[float, Field(ge=0, le=LARGEST_NUMBER)] = 0.0
    stop_s: Annotated[float, Field(ge=0, le=LARGEST_NUMBER)] | None = None  # None means that the attack does not stop


class StoredScenario(_Part):
    """Values of a scenario in the results of a campaign; `CampaignScenario` explains the values."""

    kind: Literal["campaign"]
    seed: Annotated[int, Field(ge=0, le=LARGEST_NUMBER)]
    start: str
    epochs: Annotated[int, Field(ge=1, le=MAX_EPOCHS)]
    interval_s: Annotated[float, Field(ge=0.1, le=3600)]
    fidelity: Fidelity
    recs: RecsTable
    receiver: StoredReceiver
    processor: ProcessorTable
    position: PositionTable
    attack: tuple[StoredAttack, ...]
    constellation: StoredConstellation | None

    @field_validator("start")
    @classmethod
    def _a_time(cls, text: str) -> str:
        GalileoTime.parse(text)
        return text

    @property
    def start_time(self) -> GalileoTime:
        """Start of the scenario, from the key `start`."""
        return GalileoTime.parse(self.start)

    @property
    def own_kinds(self) -> tuple[str, ...]:
        """Names `module:Name` of the user's own classes that are needed to evaluate the results."""
        loops, processor = self.receiver.e1_tracking, self.processor
        kinds = [] if loops is None or whose(loops) != OWN else [kind_of(type(loops))]
        return (*kinds, *(one for one in (processor.detector, *processor.checks) if is_own(one)))

    @property
    def recs_interval_s(self) -> float:
        """Time in s between two RECS of a satellite."""
        return self.interval_s * self.recs.every


@lru_cache(maxsize=16)
def stored_scenario(text: str) -> StoredScenario:
    """Return the scenario that the results of a campaign contain.

    `text` is the attribute `scenario` of the results, in JSON. The function raises `VestigeError` if the text is not a
    valid scenario of a campaign.
    """
    try:
        return StoredScenario.model_validate_json(text, strict=True)
    except ValidationError as error:
        first: Any = error.errors(include_url=False)[0]
        place = ".".join(str(one) for one in first["loc"] if one not in (OURS, OWN))
        cause = first.get("ctx", {}).get("error")
        if isinstance(cause, InconsistentSettingsError):  # usually an error in a class that the user wrote
            place = ".".join(one for one in (place, cause.place) if one)
            raise VestigeError(
                f"results of a campaign: scenario: {place}: found {cause.found}, expected {cause.expected}"
            ) from error
        fault = f"{place}: found {first['input']!r:.60}, expected: {first['msg']}".removeprefix(": ")
        if first["type"] == "missing":
            fault = f"found no {place}, expected a value for it"
        raise VestigeError(f"results of a campaign: scenario: {fault}") from error
