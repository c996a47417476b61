"""`python -m handbook.paper [FOLDER]`: write paper.md, and what it shows, into docs or FOLDER."""

import json
import sys
from pathlib import Path

from handbook.build import ROOT
from handbook.paper.claims import CLAIMS
from handbook.paper.figures import figures, svg
from handbook.paper.page import page


def write(docs: Path) -> None:
    """Write paper.md, paper/claims.json and paper/figure-*.svg into `docs`."""
    folder = docs / "paper"
    folder.mkdir(parents=True, exist_ok=True)
    records = [claim.record() for claim in CLAIMS]
    text = json.dumps(records, indent=1, ensure_ascii=False)
    (folder / "claims.json").write_text(text + "\n", encoding="utf-8")
    for number, panels in figures().items():
        (folder / f"figure-{number}.svg").write_text(svg(panels), encoding="utf-8")
    (docs / "paper.md").write_text(page(records), encoding="utf-8")


if __name__ == "__main__":
    docs = Path(sys.argv[1]) if sys.argv[1:] else ROOT / "docs"
    write(docs)
    print(f"written: {docs / 'paper.md'}, {docs / 'paper'}")
