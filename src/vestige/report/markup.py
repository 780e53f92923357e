"""Make HTML from untrusted text; everything but `Html` is escaped.

Scenarios, stored results and tables are untrusted files. Only this module turns the text of these files into markup.
The module always escapes the text.
"""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence


class Html(str):
    """Text that is markup already and is not escaped again."""

    __slots__ = ()


def markup(content: object) -> Html:
    """Return content as markup: `Html` unchanged, all other content escaped."""
    return content if isinstance(content, Html) else Html(html.escape(str(content), quote=True))


def element(tag: str, *content: object, **attributes: object) -> Html:
    """Return an HTML element.

    An underscore at the end of an argument's name is removed, so `class_` becomes the attribute `class`. Every other
    underscore becomes a hyphen. An attribute with the value None is omitted.
    """
    names = {name: name.rstrip("_").replace("_", "-") for name in attributes}
    text = "".join(f' {names[name]}="{markup(value)}"' for name, value in attributes.items() if value is not None)
    return Html(f"<{tag}{text}>{''.join(map(markup, content))}</{tag}>")


def joined(parts: Iterable[object]) -> Html:
    """Return several contents as markup, each on its own line."""
    return Html("\n".join(map(markup, parts)))


def section(name: str, title: str, *content: object) -> Html:
    """Return a section of the page with a heading to which a link can point."""
    heading = element("h2", title, id=f"{name}-title")
    return element("section", heading, *content, id=name, aria_labelledby=f"{name}-title")


def table(caption: str, head: Sequence[object], rows: Iterable[Sequence[object]], *, numbers_from: int = 1) -> Html:
    """Return a table that can be scrolled on a narrow screen without the rest of the page.

    The first cell of a row is the heading of the row. A row with a single cell is the heading of the rows below. The
    columns from `numbers_from` on are aligned to the right, as usual for numbers.
    """

    def kind(place: int) -> str | None:
        return "number" if place >= numbers_from else None

    def line(row: Sequence[object]) -> Html:
        if len(row) == 1:
            return element(
                "tr", element("th", element("span", row[0]), scope="rowgroup", colspan=len(head)), class_="group"
            )
        cells = [element("td", cell, class_=kind(place)) for place, cell in enumerate(row[1:], start=1)]
        return element("tr", element("th", row[0], scope="row"), *cells)

    top = [element("th", cell, scope="col", class_=kind(place)) for place, cell in enumerate(head)]
    whole = element("table", element("thead", element("tr", *top)), element("tbody", *map(line, rows)))
    region = element("div", whole, class_="scroll", tabindex=0, role="region", aria_label=caption)
    return joined([element("p", caption, class_="caption"), region])


def card(name: str, value: object, small: object) -> Html:
    """Return a number with its name above and a note below.

    Several cards belong in a `dl` element of class `cards`.
    """
    return element("div", element("dt", name), element("dd", value, element("small", small)), class_="card")


def figure(kind: str, title: str, alt: str, note: object = "") -> Html:
    """Return a figure that the script of the page draws.

    `kind` tells the script which drawing to make. The title is above the figure, and the note is below. `alt` describes
    the figure for readers who cannot see the figure.
    """
    canvas = element("canvas", alt, role="img", aria_label=alt, data_figure=kind, height=10, width=10)
    caption = element("figcaption", note) if note else ""
    return element("figure", element("h3", title), canvas, caption, class_=f"figure {kind}")


def number(value: float, digits: int = 3, unit: str = "") -> str:
    """Return a number as text, rounded to `digits` significant digits.

    A number of magnitude below 10⁷ keeps all digits before the decimal point. The text of NaN or infinity is a dash.
    """
    if not math.isfinite(value):
        return "–"
    size = abs(value)
    if size == 0 or 1e-4 <= size < _LONG:
        decimals = 0 if size == 0 or isinstance(value, int) else max(0, digits - 1 - math.floor(math.log10(size)))
        text = _short(f"{value:,.{decimals}f}").replace(",", "\N{NARROW NO-BREAK SPACE}")
    else:
        mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
        text = f"{_short(mantissa)}·10{str(int(power)).translate(_SUPERSCRIPT)}"
    text = text.replace("-", "−")
    return f"{text}\N{NO-BREAK SPACE}{unit}" if unit else text


def _short(text: str) -> str:
    """Return the text of a number without trailing zeros after the decimal point."""
    return text.rstrip("0").rstrip(".") if "." in text else text


_LONG = 1e7
_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
