from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.errors import InputFileError
from vestige.receiver.errors.empirical_ionosphere import EmpiricalIonosphere, read_residuals
from vestige.receiver.errors.error_process import named_streams


def test_one_sample_is_a_constant() -> None:
    process = EmpiricalIonosphere(samples_m=np.array([1.25])).process(named_streams(1, 3))
    assert process.advance(np.arange(9.0)).tolist() == [1.25] * 9


def test_two_samples_are_a_line_between_them() -> None:
    """F(−1) = 1/4 and F(3) = 3/4: a quarter of the values at each end, the rest uniform between."""
    process = EmpiricalIonosphere(samples_m=np.array([3.0, -1.0])).process(named_streams(1, 3))
    values = process.advance(np.arange(40_000.0))
    counts = np.array([np.mean(values == -1), np.mean((values > -1) & (values < 1)), np.mean(values == 3)])
    assert counts == pytest.approx([0.25] * 3, abs=5 * np.sqrt(0.25 * 0.75 / 40_000))


@pytest.mark.parametrize("samples", [[], [1.0, np.nan], [np.inf]])
def test_a_distribution_needs_finite_samples(samples: list[float]) -> None:
    with pytest.raises(ValueError, match="samples"):
        EmpiricalIonosphere(samples_m=np.array(samples))


def written(folder: Path, content: bytes) -> Path:
    path = folder / "residuals.csv"
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("end", [b"\n", b"\r\n"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_reads_what_was_written(tmp_path: Path, end: bytes, mark: bytes) -> None:
    path = written(tmp_path, mark + end.join([b"e6_minus_e1_m", b"1.5", b" -2e-1", b"0", b""]))
    assert read_residuals(path).tolist() == [1.5, -0.2, 0.0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "line 1: found '', expected e6_minus_e1_m"),
        (b"metres\n1\n", "line 1: found metres"),
        (b"e6_minus_e1_m\n", "file: found no samples"),
        (b"e6_minus_e1_m\n1.5\n2", "line 3: found no line end"),
        (b"e6_minus_e1_m\n1.5\n\n", "line 3: found"),
        (b"e6_minus_e1_m\n1.5\nnan\n", "line 3: found nan"),
        (b"e6_minus_e1_m\n-inf\n", "line 2: found -inf"),
        (b"e6_minus_e1_m\n1e4\n", "line 2: found 1e4"),
        (b"e6_minus_e1_m\n1_0\n", "line 2: found 1_0"),
        (b"e6_minus_e1_m\n1,2\n", "line 2: found 1,2"),
        ("e6_minus_e1_m\n٣\n".encode(), "line 2: found"),
    ],
)
def test_says_what_is_wrong_and_where(tmp_path: Path, content: bytes, message: str) -> None:
    with pytest.raises(InputFileError) as error:
        read_residuals(written(tmp_path, content))
    assert message.replace("''", "") in str(error.value)


def test_needs_a_regular_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name in ("missing.csv", "pipe", ".", "nul\0"):
        with pytest.raises(InputFileError):
            read_residuals(tmp_path / name)


@given(content=st.binary(max_size=60))
def test_garbage_is_an_error_of_the_file(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = written(tmp_path_factory.getbasetemp(), b"e6_minus_e1_m\n" + content)
    try:
        samples = read_residuals(path)
    except InputFileError:
        return
    assert np.all(np.abs(samples) <= 1000)
