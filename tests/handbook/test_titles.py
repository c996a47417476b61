"""Messages, help and study files name pages by title: a wheel has no docs/ folder."""

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from handbook.build import ROOT

PACKAGES = ("protocol", "device", "runner", "analysis", "touchbeam")
FILES = [
    path
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*"))
    if path.suffix in {".py", ".toml", ".html", ".css", ".js", ".txt"}
]
NAMED = re.compile(r"""'([^'{}\n]+)' \(touchbeam docs\)|\bpage\(["']([^"']+)["']\)""")
FILE_OF_DOCS = re.compile(r"docs/[\w/-]+\.md")


def titles(nav: list[dict[str, Any]]) -> Iterator[str]:
    for entry in nav:
        for title, below in entry.items():
            if isinstance(below, str):
                yield title
            else:
                yield from titles(below)


NAVIGATION = list(titles(tomllib.loads((ROOT / "zensical.toml").read_text())["project"]["nav"]))


def test_no_two_pages_have_the_same_title() -> None:
    assert sorted(set(NAVIGATION)) == sorted(NAVIGATION)


def test_each_page_that_is_named_by_its_title_exists() -> None:
    named = {
        first or second: path
        for path in [*FILES, *(ROOT / "docs").rglob("*.md")]
        for first, second in NAMED.findall(path.read_text(encoding="utf-8"))
    }
    assert len(named) > 5
    assert {title: path for title, path in named.items() if title not in NAVIGATION} == {}


@pytest.mark.parametrize("package", PACKAGES)
def test_nothing_that_users_see_leads_to_a_file_of_the_source(package: str) -> None:
    found = [
        (path.name, text)
        for path in FILES
        if path.is_relative_to(ROOT / package)
        for text in seen_by_users(path)
        if FILE_OF_DOCS.search(text)
    ]
    assert found == []


def seen_by_users(path: Path) -> Iterator[str]:
    """Data whole; of modules what is no comment, nor a docstring that only developers read."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        yield text
        return
    tree = ast.parse(text)
    docstrings = {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    for node in ast.walk(tree):
        is_read = "touchbeam" in path.relative_to(ROOT).parts or node not in docstrings
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and is_read:
            yield node.value
