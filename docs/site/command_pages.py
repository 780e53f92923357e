"""The reference of the commands: what `--help` prints, with the defaults, and examples out of the documents."""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Iterator

import click
import staging

from vestige.cli.main import VERBS, vestige

_CODE = re.compile(r"(`[^`]*`)")
_BLOCK = re.compile(r"^```sh\n(.*?)^```", re.MULTILINE | re.DOTALL)
MOST_EXAMPLES = 5
_SPECIAL = re.compile(r"([\\*_<>\[\]|#~])")


SHOW_DEFAULT = bool(vestige.context_settings["show_default"])  # as `--help` has it


def escaped(text: str) -> str:
    """Return a help text as Markdown in which only `code` is special."""
    parts = _CODE.split(" ".join(text.split()))
    return "".join(part if part.startswith("`") else _SPECIAL.sub(r"\\\1", part) for part in parts)


def _paragraphs(help_text: str | None) -> Iterator[str]:
    """Yield the paragraphs of a help text; one that begins with a backspace keeps its lines, as click does it."""
    text = inspect.cleandoc(help_text or "").split("\f", maxsplit=1)[0]
    for paragraph in re.split(r"\n\s*\n", text.strip()):
        kept_lines = paragraph.strip().startswith("\b")
        lines = paragraph.replace("\b", "").strip("\n").splitlines()
        yield ("```text\n" + "\n".join(lines) + "\n```") if kept_lines else escaped(" ".join(lines))


def _definitions(records: list[tuple[str, str]]) -> Iterator[str]:
    for names, meaning in records:
        yield f"`{names}`\n: {escaped(meaning)}"


def _option_groups(command: click.Command, context: click.Context) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Yield the title and the help records of each group of options, as `--help` groups them."""
    options = {str(one.name): one for one in command.get_params(context) if isinstance(one, click.Option)}
    groups = dict(getattr(command, "groups", {}))
    named = {name for names in groups.values() for name in names}
    groups["Other options" if groups else "Options"] = tuple(name for name in options if name not in named)
    for title, names in groups.items():
        records = [options[name].get_help_record(context) for name in names if name in options]
        if shown := [one for one in records if one is not None]:
            yield title, shown


def command_text(words: list[str], command: click.Command, depth: int = 1) -> str:
    """Return the page of a command, with a section for each command below it."""
    context = click.Context(command, info_name=" ".join(words), show_default=SHOW_DEFAULT)
    heading = "#" * depth
    parts = [f"{heading} {' '.join(words)}", *_paragraphs(command.help)]
    usage = " ".join([context.command_path, *command.collect_usage_pieces(context)])
    parts.append(f"```text\n{usage}\n```")
    arguments = [one.get_help_record(context) for one in command.get_params(context) if isinstance(one, click.Argument)]
    parts += _definitions([one for one in arguments if one is not None and one[1]])
    for title, records in _option_groups(command, context):
        parts += [f"**{title}**", *_definitions(records)]
    parts += _paragraphs(command.epilog)
    if isinstance(command, click.Group):
        below = ((name, command.get_command(context, name)) for name in command.list_commands(context))
        parts += [command_text([*words, name], one, depth + 1) for name, one in below if one is not None]
    return "\n\n".join(parts) + "\n"


def examples(verb: str) -> str:
    """Return commands of a verb as the documents have them, with links to these documents; `""` if none has one."""
    lines: dict[str, None] = {}
    sources: dict[str, None] = {}
    for path, place in staging.documents().items():
        for block in _BLOCK.findall(path.read_text(encoding="utf-8")):
            for line in re.sub(r" +\\\n\s*", " ", block).splitlines():
                if len(lines) < MOST_EXAMPLES and re.match(rf"vestige {verb}\b", line):
                    lines[re.sub(r" {2,}#", "  #", line)] = None
                    sources[f"[{staging.title(path)}]({os.path.relpath(place, 'reference/commands')})"] = None
    if not lines:
        return ""
    return "\n\n".join(["**Examples**", "```sh\n" + "\n".join(lines) + "\n```", f"From: {', '.join(sources)}.\n"])


def pages() -> dict[str, str]:
    """Return the pages of the command reference by their place in the staged tree."""
    found = {}
    for verb in VERBS:
        command = vestige.get_command(click.Context(vestige), verb)
        found[f"reference/commands/{verb}.md"] = command_text(["vestige", verb], command) + "\n" + examples(verb)
    rows = [f"[`vestige {verb}`](commands/{verb}.md)\n: {escaped(line)}" for verb, (_, line) in VERBS.items()]
    tree = "\n".join(f"commands/{verb}" for verb in VERBS)
    introduction = (
        "Look here for what a command takes and what each option does. These pages are generated from the commands: "
        "`vestige VERB --help` prints the same text. The examples are commands of the other pages."
    )
    found["reference/commands.md"] = "\n\n".join(
        [
            "# Commands",
            introduction,
            *_paragraphs(vestige.help),
            *rows,
            f":::{{toctree}}\n:hidden:\n\n{tree}\n:::",
        ]
    )
    return found
