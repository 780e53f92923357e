from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from builders import START, batch_of, received_batch, satellite
from vestige.constants import E1_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.errors import VestigeError
from vestige.records import Band, SampleBatch
from vestige.records.observation_epoch import ObservationEpoch
from vestige.sample_processor.acquisition import acquire
from vestige.sample_processor.e1_snapshot import measure_e1
from vestige.sample_processor.tracking import tracking_receiver
from vestige.sample_processor.tracking.channel import Channel, correlator_lags, track_together
from vestige.sample_processor.tracking.settings import PLL_DISCRIMINATORS, TrackingSettings
from vestige.sample_processor.tracking.tracking_receiver import (
    TRACKED_STRETCH_S,
    TrackedStretch,
    TrackingReceiver,
    recut,
)

RATE_HZ = 4.1e6
RANGE_M, RATE_MPS = 2.41e7, -350.0


def _sky(duration_s: float = 1.2, seed: int = 4) -> SampleBatch:
    two = [satellite(11, RANGE_M, RATE_MPS, 45.0, 45.0, seed=2), satellite(30, 2.52e7, 120.0, 42.0, 45.0, seed=3)]
    return received_batch(Band.E1, two, duration_s=duration_s, rate_hz=RATE_HZ, seed=seed)


@pytest.fixture(scope="module")
def sky() -> SampleBatch:
    return _sky()


@pytest.fixture(scope="module")
def long_sky() -> SampleBatch:
    return _sky(duration_s=2.0)


@pytest.fixture(scope="module")
def usual(sky: SampleBatch) -> list[ObservationEpoch]:
    """What is tracked in the sky as it is, in one piece and with the usual settings."""
    return _track([sky])


@pytest.fixture(scope="module")
def zeroed(sky: SampleBatch) -> list[ObservationEpoch]:
    """What is tracked if one sample is zero."""
    return _track([_with_sample(sky, 0.0)])


def _with_sample(sky: SampleBatch, value: float) -> SampleBatch:
    samples = sky.samples.copy()
    samples[int(0.9 * RATE_HZ)] = value
    return replace(sky, samples=samples)


def _cut(whole: SampleBatch, places: list[int]) -> list[SampleBatch]:
    edges = [0, *places, whole.samples.size]
    return [
        replace(whole, samples=whole.samples[a:b], first_sample=whole.first_sample + a, start=whole.start + a / RATE_HZ)
        for a, b in pairwise(edges)
        if b > a
    ]


def _epochs(stretches: list[TrackedStretch]) -> list[ObservationEpoch]:
    return [epoch for stretch in stretches for epoch in stretch.epochs]


def _track(batches: list[SampleBatch], **settings: object) -> list[ObservationEpoch]:
    receiver = TrackingReceiver(svids=(11, 17, 30), settings=TrackingSettings(**settings))  # type: ignore[arg-type]
    return _epochs(list(receiver.run(batches)))


@pytest.mark.parametrize("settings", [{}, {"replica": "CBOC"}, {"integration_periods": 5}, {"n_correlators": 11}])
def test_tracks_what_was_sent(sky: SampleBatch, settings: dict[str, object]) -> None:
    epochs = _track([sky], **settings)
    assert len(epochs) >= 7
    last = epochs[-1]
    assert set(last.observations) == {11, 30}
    one = last.observations[11]
    at_s = last.time - START
    # 45 dBHz, 1 Hz: σ 0.5 m; the loop has run for a second only, so it still has noise of the acquisition, 2 m
    assert one.pseudorange_m == pytest.approx(RANGE_M + RATE_MPS * at_s, abs=8.0)
    assert one.doppler_hz == pytest.approx(-RATE_MPS / SPEED_OF_LIGHT_MPS * E1_CARRIER_HZ, abs=0.6)
    assert one.cn0_dbhz == pytest.approx(45.0, abs=2.0)
    moved = one.carrier_phase_cycles - epochs[-4].observations[11].carrier_phase_cycles
    seconds = last.time - epochs[-4].time
    assert moved == pytest.approx(RATE_MPS * seconds / SPEED_OF_LIGHT_MPS * E1_CARRIER_HZ, abs=0.05)
    prompt = np.argmax(np.abs(last.taps[11]))
    assert last.tap_chips[prompt] == 0.0


