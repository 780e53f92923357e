"""Read attributes and columns of campaign results that are already open, without importing zarr."""

from __future__ import annotations

import hashlib
from typing import Annotated, Any, NamedTuple

import numpy as np
import xarray
from jaxtyping import Float, Int8
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from vestige.campaign.plan import EPOCH
from vestige.errors import VestigeError
from vestige.receiver.simulation import Fidelity
from vestige.scenario.stored import StoredScenario, stored_scenario
from vestige.scenario.toml.toml_file import LARGEST_NUMBER

# name of the attribute with the ephemerides of the satellites, in results of a campaign with a constellation
NAVIGATION_TEXT = "navigation"


class RunAttributes(BaseModel):
    """Attributes of a run that are stored in addition to the scenario."""

    model_config = ConfigDict(extra="ignore", frozen=True, strict=True)

    seed: Annotated[int, Field(ge=0, le=LARGEST_NUMBER)]
    scenario_digest: str  # SHA-256 of the scenario, in hexadecimal digits
    p_fa: Annotated[float, Field(gt=0, lt=1)]  # false-alarm probability of a single correlator
    # threshold of a correlator's magnitude, in standard deviations of the noise in one dimension
    threshold_sigma: Annotated[float, Field(gt=0, le=1000)]
    signal: bool  # whether E6-C was transmitted
    cn0_dbhz: FiniteFloat | None = None  # C/N0 of E6-C; None without a signal
    integration_s: Annotated[float, Field(gt=0, le=10)]  # integration time of a correlator
    fidelity: Fidelity
    satellites_expected: Annotated[int, Field(ge=1, le=100)]
    cn0_e1_expected_dbhz: FiniteFloat
    vestige_version: str = ""  # version of vestige that made the results; empty if the results were not stored
    processor: str | None = None  # kind of CPU; None if the bits of the results do not depend on the CPU
    navigation: str | None = None  # RINEX text of the satellites' ephemerides; None for a single line of sight
    own_parts: str = ""  # classes that the user wrote, each as `module:Name@digest`, with spaces between the classes

    @model_validator(mode="after")
    def _strength_of_a_signal(self) -> RunAttributes:
        if self.signal != (self.cn0_dbhz is not None):
            raise ValueError("cn0_dbhz must be given if signal is true, and must be missing otherwise")
        return self


class CheckColumns(NamedTuple):
    """Results of a single check in a campaign, for n epochs and m satellites."""

    result: Int8[np.ndarray, "n m"]  # result after confirmation: 1 for failed, 0 for passed, −1 for not run
    statistic: Float[np.ndarray, "n m"]  # statistic in the unit of the check; NaN if the check was not run
    threshold: Float[np.ndarray, "n m"]  # threshold in the unit of the check; may be NaN if the check was not run


def scenario_of(results: xarray.Dataset) -> StoredScenario:
    """Return the scenario that the results of a campaign contain.

    The function raises `VestigeError` if the results have no scenario, or the scenario does not agree with its digest.
    """
    return stored_scenario(scenario_text(results))


def scenario_text(results: xarray.Dataset) -> str:
    """Return the JSON text of the scenario that the results of a campaign contain.

    The function raises `VestigeError` if the results have no scenario, or the scenario does not agree with its digest.
    """
    text = results.attrs.get("scenario")
    if not isinstance(text, str) or hashlib.sha256(text.encode()).hexdigest() != results.attrs.get("scenario_digest"):
        raise VestigeError("results of a campaign: scenario: found no text that agrees with its digest, expected one")
    return text


def attributes_of(results: xarray.Dataset) -> RunAttributes:
    """Return the attributes of the run that made the results.

    The function raises `VestigeError` if an attribute is missing or out of its range.
    """
    try:
        return RunAttributes.model_validate(results.attrs)
    except ValidationError as error:
        first: Any = error.errors(include_url=False, include_context=False)[0]
        name = first["loc"][0] if first["loc"] else "signal"
        found = f"no {name}" if first["type"] == "missing" else f"{name} {first['input']!r}"[:60]
        raise VestigeError(
            f"results of a campaign: found {found}, expected the attributes of `vestige run`: {first['msg']}"
        ) from error


def values(results: xarray.Dataset, name: str, *dims: str) -> Float[np.ndarray, "*n"]:
    """Return a variable of the results as float64 with the axes `dims`; by default, `epoch` is the first axis."""
    found = results[name]
    order = dims or (EPOCH, *(str(dim) for dim in found.dims if dim != EPOCH))
    return found.transpose(*order).values.astype(np.float64)


def check_columns(results: xarray.Dataset, name: str) -> CheckColumns:
    """Return the stored result, statistic and threshold of a check for every epoch and satellite.

    The function raises `VestigeError` if the results have no check with this name.
    """
    names = [str(one) for one in results["check"].values] if "check" in results.variables else []
    if name not in names:
        raise VestigeError(f"check: found {name!r}, expected one of {', '.join(names) or 'the checks of a run'}")
    of = results.isel(check=names.index(name)).transpose(EPOCH, "satellite", ...)
    return CheckColumns(
        result=of["check_result"].values.astype(np.int8),
        statistic=of["check_statistic"].values.astype(np.float64),
        threshold=of["check_threshold"].values.astype(np.float64),
    )
