"""Define the table `[atmosphere]` of a scenario: troposphere and broadcast ionosphere, both off by default."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from vestige.navigation.inav.ionosphere import BroadcastIonosphere
from vestige.navigation.troposphere import SaastamoinenTroposphere
from vestige.receiver.sky.atmosphere import Atmosphere
from vestige.scenario.toml.toml_file import Section


class NtcmIonosphereTable(Section):
    """Ionosphere of the model NTCM-G; its coefficients are rounded to the resolution of their fields in word 5.

    Attributes
    ----------
    ai0_sfu, ai1_sfu_per_deg, ai2_sfu_per_deg2
        Coefficients of a polynomial in the modified dip latitude in degrees, which gives the effective ionisation level
        in solar flux units.
    """

    kind: Literal["ntcm-g"]
    ai0_sfu: Annotated[float, Field(ge=0, le=511.75)]
    ai1_sfu_per_deg: Annotated[float, Field(ge=-4, le=3.99)] = 0.0
    ai2_sfu_per_deg2: Annotated[float, Field(ge=-0.25, le=0.2499)] = 0.0

    def model(self) -> BroadcastIonosphere:
        """Return the ionosphere model with the rounded coefficients that the satellites send."""
        return BroadcastIonosphere(
            ai0_sfu=self.ai0_sfu, ai1_sfu_per_deg=self.ai1_sfu_per_deg, ai2_sfu_per_deg2=self.ai2_sfu_per_deg2
        ).as_sent()


class AtmosphereTable(Section):
    """Models of the atmosphere's delay of the signals; a model that is left out causes no delay.

    Attributes
    ----------
    troposphere
        Model of the tropospheric delay, which is the same on E1 and E6.
    ionosphere
        Model of the ionospheric delay that the coefficients in the message describe. The simulation adds the residual
        delay of `receiver.ionosphere` to this delay.
    """

    troposphere: SaastamoinenTroposphere | None = None
    ionosphere: NtcmIonosphereTable | None = None

    def models(self) -> Atmosphere:
        """Return the models of the tropospheric and the ionospheric delay."""
        ionosphere = None if self.ionosphere is None else self.ionosphere.model()
        return Atmosphere(troposphere=self.troposphere, ionosphere=ionosphere)
