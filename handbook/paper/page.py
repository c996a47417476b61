"""docs/paper.md: `page.md.jinja`, filled with the records of the claims and with Table 4."""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape

from analysis.statistics.omnibus import friedman
from device.friction.laws import LAWS
from handbook.paper.claim import Verdict
from handbook.paper.people import COMPREHENSIVE, MEANS, NAMES, PAIRS, SCORES, TABLE

Record = dict[str, Any]


def verdict_of(record: Record) -> str:
    """Return the verdict of a claim in words, with the laws where they differ.

    >>> verdict_of({"laws": {"printed": "holds", "consistent": "holds", "coulomb": "fails"}})
    'printed, consistent: holds; coulomb: fails'
    """
    laws: dict[str, list[str]] = defaultdict(list)
    for law, verdict in record["laws"].items():
        laws[verdict].append(law)
    if len(laws) == 1:
        return next(iter(laws))
    return "; ".join(f"{', '.join(names)}: {verdict}" for verdict, names in laws.items())


def _by_figure(records: Sequence[Record]) -> dict[str, list[tuple[str, str]]]:
    """Return the claims about each figure, with their verdicts; Fig 13b counts as Fig 13."""
    about = defaultdict(list)
    for record in records:
        for place in record["place"].split(", "):
            about[place.rstrip("abcd")].append((record["id"], verdict_of(record)))
    return about


def _table_4() -> list[list[str]]:
    rows = [
        [name, *(f"{score:.0f}" for score in scores), f"{mean:.1f}"]
        for name, scores, mean in zip(TABLE.subjects, SCORES, COMPREHENSIVE, strict=True)
    ]
    return [*rows, ["average", *(f"{mean:.2f}" for mean in (*MEANS.values(), SCORES.mean()))]]


def page(records: Sequence[Record]) -> str:
    """Return docs/paper.md."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=select_autoescape(),
        trim_blocks=True,
        keep_trailing_newline=True,
        undefined=StrictUndefined,
    )
    verdicts = {law: [record["laws"][law] for record in records] for law in LAWS}
    text: str = environment.get_template("page.md.jinja").render(
        records=records,
        of={record["id"]: record["computed"] for record in records},
        free=sum(record["computed"].keys() != record["laws"].keys() for record in records),
        verdicts=[*Verdict],
        counts={
            law: [given.count(verdict) for verdict in Verdict] for law, given in verdicts.items()
        },
        about=_by_figure(records),
        verdict_of=verdict_of,
        conditions=NAMES,
        table4=_table_4(),
        friedman=friedman(TABLE),
        pairs=PAIRS,
    )
    return text
