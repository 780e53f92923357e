"""The JSON schemas of the files that a person writes, and the page that offers them."""

from __future__ import annotations

import json
from typing import Any

from vestige.cli.outputs.verdict_lines import verdict_line_schema, verdict_schema
from vestige.recording.recording_toml import recording_schema
from vestige.scenario.load import scenario_schema

_PAGE = """\
# JSON schemas

## Files that you write

Use a schema to have your editor complete and check a file while you write it, or to check a file in a program. They are
generated from the readers, so what a schema allows is what vestige reads. `vestige check --schema` prints that of a
scenario. The keys are described in [file formats](../file_formats.md) and in [scenario files](../scenarios.md).

* {recording}: [recording.schema.json](../files/recording.schema.json)
* {scenario}: [scenario.schema.json](../files/scenario.schema.json)

In VS Code with the extension "Even Better TOML", put this line at the top of a `recording.toml`:

```toml
#:schema ./recording.schema.json
```

## What `--json` prints

Use these schemas to check in a program what vestige printed, or to generate the types that read it. Later
versions may add keys, so a reader should ignore keys that it does not know.

* {verdicts}: [verdicts.schema.json](../files/verdicts.schema.json)
* {lines}: [verdict_line.schema.json](../files/verdict_line.schema.json)
"""


def _text(schema: dict[str, Any]) -> str:
    return json.dumps(schema, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def pages() -> dict[str, str]:
    """Return the page and the schemas by their place in the staged tree."""
    page = _PAGE.format(
        recording="the description of a recording",
        scenario="a scenario",
        verdicts="the object of `vestige process --json`",
        lines="a line of `vestige live --json` and of `verdicts.jsonl`",
    )
    return {
        "reference/schemas.md": page,
        "files/recording.schema.json": _text(recording_schema()),
        "files/scenario.schema.json": _text(scenario_schema()),
        "files/verdicts.schema.json": _text(verdict_schema()),
        "files/verdict_line.schema.json": _text(verdict_line_schema()),
    }
