"""The parts of the documentation site: links that are staged, links that are checked, and the reference of commands."""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path

import click
import pytest

from script_loader import REPOSITORY, script
from vestige.cli.main import VERBS

SITE = REPOSITORY / "docs" / "site"
sys.path.append(str(SITE))  # command_pages imports its neighbour
staging = script(SITE / "staging.py", "site_staging")
html_links = script(SITE / "html_links.py", "site_html_links")
command_pages = script(SITE / "command_pages.py", "site_command_pages")
PAGES = staging.documents()
START = SITE / "pages" / "start.md"


@pytest.mark.parametrize(
    ("link", "staged"),
    [
        ("[a](../../levels/README.md#alarms)", "[a](levels/README.md#alarms)"),
        ("[a](../../../DESIGN.md)", "[a](project/DESIGN.md)"),
        ("![a](../../threats.png)", "![a](files/docs/threats.png)"),
        ("[a](../../levels)", "[a]"),
        ("[a](#place) [b](mailto:c@d)", "[a](#place) [b](mailto:c@d)"),
        ("```\n[a](nothing.md)\n```", "```\n[a](nothing.md)\n```"),
    ],
)
def test_a_link_leads_to_the_same_page_in_the_staged_tree(link: str, staged: str) -> None:
    linked: set[Path] = set()
    assert staging.with_staged_links(link, START, PAGES, linked) == staged
    assert linked == ({REPOSITORY / "docs" / "threats.png"} if "png" in link else set())


def test_a_link_that_leads_nowhere_stops_the_build() -> None:
    with pytest.raises(FileNotFoundError, match=r"docs/site/pages/start\.md: the link nothing\.md leads nowhere"):
        staging.with_staged_links("[a](nothing.md)", START, PAGES, set())


def test_no_two_documents_share_a_place() -> None:
    assert len(set(PAGES.values())) == len(PAGES) > 40


def test_links_of_built_pages_are_checked(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "index.html").write_text('<a href="sub/#there">a</a><a href="https://x.org">b</a><img src="no.png">')
    (tmp_path / "sub" / "index.html").write_text(
        '<p id="there"><a href="../index.html#gone">a</a><script src="https://x.org/a.js"></script>'
        '<link rel="canonical" href="https://x.org">'
    )
    assert html_links.faults(tmp_path) == [
        "index.html: no.png leads nowhere",
        "sub/index.html: loads https://x.org/a.js from a network",
        "sub/index.html: ../index.html#gone names no place on that page",
    ]


@pytest.mark.parametrize("verb", VERBS)
def test_the_page_of_a_command_has_every_option_with_its_help(verb: str) -> None:
    command = importlib.import_module(f"vestige.cli.{VERBS[verb][0]}").command
    text = command_pages.pages()[f"reference/commands/{verb}.md"]
    commands = [command, *getattr(command, "commands", {}).values()]
    for one in commands:
        context = click.Context(one, show_default=command_pages.SHOW_DEFAULT)
        for option in (option for option in one.get_params(context) if isinstance(option, click.Option)):
            record = option.get_help_record(context)
            assert record is None or f"`{record[0]}`\n: {command_pages.escaped(record[1])}" in text


def test_the_page_of_a_command_says_defaults_exit_statuses_and_examples() -> None:
    pages = command_pages.pages()
    process = pages["reference/commands/process.md"]
    for default in ("3.0; 0.1\\<=x\\<=10", "600.0; 0\\<=x", "early", "0.9; ", "1e-07; "):
        assert f"\\[default: {default}" in process
    assert "\n  130  Ctrl-C" in pages["reference/commands.md"]
    examples = process.partition("**Examples**")[2]
    assert examples.count("\nvestige process ") == command_pages.MOST_EXAMPLES
    assert "](../../project/README.md)" in examples
    assert [page for page, text in pages.items() if "**Examples**" not in text] == [
        "reference/commands/init.md", "reference/commands.md"
    ]  # fmt: skip


def test_every_example_of_the_gallery_says_what_it_is_for() -> None:
    examples = sorted((REPOSITORY / "docs" / "gallery").rglob("*.py"))
    assert len(examples) >= 12
    for path in examples:
        text = path.read_text(encoding="utf-8")
        assert re.match(r'"""\n[^\n]+\n=+\n\nUse this ', text), path
