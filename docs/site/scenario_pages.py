"""The scenario files as pages of the site: each file as it is, with a link to save it."""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "scenarios"
INDEX = "reference/scenario_files.md"


def place(path: Path) -> str:
    """Return the place of the page of a scenario file in the staged tree."""
    return f"reference/scenarios/{path.stem}.md"


def _purpose(text: str) -> str:
    """Return the first comment of a scenario file, which says what the file is for."""
    return text.splitlines()[0].lstrip("# ").strip()


def pages() -> dict[str, str]:
    """Return a page for each scenario file, and the index of these pages, by their place in the staged tree."""
    files = sorted(FOLDER.glob("*.toml"))
    texts = {path: path.read_text(encoding="utf-8") for path in files}
    found = {
        place(path): f"# {path.name}\n\n[Scenario files](../../scenarios.md) explains the keys. `vestige init` writes "
        f"this file into the folder `scenarios`.\n\n```toml\n{text}```\n"
        for path, text in texts.items()
    }
    rows = [f"| [{path.name}](scenarios/{path.stem}.md) | {_purpose(text)} |" for path, text in texts.items()]
    tree = "\n".join(f"scenarios/{path.stem}" for path in files)
    introduction = (
        "Read here the scenario files that the other pages name. In a checkout they are in the folder `scenarios`. "
        "With a wheel, `vestige init` writes them."
    )
    found[INDEX] = "\n\n".join(
        [
            "(scenario-files)=\n# The scenario files",
            introduction,
            "\n".join(["| file | what it is for |", "|---|---|", *rows]),
            f":::{{toctree}}\n:hidden:\n\n{tree}\n:::\n",
        ]
    )
    return found
