"""The table of an ionosphere that somebody measured: a file of residuals beside the scenario."""

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
    """An `EmpiricalIonosphere` whose samples stand in a CSV file (`e6_minus_e1_m`, then one number a line).

    Attributes
    ----------
    path
        The file; a relative path starts at the scenario file.
    correlation, tau_s, code_only
        Memory, its correlation time in s, and whether the residual leaves the carriers alone.
    """

    kind: Literal["empirical"]
    path: Annotated[str, Field(min_length=1)]
    correlation: Correlation = "iid"
    tau_s: Annotated[float, Field(ge=0, le=1e9)] = PASS_TAU_S
    code_only: bool = False

    _samples_m: Float[np.ndarray, " n"] = PrivateAttr()

    def model_post_init(self, context: Any) -> None:
        """Read the file; the context of the validation says in which folder the scenario stands."""
        folder = context["folder"] if context else Path()
        self._samples_m = read_residuals(folder / self.path)

    @computed_field  # type: ignore[prop-decorator]
    @cached_property
    def samples_sha256(self) -> str:
        """Digest of the samples: with other ones it is another scenario."""
        return hashlib.sha256(self._samples_m.tobytes()).hexdigest()

    def model(self) -> EmpiricalIonosphere:
        """Return the model."""
        return EmpiricalIonosphere(
            samples_m=self._samples_m, correlation=self.correlation, tau_s=self.tau_s, code_only=self.code_only
        )
