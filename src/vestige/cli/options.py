"""Values that several verbs take on the command line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from vestige.time import GalileoTime


def parse_time(text: str | None) -> GalileoTime | None:
    """Return the time that an option names, None without one; a usage error if it is none."""
    from vestige.time import GalileoTime

    try:
        return None if text is None else GalileoTime.parse(text)
    except (ValueError, OverflowError) as error:
        raise click.BadParameter(str(error)) from error


def parse_svids(text: str) -> tuple[int, ...]:
    """Return the satellites of `2,3,7-9`, () for an empty text; a usage error if there is no such satellite."""
    from vestige.constants import MAX_SVID

    svids: list[int] = []
    for part in filter(None, (piece.strip() for piece in text.split(","))):
        ends = part.split("-")
        if len(ends) > 2 or not all(end.isdecimal() for end in ends):
            raise click.BadParameter(f"not a satellite or a range of them: {part!r}")
        svids.extend(range(int(ends[0]), int(ends[-1]) + 1))
    if any(not 1 <= svid <= MAX_SVID for svid in svids):
        raise click.BadParameter(f"satellites are numbered 1 to {MAX_SVID}")
    return tuple(dict.fromkeys(svids))
