from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path

import pytest

from report_builder import data_of
from vestige.errors import InputFileError
from vestige.report.markup import element
from vestige.report.page import SCRIPTS, Page, is_report, write_page

FOLDER = Path(__file__).resolve().parents[3] / "src" / "vestige" / "report"
EVIL = "</script><script>alert(1)</script>\u2028$style ${body}"
PAGE = Page(title=EVIL, question=EVIL, version="1 <2>", body=(element("p", EVIL),), data={"text": EVIL, "<": 1})


def test_text_from_outside_ends_nothing() -> None:
    page = PAGE.html()
    assert len(re.findall(r"<script\b", page)) == 2
    assert "alert(1)</script>" not in page
    assert data_of(page) == {"text": EVIL, "<": 1}


def test_the_policy_allows_the_script_and_no_address() -> None:
    page = PAGE.html()
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    (script,) = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert policy == f"default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src 'sha256-{digest}'"


def test_the_parts_of_a_page_name_no_address() -> None:
    for path in (*FOLDER.glob("*.html"), *FOLDER.glob("*.css"), *FOLDER.glob("*.js")):
        assert not re.search(
            r"https?:|//[a-z]+\.|@import|url\(|fetch\(|XMLHttp|import\(|eval\(|innerHTML", path.read_text()
        ), path


def test_every_script_is_used_and_read_in_one_sitting() -> None:
    assert sorted(SCRIPTS) == sorted(path.name for path in FOLDER.glob("*.js"))
    for path in (*FOLDER.glob("*.js"), *FOLDER.glob("*.css")):
        assert len(path.read_text().splitlines()) <= 400


def test_a_page_is_written_over_a_page_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.html"
    write_page(PAGE, path)
    first = path.read_text(encoding="utf-8")
    assert is_report(path)
    write_page(PAGE, path)
    assert path.read_text(encoding="utf-8") == first
    path.write_text("<!doctype html><title>mine</title>")
    with pytest.raises(InputFileError, match="expected a new name, or the name of an earlier report"):
        write_page(PAGE, path)
    assert "mine" in path.read_text()
    assert [path.name for path in tmp_path.iterdir()] == ["a.html"]


def test_a_folder_is_no_page(tmp_path: Path) -> None:
    assert not is_report(tmp_path)
    assert not is_report(tmp_path / "nothing")


def test_a_write_that_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="No space left") as caught:
        write_page(PAGE, tmp_path / "a.html")
    assert caught.value.filename == str(tmp_path / "a.html")
    assert list(tmp_path.iterdir()) == []
