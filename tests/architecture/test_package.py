"""What the files around the package say of it agrees: version, date, Pythons, programs that tests ask."""

from __future__ import annotations

import re
import tomllib
from importlib.metadata import version
from pathlib import Path

import yaml

import vestige

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_the_version_is_that_of_the_metadata() -> None:
    assert vestige.__version__ == version("vestige")


def test_the_citation_and_the_changelog_name_the_release() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    newest = re.search(r"^## (\d\S*) \((\S+)\)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert newest is not None
    assert newest.groups() == (PROJECT["version"], str(citation["date-released"]))
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]


def test_the_readme_names_the_wheel_that_is_built() -> None:
    for page in (ROOT / "README.md", ROOT / "docs" / "site" / "pages" / "start.md"):
        named = set(re.findall(r"vestige-(\S+?)-py3-none-any\.whl", page.read_text()))
        assert named == {PROJECT["version"]}, page


def test_the_same_pythons_everywhere() -> None:
    declared = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    jobs = yaml.safe_load((ROOT / ".github" / "workflows" / "tests.yml").read_text())["jobs"]
    in_nox = re.search(r"^PYTHONS = (\[.*\])$", (ROOT / "noxfile.py").read_text(), re.MULTILINE)
    assert in_nox is not None
    assert re.findall(r"3\.\d+", in_nox[1]) == declared
    assert jobs["quick"]["strategy"]["matrix"]["python"] == declared
    assert PROJECT["requires-python"] == f">={declared[0]}"


def test_the_image_has_the_programs_of_the_tests() -> None:
    asked = re.search(r"^for program in (.*); do$", (ROOT / ".ci" / "run").read_text(), re.MULTILINE)
    assert asked is not None
    packages = {pair.partition(":")[2] for pair in asked[1].split()}
    assert packages <= set((ROOT / "Dockerfile").read_text().split())
