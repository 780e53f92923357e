from __future__ import annotations

import math
import re
from html.parser import HTMLParser

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vestige.report.markup import Html, element, figure, joined, markup, number, section, table

EVIL = "</script><script>alert('x')</script> & \"'"


class Seen(HTMLParser):
    """The tags, attributes and text of some markup."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[str] = []
        self.values: list[str | None] = []
        self.text = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.values += [value for _, value in attrs]

    def handle_data(self, data: str) -> None:
        self.text += data


@given(
    text=st.text(st.characters(exclude_categories=["Cs", "Cc"])),
    value=st.text(st.characters(exclude_categories=["Cs", "Cc"])),
)
def test_any_text_comes_back_as_text(text: str, value: str) -> None:
    seen = Seen(element("p", text, element("b", "x"), class_=value))
    assert seen.tags == ["p", "b"]
    assert seen.values == [value]
    assert seen.text == text + "x"


@pytest.mark.parametrize(
    "made",
    [
        markup(EVIL),
        element("p", EVIL, title=EVIL),
        joined([EVIL, EVIL]),
        section("a", EVIL, EVIL),
        table(EVIL, [EVIL], [[EVIL, EVIL], [EVIL]]),
        figure("x", EVIL, EVIL, EVIL),
    ],
)
def test_nothing_from_outside_is_a_tag(made: Html) -> None:
    assert "script" not in Seen(made).tags


def test_markup_is_not_escaped_twice() -> None:
    assert markup(markup("a < b")) == "a &lt; b"
    assert element("p", Html("<b>x</b>")) == "<p><b>x</b></p>"


def test_attributes() -> None:
    made = element("div", class_="a", aria_label="b", for_="c", title=None)
    assert made == '<div class="a" aria-label="b" for="c"></div>'


def test_a_table_has_headings_for_rows_and_columns() -> None:
    made = table("what", ("name", "count"), [("a group",), ("first", 3)])
    assert '<th scope="rowgroup" colspan="2"><span>a group</span></th>' in made
    assert '<th scope="row">first</th><td class="number">3</td>' in made
    assert '<th scope="col">name</th><th scope="col" class="number">count</th>' in made
    assert 'role="region" aria-label="what"' in made


def test_a_figure_says_what_it_shows() -> None:
    made = figure("timeline", "Time-line", "verdicts over time")
    assert re.search(
        r'<canvas role="img" aria-label="verdicts over time" data-figure="timeline"[^>]*>verdicts over time<', made
    )


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (0, 3, "0"),
        (0.0, 2, "0"),
        (1500, 3, "1\u202f500"),
        (86400.0, 3, "86\u202f400"),
        (3.1887, 3, "3.19"),
        (-22.5, 3, "−22.5"),
        (172.8, 2, "173"),
        (3.0, 3, "3"),
        (100.0, 3, "100"),
        (1e-7, 2, "1·10⁻⁷"),
        (3.33e-6, 2, "3.3·10⁻⁶"),
        (1.8e9, 4, "1.8·10⁹"),
        (math.nan, 3, "–"),
        (-math.inf, 3, "–"),
    ],
)
def test_numbers_for_people(value: float, digits: int, text: str) -> None:
    assert number(value, digits) == text


def test_a_number_with_its_unit_stays_in_one_line() -> None:
    assert number(3.2, 2, "m") == "3.2\u00a0m"
    assert number(math.nan, 2, "m") == "–"
