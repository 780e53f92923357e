"""Every number of the paper that theory determines, to the digits of the list of errata."""

from __future__ import annotations

from decimal import Decimal

import pytest

from vestige.theory.marcum_q import marcum_q
from vestige.theory.paper_numbers import NOT_COMPUTED, PaperNumber, PaperQuantity, paper_numbers
from vestige.theory.thresholds import (
    correlator_amplitude,
    miss_probability,
    overall_pfa,
    probability_of_detection,
    required_cn0_dbhz,
    single_event_pfa,
    swerling1_probability_of_detection,
    threshold,
)

# (row, quantity, unit): the recomputed value with the digits that the list of errata gives
RECOMPUTED = {
    ("1", "30 ns", "m"): "8.99",
    ("1", "10 m", "ns"): "33.4",
    ("1", "10 m", "TECU"): "118.9",
    ("2", "10 ns", "m"): "3.00",
    ("3", "30 ns", "m"): "8.99",
    ("4", "E1 MBOC, 24.552 MHz, 0.1 chip", "m"): "0.40",
    ("4", "E1 BOC(1,1), 14 MHz, 0.25 chip", "m"): "1.07",
    ("4", "E6 bound, 16 ms, 20.46 MHz", "m"): "2.06",
    ("5", "1 ns", "m"): "0.30",
    ("6", "3 chips", "µs"): "0.59",
    ("6", "5 µs", "chips"): "25.6",
    ("7", "chip", "m"): "58.6105",
    ("8", "1/(2 T_I)", "Hz"): "125",
    ("9", "60 m chip", ""): "2.998e8",
    ("9", "exact chip", ""): "3.069e8",
    ("10", "4 ms", "bins"): "80",
    ("10", "8 ms", "bins"): "160",
    ("10", "16 ms", "bins"): "320",
    ("11", "60 m chip, c = 3e8", ""): "2.400e10",
    ("11", "60 m chip", ""): "2.398e10",
    ("11", "exact chip", ""): "2.455e10",
    ("12", "P_fa", ""): "4.1688e-14",
    ("12", "as printed, in float64", ""): "4.1633e-14",
    ("13", "C/N0", "dBHz"): "40.1230",
    ("14", "C/N0", "dBHz"): "37.1970",
    ("15", "C/N0", "dBHz"): "34.2692",
    ("16", "4 → 8 ms", "dB"): "2.926",
    ("16", "8 → 16 ms", "dB"): "2.928",
    ("17", "E1 code period", "s"): "4e-3",
    ("18", "ΔT/δT", ""): "7500",
    ("19", "hypotheses", "times"): "3.2e6",
    ("20", "P_fa", ""): "1.3340e-7",
    ("21", "C/N0", "dBHz"): "37.6541",
    ("21", "with P_fa 1.30e-7", "dBHz"): "37.660",
    ("22", "gain", "dB"): "2.469",
    ("22", "gain, VII", "dB"): "2.469",
    ("23", "ADEV(1 s)", ""): "1.684e-10",
    ("23", "growth in 16 ms", "mm"): "0.12",
    ("23", "in 1 s", "cm"): "5.0",
    ("23", "in 30 s", "m"): "8.30",
    ("25", "lowest range rate", "m/s"): "49.445",
    ("25", "highest", "m/s"): "52.601",
    ("25", "jerk", "m/s³"): "15.65",
    ("25", "Doppler at v, E1", "Hz"): "268.13",
    ("25", "E6", "Hz"): "217.64",
    ("26", "Aω²", "m/s²"): "4.970",
    ("26", "Aω²", "g"): "0.507",
    ("27", "threshold", "σ"): "5.678",
    ("27", "independent taps of 11", ""): "10.7",
    ("27", "false alarm of 11 taps", ""): "1.07e-6",
    ("29", "useful chips", ""): "81840",
    ("29", "RECS body", "ms"): "16.016",
    ("30", "tap distance", "chip"): "0.2559",
    ("30", "span ±", "m"): "75",
    ("30", "correlation of neighbours", ""): "0.744",
    ("31", "P_d", "%"): "99.948",
    ("31", "95 % of the miss rate from", ""): "3.88e-4",
    ("31", "to", ""): "6.82e-4",
    ("31", "as noise alone at", "dBHz"): "33.924",
    ("31", "loss", "dB"): "1.08",
    ("32", "T_I for 99.9995 % at 35 dBHz", "ms"): "16",
    ("32", "T_I for 99.96 % at 34 dBHz", "ms"): "16",
    ("33", "P_d", "%"): "99.999565",
    ("34", "P_d", "%"): "99.960679",
    ("35", "saturated at −30 m", "m"): "-22.5",
    ("35", "amplitude of that tap", "σ"): "4.91",
    ("35", "above threshold", ""): "0.25",
    ("36", "chip", "µs"): "0.1955",
    ("36", "chip", "m"): "58.61",
    ("36", "0.195 µs", "m"): "58.46",
    ("E1", "peak at +3 m", "m"): "3",
    ("E1", "peak at -4 m", "m"): "-4",
    ("E1", "peak at +7.5 m", "m"): "7.5",
    ("E5", "needs A", "m"): "8.90",
    ("E5", "or f", "Hz"): "2.112",
    ("E5", "loss at Aω²", "dB"): "7e-6",
    ("E5", "loss at 9 g", "dB"): "0.0022",
    ("E9", "N, exact chip", ""): "2.455e10",
    ("E9", "C/N0", "dBHz"): "40.126",
    ("E12", "E1 cells", ""): "6.55e5",
    ("E12", "P_fa on E1", ""): "1.5e-9",
    ("E12", "E1 C/N0, 4 ms", "dBHz"): "38.56",
    ("E12", "8 ms", "dBHz"): "35.68",
    ("E12", "16 ms", "dBHz"): "32.79",
    ("E12", "5 × 4 ms", "dBHz"): "32.68",
    ("E12", "end-to-end gain", "dB"): "1.6",
    ("E12", "hypotheses with 11 taps", ""): "82500",
    ("E12", "P_fa", ""): "1.21e-8",
    ("E12", "C/N0", "dBHz"): "38.17",
    ("E12", "E6 gain", "dB"): "1.96",
    ("E14", "E6 bound, 10.23 MHz", "m"): "2.9",
    ("E14", "E6 bound, 20.46 MHz", "m"): "2.06",
    ("E14", "E6 bound, 40.92 MHz", "m"): "1.46",
    ("E14", "at 45 dBHz, 20.46 MHz", "m"): "0.651",
    ("omitted", "half-chip grid, worst", "dB"): "2.50",
    ("omitted", "half-chip grid, mean", "dB"): "1.13",
    ("omitted", "1/(2T) bin, worst", "dB"): "0.91",
    ("omitted", "1/(2T) bin, mean", "dB"): "0.29",
    ("omitted", "15 m grid, worst", "dB"): "1.19",
    ("omitted", "15 m grid, mean", "dB"): "0.57",
    ("omitted", "code Doppler, 5 kHz, 16 ms", "dB"): "0.72",
    ("omitted", "front end 10.23 MHz", "dB"): "0.44",
    ("omitted", "front end 20.46 MHz", "dB"): "0.22",
    ("omitted", "front end 40.92 MHz", "dB"): "0.11",
    ("omitted", "1 bit", "dB"): "1.96",
    ("omitted", "2 bit", "dB"): "0.55",
}

