"""E1 observations of a campaign of a sky, which are drawn, against those that the receiver tracks in the sky's samples.

Both have one scenario and one seed, so satellites, clock, ionosphere and multipath are the same. The tracked
observations are those of `vestige track` on the recording, before its samples are rounded to int8. Errors are relative
to the truth.

Error budget: a code loop of 1 Hz has a correlation time of 0.25 s. So 36 s of tracking contain 72 independent values
for a mean and 144 for a spread; the campaign has 400 independent epochs of 1 s. One σ of a spread is 6 % (tracked) and
3.5 % (drawn) for a satellite, and 2.4 % for the ratio of both over eight satellites. Bars on noise are at least 4 σ
wide. Bars on multipath are wider, because 36 s contain few independent fades.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from jaxtyping import Float

from sky_builder import CLEAN, sky_scenario
from vestige.constants import E1_CARRIER_HZ, MEDIAN_TRAVEL_TIME_S, SPEED_OF_LIGHT_MPS
from vestige.receiver.correlators.sky_e1_model import strangers_covariance_s
from vestige.records import Band
from vestige.records.observation_epoch import ObservationEpoch
from vestige.sample_processor.tracking.channel_track import DOPPLER_SPAN_S
from vestige.sample_processor.tracking.settings import TrackingSettings
from vestige.sample_processor.tracking.tracking_receiver import TrackingReceiver
from vestige.scenario.campaign import CampaignScenario
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E1B, E1C
from vestige.simulated.exported_case import AcasTestCase
from vestige.simulated.exported_case_folder import simulated
from vestige.theory.thermal_noise import pll_variance_rad2

RATE_HZ = 12.5e6
RECORDED_S, SETTLED_S = 40, 4.0  # until SETTLED_S the loops pull in
TO_HZ = -E1_CARRIER_HZ / SPEED_OF_LIGHT_MPS
# bandwidth and correlators of the tracking receiver: one sample early, one sample late
AS_TRACKED = f'receiver.e1_tracking={{kind="betz", bandwidth_hz={RATE_HZ}, spacing_chips={2 * 1.023e6 / RATE_HZ}}}'
SCENES = {"noise": (*CLEAN, AS_TRACKED), "shipped": ()}


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Errors of observations, a column for each satellite; the C/N0 is relative to that of E1-C alone."""

    range_m: Float[np.ndarray, "n m"]
    doppler_hz: Float[np.ndarray, "n m"]
    cn0_db: Float[np.ndarray, "n m"]


@dataclass(frozen=True, kw_only=True)
class Compared:
    """Errors of the drawn and of the tracked observations of a scene."""

    svids: tuple[int, ...]
    cn0_dbhz: Float[np.ndarray, " m"]  # C/N0 of E1-C alone
    drawn: Errors
    tracked: Errors

    def ratio(self, name: str) -> float:
        """Return the spread of the tracked over that of the drawn values, as a geometric mean over the satellites."""
        tracked, drawn = (np.std(getattr(one, name), axis=0) for one in (self.tracked, self.drawn))
        return float(np.exp(np.mean(np.log(tracked / drawn))))

    @property
    def expected_loss_db(self) -> Float[np.ndarray, " m"]:
        """Loss of C/N0 that the drawn value leaves out: BOC(1,1) as replica, other satellites, the satellite's E1-B."""
        own_hz = 10 ** (self.cn0_dbhz / 10)
        others = strangers_covariance_s(RATE_HZ)[0, 0] * (np.sum(own_hz) - own_hz)
        aligned = [float(primary_code(E1B, svid).astype(float) @ primary_code(E1C, svid)) for svid in self.svids]
        of_e1b = 10 / 11 * own_hz * np.square(aligned) / E1C.code_length / E1C.chip_rate_hz
        return np.asarray(10 * np.log10(11 / 10 * (1 + others + of_e1b)))


@pytest.fixture(scope="module")
def compared() -> Callable[[str], Compared]:
    """Return the errors of a scene by its name; a scene is tracked once."""
    return cache(lambda name: _compared(_scenario("epochs=400", *SCENES[name])))


def _scenario(*settings: str) -> CampaignScenario:
    return sky_scenario(f"receiver.sample_rate_hz={RATE_HZ}", 'fidelity="samples"', *settings)


def _compared(scenario: CampaignScenario) -> Compared:
    case = AcasTestCase(scenario=scenario, first=0, end=RECORDED_S)
    drawn, cn0_dbhz = _drawn(scenario)
    return Compared(
        svids=tuple(one.svid for one in case.satellites),
        cn0_dbhz=cn0_dbhz[:RECORDED_S].mean(axis=0),
        drawn=drawn,
        tracked=_errors_of_tracking(case, cn0_dbhz[:RECORDED_S].mean(axis=0)),
    )


