"""HTML page of the report: one file that needs no network."""

from collections.abc import Callable, Sequence
from importlib.resources import files

from analysis.loading.study_data import changed_journal
from analysis.report.blocks import Section
from analysis.report.findings import Findings
from analysis.report.sections import (
    differences,
    effects,
    left_out,
    measured,
    methods,
    model_checks,
    predictions,
    provenance,
    ranges,
    scores,
    sensitivity,
    session_checks,
    trials,
)
from protocol.study.fields import printable

SECTIONS: tuple[Callable[[Findings], Section], ...] = (
    scores.section,
    differences.section,
    effects.section,
    predictions.section,
    sensitivity.section,
    measured.section,
    model_checks.predictive,
    model_checks.recovery,
    ranges.section,
    session_checks.section,
    scores.own_questions,
    left_out.section,
    methods.section,
    provenance.section,
    trials.section,
)
"""The sections of the page, in order."""


def page_html(found: Findings, sections: Sequence[Section]) -> str:
    """Return the page, with every text escaped."""
    shown = [each for each in sections if each.blocks]
    return rendered(found.title, _notices(found), shown)


def rendered(title: str, notices: Sequence[tuple[str, str]], sections: Sequence[Section]) -> str:
    """Return a page of sections with notices, pairs of heading and text, at its top."""
    from jinja2 import Environment

    environment = Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, finalize=_printable
    )
    environment.globals["zip"] = zip
    source = (files("analysis.report") / "report.html").read_text(encoding="utf-8")
    return environment.from_string(source).render(title=title, notices=notices, sections=sections)


def _printable(value: object) -> object:
    """Replace control characters and bidirectional overrides in texts; keep markup as markup."""
    return type(value)(printable(value)) if isinstance(value, str) else value


def _notices(found: Findings) -> list[tuple[str, str]]:
    """Return the warnings at the top of the page, as pairs of heading and text."""
    notices = []
    if found.rehearsals:
        text = (
            "These scores come from rehearsals, not from sessions with participants. They are not "
            "evidence about participants."
        )
        notices.append(("Rehearsals.", text))
    if found.origin.broken_chains:
        notices.append(("Changed journal.", changed_journal(found.origin.broken_chains)))
    return notices
