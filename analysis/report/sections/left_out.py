"""Exclusions and interruptions: what the report leaves out and why, and what happened besides."""

from collections.abc import Iterable, Sequence

from analysis.loading.exclusions import rules_in_words
from analysis.loading.study_data import StudyData
from analysis.report.as_json import plain
from analysis.report.findings import Findings
from analysis.report.section import Items, Section, Table, columns
from analysis.report.wording import MISSING


def section(found: Findings) -> Section:
    """Return what is left out, and what happened in the sessions."""
    loaded = found.loaded
    counts = _counts(loaded)
    return Section(
        name="left-out",
        title="Exclusions and interruptions",
        blocks=[
            _rules_line(found),
            Items(
                lines=[
                    *(f"{why}: {count}" for why, count in counts.items()),
                    f"unfinished sessions: {_unfinished(found)}",
                ]
            ),
            _table(
                "left-out",
                "What is left out of every number of this report, and why.",
                ["participant", "session", "trial", "by", "why"],
                (
                    [e.participant, _or_all(e.session), _or_all(e.trial), e.by, e.why]
                    for e in loaded.left_out
                ),
            ),
            _table(
                "incidents",
                "Interruptions, and what the operator noted.",
                ["participant", "session", "trial", "what", "in words"],
                (
                    [e.participant, str(e.session), _or_none(e.trial), e.what, e.text]
                    for e in loaded.incidents
                ),
            ),
            _interruptions_line(found),
        ],
        data={
            "unfinished": list(loaded.unfinished),
            "left_out": counts,
            "exclusions": plain(loaded.left_out),
            "incidents": plain(loaded.incidents),
        },
    )


def _rules_line(found: Findings) -> str:
    rules = rules_in_words(found.study.exclusions)
    if not rules:
        return "The study settled no rules of exclusion beforehand."
    return f"Rules settled beforehand: {'; '.join(rules)}."


def _counts(loaded: StudyData) -> dict[str, int]:
    """How much of the study the report leaves out, by reason."""
    by_rule = [entry for entry in loaded.left_out if entry.by == "rule"]
    return {
        "rehearsals": loaded.rehearsals_left_out,
        "sessions excluded": loaded.sessions_excluded,
        "sessions withdrawn": loaded.sessions_withdrawn,
        "trials excluded": loaded.trials_excluded,
        "trials excluded by rule": sum(entry.trial is not None for entry in by_rule),
        "participants excluded by rule": len(
            {entry.participant for entry in by_rule if entry.trial is None}
        ),
    }


def _unfinished(found: Findings) -> str:
    if found.published:
        return "not known of a published table"
    return ", ".join(found.loaded.unfinished) or "none"


def _interruptions_line(found: Findings) -> str:
    """Say that nothing interrupted the sessions where that is known and so."""
    if found.published:
        return "What interrupted the sessions behind a published table is not known."
    if found.loaded.incidents:
        return ""
    if found.loaded.unfinished:
        return "No other incident was recorded."
    return "No session was interrupted, and nothing was noted."


def _table(
    name: str, caption: str, names: Sequence[str], rows: Iterable[Sequence[str]]
) -> Table | None:
    """A table of what happened, None where nothing did."""
    found = list(rows)
    if not found:
        return None
    return Table(name=name, caption=caption, columns=columns(*names, kind="text"), rows=found)


def _or_all(value: int | None) -> str:
    return "all" if value is None else str(value)


def _or_none(value: int | None) -> str:
    return MISSING if value is None else str(value)
