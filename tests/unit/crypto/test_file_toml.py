"""TOML of strangers ends soon: long keys and deep nesting are refused, and nothing that somebody would write."""

from __future__ import annotations

import time
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.crypto.file_toml import DEEPEST, parse_toml
from vestige.errors import InputFileError, VestigeError
from vestige.recording.assistance.receiver_corrections import read_hardware_bias
from vestige.recording.recording_toml import read_recording_toml
from vestige.scenario.load import load_scenario
from vestige.scenario.toml.toml_file import overridden, read_toml

SCENARIOS = sorted((Path(__file__).resolve().parents[3] / "scenarios").glob("*.toml"))
PART = ("a", '"b"', "'c'", '"\\"."')


def key(n: int) -> str:
    return ".".join(PART[k % len(PART)] for k in range(n))


LONG = {
    "dotted": lambda n: f"{key(n)} = 1\n",
    "spaces": lambda n: f"{key(n).replace('.', ' . ')} = 1\n",
    "header": lambda n: f"[{key(n)}]\n",
    "array header": lambda n: f"[[{key(n)}]]\n",
    "inline": lambda n: f"x = {{ {key(n)} = 1 }}\n",
    "after a string": lambda n: f'x = {{ y = """a"""", {key(n)} = 1, z = "" }}\n',
    "after an escape": lambda n: f'x = {{ y = """\\"""\\"""", {key(n)} = 1, z = "" }}\n',
    "no value": lambda n: f"{key(n)}",
    "wrong end": lambda n: f"{key(n)}.@ = 1",
}


@pytest.mark.parametrize("form", LONG)
@pytest.mark.parametrize("n", [DEEPEST + 1, 900, 40_000])
def test_a_key_of_many_parts_is_refused_at_once(form: str, n: int, tmp_path: Path) -> None:
    began = time.process_time()
    path = tmp_path / "scenario.toml"
    path.write_text("# a comment\n" + LONG[form](n))
    readers: tuple[Callable[[Path], object], ...] = (read_toml, load_scenario, read_recording_toml, read_hardware_bias)
    for read in readers:
        with pytest.raises(InputFileError, match="line 2: a key of more than 20 parts"):
            read(path)
    with pytest.raises(VestigeError, match="a key of more than 20 parts"):
        overridden({}, [f"x={{{LONG[form](n).strip()}}}"])
    assert time.process_time() - began < 5


@pytest.mark.parametrize("n", [DEEPEST + 1, 900, 40_000])
def test_a_setting_of_many_parts_is_refused(n: int) -> None:
    with pytest.raises(VestigeError, match=rf"found a key of {n} parts, expected at most 20"):
        overridden({}, [".".join("a" * n) + "=1"])


@pytest.mark.parametrize(
    "text",
    [
        "x = " + 30 * "[" + 30 * "]", "x = " + 20_000 * "[", "x = " + 30 * "{a = " + "1" + 30 * "}",
        "[a.b.c.d.e.f.g.h.i.j.k]\nl.m.n.o.p.q.r.s.t.u.v = 1",
    ],
)  # fmt: skip
def test_deep_nesting_is_refused_before_anything_walks_through_it(text: str, tmp_path: Path) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(text)
    with pytest.raises(InputFileError, match="more than 20 tables and lists in each other"):
        load_scenario(path, ("a=1",))


@pytest.mark.parametrize(
    "text",
    [
        *(path.read_text() for path in SCENARIOS),
        f"x = [{'1.0, ' * 3000}]",
        f"x = [{'-1.5e-3,' * 3000}2026-11-21T12:00:00.123]",
        f'x = "{key(40).replace(chr(34), "")}"'.replace("\\", ""),
        f"x = '{'a.' * 40}'",
        f'x = """\n{"a.b." * 40}\n"" {"c." * 40}"""',
        f"x = '''{'a.' * 40}'' {'b.' * 40}'''",
        f"x = 1 # {'a.' * 40}",
        f'x = ["{"a." * 30}", 1.5, "\\"{"b." * 30}"]',
        f"{key(DEEPEST)} = 1",
        "".join(f"a{k}.b.c = {k}.{k}\n" for k in range(2000)),
    ],
)  # fmt: skip
def test_what_somebody_would_write_is_read(text: str) -> None:
    assert parse_toml(text) == tomllib.loads(text)


@given(st.text(alphabet="\"'\\a.= #\n[]{},1", max_size=60))
def test_nothing_else_is_refused(text: str) -> None:
    """Whatever Python's parser takes is taken with the same result; keys of so short a text are short or refused."""
    try:
        expected = tomllib.loads(text)
    except ValueError:
        return
    assert text.count(".") > DEEPEST or parse_toml(text) == expected


ENDLESS = (
    '"""' + '\n\\"""' * 200_000, "'" * 1_000_000, "a" * 1_000_000, "a " * 500_000, "a." * 500_000, '"\\' * 500_000,
)  # fmt: skip


@pytest.mark.parametrize("text", ENDLESS)
def test_the_look_at_the_keys_takes_no_time_itself(text: str) -> None:
    began = time.process_time()
    with pytest.raises(ValueError):  # noqa: PT011  (tomllib's own, of no fixed text)
        parse_toml(text)
    assert time.process_time() - began < 5
