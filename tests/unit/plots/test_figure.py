from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from vestige.plots.figure import CM_PER_INCH, DPI, FIGURE_FORMATS, dot_size_pt, figure_of, new_axes, time_label, write

SOURCE = Path(__file__).resolve().parents[3] / "src" / "vestige"


@pytest.mark.parametrize("width_cm", [8.0, 17.5])
def test_a_file_is_as_wide_as_asked(tmp_path: Path, width_cm: float) -> None:
    ax = new_axes(height_cm=6.0)
    write(ax, tmp_path / "a.png", width_cm=width_cm)
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == pytest.approx(
            (width_cm / CM_PER_INCH * DPI, 6.0 * width_cm / 8.0 / CM_PER_INCH * DPI), abs=1
        )


@pytest.mark.parametrize(
    ("suffix", "begin"), [("png", b"\x89PNG"), ("PNG", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")]
)
def test_the_suffix_chooses_the_format(tmp_path: Path, suffix: str, begin: bytes) -> None:
    write(new_axes(), tmp_path / f"a.{suffix}")
    assert (tmp_path / f"a.{suffix}").read_bytes().startswith(begin)


@pytest.mark.parametrize("name", ["a", "a.jpeg", "png", "a.png.txt"])
def test_other_formats_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match=", ".join(FIGURE_FORMATS)):
        write(new_axes(), tmp_path / name)
    assert not (tmp_path / name).exists()


def test_axes_of_a_subfigure_belong_to_the_whole_figure() -> None:
    figure = Figure()
    assert figure_of(figure.subfigures(1, 2)[1].subfigures(2, 1)[0].add_subplot()) is figure


def test_long_runs_count_in_thousands_of_seconds() -> None:
    ax = new_axes()
    assert time_label(ax.xaxis, np.array([0.0, 1400.0])) == "time (s)"
    assert time_label(ax.xaxis, np.array([0.0, 99_999.0])) == "time (1000 s)"
    ax.set_xlim(0, 100_000)
    ax.set_xticks([0, 2500, 100_000])
    assert [label.get_text() for label in ax.get_xticklabels()] == ["0", "2.5", "100"]


def test_more_dots_are_smaller() -> None:
    sizes = [dot_size_pt(n) for n in (10, 5000, 100_000)]
    assert sizes == sorted(sizes, reverse=True)
    assert len(set(sizes)) == 3


def test_no_window_and_no_global_state() -> None:
    program = "import sys, vestige.plots\nprint('matplotlib.pyplot' in sys.modules)"
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)  # noqa: S603
    assert result.stdout == "False\n"


def test_matplotlib_is_imported_by_plots_only() -> None:
    importers = {
        path.relative_to(SOURCE).parts[0]
        for path in SOURCE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for name in ([alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""])
        if name.split(".")[0] in {"matplotlib", "mpl_toolkits"}
    }
    assert importers <= {"plots", "cli"}  # cli: for type checking only, held by test_help_loads_nothing_heavy
