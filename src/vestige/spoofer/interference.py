"""Attacks without a spoofing signal of their own: jamming, and jamming just enough to break OSNMA."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from vestige.constants import FUNDAMENTAL_FREQUENCY_HZ
from vestige.records import Band
from vestige.spoofer.attack import CheckedAttack, Jamming
from vestige.spoofer.jammers import WIDEBAND, Jammer
from vestige.spoofer.profiles import Profile, as_profile
from vestige.spoofer.repeaters import BOTH

NOISE_BANDWIDTH_HZ = 2 * FUNDAMENTAL_FREQUENCY_HZ  # main lobe of E6 with a first side lobe on each side


@dataclass(frozen=True, slots=True, kw_only=True)
class Jam(CheckedAttack):
    """A jammer.

    Attributes
    ----------
    j_over_n_db
        Its mean power over that of the noise.
    waveform
        Wideband, CW, chirp or pulsed.
    bands
        Bands that are jammed; E6 alone leaves tracking on E1 alone.
    noise_bandwidth_hz
        Bandwidth in which N is meant.
    """

    j_over_n_db: Profile
    waveform: Jammer = WIDEBAND
    bands: tuple[Band, ...] = BOTH
    noise_bandwidth_hz: float = NOISE_BANDWIDTH_HZ
    kind: Literal["jamming"] = "jamming"

    def __post_init__(self) -> None:
        CheckedAttack.__post_init__(self)
        if not 1e3 <= self.noise_bandwidth_hz <= 1e9:
            raise ValueError(f"a noise bandwidth lies between 1 kHz and 1 GHz, found {self.noise_bandwidth_hz:g} Hz")

    def jamming(self, band: Band, times_s: Float[np.ndarray, " n"]) -> Jamming | None:
        """Return the jamming waveform that it adds to a band; None for none."""
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
    """White noise on E1, weak enough to keep tracking and strong enough to break OSNMA pages.

    A key that is on air while the attack is on does not reach the receiver, so its RECS cannot be decrypted.

    Attributes
    ----------
    j_over_n_db
        Noise density that is added, over N0. Some 10 dB take 37 dBHz to 27 dBHz.
    """

    j_over_n_db: Profile = 10.0
    kind: Literal["osnma-denial"] = "osnma-denial"

    def noise_over_n0(self, band: Band, times_s: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the density of white noise that it adds to a band, over N0."""
        if band is not Band.E1:
            return np.zeros(times_s.shape)
        return np.where(self.on(times_s), 10 ** (as_profile(self.j_over_n_db).value(times_s) / 10), 0.0)

    def withholds_osnma(self, first_s: float, last_s: float) -> bool:
        """Return whether it is on at any time between the two."""
        hit = self.start_s < last_s and first_s < self.stop_s
        return hit and float(np.max(as_profile(self.j_over_n_db).value(np.array([first_s, last_s])))) > -np.inf
