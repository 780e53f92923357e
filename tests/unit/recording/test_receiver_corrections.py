from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vestige.errors import InputFileError
from vestige.recording.assistance import receiver_corrections

in_one_folder = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


@in_one_folder
@given(st.floats(-1e-3, 1e-3))
def test_bias_round_trips(tmp_path: Path, bias_s: float) -> None:
    path = receiver_corrections.write_hardware_bias(tmp_path, bias_s)
    assert path.name == "receiver.toml"
    assert receiver_corrections.read_hardware_bias(path) == bias_s


def test_bias_in_metres(tmp_path: Path) -> None:
    path = tmp_path / "receiver.toml"
    path.write_text("hardware_bias_e1_e6_m = -299.792458 # a microsecond\n")
    assert receiver_corrections.read_hardware_bias(path) == pytest.approx(-1e-6, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "keys: found none"),
        ("hardware_bias_e1_e6_s = 1e-9\nhardware_bias_e1_e6_m = 1\n", "keys: found hardware_bias_e1_e6_s, hardware"),
        ("hardware_bias = 1.0\n", "keys: found hardware_bias,"),
        ("hardware_bias_e1_e6_s = -20.6\n", "hardware_bias_e1_e6_s: found -20.6, expected a number, at most ± 0.001"),
        ("hardware_bias_e1_e6_m = nan\n", "found nan"),
        ("hardware_bias_e1_e6_m = true\n", "found True"),
        ("hardware_bias_e1_e6_m = '1'\n", "found 1"),
        ("hardware_bias_e1_e6_m = 1" + "0" * 400 + "\n", "found 1000"),
        ("hardware_bias_e1_e6_m\n", "expected a TOML file"),
    ],
)
def test_what_is_no_bias(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "receiver.toml"
    path.write_text(text)
    with pytest.raises(InputFileError, match=message):
        receiver_corrections.read_hardware_bias(path)


@in_one_folder
@given(st.dictionaries(st.integers(1, 36), st.floats(0, 1000)))
def test_ionosphere_round_trips(tmp_path: Path, delays_m: dict[int, float]) -> None:
    path = receiver_corrections.write_ionosphere(tmp_path, delays_m)
    assert path.name == "ionosphere.csv"
    assert receiver_corrections.read_ionosphere(path) == delays_m


HEADER = "svid,slant_delay_e1_m\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: found"),
        ("svid,delay\n", "line 1: found svid,delay"),
        (HEADER + "11\n", "line 2: found 1 values"),
        (HEADER + "37,1\n", "line 2"),
        (HEADER + "11,1\n\n11,2\n", "line 4: svid: found 11"),
        (HEADER + "11,-1\n", "line 2: slant_delay_e1_m: found -1"),
        (HEADER + "11,nan\n", "found nan"),
        (HEADER + "11,1e999\n", "found 1e999"),
        (HEADER + "11,1", "expected a whole line"),
    ],
)
def test_what_is_no_ionosphere(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "ionosphere.csv"
    path.write_text(text)
    with pytest.raises(InputFileError, match=message):
        receiver_corrections.read_ionosphere(path)


@in_one_folder
@given(
    st.one_of(st.binary(max_size=60), st.text(alphabet="svid,lantdey_e1m\n 0.-#=[]\"'", max_size=60).map(str.encode))
)
def test_garbage(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "file"
    path.write_bytes(data)
    for read in (receiver_corrections.read_hardware_bias, receiver_corrections.read_ionosphere):
        with pytest.raises(InputFileError) as caught:
            read(path)
        assert "\n" not in str(caught.value)
