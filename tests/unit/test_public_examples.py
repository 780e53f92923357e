"""The public interface can be read and copied: each name has an example that runs, and explains what it takes."""

from __future__ import annotations

import doctest
import importlib.metadata
import inspect
import shutil
from enum import EnumType
from pathlib import Path
from types import ModuleType

import pytest

import vestige as vs
from code_blocks import ROOT
from night import done
from vestige.cli.recordings.simulate import command as simulate

NAMES = [name for name in vs.__all__ if name != "plots"]  # a figure is no example that can be compared
ONE_RECS = ("--epochs", "0:1", "--set", "receiver.sample_rate_hz=6.2e6", "--set", "receiver.cn0_dbhz=45")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the examples name: the scenarios of the project, and `night/`, a recording of one RECS."""
    made = tmp_path_factory.mktemp("examples")
    shutil.copytree(ROOT / "scenarios", made / "scenarios")
    done(simulate, made / "scenarios" / "quick.toml", "-o", made / "night", *ONE_RECS)
    return made


@pytest.mark.parametrize("name", NAMES)
def test_the_example_of_a_public_name_runs(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    shutil.rmtree(folder / "quick.zarr", ignore_errors=True)
    parser, runner = doctest.DocTestParser(), doctest.DocTestRunner(verbose=False)
    text = inspect.getdoc(getattr(vs, name)) or ""
    test = parser.get_doctest(text, {}, name, None, 0)
    assert test.examples
    said: list[str] = []
    runner.run(test, out=said.append)
    assert runner.failures == 0, "".join(said)


def section(text: str, title: str) -> str:
    """Return a section of a numpydoc docstring, empty if it has none."""
    _, _, rest = text.partition(f"\n{title}\n{'-' * len(title)}\n")
    return rest.split("\n\n", 1)[0]


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_explains_what_it_takes_and_returns(name: str) -> None:
    value = getattr(vs, name)
    if isinstance(value, ModuleType):
        return
    text = inspect.getdoc(value) or ""
    assert text.split("\n")[0].endswith("."), name
    explained = section(text, "Attributes") + section(text, "Parameters")
    is_enum = isinstance(value, EnumType)
    names = list(value.__members__ if is_enum else inspect.signature(value).parameters)
    entries = [one.strip() for line in explained.splitlines() if line[:1].strip() for one in line.split(",")]
    assert [one for one in names if one not in entries] == [], name
    if inspect.isfunction(value):
        assert "\nReturns\n" in text, name


def test_the_version_is_that_of_the_package() -> None:
    assert vs.__version__ == importlib.metadata.version("vestige")
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = vs.nothing
