from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from builders import START, batch_of, validated_key
from vestige.acas_processor.detectors import EarlyDetector, MaximumDetector
from vestige.acas_processor.processor import AcasProcessor
from vestige.acas_processor.searches.sampled_searches import E1VestigialSearch, E6ExhaustiveSearch
from vestige.acas_processor.searches.sampled_snapshot import block_of
from vestige.constants import E6_CARRIER_HZ, SPEED_OF_LIGHT_MPS
from vestige.crypto.recs.group_delay import OS_ICD_CONVENTION
from vestige.crypto.recs.recs_segment import CipherMode, encrypt
from vestige.errors import VestigeError
from vestige.records import (
    Assistance,
    ChipSequence,
    CorrelatorBank,
    E1Observation,
    GroupDelay,
    Handover,
    Snapshot,
    Status,
    Verdict,
)
from vestige.records.inertial import Accelerations
from vestige.records.time_uncertainty import TimeUncertainty
from vestige.sample_processor.correlator import CorrelatableSamples
from vestige.time import GalileoTime
from vestige.validated_key import ValidatedKey

FS = 10.3e6
RANGE_M = 24_123_456.0
DOPPLER_HZ = 300.0  # on E1


def _key(number: int = 0) -> ValidatedKey:
    return validated_key(START.subframe + 30 * number, bytes([number + 1]) * 16)


def _world(
    *, e6_delay_m: float = 0.0, cn0_dbhz: float = 45.0, seed: int = 1, signal: bool = True, encrypted_under: int = 0
) -> tuple[Snapshot, Assistance]:
    """One satellite: E6 samples, its E1 observation, the RECS, the key."""
    rng = np.random.default_rng(seed)
    chips = ChipSequence.of(
        svid=11,
        transmit_time=START,
        chip_rate_hz=5.115e6,
        chips=(1 - 2 * rng.integers(0, 2, 81_840)).astype(np.int8),
    )
    start_s = 0.079
    t = start_s + np.arange(int(0.02 * FS)) / FS
    sent = t - (RANGE_M + e6_delay_m - DOPPLER_HZ / 1575.42e6 * SPEED_OF_LIGHT_MPS * (t - 0.08)) / SPEED_OF_LIGHT_MPS
    j = np.floor(sent * 5.115e6).astype(int)
    inside = (j >= 0) & (j < chips.chips.size)
    samples = (rng.standard_normal((t.size, 2)) @ [1, 1j]) * np.sqrt(0.5)
    if signal:
        carrier = np.exp(2j * np.pi * ((E6_CARRIER_HZ * (sent - t)) % 1.0))
        samples += np.sqrt(10 ** (cn0_dbhz / 10) / FS) * inside * chips.chips[np.clip(j, 0, 81_839)] * carrier
    batch = replace(batch_of(samples, FS), start=START + start_s)
    observation = E1Observation(
        svid=11,
        pseudorange_m=RANGE_M,
        carrier_phase_cycles=float("nan"),
        doppler_hz=DOPPLER_HZ,
        doppler_rate_hz_per_s=0.0,
        cn0_dbhz=cn0_dbhz - 2,
    )
    snapshot = Snapshot(
        index=0,
        time=START + 0.08,
        received_at=START + start_s + 0.02,
        time_uncertainty_s=1.0,
        observations={11: observation},
        e6=CorrelatableSamples(batch),
    )
    segment = encrypt(chips, _key(encrypted_under).data)
    return snapshot, Assistance(segments=(segment,), keys=(_key(0), _key(1)))


def _verdict(snapshot: Snapshot, assistance: Assistance, processor: AcasProcessor | None = None) -> Verdict:
    processor = processor or AcasProcessor()
    (verdict,) = processor.step(None, block_of(snapshot), assistance).verdicts
    return verdict


@pytest.mark.parametrize("detector", [EarlyDetector(), MaximumDetector(), EarlyDetector(spacing=2)])
def test_authentic(detector: EarlyDetector | MaximumDetector) -> None:
    verdict = _verdict(*_world(), AcasProcessor(detector=detector))
    assert verdict.status is Status.AUTHENTIC
    assert verdict.range_offset_m == pytest.approx(0.0, abs=5.0)  # 0.9 m (1σ) at 45 dBHz, n = 1; 1.3 m for n = 2
    assert verdict.available_at == _key().complete_at


def test_range_offset_has_the_sign_of_the_delay() -> None:
    for delay_m in (-20.0, 20.0):
        assert _verdict(*_world(e6_delay_m=delay_m)).range_offset_m == pytest.approx(delay_m, abs=5.0)


def test_e6_late_by_more_than_the_budget_is_spoofed() -> None:
    assert _verdict(*_world(e6_delay_m=50.0)).status is Status.SPOOFED


def test_encrypted_under_another_key_is_not_detected() -> None:
    verdict = _verdict(*_world(encrypted_under=1))
    assert verdict.status is Status.NOT_DETECTED


