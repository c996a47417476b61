"""The three parts of the documentation: each page stands in one, and Use it stays short."""

import tomllib
from collections.abc import Iterator
from typing import Any

from handbook.build import ROOT

MOST_WORDS = 25_000
NAVIGATION = tomllib.loads((ROOT / "zensical.toml").read_text(encoding="utf-8"))["project"]["nav"]
PARTS = {title: below for entry in NAVIGATION for title, below in entry.items()}


def pages(below: str | list[dict[str, Any]]) -> Iterator[str]:
    """The pages of a part of the navigation."""
    if isinstance(below, str):
        yield below
        return
    for entry in below:
        for deeper in entry.values():
            yield from pages(deeper)


def test_each_page_stands_in_one_part() -> None:
    docs = ROOT / "docs"
    written = sorted(path.relative_to(docs).as_posix() for path in docs.rglob("*.md"))
    assert list(PARTS) == ["touchbeam", "Use it", "Reference", "For developers"]
    assert sorted(page for below in PARTS.values() for page in pages(below)) == written


def test_what_a_user_needs_stays_short() -> None:
    files = [*pages(PARTS["Use it"]), "assets/annotated-study.toml"]
    texts = ((ROOT / "docs" / name).read_text(encoding="utf-8") for name in files)
    assert 10_000 < sum(len(text.split()) for text in texts) <= MOST_WORDS
