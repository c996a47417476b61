"""HTML page of the report: one file that needs no network."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import KW_ONLY, dataclass
from functools import lru_cache, partial
from html import escape
from importlib.metadata import version
from importlib.resources import files
from types import MappingProxyType

import numpy as np

from analysis.estimates import NotEstimable
from analysis.loading.response import IN_WORDS
from analysis.loading.study_data import changed_journal
from analysis.report import blocks
from analysis.report.findings import Findings
from analysis.report.sections import (
    conditions,
    groups_and_factors,
    methods,
    model_checks,
    noticed,
    predictions,
    registration,
    scores,
    sensitivity,
    session_checks,
    thresholds,
)
from analysis.report.wording import count_of
from analysis.statistics.detection import Detection
from analysis.statistics.omnibus import Friedman
from analysis.statistics.signed_rank import SignedRank
from device.friction.laws import LAWS
from protocol.errors import BadInput, listed
from protocol.journal.events import UNKNOWN_UTC
from protocol.study.fields import printable

# The terms of the report, each in a sentence or two, for readers of other fields.

_TERMS = {
    "95% CI": "confidence interval, or for levels, gains and d the interval that holds the value "
    "with a probability of 95%, given the model.",
    "contrast": "predicted change of friction, as a difference of natural logarithms: .10 is a "
    "change of about 10%. It is positive if friction changes as the study expects. At a place: "
    "friction there before and after. Over a path: root mean square difference along the way. "
    "Growth of a swing: how much more friction varies along the way than before.",
    "d": "how much more strongly a change of one SD of the contrasts is felt, in SDs of the noise "
    "in a subject's perception.",
    "d′": "how much more often changes are reported with a signal than on catch trials: z of the "
    "one share less z of the other.",
    "gain": "rating points per unit of contrast: a subject's sensitivity.",
    "as expected": "the answer that the study file expects of a condition; the other way is its "
    "opposite, such as rougher in place of smoother.",
    "Holm's correction": "p-values of several tests, raised so that where nothing has an effect "
    "any is called significant in at most 5% of studies.",
    "Kendall's W": "agreement of the subjects' rankings: 0 none, 1 perfect.",
    "law": "how friction follows from vibration. {laws}: printed is the paper's law as it "
    "stands, consistent repairs it so that it has the right limits, coulomb cannot exceed "
    "Coulomb's friction.",
    "level": "the rating that a subject gives to a change of medium size, the mean of the "
    "rated contrasts.",
    "p": "probability of data at least as far from no effect as these, if there is none.",
    "response": f"{IN_WORDS}. Every answer counts.",
    "r": "rank-biserial correlation: 1 if every subject whose responses differ has more for the "
    "first condition. Its interval is for this pair alone; p is corrected for all pairs.",
    "relative gain": "a subject's gain less the mean gain of all subjects.",
    "rung": "how the beam's motion is computed; the top rung is the most accurate.",
}


_OF_ANSWERS = frozenset({"as expected", "response"})
_OF_CONDITIONS = frozenset(
    {"d", "gain", "Holm's correction", "Kendall's W", "level", "r", "relative gain"}
)
_OF_SCORES = {
    "contrast": "predicted log friction of the last touch, relative to {rest}: −.10 "
    "is friction lower by about 10%.",
    "level": "the score that a subject gives to a touch of medium friction, the mean of the "
    "rated contrasts.",
}
"""What terms mean where what is felt is scored without a question."""
_OF_IMPORTED = {
    "as expected": "the answer that was said to be the expected one when the scores were imported; "
    "the other way is its contrary.",
    "contrast": "change of the logarithm of friction that the author of the scores predicts: .10 "
    "is a change of about 10%.",
}
"""What terms mean of imported scores."""
_OF_PREDICTIONS = frozenset({"contrast", "gain", "law", "level", "relative gain", "rung"})


def glossary(found: Findings) -> blocks.Section:
    """Return the terms that stand on the page, in alphabetical order."""
    own = _OF_SCORES if found.at_once else _OF_IMPORTED if found.study.imported else {}
    told = _TERMS | own
    if not found.is_predicted:
        told |= {"95% CI": "confidence interval, which holds the value in 95% of studies."}
    entries = {
        name: found.in_measure(
            told[name].replace("{laws}", ", ".join(LAWS)).replace("{rest}", found.rest)
        )
        for name in sorted(_TERMS.keys() - set(_absent(found)), key=str.casefold)
    }
    return blocks.Section(title="Glossary", blocks=[blocks.Definitions(entries=entries)])


def _absent(found: Findings) -> Iterator[str]:
    """Yield the terms of what this study did not ask, or what these data cannot tell."""
    if found.measure == "score":
        yield from _OF_ANSWERS
    if not found.is_predicted:
        yield from _OF_PREDICTIONS
    if len(found.shown_laws) < 2:
        yield from ("law", "rung")
    if not (
        found.study.track or any(isinstance(it.found, Detection) for it in found.trials.noticed)
    ):
        yield "d′"
    if not found.loaded.table.conditions:
        yield from (*_OF_CONDITIONS, *_OF_ANSWERS)
    else:
        yield from _untold(found)


def _untold(found: Findings) -> Iterator[str]:
    """Yield the terms of comparisons of conditions and of models that could not be made."""
    tests = found.trials.response_tests
    if not isinstance(tests.omnibus, Friedman):
        yield "Kendall's W"
    if not any(isinstance(pair.test, SignedRank) for pair in tests.pairwise):
        yield "r"
    if not found.is_predicted or isinstance(found.sensitivity.noticing, NotEstimable):
        yield "d"


# What stands above the results: title, authors, and the facts that a reader asks for first.


@dataclass(frozen=True, kw_only=True)
class Masthead:
    """Title and authors of the study, and its facts by name, those that are known."""

    title: str
    authors: str
    facts: dict[str, str]


def masthead(found: Findings) -> Masthead:
    publication = found.study.publication
    facts = {
        # A publication's title hides the name under which the operator knows the study.
        "study": found.study.study.name if found.title != found.study.study.name else "",
        "institution": publication.institution or "",
        "ethics": "; ".join(publication.ethics_approvals),
        "participants": _participants(found),
        "sessions": _sessions(found),
        "device": "; ".join(found.loaded.recording.devices),
        "software": f"touchbeam {version('touchbeam')}",
    }
    return Masthead(
        title=found.title,
        authors=listed(publication.authors),
        facts={name: text for name, text in facts.items() if text},
    )


def _participants(found: Findings) -> str:
    table = found.loaded.table
    if not table.conditions:
        return f"{len(table.subjects)}, in {count_of(len(found.study.track), 'track')} alone"
    given = found.trials.response_tests.table.given
    people, conditions = (int(given.any(axis=axis).sum()) for axis in (1, 0))
    answers = count_of(int(np.isfinite(found.trials.responses).sum()), "answer")
    ratings = count_of(int(found.loaded.scored["score"].notna().sum()), "rating")
    told = ratings if found.measure == "score" else f"{answers} and {ratings}"
    return f"{people}, with {told} of {count_of(conditions, 'condition')}"


def _sessions(found: Findings) -> str:
    """Return the known days of the sessions, in UTC; of imported scores the file they came from."""
    if found.published:
        return (
            f"imported from a table, {'; '.join(found.loaded.recording.sources) or 'no file named'}"
        )
    # Sessions that an earlier version imported from a data set begin in 1970.
    answered = found.loaded.trials["answered_utc"].dropna()
    known = answered[answered.dt.year > UNKNOWN_UTC.year]
    days = sorted(known.dt.strftime("%Y-%m-%d").unique())
    when = "" if not days else days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
    kind = " (rehearsals)" if found.rehearsals else ""
    count = len(found.loaded.trials[["participant", "session"]].drop_duplicates())
    return f"{count:,}{kind}{f', {when}' * bool(when)}"


@dataclass(frozen=True)
class Part:
    """A section of the page, and what is known of it before it is made.

    Attributes:
        make: makes the section.
        figures: names of all the figures that it may have.
        front: makes what stands among the results whichever sections are shown.
        of_tracks: whether a study of tracks alone has it; all others compare conditions.
        of_predictions: whether it is about predicted friction, which not every surface has.
    """

    make: Callable[[Findings], blocks.Section]
    _: KW_ONLY
    figures: Sequence[str] = ()
    front: Callable[[Findings], Iterable[blocks.Block]] | None = None
    of_tracks: bool = False
    of_predictions: bool = False


def _each(
    *makes: Callable[[Findings], blocks.Block],
) -> Callable[[Findings], Iterable[blocks.Block]]:
    return lambda found: (make(found) for make in makes)


SECTIONS: Mapping[str, Part] = MappingProxyType(
    {
        "table4": Part(scores.section, front=_each(scores.score_table, scores.notes)),
        "methods": Part(methods.section),
        "registration": Part(registration.section, of_tracks=True),
        "thresholds": Part(
            thresholds.section,
            figures=thresholds.FIGURES,
            front=thresholds.curves_figures,
            of_tracks=True,
        ),
        "tests": Part(
            conditions.tests, figures=("scores", "people"), front=_each(conditions.scores_figure)
        ),
        "groups": Part(groups_and_factors.groups, figures=("groups",)),
        "detection": Part(noticed.section, figures=("noticed",)),
        "factors": Part(groups_and_factors.factors, figures=groups_and_factors.FIGURES),
        "sensitivity": Part(
            sensitivity.section,
            figures=sensitivity.FIGURES,
            front=_each(sensitivity.front_figure),
            of_predictions=True,
        ),
        "model": Part(
            predictions.section,
            figures=("model", "levels"),
            front=_each(predictions.ratings_figure),
            of_predictions=True,
        ),
        "questions": Part(scores.own_questions, of_tracks=True),
        "left-out": Part(session_checks.left_out, of_tracks=True),
        "checks": Part(session_checks.section, figures=session_checks.FIGURES),
        "recovery": Part(model_checks.recovery, of_predictions=True),
        "contrasts": Part(model_checks.section, of_predictions=True),
        "glossary": Part(glossary, of_tracks=True),
        "provenance": Part(methods.provenance, of_tracks=True),
        "trials": Part(scores.trials, of_tracks=True),
    }
)
"""The sections of the page by name, in the order in which an author needs them."""
FORMER_SECTIONS = frozenset({"agreement", "measured", "multiverse", "predictive"})
"""Sections of earlier versions, which the `report.toml` of a study may still name."""


def require_sections(names: Iterable[str]) -> None:
    """Refuse a name that no section has.

    Raises:
        BadInput: there is such a name.
    """
    for name in names:
        if name not in SECTIONS:
            raise BadInput(f"no section {name!r}; there are {', '.join(SECTIONS)}")


def page_html(
    found: Findings,
    sections: Sequence[blocks.Section],
    folded: Sequence[blocks.Section] | None = None,
) -> str:
    """Return the page, with every text escaped.

    What stands in front comes from `sections`; `folded` are those below, all without it.
    """
    shown = [each for each in folded or sections if any(map(_is_folded, each.blocks))]
    # The results stand on the page whichever sections are folded below.
    front = [block for each in sections for block in each.blocks if _is_front(block)]
    return rendered(
        masthead(found), _notices(found), shown, list(registration.marked(found)), front
    )


def rendered(
    head: Masthead,
    notices: Sequence[tuple[str, str]],
    sections: Sequence[blocks.Section],
    results: Sequence[tuple[str, str]] = (),
    front: Sequence[blocks.Block] = (),
) -> str:
    """Return a page with notices, pairs of heading and text, at its top.

    Without `results`, pairs of question and answer, its sections are open. A cell links only to
    what the page has.
    """
    # Only a page needs it, and most commands make none.
    from jinja2 import Environment

    # Everything is escaped, because texts of a study may come from a stranger.
    environment = Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, finalize=_printable
    )
    # The table of a figure in front stands in its section.
    shown: list[blocks.Block] = [block for block in front if not isinstance(block, blocks.Figure)]
    shown += [block for each in sections for block in each.blocks if _is_folded(block)]
    # A section that is left out takes its tables along, and links to them would lead nowhere.
    ids = {name for block in shown for name in _ids(block) if name}
    environment.globals["row_html"] = partial(_row_html, ids)
    source = (files("analysis.report") / "report.html").read_text(encoding="utf-8")
    return environment.from_string(source).render(
        masthead=head, notices=notices, sections=sections, paragraphs=results, front=front
    )


def _ids(block: blocks.Block) -> Iterator[str]:
    """Yield the names that links to parts of `block` use."""
    match block:
        case blocks.Table():
            cells = (cell for row in block.rows for cell in row if isinstance(cell, blocks.Cell))
            yield from (block.name, *(cell.anchor for cell in cells))
        case blocks.TableGroup():
            for table in block.tables:
                yield from _ids(table)
        case blocks.Figure(table=blocks.Table() as table):
            yield from _ids(table)


def _row_html(ids: Set[str], table: blocks.Table, row: blocks.Row) -> str:
    """Return the markup of a row; a cell links only to one of the `ids`.

    A large study has half a million cells, and a template's macros take much longer.
    """
    first, *cells = (blocks.Cell(text=each) if isinstance(each, str) else each for each in row)
    shown = "".join(map(partial(_cell_html, ids), table.columns[1:], cells))
    opened = f'<tr{_attribute("id", first.anchor)}><th scope="row">'
    return f"{opened}{_linked(ids, first)}</th>{shown}</tr>"


def _cell_html(ids: Set[str], column: blocks.Column, cell: blocks.Cell) -> str:
    plain = "" if column.kind == "number" else column.kind
    kind = f"{column.kind} missing" if cell.missing else plain
    named = ("id", cell.anchor), ("class", kind), ("title", cell.why)
    attributes = "".join(_attribute(*each) for each in named)
    return f"<td{attributes}>{_linked(ids, cell)}</td>"


def _linked(ids: Set[str], cell: blocks.Cell) -> str:
    if cell.target not in ids:
        return _escaped(cell.text)
    label = _attribute("aria-label", cell.label)
    return f"<a{_attribute('href', f'#{cell.target}')}{label}>{_escaped(cell.text)}</a>"


def _attribute(name: str, value: str) -> str:
    return f' {name}="{escape(printable(value))}"' if value else ""


@lru_cache(maxsize=10_000)
def _escaped(text: str) -> str:
    return escape(printable(text), quote=False)


def _is_front(block: blocks.Block) -> bool:
    return getattr(block, "front", False)


def _is_folded(block: blocks.Block) -> bool:
    """Return whether a section shows something of `block`: of a front figure, its table."""
    if isinstance(block, blocks.Figure):
        return bool(block.draw or block.instead)
    return bool(block) and not _is_front(block)


def _printable(value: object) -> object:
    """Replace control characters and bidirectional overrides in texts; keep markup as markup."""
    # `type(value)` keeps markup, which is a text of its own class, from being escaped twice.
    return type(value)(printable(value)) if isinstance(value, str) else value


def _notices(found: Findings) -> list[tuple[str, str]]:
    """Return the warnings at the top of the page, as pairs of heading and text."""
    notices = []
    # A reader must see both before any number.
    if found.rehearsals:
        notices.append(("Rehearsals.", "These scores are no evidence about participants."))
    if not found.loaded.table.conditions:
        alone = "The study has tracks and no conditions: sections that compare those are left out."
        notices.append(("Tracks alone.", alone))
    if found.origin.broken_chains:
        notices.append(("Changed journal.", changed_journal(found.origin.broken_chains)))
    return notices