def test_no_signal_in_e6() -> None:
    assert _verdict(*_world(signal=False)).status is Status.NOT_DETECTED


def test_the_other_cipher_mode_is_noise() -> None:
    assert _verdict(*_world(), AcasProcessor(cipher_mode=CipherMode.CTR)).status is Status.NOT_DETECTED


def test_too_weak_to_say_anything() -> None:
    verdict = _verdict(*_world(cn0_dbhz=28.0, signal=False))
    assert verdict.status is Status.NOT_AVAILABLE
    assert "probability" in verdict.reason


@pytest.mark.parametrize(
    ("uncertainty_s", "allowed"), [(0.0, True), (5.8, True), (5.95, False), (30.0, False), (float("inf"), False)]
)
def test_samples_must_be_older_than_the_disclosure(uncertainty_s: float, allowed: bool) -> None:
    """The samples end 16.099 s into the subframe; the key is on air from 22 s on: 5.901 s are left."""
    snapshot, assistance = _world()
    verdict = _verdict(replace(snapshot, time_uncertainty_s=uncertainty_s), assistance)
    assert (verdict.status is Status.AUTHENTIC) is allowed
    if not allowed:
        assert verdict.status is Status.NOT_AVAILABLE
        assert "disclosure" in verdict.reason


def test_an_unknown_bound_on_the_clock_is_a_reason_of_its_own() -> None:
    snapshot, assistance = _world()
    verdict = _verdict(replace(snapshot, time_uncertainty_s=math.inf), assistance)
    assert verdict.status is Status.NOT_AVAILABLE
    assert "the upper limit of the receiver clock's error is not known" in verdict.reason


class _Model:
    """E6 that says of itself what it likes."""

    def __init__(self, samples: Any, received_until: GalileoTime, **changes: Any) -> None:
        self.samples, self.received_until, self.changes = samples, received_until, changes
        self.received_from, self.searched = samples.received_from, None

    def correlate(self, handover: Handover, offsets_m: np.ndarray) -> CorrelatorBank:
        return replace(self.samples.correlate(handover, offsets_m), **self.changes)


def test_the_window_that_is_correlated_decides_whatever_the_source_says() -> None:
    """Samples end 5.901 s before the disclosure and the clock is good to 6 s, so an hour earlier must not help."""
    snapshot, assistance = _world()
    earlier = snapshot.received_at + -3600.0
    lying = replace(snapshot, received_at=earlier, e6=_Model(snapshot.e6, earlier), time_uncertainty_s=6.0)
    verdict = _verdict(lying, assistance)
    assert verdict.status is Status.NOT_AVAILABLE
    assert "not provably received" in verdict.reason
    assert _verdict(replace(lying, time_uncertainty_s=5.8), assistance).status is Status.AUTHENTIC
    with pytest.raises(VestigeError, match=r"snapshot 0: received_at: found .*, expected the end of the E6 samples"):
        replace(snapshot, received_at=earlier)


@pytest.mark.parametrize("uncertainty_s", [-1e9, -1e-9, math.nan])
def test_a_snapshot_with_a_negative_time_uncertainty_is_refused(uncertainty_s: float) -> None:
    with pytest.raises(VestigeError, match="time uncertainty"):
        replace(_world()[0], time_uncertainty_s=uncertainty_s)
    with pytest.raises(VestigeError, match="time uncertainty"):
        TimeUncertainty(initial_s=uncertainty_s)


def _unlike(value: float) -> dict[str, Any]:
    """Return what makes a bank whose first tap is a value."""
    taps = np.ones(11, np.complex128)
    taps[0] = value
    return {"taps": taps}


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_not_finite_are_one_line(value: float) -> None:
    snapshot, assistance = _world()
    seen = snapshot.observations[11]
    for name in ("pseudorange_m", "carrier_phase_cycles", "doppler_hz", "doppler_rate_hz_per_s", "cn0_dbhz"):
        if math.isnan(value) and name in ("carrier_phase_cycles", "cn0_dbhz"):
            assert math.isnan(getattr(replace(seen, **{name: value}), name))  # was not measured
            continue
        with pytest.raises(VestigeError, match=f"E1 of E11: {name}: found .* expected a finite number"):
            replace(snapshot, observations={11: replace(seen, **{name: value})})
    for changes in (_unlike(value), {"noise_power": value}):
        with pytest.raises(VestigeError, match=r"E6 of E11: (taps|noise_power)"):
            _verdict(replace(snapshot, e6=_Model(snapshot.e6, snapshot.received_at, **changes)), assistance)
    for off in ({"hardware_bias_e1_e6_s": value}, {"ionosphere_e1_m": {11: value}}):
        with pytest.raises(VestigeError, match="assistance of E11"):
            _verdict(snapshot, replace(assistance, **off))
    sensed = np.zeros((3, 3))
    sensed[1, 2] = value
    with pytest.raises(VestigeError, match="accelerations: acceleration_mps2"):
        Accelerations(start=START, elapsed_s=np.arange(3.0), acceleration_mps2=sensed)


