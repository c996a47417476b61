"""HTML page of the report: one file that needs no network."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from html import escape
from importlib.resources import files
from types import MappingProxyType

from analysis.loading.study_data import changed_journal
from analysis.report.blocks import (
    Block,
    Cell,
    ColumnKind,
    Figure,
    Row,
    Section,
    Table,
    TableGroup,
)
from analysis.report.findings import Findings
from analysis.report.glossary import glossary
from analysis.report.masthead import Masthead, masthead
from analysis.report.registration import registered
from analysis.report.registration.named_results import marked
from analysis.report.sections import (
    differences,
    effects,
    left_out,
    measured,
    methods,
    model_checks,
    predictions,
    ranges,
    scores,
    sensitivity,
    session_checks,
    trials,
)
from analysis.report.specification import specification_curves
from analysis.report.specification.specification_curves import MULTIVERSE
from protocol.errors import BadInput
from protocol.study.fields import printable

SECTIONS: Mapping[str, Callable[[Findings], Section]] = MappingProxyType(
    {
        "table4": scores.section,
        "methods": methods.section,
        "registration": registered.section,
        "tests": differences.section,
        "agreement": effects.section,
        "sensitivity": sensitivity.section,
        "measured": measured.section,
        "model": predictions.section,
        "questions": scores.own_questions,
        "left-out": left_out.section,
        "checks": session_checks.section,
        "predictive": model_checks.predictive,
        "recovery": model_checks.recovery,
        "contrasts": ranges.section,
        MULTIVERSE: specification_curves.section,
        "glossary": glossary,
        "provenance": methods.provenance,
        "trials": trials.section,
    }
)
"""The sections of the page by name, in the order in which an author needs them."""

FRONTS: Mapping[str, Callable[[Findings], Sequence[Block]]] = MappingProxyType(
    {
        "table4": scores.front,
        "tests": differences.front,
        "sensitivity": sensitivity.front,
        "model": predictions.front,
    }
)
"""What stands among the results whichever sections are shown, by the section that it belongs to."""


def require_sections(names: Iterable[str]) -> None:
    """Refuse a name that no section has.

    Raises:
        BadInput: there is such a name.
    """
    for name in names:
        if name not in SECTIONS:
            raise BadInput(f"no section {name!r}; there are {', '.join(SECTIONS)}")


def page_html(
    found: Findings, sections: Sequence[Section], folded: Sequence[Section] | None = None
) -> str:
    """Return the page, with every text escaped.

    What stands in front comes from `sections`; `folded` are those below, all without it.
    """
    shown = [each for each in folded or sections if any(map(_is_folded, each.blocks))]
    front = [block for each in sections for block in each.blocks if _is_front(block)]
    return rendered(masthead(found), _notices(found), shown, list(marked(found)), front)


def rendered(
    head: Masthead,
    notices: Sequence[tuple[str, str]],
    sections: Sequence[Section],
    results: Sequence[tuple[str, str]] = (),
    front: Sequence[Block] = (),
) -> str:
    """Return a page with notices, pairs of heading and text, at its top.

    Without `results`, pairs of question and answer, its sections are open. A cell links only to
    what the page has.
    """
    from jinja2 import Environment

    environment = Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, finalize=_printable
    )
    # The table of a figure in front stands in its section.
    shown: list[Block] = [block for block in front if not isinstance(block, Figure)]
    shown += [block for each in sections for block in each.blocks if _is_folded(block)]
    ids = {name for block in shown for name in _ids(block) if name}
    environment.globals |= {"zip": zip, "plain_cells": _plain_cells, "ids": ids}
    source = (files("analysis.report") / "report.html").read_text(encoding="utf-8")
    return environment.from_string(source).render(
        masthead=head, notices=notices, sections=sections, paragraphs=results, front=front
    )


def _ids(block: Block) -> Iterator[str]:
    """Yield the names that links to parts of `block` use."""
    match block:
        case Table():
            cells = (cell for row in block.rows for cell in row if isinstance(cell, Cell))
            yield from (block.name, *(cell.anchor for cell in cells))
        case TableGroup():
            for table in block.tables:
                yield from _ids(table)
        case Figure(table=Table() as table):
            yield from _ids(table)


def _plain_cells(table: Table, row: Row) -> str | None:
    """Return the markup of a row's cells after the first one, None if some are more than texts.

    A large study has half a million of them, and the template's macros take much longer.
    """
    texts = [cell for cell in row[1:] if isinstance(cell, str)]
    if len(texts) < len(row) - 1:
        return None
    kinds = (column.kind for column in table.columns[1:])
    return "".join(map(_plain_cell, kinds, texts))


@lru_cache(maxsize=10_000)
def _plain_cell(kind: ColumnKind, text: str) -> str:
    aligned = "" if kind == "number" else f' class="{kind}"'
    return f"<td{aligned}>{escape(printable(text), quote=False)}</td>"


def _is_front(block: Block) -> bool:
    return getattr(block, "front", False)


def _is_folded(block: Block) -> bool:
    """Return whether a section shows something of `block`: of a front figure, its table."""
    if isinstance(block, Figure):
        return bool(block.draw or block.instead)
    return bool(block) and not _is_front(block)


def _printable(value: object) -> object:
    """Replace control characters and bidirectional overrides in texts; keep markup as markup."""
    return type(value)(printable(value)) if isinstance(value, str) else value


def _notices(found: Findings) -> list[tuple[str, str]]:
    """Return the warnings at the top of the page, as pairs of heading and text."""
    notices = []
    if found.rehearsals:
        notices.append(("Rehearsals.", "These scores are no evidence about participants."))
    if found.origin.broken_chains:
        notices.append(("Changed journal.", changed_journal(found.origin.broken_chains)))
    return notices
