"""Recompute every number of [WFO] that theory determines, and compare the result with the printed value.

This file contains the paper's own inputs and its printed digits. A number agrees if its rounded value has the printed
digits. If a number does not agree, a remark gives the reason, usually with the number of the erratum (E1, E2, …;
docs/paper_map.md). Rows 1 to 37 are in the order of the paper's sections II to VI. A row that is named after an
erratum, such as E1, has numbers that belong to this erratum. The row `omitted` has the sizes of effects that the
paper's theory leaves out.
`NOT_COMPUTED` lists the numbers that theory cannot give, with reasons.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal

import numpy as np
from scipy.special import betaincinv

from vestige.constants import E1_CARRIER_HZ, E6_CARRIER_HZ, GAMMA_E1_E6, SPEED_OF_LIGHT_MPS
from vestige.signals.definitions import E1C, E6C
from vestige.signals.pulse import BOC11
from vestige.theory import losses
from vestige.theory.hypotheses import (
    code_offsets,
    doppler_bins,
    effective_taps,
    exhaustive_hypotheses,
    handover_hypotheses,
)
from vestige.theory.marcum_q import marcum_q
from vestige.theory.range_offset import range_offset_m
from vestige.theory.thermal_noise import dll_noise_m, snapshot_noise_bound_m
from vestige.theory.thresholds import (
    correlator_amplitude,
    overall_pfa,
    probability_of_detection,
    required_cn0_dbhz,
    single_event_pfa,
    threshold,
)

C = SPEED_OF_LIGHT_MPS
CHIP_S = 1 / E6C.chip_rate_hz
CHIP_M = C * CHIP_S
STANDARD_GRAVITY_MPS2 = 9.80665  # exact by definition, CGPM 1901
IONOSPHERE_M3_PER_S2 = 40.3  # the first-order delay is 40.3 TEC / f² [OS-ICD, 5.1.6]

# inputs of the paper; the comments name the sections of [WFO]
CHIP_PRINTED_S = 60.0 / C  # T_c = 60 m, III-D
OVERALL_PFA = 1e-3  # III-D
UNCERTAINTY_S = 30.0  # III-D
SPAN_HZ = 10e3  # ±5 kHz, III-D
PD = 0.9  # III-D
RECS_S = 16e-3  # VI-A
PFA = 1e-7  # VI-A
CN0_DBHZ = 35.0  # VI
TAPS, TAP_M = 11, 15.0  # VI-A
V_MPS, A_M, OMEGA_RAD_S = 51.023, 0.5012, 2 * np.pi * 0.5012  # VI
H0_S, H_MINUS_2_HZ = 7.115e-24, 4.311e-21  # V

NOT_COMPUTED = {
    "24": "percentiles of the station data are not public",
    "28": "a choice: one RECS a second, 100,000 of them",
    "37": "amplitude, period and power of the spoofing profile are not given",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperQuantity:
    """Recomputed value in a row of the comparison, with the value that the paper prints."""

    name: str
    value: float
    unit: str = ""
    digits: str = ".4g"  # format specification with which a table shows the value
    printed: str = ""  # value that the paper prints, in the same unit; "" if the paper prints no value

    @property
    def agrees(self) -> bool:
        """Whether the value rounds to the printed digits, or the paper prints no value."""
        if not self.printed:
            return True
        printed = Decimal(self.printed)
        return abs(Decimal(self.value) - printed) <= Decimal(5).scaleb(int(printed.as_tuple().exponent) - 1)

    @property
    def text(self) -> str:
        """Recomputed value with its unit, rounded as `digits` states."""
        return f"{self.value:{self.digits}} {self.unit}".rstrip()


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperNumber:
    """Row of the comparison: section of the paper, text that the paper prints, and recomputed values."""

    row: str
    where: str
    printed: str
    quantities: tuple[PaperQuantity, ...]
    remark: str = ""

    @property
    def verdict(self) -> str:
        """Result of the comparison (`ok`, `differs`, or empty without a printed value), followed by the remark."""
        word = "ok" if any(quantity.printed for quantity in self.quantities) else ""
        if not all(quantity.agrees for quantity in self.quantities):
            word = "differs"
        return ": ".join(part for part in (word, self.remark) if part)


def paper_numbers() -> tuple[PaperNumber, ...]:
    """Return all rows of the comparison; each call computes all numbers again."""
    return (*_errors(), *_exhaustive(), *_handover(), *_models(), *_results(), *_errata(), *_omitted())


def _row(row: int | str, where: str, printed: str, *quantities: PaperQuantity, remark: str = "") -> PaperNumber:
    return PaperNumber(row=str(row), where=where, printed=printed, quantities=quantities, remark=remark)


def _q(name: str, value: float, unit: str = "", digits: str = ".4g", printed: str = "") -> PaperQuantity:
    return PaperQuantity(name=name, value=float(value), unit=unit, digits=digits, printed=printed)


def _errors() -> list[PaperNumber]:
    """Return rows 1 to 7, which describe delays, range errors and the length of a chip."""
    tecu_m = (GAMMA_E1_E6 - 1) * IONOSPHERE_M3_PER_S2 * 1e16 / E1_CARRIER_HZ**2
    mboc_m = dll_noise_m(CN0_DBHZ, bandwidth_hz=24.552e6, spacing_chips=0.1)
    boc_m = dll_noise_m(CN0_DBHZ, bandwidth_hz=14e6, spacing_chips=0.25, shares={BOC11: 1.0})
    loose = "order of magnitude"
    return [
        _row(
            1, "II-B", "iono 30 ns (10 m)",
            _q("30 ns", 30e-9 * C, "m", ".2f", "10"), _q("10 m", 10 / C * 1e9, "ns", ".1f"),
            _q("10 m", 10 / tecu_m, "TECU", ".1f"),
            remark=loose,
        ),
        _row(2, "II-B", "hardware 10 ns (3 m)", _q("10 ns", 10e-9 * C, "m", ".2f", "3")),
        _row(3, "II-B", "multipath 30 ns (10 m)", _q("30 ns", 30e-9 * C, "m", ".2f", "10"), remark=loose),
        _row(
            4, "II-B", "thermal noise 0.5–1 m",
            _q("E1 MBOC, 24.552 MHz, 0.1 chip", mboc_m, "m", ".2f"),
            _q("E1 BOC(1,1), 14 MHz, 0.25 chip", boc_m, "m", ".2f"),
            _q("E6 bound, 16 ms, 20.46 MHz", snapshot_noise_bound_m(CN0_DBHZ, RECS_S, 20.46e6), "m", ".2f"),
            remark="true for E1; E6 at 35 dBHz has 2.5 m with correlators 15 m apart (E14)",
        ),
        _row(5, "II-A", "ADC about 1 ns", _q("1 ns", 1e-9 * C, "m", ".2f")),
        _row(
            6, "III-B", "a few chips = a few µs",
            _q("3 chips", 3 * CHIP_S * 1e6, "µs", ".2f"), _q("5 µs", 5e-6 / CHIP_S, "chips", ".1f"),
            remark="loose wording (E13)",
        ),
        _row(7, "III-D", "T_c = 60 m", _q("chip", CHIP_M, "m", ".4f", "60"), remark="rounded (E9)"),
    ]  # fmt: skip


def _exhaustive() -> list[PaperNumber]:
    """Return rows 8 to 16, which describe the exhaustive search in E6."""
    n_exact_chip = exhaustive_hypotheses(UNCERTAINTY_S, 4e-3, SPAN_HZ)
    n_exact_c = exhaustive_hypotheses(UNCERTAINTY_S, 4e-3, SPAN_HZ, CHIP_PRINTED_S)
    n_paper = exhaustive_hypotheses(UNCERTAINTY_S, 4e-3, SPAN_HZ, 60.0 / 3e8)  # the printed value uses c = 3e8 m/s
    pfa = single_event_pfa(OVERALL_PFA, n_paper)
    cn0 = [required_cn0_dbhz(PD, k * 4e-3, single_event_pfa(OVERALL_PFA, k * n_paper)) for k in (1, 2, 4)]
    return [
        _row(8, "III-D", "ΔF = 125 Hz", _q("1/(2 T_I)", SPAN_HZ / doppler_bins(SPAN_HZ, 4e-3), "Hz", ".0f", "125")),
        _row(
            9, "III-D", "3e8 code offsets",
            _q("60 m chip", code_offsets(UNCERTAINTY_S, CHIP_PRINTED_S), "", ".3e", "3e8"),
            _q("exact chip", code_offsets(UNCERTAINTY_S), "", ".3e"),
        ),
        _row(
            10, "III-D", "80 bins",
            _q("4 ms", doppler_bins(SPAN_HZ, 4e-3), "bins", ".0f", "80"),
            _q("8 ms", doppler_bins(SPAN_HZ, 8e-3), "bins", ".0f"),
            _q("16 ms", doppler_bins(SPAN_HZ, 16e-3), "bins", ".0f"),
        ),
        _row(
            11, "III-D", "N = 2.4e10",
            _q("60 m chip, c = 3e8", n_paper, "", ".3e", "2.4e10"), _q("60 m chip", n_exact_c, "", ".3e"),
            _q("exact chip", n_exact_chip, "", ".3e"),
        ),
        _row(
            12, "III-D", "P_fa = 4.16e-14",
            _q("P_fa", pfa, "", ".4e", "4.16e-14"),
            _q("as printed, in float64", 1 - (1 - OVERALL_PFA) ** (1 / n_paper), "", ".4e"),
            remark="cancellation in floating point (E6)",
        ),
        _row(13, "III-D", "40.12 dBHz (4 ms)", _q("C/N0", cn0[0], "dBHz", ".4f", "40.12")),
        _row(14, "III-D", "37.2 dBHz (8 ms)", _q("C/N0", cn0[1], "dBHz", ".4f", "37.2")),
        _row(15, "III-D", "34.27 dBHz (16 ms)", _q("C/N0", cn0[2], "dBHz", ".4f", "34.27")),
        _row(
            16, "III-D", "about 2.9 dB a step",
            _q("4 → 8 ms", cn0[0] - cn0[1], "dB", ".3f", "2.9"), _q("8 → 16 ms", cn0[1] - cn0[2], "dB", ".3f", "2.9"),
        ),
    ]  # fmt: skip


def _handover() -> list[PaperNumber]:
    """Return rows 17 to 22, which describe the search in E6 with hand-over from E1."""
    n = handover_hypotheses(UNCERTAINTY_S)
    pfa = single_event_pfa(OVERALL_PFA, n)
    cn0 = required_cn0_dbhz(PD, 4e-3, pfa)
    gain = required_cn0_dbhz(PD, 4e-3, single_event_pfa(OVERALL_PFA, 2.4e10)) - cn0
    return [
        _row(17, "III-E", "δT = 1e-3 s", _q("E1 code period", E1C.period_s, "s", ".0e", "1e-3"), remark="slip (E3)"),
        _row(18, "III-E", "30/4·1e-3 = 7500", _q("ΔT/δT", n, "", ".0f", "7500"), remark="brackets missing (E3)"),
        _row(
            19, "III-E", "a million times less complex",
            _q("hypotheses", 2.4e10 / n, "times", ".1e", "1e6"),
            remark="order of magnitude; 1e2 to 1e3 in run time with FFT",
        ),
        _row(20, "III-E", "P_fa = 1.33e-7", _q("P_fa", pfa, "", ".4e", "1.33e-7")),
        _row(
            21, "III-E", "37.66 dBHz",
            _q("C/N0", cn0, "dBHz", ".4f", "37.66"),
            _q("with P_fa 1.30e-7", required_cn0_dbhz(PD, 4e-3, 1.30e-7), "dBHz", ".3f"),
            remark="last digit (E7)",
        ),
        _row(
            22, "III-E, VII", "2.46 dB; about 2.5 dB",
            _q("gain", gain, "dB", ".3f", "2.46"), _q("gain, VII", gain, "dB", ".3f", "2.5"),
            remark="last digit (E7); on E6 alone (E12)",
        ),
    ]  # fmt: skip


def _models() -> list[PaperNumber]:
    """Return rows 23, 25 and 26, which describe the clock and the dynamics."""
    # spectral densities of the noise that drives the random walk of the frequency, and of the white frequency noise
    drift_psd, bias_psd = 2 * np.pi**2 * H_MINUS_2_HZ, H0_S / 2
    adev = np.sqrt(H0_S / 2 + drift_psd / 3)

    def growth_m(time_s: float) -> float:
        return C * float(np.sqrt(bias_psd * time_s + drift_psd * time_s**3 / 3))

    swing, acceleration = A_M * OMEGA_RAD_S, A_M * OMEGA_RAD_S**2
    return [
        _row(
            23, "V", "h0 = 7.115e-24, h−2 = 4.311e-21",
            _q("ADEV(1 s)", adev, "", ".3e"), _q("growth in 16 ms", growth_m(16e-3) * 1e3, "mm", ".2f"),
            _q("in 1 s", growth_m(1.0) * 1e2, "cm", ".1f"), _q("in 30 s", growth_m(30.0), "m", ".2f"),
        ),
        _row(
            25, "VI", "v 51.023 m/s, A 0.5012 m, ω 2π·0.5012",
            _q("lowest range rate", V_MPS - swing, "m/s", ".3f"), _q("highest", V_MPS + swing, "m/s", ".3f"),
            _q("jerk", A_M * OMEGA_RAD_S**3, "m/s³", ".2f"),
            _q("Doppler at v, E1", V_MPS / C * E1_CARRIER_HZ, "Hz", ".2f"),
            _q("E6", V_MPS / C * E6_CARRIER_HZ, "Hz", ".2f"),
        ),
        _row(
            26, "VI", "max. acceleration about 9 g",
            _q("Aω²", acceleration, "m/s²", ".3f"),
            _q("Aω²", acceleration / STANDARD_GRAVITY_MPS2, "g", ".3f", "9"),
            remark="slip (E5)",
        ),
    ]  # fmt: skip


def _results() -> list[PaperNumber]:
    """Return rows 27 and 29 to 36: harsh conditions without spoofing, and the printed length of a chip."""
    correlation = 1 - TAP_M / CHIP_M
    independent = effective_taps(PFA, TAPS, correlation)
    useful_chips = E6C.chip_rate_hz * RECS_S
    body_chips = np.ceil(useful_chips / 128) * 128  # number of useful chips, rounded up to whole AES blocks of 128 bits
    missed, epochs = 52, 100_000
    noise_only = required_cn0_dbhz(1 - missed / epochs, RECS_S, PFA)
    recs_35, recs_34 = (
        correlator_amplitude(required_cn0_dbhz(pd, 1.0, PFA), 1.0) ** 2 / (2 * 10 ** (cn0 / 10))
        for pd, cn0 in ((0.999995, 35.0), (0.9996, 34.0))
    )
    flank = correlator_amplitude(CN0_DBHZ, RECS_S) * (1 - 2 * TAP_M / CHIP_M)
    saturated = range_offset_m(np.array([[0.5, 1.0, 1.0]]), np.array([1]), 1, np.array([-45.0, -30.0, -15.0]))[0]
    return [
        _row(
            27, "VI-A", "P_fa = 1e-7",
            _q("threshold", threshold(PFA), "σ", ".3f"), _q("independent taps of 11", independent, "", ".1f"),
            _q("false alarm of 11 taps", overall_pfa(PFA, independent), "", ".2e"),
        ),
        _row(
            29, "VI-A", "16 ms",
            _q("useful chips", useful_chips, "", ".0f"), _q("RECS body", body_chips * CHIP_S * 1e3, "ms", ".3f", "16"),
        ),
        _row(
            30, "VI-A", "11 taps × 15 m, about a quarter chip",
            _q("tap distance", TAP_M / CHIP_M, "chip", ".4f"), _q("span ±", TAP_M * (TAPS - 1) / 2, "m", ".0f"),
            _q("correlation of neighbours", correlation, "", ".3f"),
        ),
        _row(
            31, "VI-A", "52 missed of 100,000, P_d = 99.95 %",
            _q("P_d", 100 * (1 - missed / epochs), "%", ".3f", "99.95"),
            _q("95 % of the miss rate from", betaincinv(missed, epochs - missed + 1, 0.025), "", ".2e"),
            _q("to", betaincinv(missed + 1, epochs - missed, 0.975), "", ".2e"),
            _q("as noise alone at", noise_only, "dBHz", ".3f"), _q("loss", CN0_DBHZ - noise_only, "dB", ".2f"),
        ),
        _row(
            32, "VI-A", "T_I = 1e-7",
            _q("T_I for 99.9995 % at 35 dBHz", recs_35 * 1e3, "ms", ".0f", "1e-4"),
            _q("T_I for 99.96 % at 34 dBHz", recs_34 * 1e3, "ms", ".0f", "1e-4"),
            remark="slip, 16 ms (E4)",
        ),
        _row(
            33, "VI-A", "P_d 99.9995 % at 35 dBHz",
            _q("P_d", 100 * probability_of_detection(35.0, RECS_S, PFA), "%", ".6f", "99.9995"),
            remark="truncated (E8)",
        ),
        _row(
            34, "VI-A", "P_d 99.96 % at 34 dBHz",
            _q("P_d", 100 * probability_of_detection(34.0, RECS_S, PFA), "%", ".6f", "99.96"),
        ),
        _row(
            35, "VI-A", "cluster at −22.5 m",
            _q("saturated at −30 m", saturated, "m", ".1f", "-22.5"),
            _q("amplitude of that tap", flank, "σ", ".2f"),
            _q("above threshold", marcum_q(flank, threshold(PFA)), "", ".2f"),
            remark="early detector, n = 1, with the ½ (E2)",
        ),
        _row(
            36, "VI-B", "chip 0.195 µs, 58.7 m",
            _q("chip", CHIP_S * 1e6, "µs", ".4f", "0.195"), _q("chip", CHIP_M, "m", ".2f", "58.7"),
            _q("0.195 µs", 0.195e-6 * C, "m", ".2f"),
            remark="rounded (E9)",
        ),
    ]  # fmt: skip


def _errata() -> list[PaperNumber]:
    """Return rows with numbers that belong to an erratum and not to the paper."""
    n_exact = exhaustive_hypotheses(UNCERTAINTY_S, 4e-3, SPAN_HZ)
    e1 = {
        t: single_event_pfa(OVERALL_PFA, exhaustive_hypotheses(E1C.period_s, t, SPAN_HZ, 1 / E1C.chip_rate_hz))
        for t in (4e-3, 8e-3, 16e-3)
    }
    exhaustive = required_cn0_dbhz(PD, 4e-3, single_event_pfa(OVERALL_PFA, n_exact))
    e1_cn0 = required_cn0_dbhz(PD, 4e-3, e1[4e-3])
    bank_pfa = single_event_pfa(OVERALL_PFA, handover_hypotheses(UNCERTAINTY_S, TAPS))
    bank_cn0 = required_cn0_dbhz(PD, 4e-3, bank_pfa)
    nine_g = 9 * STANDARD_GRAVITY_MPS2
    peaks_m, taps_m = np.array([3.0, -4.0, 7.5]), TAP_M * np.array([-1.0, 0.0, 1.0])
    found_m = range_offset_m(1 - np.abs(taps_m - peaks_m[:, None]) / CHIP_M, np.ones(3, dtype=int), 1, taps_m)
    return [
        _row(
            "E1", "III-C", "Δτ without ½ and sign",
            *(_q(f"peak at {m:+g} m", estimate, "m", "+.1f") for m, estimate in zip(peaks_m, found_m, strict=True)),
            remark="correlators 15 m apart; the printed formula gives 6, 8 and 15 m",
        ),
        _row(
            "E5", "VI", "9 g",
            _q("needs A", nine_g / OMEGA_RAD_S**2, "m", ".2f"),
            _q("or f", np.sqrt(nine_g / A_M) / (2 * np.pi), "Hz", ".3f"),
            _q("loss at Aω²", losses.acceleration_loss_db(A_M * OMEGA_RAD_S**2, RECS_S), "dB", ".0e"),
            _q("loss at 9 g", losses.acceleration_loss_db(nine_g, RECS_S), "dB", ".4f"),
        ),
        _row(
            "E9", "III-D", "N with T_c = 60 m",
            _q("N, exact chip", n_exact, "", ".3e"),
            _q("C/N0", exhaustive, "dBHz", ".3f"),
        ),
        _row(
            "E12", "III-E", "2.5 dB more sensitive",
            _q("E1 cells", exhaustive_hypotheses(E1C.period_s, 4e-3, SPAN_HZ, 1 / E1C.chip_rate_hz), "", ".2e"),
            _q("P_fa on E1", e1[4e-3], "", ".1e"), _q("E1 C/N0, 4 ms", e1_cn0, "dBHz", ".2f"),
            _q("8 ms", required_cn0_dbhz(PD, 8e-3, e1[8e-3]), "dBHz", ".2f"),
            _q("16 ms", required_cn0_dbhz(PD, 16e-3, e1[16e-3]), "dBHz", ".2f"),
            _q("5 × 4 ms", required_cn0_dbhz(PD, 4e-3, e1[4e-3], 5), "dBHz", ".2f"),
            _q("end-to-end gain", exhaustive - e1_cn0, "dB", ".1f"),
            _q("hypotheses with 11 taps", handover_hypotheses(UNCERTAINTY_S, TAPS), "", ".0f"),
            _q("P_fa", bank_pfa, "", ".2e"), _q("C/N0", bank_cn0, "dBHz", ".2f"),
            _q("E6 gain", exhaustive - bank_cn0, "dB", ".2f"),
            remark="true of E6 alone; the detection on E1 needs more",
        ),
        _row(
            "E14", "II-B", "thermal noise 0.5–1 m",
            *(
                _q(f"E6 bound, {mhz} MHz", snapshot_noise_bound_m(CN0_DBHZ, RECS_S, mhz * 1e6), "m", ".2f")
                for mhz in (10.23, 20.46, 40.92)
            ),
            _q("at 45 dBHz, 20.46 MHz", snapshot_noise_bound_m(45.0, RECS_S, 20.46e6), "m", ".2f"),
        ),
    ]  # fmt: skip


def _omitted() -> list[PaperNumber]:
    """Return the row with the sizes of the effects that the paper's theory leaves out."""
    grids = {
        "half-chip grid": losses.code_grid_loss(0.5),
        "1/(2T) bin": losses.doppler_grid_loss(1 / (2 * RECS_S), RECS_S),
        "15 m grid": losses.code_grid_loss(TAP_M / CHIP_M),
    }
    sizes = {
        **{f"{name}, worst": loss.worst_db for name, loss in grids.items()},
        **{f"{name}, mean": loss.mean_db for name, loss in grids.items()},
        "code Doppler, 5 kHz, 16 ms": losses.code_doppler_loss_db(5e3, RECS_S),
        **{f"front end {mhz} MHz": losses.front_end_loss_db(mhz * 1e6) for mhz in (10.23, 20.46, 40.92)},
        **{f"{bits} bit": losses.quantisation_loss_db(bits) for bits in (1, 2)},
    }
    return [_row("omitted", "III-D", "–", *(_q(name, loss_db, "dB", ".2f") for name, loss_db in sizes.items()))]
