"""The commands of CONTRIBUTING.md on each Python that vestige supports, and the package outside of the checkout.

`pipx run nox` runs all of it, `pipx run nox -s test-3.13` one session, `pipx run nox -l` lists them. A Python that is
not installed is skipped. The Makefile has the rules; a session gives it another environment than `.venv`.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import nox

ROOT = Path(__file__).resolve().parent
PYTHONS = ["3.11", "3.12", "3.13"]
# What the wheel must do without a checkout, in this order.
IN_AN_EMPTY_FOLDER = {
    "demo": "demo",
    "init": "init .",
    "harsh": "run scenarios/harsh.toml -o harsh.zarr -j 2",
    "threats": "threats --quick -j 2 -o threats",
}

nox.options.default_venv_backend = "venv"


def _make(session: nox.Session, *targets: str) -> None:
    session.run("make", f"VENV={session.virtualenv.location}", *targets, external=True)


@nox.session(python=PYTHONS)
def test(session: nox.Session) -> None:
    """Run the quick tests, or the paths and options of pytest after `--`."""
    if session.posargs:
        _make(session, "setup")
        session.run("python", "-m", "pytest", *session.posargs)
    else:
        _make(session, "test")


@nox.session(python=PYTHONS[0])
def lint(session: nox.Session) -> None:
    """Check style and layers."""
    _make(session, "lint", "arch")


@nox.session(python=PYTHONS)
def types(session: nox.Session) -> None:
    """Check types."""
    _make(session, "types")


@nox.session(python=PYTHONS[0])
def docs(session: nox.Session) -> None:
    """Build the documentation site."""
    _make(session, "docs")


@nox.session(python=PYTHONS)
def wheel(session: nox.Session) -> None:
    """Build sdist and wheel, and use the wheel in an empty folder: all steps, or those named after `--`."""
    work = Path(session.create_tmp())
    made, folder = work / "dist", work / "empty"
    for earlier in (made, folder):
        shutil.rmtree(earlier, ignore_errors=True)
    folder.mkdir()
    session.install("build")
    session.run("python", "-m", "build", "--outdir", str(made), str(ROOT))  # the wheel is built from the sdist
    (built,) = made.glob("*.whl")
    session.install(str(built))
    session.chdir(folder)
    for step in session.posargs or IN_AN_EMPTY_FOLDER:
        session.run("vestige", *IN_AN_EMPTY_FOLDER[step].split(), env={"PYTHONPATH": None})
