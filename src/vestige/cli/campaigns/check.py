"""`vestige check`: parse scenario files and print their content, without running the scenarios."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.options import PATH, parts_option, set_option
from vestige.cli.terminal import echo, raise_last, warn
from vestige.errors import VestigeError

if TYPE_CHECKING:
    from vestige.scenario.campaign import CampaignScenario
    from vestige.scenario.load import Scenario

_UNSET: tuple[object, ...] = (None, [], "")  # values of keys that are not set, which are not printed
_WIDTH = 120  # largest number of characters in a line
_EQUALS = "\u00a0=\u00a0"  # non-breaking spaces, so that a key and its value stay in the same line


@click.command()
@click.argument("files", nargs=-1, type=PATH)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object with the resolved scenarios.")
@set_option
@click.option("--schema", "as_schema", is_flag=True, help="Print the JSON schema of scenario files, for editors.")
@parts_option
def command(files: tuple[Path, ...], settings: tuple[str, ...], as_json: bool, as_schema: bool) -> None:
    """Parse scenario FILES, fill in the defaults, and print the content of each scenario.

    Every file is checked. If some files are invalid, the exit code is 1, and the errors are printed after the content
    of the valid files.
    """
    import json

    from vestige.scenario.load import load_scenario, scenario_schema
    from vestige.scenario.warnings import scenario_warnings

    if bool(files) == as_schema:
        raise click.UsageError("expected scenario FILES, or --schema alone")
    if as_schema:
        echo(*json.dumps(scenario_schema(), indent=2, allow_nan=False).split("\n"))
        return
    resolved: dict[str, object] = {}
    errors: list[VestigeError | OSError] = []
    for path in files:
        try:
            scenario = load_scenario(path, settings)
        except (VestigeError, OSError) as error:
            errors.append(error)
            continue
        for warning in scenario_warnings(scenario):
            warn(f"{path}: {warning}")
        resolved[str(path)] = json.loads(scenario.model_dump_json(by_alias=True))  # infinite values become null
        if not as_json:
            echo(*_lines(path, scenario))
    if as_json:
        echo(json.dumps(resolved))
    raise_last(errors)


def _lines(path: Path, scenario: Scenario) -> list[str]:
    from vestige.scenario.recording import RecordingScenario

    if isinstance(scenario, RecordingScenario):
        return [
            f"{path}: recording, {len(scenario.satellites)} satellites, {scenario.duration_s:g} s from "
            f"{scenario.start_time}, E1 and E6 at {scenario.receiver.sample_rate_hz / 1e6:g} MHz, seed {scenario.seed}",
            *(
                f"  E{one.svid:02d}  range {one.range_m / 1e3:.3f} km  rate {one.range_rate_mps:+.1f} m/s  "
                f"C/N0 E1-C {one.cn0_e1_dbhz:g}, E6-C {one.cn0_e6_dbhz:g} dBHz"
                for one in scenario.satellites
            ),
        ]
    receiver = scenario.receiver
    described = scenario.model_dump(mode="json", by_alias=True)
    front_end = receiver.front_end.front_end(receiver.sample_rate_hz)
    tables: dict[str, object] = {
        name: described[name]
        for name in ("constellation", "trajectory", "position", "atmosphere")
        if scenario.constellation is not None
    }
    tables |= {"receiver.front_end": None if front_end.transparent else described["receiver"]["front_end"]}
    models = ("clock", "ionosphere", "multipath", "e1_tracking", "bias")
    tables |= {f"receiver.{name}": described["receiver"][name] for name in models}
    tables |= {"processor": described["processor"]}
    tables |= {f"attack.{number}": attack for number, attack in enumerate(described["attack"])}
    return [
        f"{path}: campaign, {scenario.epochs} epochs of {scenario.interval_s:g} s from {scenario.start_time}, "
        f"{scenario.recs.duration_ms} ms each, C/N0 {receiver.cn0_dbhz:g} dBHz, {scenario.fidelity}, "
        f"seed {scenario.seed}",
        *_in_view(scenario),
        *(line for name, table in tables.items() for line in _table_lines(name, table)),
    ]


def _in_view(scenario: CampaignScenario) -> list[str]:
    if scenario.constellation is None:
        return []
    svids = ", ".join(f"E{one.svid:02d}" for one in scenario.simulations)
    return [f"  in view at some time: {svids}; a RECS every {scenario.interval_s * scenario.recs.every:g} s"]


def _table_lines(name: str, table: Any) -> list[str]:
    """Return a table of a scenario as lines of text, with the names of its keys.

    A line has at most `_WIDTH` characters, unless a single key with its value is longer. A table inside the table, such
    as `processor.budget`, begins a new line.
    """
    inner: dict[str, Any] = {}
    if isinstance(table, dict):
        inner = {key: one for key, one in table.items() if isinstance(one, dict)}
        table = {key: one for key, one in table.items() if key not in inner and one not in _UNSET}
    lines: list[str] = []
    if table or not inner:
        text = f"  {name}: {_text_of(table) if table else 'none'}".replace(" = ", _EQUALS)
        wrapped = textwrap.wrap(
            text, _WIDTH, subsequent_indent="      ", break_long_words=False, break_on_hyphens=False
        )
        lines = [line.replace(_EQUALS, " = ") for line in wrapped]
    return lines + [line for key, one in inner.items() for line in _table_lines(f"{name}.{key}", one)]


def _text_of(value: Any) -> str:
    """Return a value of a scenario as text; the text of a table has its kind, and then the keys that are set."""
    if isinstance(value, dict):
        keys = [f"{key} = {_inner(one)}" for key, one in value.items() if key != "kind" and one not in _UNSET]
        return ": ".join(filter(None, (value.get("kind"), ", ".join(keys))))
    if isinstance(value, list):
        return ", ".join(_inner(one) for one in value)
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def _inner(value: Any) -> str:
    """Return a value inside a table as text, with braces around a table and brackets around a list."""
    text = _text_of(value)
    return f"{{{text}}}" if isinstance(value, dict) else f"[{text}]" if isinstance(value, list) else text
