"""Simulate attacks without a spoofing signal: jamming, and noise that destroys OSNMA pages but permits tracking."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from vestige.constants import FUNDAMENTAL_FREQUENCY_HZ
from vestige.errors import SettingError
from vestige.records import Band
from vestige.spoofer.attack import CheckedAttack, Jamming
from vestige.spoofer.jammers import WIDEBAND, Jammer
from vestige.spoofer.profiles import Profile, as_profile
from vestige.spoofer.repeaters import BOTH

NOISE_BANDWIDTH_HZ = 2 * FUNDAMENTAL_FREQUENCY_HZ  # width in Hz of main lobe and first side lobes of E6


@dataclass(frozen=True, slots=True, kw_only=True)
class Jam(CheckedAttack):
    """Jammer on one band or on both bands.

    Attributes
    ----------
    j_over_n_db
        Mean power of the jammer over the noise power in dB.
    waveform
        Waveform of the jammer: wideband noise, continuous wave, chirp or pulsed noise.
    bands
        Bands that are jammed. If only E6 is jammed, tracking on E1 continues.
    noise_bandwidth_hz
        Bandwidth in Hz of the noise power N.
    """

    j_over_n_db: Profile
    waveform: Jammer = WIDEBAND
    bands: tuple[Band, ...] = BOTH
    noise_bandwidth_hz: float = NOISE_BANDWIDTH_HZ
    kind: Literal["jamming"] = "jamming"

    def __post_init__(self) -> None:
        CheckedAttack.__post_init__(self)
        if not 1e3 <= self.noise_bandwidth_hz <= 1e9:
            raise SettingError("noise_bandwidth_hz", f"{self.noise_bandwidth_hz:g} Hz", "1 kHz to 1 GHz")

    def jamming(self, band: Band, times_s: Float[np.ndarray, " n"]) -> Jamming | None:
        """Return the jamming waveform that the attack adds to a band; None for a band that is not jammed."""
        if band not in self.bands:
            return None
        level = 10 ** (as_profile(self.j_over_n_db).value(times_s) / 10)
        return Jamming(
            waveform=self.waveform,
            j_over_n=np.where(self.on(times_s), level, 0.0),
            noise_bandwidth_hz=self.noise_bandwidth_hz,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class OsnmaDenial(CheckedAttack):
    """White noise on E1 that permits tracking, but destroys OSNMA pages.

    In a campaign, a key that is on air during the attack is lost, so RECS with this key cannot be decrypted.

    Attributes
    ----------
    j_over_n_db
        Added noise density over N0 in dB. Noise of 10 dB reduces a C/N0 of 37 dBHz to about 27 dBHz.
    """

    j_over_n_db: Profile = 10.0
    kind: Literal["osnma-denial"] = "osnma-denial"

    def noise_over_n0(self, band: Band, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the density of white noise that the attack adds to a band, divided by N0."""
        if band is not Band.E1:
            return np.zeros(times_s.shape)
        return np.where(self.on(times_s), 10 ** (as_profile(self.j_over_n_db).value(times_s) / 10), 0.0)

    def withholds_osnma(self, first_s: float, last_s: float) -> bool:
        """Return whether the attack is on between `first_s` and `last_s`, and has power at one of these two times."""
        hit = self.start_s < last_s and first_s < self.stop_s
        return hit and float(np.max(as_profile(self.j_over_n_db).value(np.array([first_s, last_s])))) > -np.inf