OK = {"2", "8", "9", "10", "11", "13", "14", "15", "16", "18", "20", "29", "31", "34", "35"}
DIFFERS = {"1", "3", "7", "12", "17", "19", "21", "22", "26", "32", "33", "36"}


def rounds_to(value: float, printed: str) -> bool:
    last_digit = float(Decimal((0, (1,), int(Decimal(printed).as_tuple().exponent))))
    return abs(value - float(printed)) <= 0.5000001 * last_digit


@pytest.fixture(scope="module")
def rows() -> dict[str, PaperNumber]:
    return {row.row: row for row in paper_numbers()}


@pytest.fixture(scope="module")
def quantities(rows: dict[str, PaperNumber]) -> dict[tuple[str, str, str], PaperQuantity]:
    return {(row.row, q.name, q.unit): q for row in rows.values() for q in row.quantities}


@pytest.mark.parametrize("key", RECOMPUTED, ids=lambda key: f"{key[0]} {key[1]}")
def test_recomputed(key: tuple[str, str, str], quantities: dict[tuple[str, str, str], PaperQuantity]) -> None:
    assert rounds_to(quantities[key].value, RECOMPUTED[key])


def test_no_quantity_goes_unchecked(quantities: dict[tuple[str, str, str], PaperQuantity]) -> None:
    assert set(quantities) == set(RECOMPUTED)


def test_every_row_is_computed_or_has_a_reason(rows: dict[str, PaperNumber]) -> None:
    numbered = {row for row in rows if row.isdigit()}
    assert numbered | set(NOT_COMPUTED) == {str(i) for i in range(1, 38)}
    assert not numbered & set(NOT_COMPUTED)


