"""Exclusions with their reasons, interruptions, and operator notes."""

from collections.abc import Sequence
from functools import partial
from typing import Any

from analysis.estimates import plain
from analysis.loading.study_data import StudyData, rules_in_words
from analysis.report.blocks import Column, Items, Section, Table, text
from analysis.report.findings import Findings
from analysis.report.wording import place_of

_text = partial(Column, kind="text")


def section(found: Findings) -> Section:
    """Return the exclusions, and the incidents of the sessions."""
    loaded, rules = found.loaded, rules_in_words(found.study.exclusions)
    counts = _counts(loaded)
    unfinished = ", ".join(loaded.unfinished) or "none"
    if found.published:
        # A published table does not tell, which is not the same as none.
        unfinished = "unknown for a published table"
    return Section(
        name="left-out",
        title="Exclusions and interruptions",
        blocks=[
            f"Prespecified exclusion rules: {'; '.join(rules)}."
            if rules
            else "The study prespecified no exclusion rules.",
            Items(
                lines=[
                    f"rehearsals left out: {counts['rehearsals']}",
                    *(f"{why}: {n}" for why, n in counts.items() if why != "rehearsals"),
                    f"unfinished sessions: {unfinished}",
                ]
            ),
            _table(
                loaded.left_out,
                [_text("by", "by"), _text("reason", "why")],
                # A session without a number stands for all of them.
                lambda of: "all" if of is None else str(of),
                name="left-out",
                caption="Data excluded from every number in this report, with the reasons.",
            ),
            _table(
                loaded.incidents,
                [_text("event", "what"), _text("description", "text")],
                name="incidents",
                caption="Interruptions and operator notes.",
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


def _table(
    entries: Sequence[Any], further: Sequence[Column], place: Any = text, **told: str
) -> Table | None:
    """Return a table of what happened where, or None if nothing did."""
    where = ("participant", "session", "trial")
    columns = [*(_text(name, name, place) for name in where), *further]
    return Table.over(entries, columns, **told) if entries else None


_MOST_LINES = 12


def left_out_lines(loaded: StudyData) -> list[str]:
    """Return for the terminal who and what the report leaves out, and why."""
    said = [f"Left out: {place_of(entry)} ({entry.by}): {entry.why}" for entry in loaded.left_out]
    if len(said) > _MOST_LINES:
        more = len(said) - _MOST_LINES
        said[_MOST_LINES:] = [f"Left out: {more} more, listed under Exclusions in the report"]
    counts = _counts(loaded)
    said += [
        f"Left out: {what}: {counts[what]}"
        for what in ("rehearsals", "sessions withdrawn")
        if counts[what]
    ]
    return [*said, *(f"Not finished: {who}" for who in loaded.unfinished[:_MOST_LINES])]


def _counts(loaded: StudyData) -> dict[str, int]:
    """Return the numbers of excluded sessions, trials and participants, by reason."""
    by_rule = [entry for entry in loaded.left_out if entry.by == "rule"]
    return {
        "rehearsals": loaded.rehearsals_left_out,
        "sessions excluded": loaded.sessions_excluded,
        "sessions withdrawn": loaded.sessions_withdrawn,
        "trials excluded": loaded.trials_excluded,
        "trials excluded by rule": sum(e.trial is not None for e in by_rule),
        "participants excluded by rule": len({e.participant for e in by_rule if e.trial is None}),
    }


def _interruptions_line(found: Findings) -> str:
    """Return a sentence on missing incidents, or an empty text if there were incidents."""
    if found.published:
        return "Interruptions are unknown for a published table."
    if found.loaded.incidents:
        return ""
    if found.loaded.unfinished:
        return "No other incident was recorded."
    return "No interruptions or notes were recorded."
