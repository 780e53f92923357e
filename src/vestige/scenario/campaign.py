"""Define the scenario of a campaign: a simulated receiver with its error models, and the processing of many epochs.

Tables of models become objects. For example, `[receiver.clock]` with `kind = "two-state"` becomes a `TwoStateClock`. An
error model that is left out has no effect.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Literal, Self

import numpy as np
from jaxtyping import Float
from pydantic import Field, ValidationInfo, field_validator, model_validator

from vestige.constants import SPEED_OF_LIGHT_MPS
from vestige.crypto.recs.recs_segment import LENGTHS, CipherMode
from vestige.navigation.line_of_sight import ReceiverMotion
from vestige.own_parts import digest, is_own, kind_of
from vestige.receiver.correlators.e1_loop import REACQUISITION_S
from vestige.receiver.errors.accelerometer import Accelerometers
from vestige.receiver.front_end.front_end import FrontEnd
from vestige.receiver.simulation import SVID, Fidelity, Simulation
from vestige.receiver.sky.atmosphere import through_atmosphere
from vestige.receiver.sky.meaconer_way import placed_attacks
from vestige.receiver.snapshots.simulated_receiver import SimulatedReceiver
from vestige.receiver.undisturbed_truth import ErrorModels
from vestige.scenario.limits import (
    LARGEST_CLOCK_ERROR_S,
    MAX_EPOCHS,
    check_attacks,
    check_clock,
    check_disclosed,
    check_jammers,
    check_length,
    check_motion,
    check_no_clock_offset,
    check_weak_signal,
    longest_delay_s,
)
from vestige.scenario.on_air.atmosphere_table import AtmosphereTable
from vestige.scenario.on_air.osnma_table import OsnmaTable
from vestige.scenario.tables.empirical import EmpiricalIonosphereTable
from vestige.scenario.tables.error_models import Bias, Clock, Ionosphere, Multipath, Tracking
from vestige.scenario.tables.own_tables import OrOwn, whose
from vestige.scenario.tables.processor_table import ProcessorTable
from vestige.scenario.tables.sky import AnyConstellation, AnyTrajectory, PositionTable, satellites_in_view
from vestige.scenario.toml.toml_file import OWN, InconsistentSettingsError, Section
from vestige.signal_generator.range_model import RangeModel
from vestige.signals.definitions import E6C
from vestige.spoofer.after_disclosure import LONGEST_FORGERY_S
from vestige.spoofer.attack import Attack
from vestige.spoofer.repeaters import Meaconing
from vestige.spoofer.scer import against
from vestige.spoofer.spoofer import Attacks, Spoofer
from vestige.time import GalileoTime

AnyAttack = Annotated[Attacks, Field(discriminator="kind"), OrOwn(Attack)]

_RECS_LOOKED_AT = 300  # intervals are multiples of 0.1 s, so the positions of RECS in a subframe repeat after 300 RECS
_LAST_WEEK = 9999  # last week (year 2191) in which a run may start, so that no run reaches the end of the calendar


class FrontEndTable(Section):
    """Settings of the front end (`FrontEnd`): no filter without `bandwidth_hz`, and no quantiser without `bits`."""

    bandwidth_hz: Annotated[float, Field(ge=1e6, le=200e6)] | None = None
    bits: Literal[1, 2, 3, 8] | None = None
    agc: bool = True
    oversampling: Annotated[int, Field(ge=1, le=16)] = 1
    transition_hz: Annotated[float, Field(ge=1e4, le=200e6)] | None = None

    def front_end(self, sample_rate_hz: float) -> FrontEnd:
        """Return the front end at a sampling rate."""
        return FrontEnd(sample_rate_hz=sample_rate_hz, **dict(self))


class ReceiverTable(Section):
    """Settings of the receiver: signal strength, sampling and error models. Each error model may be left out.

    Attributes
    ----------
    cn0_dbhz, cn0_e1_dbhz
        C/N0 in dBHz of E6-C alone, and of E1-C alone; in a scenario with a sky, the C/N0 at the zenith.
    signal
        Whether E6-C is on air. Without E6-C and without attacks, every detection in E6 is false.
    time_uncertainty_s
        Upper limit of the clock error in s, as the receiver assumes it.
    clock_offset_s
        Constant difference in s of receiver clock minus Galileo System Time, in addition to the error of `clock`. The
        receiver does not know this offset, which may be larger than `time_uncertainty_s`. The offset is possible only
        with the fidelity `correlators`.
    reacquisition_s
        Time in s for which a signal must be present on E1 after a loss of lock or a restart, before the receiver tracks
        the signal. E1 has no measurements during this time.
    e1_multipath
        Whether the reflections of `multipath` also disturb E1.
    accelerometers
        Accelerometers for the inertial check, only in a scenario with a constellation.
    """

    cn0_dbhz: Annotated[float, Field(ge=0, le=80)]
    cn0_e1_dbhz: Annotated[float, Field(ge=10, le=80)]
    signal: bool = True
    sample_rate_hz: Annotated[float, Field(ge=2.6e6, le=100e6)] = 12.5e6
    time_uncertainty_s: Annotated[float, Field(ge=0, le=3600)] = 1.0
    clock_offset_s: Annotated[float, Field(ge=-LONGEST_FORGERY_S, le=LONGEST_FORGERY_S)] = 0.0
    reacquisition_s: Annotated[float, Field(ge=0, le=3600)] = REACQUISITION_S
    front_end: FrontEndTable = FrontEndTable()
    clock: Clock | None = None
    ionosphere: Ionosphere | None = None
    multipath: Multipath | None = None
    e1_tracking: Tracking | None = None
    bias: Bias | None = None
    e1_multipath: bool = False
    accelerometers: Accelerometers | None = None

    @field_validator("front_end")
    @classmethod
    def _at_this_rate(cls, table: FrontEndTable, info: ValidationInfo) -> FrontEndTable:
        if "sample_rate_hz" in info.data:
            table.front_end(info.data["sample_rate_hz"])  # raises an error if the front end is impossible
        return table


class RecsTable(Section):
    """Settings of the RECS: duration, key delay, and number of epochs from one RECS to the next RECS.

    `key_delay` is KDI: 0 if the key is sent in the subframe of the RECS, 1 if the key is sent in the next subframe.
    `cipher_mode` is the AES mode of the encryption; the service has not published the mode.
    """

    duration_ms: Literal[1, 2, 4, 8, 16] = 16
    key_delay: Literal[0, 1] = 1
    every: Annotated[int, Field(ge=1, le=3600)] = 1
    cipher_mode: Literal["cbc", "ctr"] = "cbc"

    @property
    def n_chips(self) -> int:
        """Number of chips in a RECS."""
        return next(length.n_chips for length in LENGTHS if length.duration_ms == self.duration_ms)

    @property
    def integration_s(self) -> float:
        """Duration of a RECS in s."""
        return self.n_chips / E6C.chip_rate_hz


class CampaignScenario(Section):
    """Scenario of a campaign, which simulates many epochs of a receiver.

    Attributes
    ----------
    kind
        Kind of the scenario: `campaign`.
    seed
        Seed of all random numbers.
    start
        Time of epoch 0, on a whole second.
    epochs, interval_s
        Number of epochs, and the time between two epochs in s. Each epoch has a RECS, unless `recs.every` is larger
        than 1.
    fidelity
        Method of the simulation: `samples`, the reference, or `correlators`, which draws correlators from their
        distribution without samples.
    attack
        Attacks, each in a table `[[attack]]`; several attacks may act at the same time.
    constellation, trajectory
        Orbits of the satellites and motion of the receiver, together called a sky. Without these two keys there is a
        single line of sight.
    position
        Standard deviations of pseudoranges in m that the receiver assumes.
    osnma
        Events and keys of the OSNMA operator.
    atmosphere
        Troposphere and broadcast ionosphere of a scenario with a sky.
    """

    kind: Literal["campaign"]
    seed: Annotated[int, Field(ge=0)]
    start: str
    epochs: Annotated[int, Field(ge=1, le=MAX_EPOCHS)]
    interval_s: Annotated[float, Field(ge=0.1, le=3600, multiple_of=0.1)] = 1.0
    fidelity: Fidelity = "samples"
    line_of_sight: RangeModel = RangeModel()
    recs: RecsTable = RecsTable()
    receiver: ReceiverTable
    processor: ProcessorTable = ProcessorTable()
    attack: tuple[AnyAttack, ...] = ()
    constellation: AnyConstellation | None = None
    trajectory: AnyTrajectory | None = None
    position: PositionTable = PositionTable()
    osnma: OsnmaTable = OsnmaTable()
    atmosphere: AtmosphereTable = AtmosphereTable()

    @field_validator("start")
    @classmethod
    def _whole_second(cls, text: str) -> str:
        time = GalileoTime.parse(text)
        if time.fraction:
            raise ValueError("the start must be a whole second")
        if time.week > _LAST_WEEK:
            raise ValueError(f"the start must not be later than week {_LAST_WEEK}")
        return text

    @model_validator(mode="after")
    def _within_limits(self) -> Self:
        duration_s, front_end = self.epochs * self.interval_s, self.receiver.front_end
        check_length(self.fidelity, duration_s)
        check_jammers(front_end.front_end(self.receiver.sample_rate_hz).input_rate_hz, self.attack)
        if self.fidelity == "correlators":
            met = Spoofer(attacks=against(self.attack, SVID, {SVID: self.receiver.cn0_dbhz}))
            check_attacks(front_end.front_end(self.receiver.sample_rate_hz), met)
            check_weak_signal(front_end.front_end(self.receiver.sample_rate_hz), self.receiver.cn0_dbhz)
            check_clock(self.receiver.clock, duration_s, LARGEST_CLOCK_ERROR_S)
        else:
            check_motion(self.line_of_sight, duration_s)
            check_clock(self.receiver.clock, duration_s)
            check_no_clock_offset(self.receiver.clock_offset_s)
        numbers = range(min(_RECS_LOOKED_AT, -(-self.epochs // self.recs.every)))
        sent_s = [self.start_time.second + number * self.interval_s * self.recs.every for number in numbers]
        check_disclosed(self.attack, sent_s, self.recs.key_delay)
        return self

    @model_validator(mode="after")
    def _one_geometry(self) -> Self:
        if self.constellation is None:
            if self.trajectory is not None:
                raise InconsistentSettingsError("trajectory", "no [constellation]", "one, which this key needs")
            for place, given in (
                ("position", self.position != PositionTable()),
                ("osnma", self.osnma != OsnmaTable()),
                ("atmosphere", self.atmosphere != AtmosphereTable()),
                ("receiver.accelerometers", self.receiver.accelerometers is not None),
            ):
                if given:
                    raise InconsistentSettingsError(place, "no [constellation]", "one, which this key needs")
            if self.recs.every != 1:
                raise InconsistentSettingsError("recs.every", self.recs.every, "1 without [constellation]")
            for number, attack in enumerate(self.attack):
                if isinstance(attack, Meaconing) and attack.antenna is not None:
                    raise InconsistentSettingsError(
                        f"attack.{number}.antenna", "no [constellation]", "one, which this key needs"
                    )
            return self
        if self.trajectory is None:
            raise InconsistentSettingsError("trajectory", "nothing", "one, because there is a [constellation]")
        if "line_of_sight" in self.model_fields_set:
            raise InconsistentSettingsError("line_of_sight", "a [constellation] as well", "one of the two")
        check_clock(self.receiver.clock, self.epochs * self.interval_s)
        _ = self.simulations
        return self

    @property
    def start_time(self) -> GalileoTime:
        """Time of epoch 0, from the key `start`."""
        return GalileoTime.parse(self.start)

    @cached_property
    def simulations(self) -> tuple[Simulation, ...]:
        """Simulations of the receiver, one for each satellite."""
        one = self._line_of_sight()
        if self.constellation is None or self.trajectory is None:
            return (one,)
        duration_s, delay_s = self.epochs * self.interval_s, longest_delay_s(self.attack)
        service = self.osnma.service(self.start_time, duration_s)
        sky = satellites_in_view(
            self.constellation,
            self.trajectory,
            self.start_time,
            duration_s=duration_s + max(-self.receiver.clock_offset_s, 0.0),
            longest_delay_s=delay_s + max(self.receiver.clock_offset_s, 0.0),
        )
        cn0_dbhz = {effects.path.ephemeris.svid: self.receiver.cn0_dbhz + effects.nominal_db for effects in sky}
        return tuple(
            replace(
                one,
                n_epochs=-(-self.epochs // self.recs.every),
                interval_s=round(self.interval_s * self.recs.every, 1),
                truth_interval_s=self.interval_s,
                line_of_sight=effects.line_of_sight,
                spoofer=Spoofer(
                    attacks=placed_attacks(
                        against(self.attack, effects.path.ephemeris.svid, cn0_dbhz), effects.path, duration_s
                    )
                ),
                svid=effects.path.ephemeris.svid,
                elevation=effects,
                osnma=service,
                cn0_dbhz=one.cn0_dbhz + effects.nominal_db,
                cn0_e1_dbhz=one.cn0_e1_dbhz + effects.nominal_db,
                longest_delay_s=delay_s,
            )
            for effects in (through_atmosphere(one, self.atmosphere.models()) for one in sky)
        )

    @property
    def simulated_receiver(self) -> SimulatedReceiver:
        """Simulated receiver of all satellites, which makes snapshots from the true ranges and clock.

        A receiver of level 1 on a single line of sight does not track E1 between RECS.
        """
        return SimulatedReceiver(
            simulations=self.simulations,
            fidelity=self.fidelity,
            interval_s=self.interval_s,
            every=self.recs.every,
            accelerometers=self.receiver.accelerometers,
            with_taps=self.constellation is not None or self.processor.level > 1,
        )

    def receiver_motion(self, time_s: Float[np.ndarray, " n"], clock_m: Float[np.ndarray, " n"]) -> ReceiverMotion:
        """Return the true position and motion of the antenna in a scenario with a sky.

        Parameters
        ----------
        time_s
            Times in s after the start, on the receiver's own clock.
        clock_m
            Error of `receiver.clock` at the times `time_s`, multiplied by c, in m; positive if the clock is ahead.

        Raises
        ------
        ValueError
            If the scenario has a single line of sight, which has no position.
        """
        trajectory = next(
            (one.elevation.path.trajectory for one in self.simulations if one.elevation is not None), None
        )
        if trajectory is None:
            raise ValueError("a single line of sight has no position")
        return trajectory.motion(time_s - clock_m / SPEED_OF_LIGHT_MPS - self.receiver.clock_offset_s)

    @property
    def own_parts(self) -> tuple[str, ...]:
        """Classes that the user wrote, each with the digest of its file, for example `module:Name@1f2e3d4c5b6a`.

        The user's classes are error models, attacks, a detector or checks.
        """
        receiver, processor = self.receiver, self.processor
        models = (receiver.clock, receiver.ionosphere, receiver.multipath, receiver.e1_tracking, receiver.bias)
        kinds = [kind_of(type(one)) for one in (*models, *self.attack) if whose(one) == OWN]
        kinds += [one for one in (processor.detector, *processor.checks) if is_own(one)]
        return tuple(f"{kind}@{digest(kind)}" for kind in dict.fromkeys(kinds))

    def replaced(self, **values: object) -> Self:
        """Return a copy of the scenario with some values replaced; the new values are not checked."""
        other = self.model_copy(update=values)
        other.__dict__.pop("simulations", None)  # the cached simulations belong to the old values
        return other

    def simulation(self) -> Simulation:
        """Return the simulation of the receiver on its single line of sight.

        The function raises `ValueError` if the scenario has a sky.
        """
        if self.constellation is not None:
            raise ValueError("a sky has no single line of sight")
        return self.simulations[0]

    def _line_of_sight(self) -> Simulation:
        receiver, ionosphere = self.receiver, self.receiver.ionosphere
        return Simulation(
            seed=self.seed,
            start=self.start_time,
            n_epochs=self.epochs,
            interval_s=self.interval_s,
            line_of_sight=self.line_of_sight,
            models=ErrorModels(
                clock=receiver.clock,
                ionosphere=ionosphere.model() if isinstance(ionosphere, EmpiricalIonosphereTable) else ionosphere,
                multipath=receiver.multipath,
                e1_tracking=receiver.e1_tracking,
                bias=receiver.bias,
                e1_multipath=receiver.e1_multipath,
            ),
            cn0_dbhz=receiver.cn0_dbhz if receiver.signal else -math.inf,
            cn0_e1_dbhz=receiver.cn0_e1_dbhz,
            front_end=receiver.front_end.front_end(receiver.sample_rate_hz),
            time_uncertainty_s=receiver.time_uncertainty_s,
            clock_offset_s=receiver.clock_offset_s,
            reacquisition_s=receiver.reacquisition_s,
            n_chips=self.recs.n_chips,
            key_delay=self.recs.key_delay,
            cipher_mode=CipherMode(self.recs.cipher_mode),
            spoofer=Spoofer(attacks=against(self.attack, SVID, {SVID: receiver.cn0_dbhz})),
        )
