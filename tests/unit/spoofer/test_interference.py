from __future__ import annotations

import numpy as np
import pytest

from vestige.records import Band
from vestige.spoofer.interference import Jam, OsnmaDenial
from vestige.spoofer.jammers import ContinuousWave
from vestige.spoofer.spoofer import Spoofer

T = np.array([0.0, 10.0, 20.0])


def test_a_jammer_hits_its_bands() -> None:
    jam = Jam(j_over_n_db=10.0, start_s=5.0, stop_s=20.0, bands=(Band.E6,))
    assert jam.jamming(Band.E1, T) is None
    jamming = jam.jamming(Band.E6, T)
    assert jamming is not None
    assert jamming.j_over_n == pytest.approx([0.0, 10.0, 0.0])
    assert Spoofer(attacks=(jam,)).effects(Band.E6, 11, T).rise(Band.E6) == pytest.approx([0.0, 10.0, 0.0])


def test_a_line_on_the_carrier_is_heard_by_the_code_of_the_band() -> None:
    """BPSK(5) has its maximum there, B T_c = 4 J/N; BOC(1,1) its null."""
    effects = Spoofer(attacks=(Jam(j_over_n_db=0.0, waveform=ContinuousWave()),)).effects(Band.E1, 11, T)
    assert effects.rise(Band.E6) == pytest.approx(np.full(3, 4.0))
    assert effects.rise(Band.E1) == pytest.approx(np.zeros(3), abs=1e-9)


@pytest.mark.parametrize(
    ("first_s", "last_s", "lost"), [(0.0, 9.0, False), (9.0, 11.0, True), (12.0, 15.0, True), (20.0, 22.0, False)]
)
def test_keys_that_are_on_air_meanwhile_are_lost(first_s: float, last_s: float, lost: bool) -> None:
    assert OsnmaDenial(start_s=10.0, stop_s=20.0).withholds_osnma(first_s, last_s) is lost


def test_osnma_denial_weakens_e1_alone() -> None:
    """10 dB of noise on top of the noise: 10.4 dB less C/N0."""
    denial = OsnmaDenial(j_over_n_db=10.0)
    assert 10 * np.log10(1 + denial.noise_over_n0(Band.E1, T)) == pytest.approx(np.full(3, 10.414), abs=1e-3)
    assert not np.any(denial.noise_over_n0(Band.E6, T))
