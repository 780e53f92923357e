"""Define a command class whose `--help` shows the options in groups, each group below a title."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import click

_REST = "Other options"


class GroupedCommand(click.Command):
    """Command whose `--help` shows the options in groups.

    `groups` names the parameters below each title, in the order of the help text. Options without a group come last.
    """

    def __init__(self, *arguments: Any, groups: Mapping[str, tuple[str, ...]], **attributes: Any) -> None:
        super().__init__(*arguments, **attributes)
        self.groups = groups

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the help texts of the options in groups, each group below its title."""
        parameters = {str(one.name): one for one in self.get_params(ctx) if isinstance(one, click.Option)}
        named = {name for names in self.groups.values() for name in names}
        rest = tuple(name for name in parameters if name not in named)
        for title, names in (*self.groups.items(), (_REST, rest)):
            shown = [parameters[name].get_help_record(ctx) for name in names if name in parameters]
            if records := [one for one in shown if one is not None]:
                with formatter.section(title):
                    formatter.write_dl(records)