def test_how_samples_are_cut_changes_no_bit(sky: SampleBatch, usual: list[ObservationEpoch]) -> None:
    whole = usual
    n = sky.samples.size
    for places in ([n // 3], [1, 5, n - 7], list(range(100_000, n, 333_333))):
        cut = _track(_cut(sky, places))
        assert [epoch.time for epoch in cut] == [epoch.time for epoch in whole]
        assert repr([epoch.observations for epoch in cut]) == repr([epoch.observations for epoch in whole])
        for a, b in zip(cut, whole, strict=True):
            assert all(np.array_equal(a.taps[svid], b.taps[svid]) for svid in b.taps)


def test_workers_change_no_bit(sky: SampleBatch) -> None:
    receivers = [TrackingReceiver(svids=(11, 30), workers=n) for n in (1, 3)]
    one, three = (_epochs(list(receiver.run([sky]))) for receiver in receivers)
    assert repr([epoch.observations for epoch in one]) == repr([epoch.observations for epoch in three])


def test_channels_together_are_as_each_alone(sky: SampleBatch) -> None:
    found = [measure_e1(sky, one) for one in acquire(sky, (11, 30), max_stretches=8)]
    channels = [[Channel(one, sky) for one in found if one is not None] for _ in range(2)]
    together = track_together(channels[0], sky.samples, 0)
    assert len(together) == 2
    for tracked, channel in zip(together, channels[1], strict=True):
        alone = channel.run(sky.samples, 0)
        assert alone.periods.size > 250
        assert tracked.periods.tobytes() == alone.periods.tobytes()
        assert np.array_equal(tracked.banks, alone.banks)
    with pytest.raises(ValueError, match="a channel needs"):
        track_together(channels[0], sky.samples, sky.samples.size + 1)
    assert track_together([], sky.samples, 0) == []


def test_a_signal_that_ends_is_lost_and_found_again() -> None:
    whole = _sky(duration_s=4.8)
    samples = whole.samples.copy()
    rng = np.random.default_rng(9)
    off = slice(int(1.0 * RATE_HZ), int(2.2 * RATE_HZ))
    sigma = np.sqrt(np.mean(np.abs(samples) ** 2) / 2)
    count = off.stop - off.start
    samples[off] = sigma * (rng.normal(size=count) + 1j * rng.normal(size=count))
    receiver = TrackingReceiver(svids=(11, 30))
    epochs = _epochs(list(receiver.run([replace(whole, samples=samples)])))
    seen = {round(epoch.time - START, 1): set(epoch.observations) for epoch in epochs}
    assert seen[0.9] == {11, 30}
    assert seen[2.0] == set()
    # a lost signal is searched every second; the noise decides after which search the loops give up: at 3.5 or 4.5 s
    assert seen[4.7] == {11, 30}
    back = next(epoch for epoch in epochs if epoch.time - START > 2.3 and 11 in epoch.observations)
    assert 11 in back.slipped
    error_m = back.observations[11].pseudorange_m - (RANGE_M + RATE_MPS * (back.time - START))
    assert abs(error_m) < 15.0


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 3e38])
def test_samples_that_are_no_numbers_count_as_zero(
    sky: SampleBatch, zeroed: list[ObservationEpoch], value: float
) -> None:
    tracked = _track([_with_sample(sky, value)])
    assert set(tracked[-1].observations) == {11, 30}
    assert repr([epoch.observations for epoch in tracked]) == repr([epoch.observations for epoch in zeroed])
    assert tracked[-1].power_db == zeroed[-1].power_db


def test_a_channel_ends_at_samples_that_are_no_numbers(sky: SampleBatch) -> None:
    found = measure_e1(sky, acquire(sky, (11,))[0])
    assert found is not None
    channel = Channel(found, sky)
    samples = sky.samples.copy()
    samples[int(0.9 * RATE_HZ)] = np.nan
    tracked = channel.run(samples, 0)
    assert channel.lost
    assert np.all(np.isfinite(tracked.banks))
    assert tracked.periods["first_sample"][-1] < 0.9 * RATE_HZ


