"""`touchbeam docs`: which page it opens, and where it looks for it."""

import os
from pathlib import Path

import pytest

from protocol.errors import BadInput, WorkFailed
from tests.runner.command_line import typed
from touchbeam.cli import documentation as command
from touchbeam.cli.documentation import documentation, titled


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A package with a site of three pages."""
    package = tmp_path / "touchbeam"
    (package / "documentation" / "how-to").mkdir(parents=True)
    for name, title in [
        ("index", "touchbeam"),
        ("journal", "Journal"),
        ("how-to/events", "The journal&#39;s events"),
    ]:
        page = package / "documentation" / f"{name}.html"
        page.write_text(f"<html><title>{title} - touchbeam</title>", encoding="utf-8")
    return package


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """A copy of the source that has not built its pages."""
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text("# touchbeam", encoding="utf-8")
    (tmp_path / "zensical.toml").touch()
    (tmp_path / "handbook").mkdir()
    (tmp_path / "handbook" / "__init__.py").touch()
    (tmp_path / "handbook" / "build.py").write_text(
        "from pathlib import Path\n"
        "Path('site').mkdir(exist_ok=True)\n"
        "Path('site/index.html').write_text(Path('docs/index.md').read_text())\n"
    )
    return tmp_path


@pytest.mark.parametrize(
    ("words", "page"),
    [
        ("journal", "journal.html"),
        ("EVENTS", "how-to/events.html"),
        ("the journal's", "how-to/events.html"),
    ],
)
def test_a_page_is_found_by_its_title_or_by_words_of_it(
    installed: Path, words: str, page: str
) -> None:
    site = installed / "documentation"
    assert titled(site, words) == site / page


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("pens", r"^no page has 'pens' in its title; `touchbeam docs` opens the first"),
        ("journa", r"^2 pages have 'journa' in their title: 'The journal's events', 'Journal'; "),
    ],
)
def test_words_that_lead_to_no_single_page_are_refused(
    installed: Path, words: str, message: str
) -> None:
    with pytest.raises(BadInput, match=message):
        titled(installed / "documentation", words)


def test_the_pages_of_a_copy_of_the_source_are_built_anew_after_a_change(source: Path) -> None:
    page = source / "docs" / "index.md"
    site = documentation(source / "touchbeam")
    assert (site / "index.html").read_text() == "# touchbeam"
    written = (site / "index.html").stat().st_mtime
    for text, moment in (("older", written - 9), ("newer", written + 9)):
        page.write_text(text)
        os.utime(page, (moment, moment))
        documentation(source / "touchbeam")
        assert (site / "index.html").read_text() == ("# touchbeam" if text == "older" else text)


def test_a_copy_of_the_source_that_cannot_build_says_what_can(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (source / "handbook" / "build.py").write_text("raise SystemExit(1)")
    with pytest.raises(
        WorkFailed, match=f"^the documentation cannot be built; type `make docs` in {source}"
    ):
        documentation(source / "touchbeam")
    monkeypatch.setattr(command, "find_spec", lambda _: None)
    with pytest.raises(
        WorkFailed, match=f"^the documentation is not built yet: type `make docs` in {source}"
    ):
        documentation(source / "touchbeam")
    (source / "site").mkdir()
    assert documentation(source / "touchbeam") == source / "site"


def test_without_a_browser_the_page_is_named(
    installed: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "PACKAGE", installed)
    monkeypatch.setattr("webbrowser.open", lambda _: False)
    assert typed("docs", "journal") == 0
    said = capsys.readouterr()
    assert said.out == f"{installed / 'documentation' / 'journal.html'}\n"
    assert said.err == "No browser could be opened here: open this file in one.\n"
