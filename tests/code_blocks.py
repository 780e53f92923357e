"""The code blocks of README.md and of every page of docs, and the commands in them.

A block has one of four languages: `python`, `toml`, `sh` for what is typed, and `text` for what is only read: output of
a program, a picture, an extract of a file. tests/architecture/test_code_blocks.py says what is done with each.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGES = (*sorted(ROOT.glob("*.md")), *sorted(ROOT.glob("docs/**/*.md")))
LANGUAGES = ("python", "toml", "sh", "text")
_FENCE = re.compile(r"^ *```([^\n]*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class CodeBlock:
    """A code block, and where it begins."""

    page: str
    line: int
    language: str
    text: str

    @property
    def place(self) -> str:
        return f"{self.page}:{self.line}"


@dataclass(frozen=True)
class Command:
    """A program with its arguments, and the file that takes its output or is empty."""

    block: CodeBlock
    words: tuple[str, ...]
    output: str = ""

    @property
    def text(self) -> str:
        """The command as one would type it."""
        return shlex.join(self.words)


@cache
def code_blocks() -> tuple[CodeBlock, ...]:
    """Return every code block, in the order of the pages."""
    found = []
    for path in PAGES:
        text = path.read_text(encoding="utf-8")
        found += [
            CodeBlock(path.relative_to(ROOT).as_posix(), text[: match.start()].count("\n") + 1, match[1], match[2])
            for match in _FENCE.finditer(text)
            if not match[1].startswith("{")  # a directive of the site, such as a figure
        ]
    return tuple(found)


def blocks_of(language: str) -> list[CodeBlock]:
    return [block for block in code_blocks() if block.language == language]


def commands_of(block: CodeBlock) -> Iterator[Command]:
    """Yield the commands of a block: one a line, or several with `|` and `&&` between them."""
    for line in block.text.replace("\\\n", " ").splitlines():
        parser = shlex.shlex(line, posix=True, punctuation_chars="|&;<>")
        parser.whitespace_split = True
        words: list[str] = []
        for word in (*parser, ";"):
            if word not in ("|", "&&", ";"):
                words.append(word)
            elif words:
                output = words.pop() if ">" in words else ""
                yield Command(block, tuple(one for one in words if one != ">"), output)
                words = []


def commands() -> list[Command]:
    """Return the commands of every block of what is typed."""
    return [command for block in blocks_of("sh") for command in commands_of(block)]