def _drawn(scenario: CampaignScenario) -> tuple[Errors, Float[np.ndarray, "n m"]]:
    """Return the errors of a campaign at its epochs, and the C/N0 of E1-C alone."""
    receiver = replace(scenario.simulated_receiver, with_taps=False)  # no observation depends on the correlators
    truth = tuple(one.advance(0, scenario.epochs) for one in receiver.truth())
    e1 = receiver.snapshots(0, truth).e1
    range_m = np.stack([one.range_m + one.clock_m + one.ionosphere_m(Band.E1) for one in truth], axis=1)
    rate_mps = np.stack([one.rate_mps + one.clock_drift_mps for one in truth], axis=1)
    cn0_dbhz = np.stack(
        [
            one.cn0_e1_dbhz + 20 * np.log10(own.geometry.amplitude)
            for one, own in zip(scenario.simulations, truth, strict=True)
        ],
        axis=1,
    )
    errors = Errors(
        range_m=e1.pseudorange_m - range_m, doppler_hz=e1.doppler_hz - TO_HZ * rate_mps, cn0_db=e1.cn0_dbhz - cn0_dbhz
    )
    return errors, cn0_dbhz


def _tracked(case: AcasTestCase) -> list[ObservationEpoch]:
    receiver = TrackingReceiver(svids=tuple(one.svid for one in case.satellites))
    return [epoch for piece in receiver.run(simulated(case).record(Band.E1)) for epoch in piece.epochs]


def _errors_of_tracking(case: AcasTestCase, cn0_dbhz: Float[np.ndarray, " m"]) -> Errors:
    """Return the errors of the tracked observations, ten a second; every satellite is always there."""
    start = case.simulation.start
    epochs = [epoch for epoch in _tracked(case) if epoch.time - start > SETTLED_S]
    t_s = np.array([epoch.time - start for epoch in epochs])
    range_m, doppler_hz, strength_dbhz = [], [], []
    for one in case.satellites:
        seen = [epoch.observations[one.svid] for epoch in epochs]
        ionosphere_m = np.interp(t_s - MEDIAN_TRAVEL_TIME_S, one.path.truth.time_s, one.path.ionosphere_m(Band.E1))
        range_m.append(np.array([each.pseudorange_m for each in seen]) - one.path.range_m(t_s) - ionosphere_m)
        doppler_hz.append(np.array([each.doppler_hz for each in seen]) - TO_HZ * one.path.rate_mps(t_s))
        strength_dbhz.append([each.cn0_dbhz for each in seen])
    return Errors(
        range_m=np.stack(range_m, axis=1),
        doppler_hz=np.stack(doppler_hz, axis=1),
        cn0_db=np.array(strength_dbhz).T - cn0_dbhz,
    )


@pytest.mark.judged(
    by="tracking loops on samples",
    what="drawn E1 observations of a sky, noise alone",
    figure="pseudorange: ratio of the spreads within 0.1 of that from the C/N0; C/N0 within 0.25 dB of the known loss",
)
def test_noise_alone(compared: Callable[[str], Compared]) -> None:
    """With bandwidth and correlators of the tracking receiver, the drawn pseudorange has the noise of the tracked one.

    The drawn values leave out known losses of 0.75 dB on average, of 0.86 dB that are measured. So the tracked
    pseudorange has 10 % more noise. The tracked
    Doppler is a difference of phases over 0.1 s; the drawn one is that of a frequency loop and has 3.6 times the noise.
    """
    scene = compared("noise")
    for errors, independent in ((scene.tracked, 72), (scene.drawn, 400)):
        limit_m = 4 * np.std(errors.range_m, axis=0) / np.sqrt(independent)
        assert np.all(np.abs(np.mean(errors.range_m, axis=0)) < limit_m)
    loss_db = -np.mean(scene.tracked.cn0_db, axis=0)
    assert abs(np.mean(scene.drawn.cn0_db)) < 0.03
    assert np.mean(loss_db - scene.expected_loss_db) == pytest.approx(0.0, abs=0.25)
    assert loss_db == pytest.approx(scene.expected_loss_db, abs=0.5)
    assert scene.ratio("range_m") == pytest.approx(10 ** (np.mean(loss_db) / 20), rel=0.1)
    settings = TrackingSettings()
    received_hz = 10 ** ((scene.cn0_dbhz - scene.expected_loss_db) / 10)
    phase_rad2 = pll_variance_rad2(received_hz, bandwidth_hz=settings.pll_bandwidth_hz, integration_s=E1C.period_s)
    in_theory_hz = np.sqrt(2 * phase_rad2) / (2 * np.pi * DOPPLER_SPAN_S)
    assert np.mean(np.std(scene.tracked.doppler_hz, axis=0) / in_theory_hz) == pytest.approx(1.0, abs=0.1)
    assert 0.25 < scene.ratio("doppler_hz") < 0.31


