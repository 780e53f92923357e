"""Compute the columns of the results that contain the simulated truth of the attacks."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from vestige.campaign.plan import Coord, column_table
from vestige.receiver.samples.sampled_epoch import Arrival
from vestige.receiver.simulation import Simulation, e1_error_m
from vestige.receiver.truth import TruthBlock
from vestige.records import Band

_SATELLITE, _ATTACKS = ("epoch", "satellite"), ("epoch", "satellite", "attack")

ATTACK_COLUMNS = column_table(
    ("truth_phase_rad", _SATELLITE, "float32", "rad", "carrier phase of the line of sight on E6"),
    ("truth_prediction_error_m", _SATELLITE, "float64", "m", "delay of the line of sight on E6 after the prediction"),
    ("truth_spoofed", _SATELLITE, "bool", "1", "whether any spoofing signal is on the air"),
    ("truth_spoofer_offset_m", _ATTACKS, "float64", "m", "spoofing signal's delay on E6 after the line of sight"),
    ("truth_spoofer_power_db", _ATTACKS, "float32", "dB", "spoofing signal's power on E6 over the line of sight"),
    ("truth_spoofer_phase_rad", _ATTACKS, "float32", "rad", "spoofing signal's phase on E6 minus the line of sight's"),
    ("truth_noise_rise_db", _SATELLITE, "float32", "dB", "noise density behind an E6 correlator over N0"),
    ("truth_e1_spoofer_offset_m", _ATTACKS, "float64", "m", "spoofing signal's delay on E1 after the line of sight"),
    ("truth_e1_spoofer_power_db", _ATTACKS, "float32", "dB", "spoofing signal's power on E1 over the line of sight"),
    ("truth_e1_noise_rise_db", _SATELLITE, "float32", "dB", "noise density behind an E1 correlator over N0"),
    ("truth_e1_error_m", _SATELLITE, "float64", "m", "error of the E1 pseudorange that the attack causes"),
    ("truth_e1_worst_error_m", _SATELLITE, "float64", "m", "largest E1 error by the attack since the previous epoch"),
    ("truth_e1_captured", _SATELLITE, "bool", "1", "whether E1 tracking is on a spoofing signal"),
)


def attack_coords(simulation: Simulation) -> dict[str, Coord]:
    """Return the coordinates of the attacks: number and kind, and whether the attacker invents the E6 chips."""
    attacks = simulation.spoofer.attacks
    if not attacks:
        return {}
    names = np.array([f"{number} {attack.kind}" for number, attack in enumerate(attacks)])
    # an attack invents the chips of all satellites or of no satellite
    made = [attack.spoofing_signal(Band.E6, np.zeros(1)) for attack in attacks]
    forged = np.array([one is not None and one.forged_chips for one in made])
    return {
        "attack": Coord(dim="attack", values=names, long_name="attack"),
        "forged": Coord(dim="attack", values=forged, long_name="whether the attacker invents its E6 chips"),
    }


def phase_columns(arrived: Arrival) -> dict[str, np.ndarray]:
    """Return the phase column of `ATTACK_COLUMNS` of one satellite; `arrived` is the arrival of E6 at each epoch."""
    return {"truth_phase_rad": np.angle(arrived.carrier)}


def attack_columns(truth: TruthBlock, e1_multipath_m: Float[np.ndarray, " n"]) -> dict[str, np.ndarray]:
    """Return the values of `ATTACK_COLUMNS` of one satellite, except the column of `phase_columns`."""
    on_air = np.concatenate([truth.e1_attack.power_db, truth.e6.power_db], axis=1) > -np.inf
    return {
        "truth_prediction_error_m": truth.iono_diff_m + truth.bias_m - e1_error_m(truth, e1_multipath_m),
        "truth_spoofed": np.any(on_air, axis=1),
        "truth_spoofer_offset_m": truth.e6.delay_m,
        "truth_spoofer_power_db": truth.e6.power_db,
        "truth_spoofer_phase_rad": np.angle(np.exp(1j * truth.e6.phase_rad)),
        "truth_noise_rise_db": 10 * np.log10(1 + truth.e6.rise(Band.E6)),
        "truth_e1_spoofer_offset_m": truth.e1_attack.delay_m,
        "truth_e1_spoofer_power_db": truth.e1_attack.power_db,
        "truth_e1_noise_rise_db": 10 * np.log10(1 + truth.e1_attack.rise(Band.E1)),
        "truth_e1_error_m": truth.e1.error_m,
        "truth_e1_worst_error_m": truth.e1.worst_error_m,
        "truth_e1_captured": truth.e1.captured,
    }
