from __future__ import annotations

import numpy as np
import pytest

from vestige.records import Band
from vestige.spoofer.between_recs import BetweenRecs
from vestige.spoofer.interference import Jam
from vestige.spoofer.phase import Slipping
from vestige.spoofer.profiles import Ramp
from vestige.spoofer.repeaters import Forgery, LiftOff, Meaconing, Nulling

T = np.array([0.0, 10.0, 20.0])
RISING = Ramp(first=-10.0, last=10.0, start_s=0.0, stop_s=20.0)


def test_repeated_noise_is_power_over_reception_gain() -> None:
    """−10, 0, 10 dB over a reception 10 dB better than the victim's; E1 of a lift-off is made, not repeated."""
    lift_off = LiftOff(delay_m=0.0, power_db=RISING, reception_gain_db=10.0)
    assert lift_off.noise_over_n0(Band.E6, T) == pytest.approx([0.01, 0.1, 1.0])
    assert lift_off.noise_over_n0(Band.E1, T) == pytest.approx([0, 0, 0])
    meacon = Meaconing(delay_s=1e-6, power_db=RISING, reception_gain_db=0.0, start_s=10.0)
    for band in Band:
        assert meacon.noise_over_n0(band, T) == pytest.approx([0, 1.0, 10.0])


def test_a_meaconer_delays_every_band_alike() -> None:
    meacon = Meaconing(delay_s=1e-6, power_db=3.0)
    for band in Band:
        spoofing_signal = meacon.spoofing_signal(band, T)
        assert spoofing_signal is not None
        assert spoofing_signal.delay_m == pytest.approx(np.full(3, 299.792458))
        assert np.all(spoofing_signal.doppler_hz == 0)
    assert Meaconing(delay_s=1e-6, power_db=3.0, bands=(Band.E6,)).spoofing_signal(Band.E1, T) is None
    assert not Meaconing(delay_s=1e-6, power_db=3.0, bands=(Band.E6,)).reacquired


def test_what_a_nuller_leaves() -> None:
    """|1 − g e^{je}|²: −0.5 dB and 5° leave −19.9 dB."""
    spoofing_signal = Nulling(gain_db=-0.5, phase_error_rad=np.radians(5.0)).spoofing_signal(Band.E1, T)
    assert spoofing_signal is not None
    left = 1 + 10 ** (spoofing_signal.power_db / 20) * np.exp(1j * spoofing_signal.phase_rad)
    assert 20 * np.log10(np.abs(left)) == pytest.approx(np.full(3, -19.9), abs=0.05)
    assert Nulling().spoofing_signal(Band.E6, T) is None


def test_phase_follows_the_carrier_of_the_band() -> None:
    lift_off = LiftOff(delay_m=RISING, power_db=0.0)
    for band, carrier_hz in ((Band.E1, 1575.42e6), (Band.E6, 1278.75e6)):
        spoofing_signal = lift_off.spoofing_signal(band, T)
        assert spoofing_signal is not None
        assert spoofing_signal.doppler_hz == pytest.approx([-carrier_hz / 299_792_458] * 2 + [0])


def test_a_slip_counts_from_the_start_of_the_attack() -> None:
    """0.025 Hz: a quarter of a turn 10 s after the start."""
    attack = LiftOff(delay_m=0.0, power_db=0.0, phase=Slipping(slip_hz=0.025, phase_rad=0.2), start_s=10.0)
    spoofing_signal = attack.spoofing_signal(Band.E6, T)
    assert spoofing_signal is not None
    assert spoofing_signal.phase_rad[1:] == pytest.approx([0.2, 0.2 + np.pi / 2])
    assert spoofing_signal.power_db.tolist() == [-np.inf, 0.0, 0.0]


@pytest.mark.parametrize("bands", [(), (Band.E6, Band.E6)])
def test_bands_are_named_once(bands: tuple[Band, ...]) -> None:
    for make in (
        lambda: LiftOff(delay_m=0.0, power_db=0.0, bands=bands),
        lambda: Meaconing(delay_s=1e-6, power_db=0.0, bands=bands),
        lambda: Nulling(bands=bands),
        lambda: BetweenRecs(top_m=9.0, power_db=0.0, period_s=30.0, bands=bands),
        lambda: Jam(j_over_n_db=3.0, bands=bands),
    ):
        with pytest.raises(ValueError, match="expected one band or more, each once"):
            make()


def test_forged_chips_are_on_e6_alone() -> None:
    forgery = Forgery(power_db=9.0)
    assert forgery.spoofing_signal(Band.E1, T) is None
    spoofing_signal = forgery.spoofing_signal(Band.E6, T)
    assert spoofing_signal is not None
    assert spoofing_signal.forged_chips