def test_verdicts(rows: dict[str, PaperNumber]) -> None:
    assert {row for row, number in rows.items() if number.verdict.startswith("ok")} == OK
    assert {row for row, number in rows.items() if number.verdict.startswith("differs")} == DIFFERS
    assert all(rows[row].remark for row in DIFFERS)


@pytest.mark.parametrize(
    ("value", "printed", "agrees"),
    [
        (4.1688e-14, "4.16e-14", False),
        (4.1633e-14, "4.16e-14", True),
        (40.1230, "40.12", True),
        (37.1970, "37.2", True),
        (37.6541, "37.66", False),
        (-22.5, "-22.5", True),
        (1e3, "", True),
    ],
)
def test_agreement_is_rounding_to_the_printed_digits(value: float, printed: str, agrees: bool) -> None:
    assert PaperQuantity(name="x", value=value, printed=printed).agrees is agrees


@pytest.mark.judged(by="the paper", what="required C/N0 of the searches", figure="the printed digits, at P_d 0.9")
@pytest.mark.parametrize(
    ("hypotheses", "time_s", "pfa", "cn0"),
    [  # the table of detection numbers
        (2.4e10, 4e-3, "4.1688e-14", "40.123"),
        (4.8e10, 8e-3, "2.0844e-14", "37.197"),
        (9.6e10, 16e-3, "1.0422e-14", "34.269"),
        (7500, 4e-3, "1.3340e-7", "37.654"),
        (7500, 8e-3, "1.3340e-7", "34.644"),
        (7500, 16e-3, "1.3340e-7", "31.634"),
        (82_500, 4e-3, "1.2127e-8", "38.168"),
        (82_500, 16e-3, "1.2127e-8", "32.148"),
        (654_720, 4e-3, "1.53e-9", "38.56"),
    ],
)
def test_required_cn0(hypotheses: float, time_s: float, pfa: str, cn0: str) -> None:
    single = single_event_pfa(1e-3, hypotheses)
    assert rounds_to(single, pfa)
    assert rounds_to(required_cn0_dbhz(0.9, time_s, single), cn0)
    assert overall_pfa(single, hypotheses) == pytest.approx(1e-3, rel=1e-12)


@pytest.mark.judged(by="the paper", what="probability of detection in 16 ms", figure="the printed digits, at P_fa 1e-7")
@pytest.mark.parametrize(
    ("cn0", "pd"),
    [(35.0, "0.99999565"), (34.0, "0.99960679"), (33.0, "0.99150641"), (32.0, "0.93607876"), (30.0, "0.52704879")],
)
def test_probability_of_detection_at_16_ms(cn0: float, pd: str) -> None:
    assert rounds_to(probability_of_detection(cn0, 16e-3, 1e-7), pd)


def test_further_numbers_of_the_detection_model() -> None:
    assert rounds_to(threshold(single_event_pfa(1e-3, 2.4e10)), "7.8497")
    assert rounds_to(probability_of_detection(40.12, 4e-3, single_event_pfa(1e-3, 2.4e10)), "0.8994")
    assert rounds_to(miss_probability(35.0, 16e-3, 1e-7), "4.3e-6")
    assert rounds_to(miss_probability(34.0, 16e-3, 1e-7), "3.9e-4")
    for hypotheses, time_s, cn0 in ((2.4e10, 4e-3, 48.62), (4.8e10, 8e-3, 45.71), (9.6e10, 16e-3, 42.80)):
        pd = [
            swerling1_probability_of_detection(cn0 + x, time_s, single_event_pfa(1e-3, hypotheses))
            for x in (-0.005, 0.005)
        ]
        assert pd[0] < 0.9 < pd[1]


@pytest.mark.parametrize(
    ("tap_m", "strength", "fires"), [(0, "10.06", "1"), (15, "7.48", "0.97"), (45, "2.34", "7e-4")]
)
def test_how_often_a_tap_on_the_flank_fires_at_35_dbhz(tap_m: float, strength: str, fires: str) -> None:
    a = correlator_amplitude(35.0, 16e-3) * (1 - tap_m / 58.6105)
    assert rounds_to(a, strength)
    assert rounds_to(marcum_q(a, threshold(1e-7)), fires)


def test_clock_growth_as_phase(quantities: dict[tuple[str, str, str], PaperQuantity]) -> None:
    growth_m = quantities["23", "growth in 16 ms", "mm"].value / 1e3
    assert rounds_to(2 * 3.141592653589793 * growth_m * 1278.75e6 / 299_792_458 * 1e3, "3.3")