@pytest.mark.parametrize("offset_hz", [1.0e6, -3.1e5])
def test_a_front_end_beside_e1_gives_the_same_observations(
    sky: SampleBatch, usual: list[ObservationEpoch], offset_hz: float
) -> None:
    carrier = np.exp(-2j * np.pi * offset_hz / RATE_HZ * np.arange(sky.samples.size))
    beside = replace(
        sky,
        samples=(sky.samples * carrier).astype(np.complex64),
        center_frequency_hz=sky.center_frequency_hz + offset_hz,
    )
    plain, moved = usual[-1].observations, _track([beside])[-1].observations
    assert set(plain) == set(moved) == {11, 30}
    for svid, one in plain.items():
        assert moved[svid].pseudorange_m == pytest.approx(one.pseudorange_m, abs=1e-3)
        assert moved[svid].doppler_hz == pytest.approx(one.doppler_hz, abs=1e-5)
        assert moved[svid].cn0_dbhz == pytest.approx(one.cn0_dbhz, abs=1e-3)
        cycles = moved[svid].carrier_phase_cycles - one.carrier_phase_cycles
        assert abs(cycles - round(cycles)) < 1e-5


def test_the_observation_rate_adds_epochs_and_changes_none(sky: SampleBatch, usual: list[ObservationEpoch]) -> None:
    few = {epoch.time: epoch.observations for epoch in usual}
    often = _epochs(list(TrackingReceiver(svids=(11, 17, 30), epochs_per_s=50).run([sky])))
    assert {round((after.time - before.time) * 1e6) for before, after in pairwise(often)} == {20_000}
    common = {epoch.time: epoch.observations for epoch in often if epoch.time in few}
    assert len(common) == len(few)
    seen = [time for time in few if 11 in few[time]]
    assert len(seen) > 3
    for time in seen:
        assert common[time][11].pseudorange_m == pytest.approx(few[time][11].pseudorange_m, abs=1e-6)
        assert common[time][11].doppler_hz == pytest.approx(few[time][11].doppler_hz, abs=1e-6)


@pytest.mark.parametrize("discriminator", PLL_DISCRIMINATORS)
def test_a_phase_jump_is_flagged(long_sky: SampleBatch, discriminator: str) -> None:
    """Half a cycle is solved by the sign of the secondary code; until then there is no observation.

    The next observation is flagged, and no later one. Its carrier phase differs by half a cycle, or by half a cycle and
    whole cycles, from that without the jump.
    """
    samples = long_sky.samples.copy()
    samples[int(0.62 * RATE_HZ) :] *= -1
    epochs = _track([replace(long_sky, samples=samples)], pll_discriminator=discriminator)
    usual = _track([long_sky], pll_discriminator=discriminator)
    seen = {round(epoch.time - START, 1): 11 in epoch.observations for epoch in epochs}
    assert seen[0.6]
    assert not seen[0.7]
    back = next(time for time, there in seen.items() if there and time > 0.7)
    assert back <= 1.2
    assert all(there for time, there in seen.items() if time >= back)
    assert [time for epoch in epochs if 11 in epoch.slipped and (time := round(epoch.time - START, 1)) > 0.6] == [back]
    last, usual_last = (each[-1].observations[11].carrier_phase_cycles for each in (epochs, usual))
    assert (last - usual_last) % 1.0 == pytest.approx(0.5, abs=0.05)


def test_noise_alone_gives_nothing() -> None:
    rng = np.random.default_rng(5)
    samples = (rng.normal(size=2 * int(0.7 * RATE_HZ)).astype(np.float32)).view(np.complex64)
    receiver = TrackingReceiver(svids=(11, 12, 13))
    epochs = _epochs(list(receiver.run([batch_of(samples, RATE_HZ, Band.E1)])))
    assert all(not epoch.observations for epoch in epochs)


@pytest.mark.parametrize("value", [0.0, 127.0])
def test_constant_samples_give_nothing(value: float) -> None:
    samples = np.full(int(0.5 * RATE_HZ), value, np.complex64)
    receiver = TrackingReceiver(svids=(11, 12))
    assert not any(epoch.observations for epoch in _epochs(list(receiver.run([batch_of(samples, RATE_HZ, Band.E1)]))))