@pytest.mark.judged(
    by="tracking loops on samples",
    what="drawn E1 observations of `scenarios/sky.toml`",
    figure="tracked over drawn spread: pseudorange 0.5 to 0.9, Doppler 0.5 to 0.85; C/N0 0.7 to 1.4 dB lower",
)
def test_the_shipped_sky(compared: Callable[[str], Compared]) -> None:
    """Multipath moves the drawn pseudorange at once; the loop averages fades that are fast against its 1 Hz."""
    scene = compared("shipped")
    tracked_m, drawn_m = (float(np.mean(errors.range_m)) for errors in (scene.tracked, scene.drawn))
    assert abs(drawn_m) < 0.2
    assert abs(tracked_m - drawn_m) < 0.4
    assert 0.5 < scene.ratio("range_m") < 0.9
    assert abs(np.mean(scene.tracked.doppler_hz)) < 0.1
    assert abs(np.mean(scene.drawn.doppler_hz)) < 0.1
    assert 0.5 < scene.ratio("doppler_hz") < 0.85
    assert abs(np.mean(scene.drawn.cn0_db)) < 0.1
    assert 0.7 < -np.mean(scene.tracked.cn0_db) < 1.4
    assert 1.5 < scene.ratio("cn0_db") < 4.0


@pytest.mark.judged(
    by="tracking loops on samples",
    what="drawn E1 pseudorange through a lift-off under a sky",
    figure="within 4 m of the tracked one",
)
def test_a_lift_off_takes_both_along() -> None:
    """A spoofing signal of 6 dB begins aligned and leaves with 2 m/s, 10.5 Hz on the carrier; both follow it.

    Aligned, it triples the amplitude: 9.5 dB. The tracked C/N0 rises by less. Then the two signals beat with 10.5 Hz.
    The C/N0 of the tracking receiver counts the beat as noise and falls by 14 dB. The drawn C/N0 is relative to the
    noise of a code that no satellite sends, and stays 7 dB higher.
    """
    push = 'delay_m={kind="ramp", first=0, last=60, start_s=8, stop_s=38}'
    scenario = _scenario(
        "epochs=26", *CLEAN, "constellation.svids=[7, 24]",
        f'attack=[{{kind="position-push", svids=[7], start_s=5, power_db=6, {push}}}]',
    )  # fmt: skip
    drawn, cn0_dbhz = _drawn(scenario)
    case = AcasTestCase(scenario=scenario, first=0, end=26)
    path, found = case.satellites[0].path, {}
    for epoch in _tracked(case):
        t_s, seen = epoch.time - case.simulation.start, epoch.observations.get(7)
        if seen is not None and epoch.time.fraction == 0.0:
            row = round(t_s)  # epochs are times of transmission: the ramp is 0.2 m further at the drawn value
            range_error_m = seen.pseudorange_m - float(path.range_m(np.array([t_s]))[0])
            doppler_error_hz = seen.doppler_hz - TO_HZ * float(path.rate_mps(np.array([t_s]))[0])
            found[row] = (range_error_m, doppler_error_hz, seen.cn0_dbhz - cn0_dbhz[row, 0])
    rows = np.arange(11, 26)
    range_m, doppler_hz, cn0_db = np.array([found[row] for row in rows.tolist()]).T
    assert range_m == pytest.approx(drawn.range_m[rows, 0], abs=4.0)
    assert range_m[-1] > 20.0
    assert np.mean(doppler_hz - drawn.doppler_hz[rows, 0]) == pytest.approx(0.0, abs=0.5)
    before_db = found[4][2]
    assert found[7][2] - before_db == pytest.approx(6.0, abs=1.0)
    assert drawn.cn0_db[7, 0] == pytest.approx(9.5, abs=0.5)
    assert np.mean(cn0_db) - before_db == pytest.approx(-14.0, abs=2.0)
    assert np.mean(drawn.cn0_db[rows, 0]) == pytest.approx(7.0, abs=1.0)
