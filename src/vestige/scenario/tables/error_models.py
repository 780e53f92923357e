"""Define the tables for the errors of a receiver: models of vestige, their presets, or models that the user wrote."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from vestige.receiver.errors.bias import BiasResiduals
from vestige.receiver.errors.clock import TwoStateClock
from vestige.receiver.errors.error_process import BiasModel, ClockModel, IonosphereModel, MultipathModel, TrackingModel
from vestige.receiver.errors.ionosphere import IONOSPHERE_PRESETS, HeavyTailedIonosphere
from vestige.receiver.errors.multipath import MULTIPATH_PRESETS, LmsLiteMultipath
from vestige.receiver.errors.tracking_noise import BetzTrackingNoise
from vestige.scenario.tables.empirical import EmpiricalIonosphereTable
from vestige.scenario.tables.own_tables import OrOwn
from vestige.scenario.tables.preset import Presets

Clock = Annotated[TwoStateClock, OrOwn(ClockModel)]
Ionosphere = Annotated[
    Annotated[HeavyTailedIonosphere, Presets(IONOSPHERE_PRESETS)] | EmpiricalIonosphereTable,
    Field(discriminator="kind"),
    OrOwn(IonosphereModel),
]
Multipath = Annotated[
    LmsLiteMultipath, Presets(MULTIPATH_PRESETS, LmsLiteMultipath.at_elevation), OrOwn(MultipathModel)
]
Tracking = Annotated[BetzTrackingNoise, OrOwn(TrackingModel)]
Bias = Annotated[BiasResiduals, OrOwn(BiasModel)]
