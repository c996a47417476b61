"""The documentation's site: `python -m handbook.build`, which `make docs` and each wheel run.

Zensical builds it from `docs/` after `zensical.toml`. Its search on pages that are opened as files
loads a script from the internet; here it gets one of our own, so that nothing needs a network.
"""

import shutil
import subprocess
import sys
from pathlib import Path

from handbook.formulas import with_drawn_formulas

ROOT = Path(__file__).resolve().parents[1]
_LOADED = "https://unpkg.com/iframe-worker/shim"
_OWN = "assets/offline.js"


def build(root: Path = ROOT) -> Path:
    """Build the site of the pages in `root/docs` anew and return its folder.

    Raises:
        subprocess.CalledProcessError: a link in a page leads nowhere; Zensical has said which.
    """
    zensical = [sys.executable, "-m", "zensical", "build", "--clean", "--strict"]
    subprocess.run(zensical, cwd=root, check=True)
    site = root / "site"
    (site / "404.html").unlink()  # only a server shows it, and its links begin at a server's root
    for page in site.rglob("*.html"):
        up = "../" * (len(page.relative_to(site).parts) - 1)
        text = page.read_text(encoding="utf-8")
        text = with_drawn_formulas(text.replace(_LOADED, up + _OWN))
        page.write_text(text, encoding="utf-8")
    return site


def build_in(folder: Path) -> Path:
    """Build the site of a copy of the pages in `folder`, as `build` does."""
    shutil.copytree(ROOT / "docs", folder / "docs")
    shutil.copy(ROOT / "zensical.toml", folder)
    return build(folder)


if __name__ == "__main__":
    built = build_in(Path(sys.argv[1])) if sys.argv[1:] else build()
    print(f"open {built / 'index.html'}")