def test_a_dead_front_end_is_no_alarm() -> None:
    snapshot, assistance = _world()
    assert isinstance(snapshot.e6, CorrelatableSamples)
    dead = replace(snapshot.e6.batch, samples=np.zeros_like(snapshot.e6.batch.samples))
    verdict = _verdict(replace(snapshot, e6=CorrelatableSamples(dead)), assistance)
    assert verdict.status is Status.NOT_AVAILABLE
    assert "zero" in verdict.reason


def test_exactly_at_the_disclosure_is_too_late() -> None:
    snapshot, assistance = _world()
    verdict = _verdict(replace(snapshot, received_at=_key().disclosed_at, time_uncertainty_s=0.0), assistance)
    assert verdict.status is Status.NOT_AVAILABLE


def test_what_is_missing_is_named() -> None:
    snapshot, assistance = _world()
    far = replace(snapshot.observations[11], pseudorange_m=RANGE_M + 3e6)  # 10 ms later
    cases = {
        "RECS": (snapshot, replace(assistance, segments=())),
        "key": (snapshot, replace(assistance, keys=(_key(1),))),
        "no E6 samples": (replace(snapshot, e6=None), assistance),
        "do not hold": (replace(snapshot, observations={11: far}), assistance),
    }
    for words, world in cases.items():
        verdict = _verdict(*world)
        assert verdict.status is Status.NOT_AVAILABLE, words
        assert words in verdict.reason


def test_only_the_satellite_and_epoch_of_the_segment() -> None:
    snapshot, assistance = _world()
    (segment,) = assistance.segments
    other = replace(segment, svid=12)
    later = replace(segment, transmit_time=START + 30, key_time=START.subframe + 30)
    for segments, status in [
        ((other,), Status.NOT_AVAILABLE),
        ((later,), Status.NOT_AVAILABLE),
        ((other, segment, later), Status.AUTHENTIC),
    ]:
        assert _verdict(snapshot, replace(assistance, segments=segments)).status is status


def test_corrections_move_the_prediction() -> None:
    snapshot, assistance = _world(e6_delay_m=30.0)
    bias = replace(assistance, hardware_bias_e1_e6_s=30.0 / SPEED_OF_LIGHT_MPS)
    iono = replace(assistance, ionosphere_e1_m={11: 30.0 / 0.517824})
    delays = (
        GroupDelay(svid=11, bgd_e1_e6_s=30.0 / 0.517824 / SPEED_OF_LIGHT_MPS, valid_from=START + -100),
        GroupDelay(svid=11, bgd_e1_e6_s=1e-6, valid_from=START + 100),
        GroupDelay(svid=12, bgd_e1_e6_s=1e-6, valid_from=START + -50),
    )
    for corrected in (bias, iono, replace(assistance, group_delays=delays)):
        assert _verdict(snapshot, corrected).range_offset_m == pytest.approx(0.0, abs=5.0)


def test_settings_that_make_no_sense() -> None:
    with pytest.raises(ValueError, match="level"):
        AcasProcessor(level=9)
    with pytest.raises(ValueError, match="correlators"):
        AcasProcessor(n_taps=2)


def test_the_recs_of_other_times_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """A live receiver may not have them yet; levels 2 and 3 must search for the same with and without."""
    snapshot, assistance = _world()
    own = assistance.segments[0]
    others = tuple(replace(own, transmit_time=START + late) for late in (-30.0, 0.0, 0.4, 30.0, 60.0))
    seen: list[Assistance] = []

    def search(self: E1VestigialSearch, snapshot: Snapshot, assistance: Assistance, *_: object) -> tuple[Any, ...]:
        seen.append(assistance)
        return ()

    monkeypatch.setattr(E1VestigialSearch, "search", search)
    AcasProcessor(level=2).step(None, block_of(snapshot), replace(assistance, segments=others))
    assert [round(one.transmit_time - START, 6) for one in seen[0].segments] == [0.0, 0.4]


@pytest.mark.parametrize("name", ["E1VestigialSearch", "E6ExhaustiveSearch"])
def test_cipher_mode_and_convention_reach_the_searches(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    snapshot, assistance = _world()
    seen: list[Any] = []

    def search(self: Any, *_: object, **__: object) -> tuple[Any, ...]:
        seen.append(self)
        return ()

    monkeypatch.setattr(f"vestige.acas_processor.searches.sampled_searches.{name}.search", search)
    if name == "E6ExhaustiveSearch":
        monkeypatch.setattr(E1VestigialSearch, "search", lambda *_, **__: ())
    else:
        monkeypatch.setattr(E6ExhaustiveSearch, "search", lambda *_, **__: ())
    convention = replace(OS_ICD_CONVENTION, sign=-1)
    processor = AcasProcessor(level=3, cipher_mode=CipherMode.CTR, group_delay_convention=convention)
    processor.step(None, block_of(snapshot), assistance)
    assert seen[0].cipher_mode is CipherMode.CTR
    assert getattr(seen[0], "group_delay_convention", convention) == convention
