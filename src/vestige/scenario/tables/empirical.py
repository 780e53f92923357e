"""Define the table of a measured ionosphere, whose residuals are in a CSV file."""

from __future__ import annotations

import hashlib
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field, PrivateAttr, computed_field

from vestige.receiver.errors.empirical_ionosphere import EmpiricalIonosphere, read_residuals
from vestige.receiver.errors.ionosphere import PASS_TAU_S, Correlation
from vestige.scenario.toml.toml_file import Section


class EmpiricalIonosphereTable(Section):
    """Table of an `EmpiricalIonosphere` whose samples are in a CSV file.

    The file has the header `e6_minus_e1_m`. Each following line has a number in m.

    Attributes
    ----------
    path
        Path of the CSV file, relative to the folder of the scenario file.
    correlation, tau_s, code_only
        Kind of correlation in time, correlation time in s, and whether the residual delays only the codes and not the
        carriers.
    """

    kind: Literal["empirical"]
    path: Annotated[str, Field(min_length=1)]
    correlation: Correlation = "iid"
    tau_s: Annotated[float, Field(ge=0, le=1e9)] = PASS_TAU_S
    code_only: bool = False

    _samples_m: Float[np.ndarray, " n"] = PrivateAttr()

    def model_post_init(self, context: Any) -> None:
        """Read the samples from the CSV file; `context` gives the folder of the scenario file."""
        folder = context["folder"] if context else Path()
        self._samples_m = read_residuals(folder / self.path)

    @computed_field  # type: ignore[prop-decorator]
    @cached_property
    def samples_sha256(self) -> str:
        """SHA-256 digest of the samples, which are part of the scenario's identity."""
        return hashlib.sha256(self._samples_m.tobytes()).hexdigest()

    def model(self) -> EmpiricalIonosphere:
        """Return the model of the ionosphere that the table describes."""
        return EmpiricalIonosphere(
            samples_m=self._samples_m, correlation=self.correlation, tau_s=self.tau_s, code_only=self.code_only
        )
