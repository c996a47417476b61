"""The command that opens the documentation: `docs`."""

import re
import subprocess
import sys
from html import unescape
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from typer import Argument, Typer

from protocol.errors import BadInput, WorkFailed
from touchbeam.cli.output import complain, say

app = Typer()

PACKAGE = Path(__file__).resolve().parents[1]
_TITLE = re.compile(r"<title>(.*) - touchbeam</title>")


@app.command()
def docs(
    words: Annotated[
        list[str] | None,
        Argument(metavar="WORDS", help="Words of a page's title. [default: the first page]"),
    ] = None,
) -> None:
    """Open the documentation in a browser, and print where it is.

    It is part of touchbeam, with pictures and a search, and needs no network.
    """
    import webbrowser

    site = documentation(PACKAGE)
    page = titled(site, " ".join(words)) if words else site / "index.html"
    say(str(page))
    if not webbrowser.open(page.as_uri()):
        complain("No browser could be opened here: open this file in one.")


def documentation(package: Path) -> Path:
    """Return the folder of the pages: a wheel's, or those that a copy of the source builds.

    Raises:
        WorkFailed: a copy of the source cannot build them; it says what can.
    """
    installed = package / "documentation"
    if installed.is_dir():
        return installed
    source = package.parent
    site = source / "site"
    by_hand = f"type `make docs` in {source}"
    if not find_spec("zensical") and not site.is_dir():
        raise WorkFailed(f"the documentation is not built yet: {by_hand}")
    if not find_spec("zensical") or _is_newer(site / "index.html", source):
        return site
    complain("The pages are built, which takes a few seconds ...")
    build = [sys.executable, "-m", "handbook.build"]
    built = subprocess.run(build, cwd=source, capture_output=True, check=False, text=True)
    if built.returncode:
        raise WorkFailed(f"the documentation cannot be built; {by_hand}, which shows why")
    return site


def _is_newer(page: Path, source: Path) -> bool:
    pages = [source / "zensical.toml", *(source / "docs").rglob("*.md")]
    return page.is_file() and page.stat().st_mtime >= max(path.stat().st_mtime for path in pages)


def titled(site: Path, words: str) -> Path:
    """Return the page with this title, or the only one whose title has these words.

    Raises:
        BadInput: no page has, or several have; it names them.
    """
    pages = {_title(page).casefold(): page for page in sorted(site.rglob("*.html"))}
    words = words.casefold()
    matches = [words] if words in pages else [title for title in pages if words in title]
    if len(matches) == 1:
        return pages[matches[0]]
    titles = ", ".join(f"'{_title(pages[title])}'" for title in matches)
    raise BadInput(
        f"{len(matches)} pages have {words!r} in their title: {titles}; type more of one"
        if matches
        else f"no page has {words!r} in its title; `touchbeam docs` opens the first, with a search"
    )


def _title(page: Path) -> str:
    title = _TITLE.search(page.read_text(encoding="utf-8"))
    return unescape(title[1]) if title else ""