def test_all_satellites_are_searched_unless_some_are_named(sky: SampleBatch, monkeypatch: pytest.MonkeyPatch) -> None:
    searched: list[int] = []
    monkeypatch.setattr(tracking_receiver, "acquire", lambda _, svids, **__: searched.extend(svids) or ())
    TrackingReceiver().track(next(recut([sky], TRACKED_STRETCH_S)))
    assert searched == list(range(1, 37))


def test_too_low_a_rate_is_refused() -> None:
    with pytest.raises(VestigeError, match=r"3e\+06 Hz.*0\.34 chips from the prompt.*a rate above 3\.07e\+06 Hz"):
        correlator_lags(TrackingSettings(), 3.0e6)


def test_settings_are_checked() -> None:
    with pytest.raises(VestigeError, match=r"dll_bandwidth_hz = -1\.0, expected a positive number"):
        TrackingSettings(dll_bandwidth_hz=-1.0)
    with pytest.raises(VestigeError, match=r"n_correlators = 6, expected one of 5, 7, 9, 11"):
        TrackingSettings(n_correlators=6)


def test_recut_ends_a_piece_at_a_gap(sky: SampleBatch) -> None:
    first, _, third = _cut(sky, [100_000, 200_000])
    pieces = [(one.first_sample, one.samples.size) for one in recut([first, third], 0.2)]
    assert pieces[0] == (sky.first_sample, 100_000)
    assert pieces[1] == (sky.first_sample + 200_000, round(0.2 * RATE_HZ))


@pytest.mark.parametrize("jump", [123_456, -50_000])
def test_tracking_starts_anew_behind_a_gap(sky: SampleBatch, jump: int) -> None:
    """Samples are lost, or the counter is set back: what was tracked before is not joined to what comes."""
    n = sky.samples.size
    first, second = _cut(sky, [n // 2])
    moved = replace(second, first_sample=second.first_sample + jump, start=second.start + jump / RATE_HZ)
    receiver = TrackingReceiver(svids=(11, 30))
    stretches = list(receiver.run([first, moved]))
    epochs = _epochs(stretches)
    times = [epoch.time for epoch in epochs]
    assert times == sorted(set(times))
    behind = [epoch for epoch in epochs if epoch.time >= max(moved.start, first.end)]
    assert behind
    assert set(behind[-1].observations) == {11, 30}
    assert behind[0].slipped == set(behind[0].observations)
    # the signals are those of before, the clock says another time: the ranges differ by the jump, modulo 100 ms
    at_s = behind[-1].time - START - jump / RATE_HZ
    expected_m = RANGE_M + RATE_MPS * at_s + jump / RATE_HZ * SPEED_OF_LIGHT_MPS
    off_m = behind[-1].observations[11].pseudorange_m - expected_m
    period_m = 0.1 * SPEED_OF_LIGHT_MPS
    assert off_m - round(off_m / period_m) * period_m == pytest.approx(0.0, abs=10.0)
    assert not receiver.time_is_told


def test_a_satellite_is_placed_by_its_own_message(sky: SampleBatch) -> None:
    """A replay whose message is 1 s late is 1 s later than the others, whatever the others say."""
    receiver = TrackingReceiver(svids=(11, 30))
    stretches = receiver.run([sky])
    for _ in range(3):
        next(stretches)
    newest = receiver.tracks[30].newest()
    assert newest is not None
    # a tenth of a second of reception, 0.08 s of travel and a second of replay before
    receiver.tracks[30].zero = START + (round(10 * (newest[0] / RATE_HZ - newest[1] - 0.086)) / 10 - 1.0)
    last = [epoch for stretch in stretches for epoch in stretch.epochs][-1]
    assert last.observations[11].pseudorange_m == pytest.approx(RANGE_M, rel=0.01)
    assert last.observations[30].pseudorange_m == pytest.approx(2.52e7 + SPEED_OF_LIGHT_MPS, rel=0.01)
