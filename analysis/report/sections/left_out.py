"""Exclusions with their reasons, interruptions, and operator notes."""

from collections.abc import Sequence

from analysis.estimates import plain
from analysis.loading.records import Exclusion
from analysis.loading.study_data import StudyData, rules_in_words
from analysis.report.blocks import Items, Section, Table, columns
from analysis.report.findings import Findings
from analysis.report.wording import MISSING


def section(found: Findings) -> Section:
    """Return the exclusions, and the incidents of the sessions."""
    loaded = found.loaded
    counts = _counts(loaded)
    unfinished = ", ".join(loaded.unfinished) or "none"
    if found.published:
        # A published table does not tell, which is not the same as none.
        unfinished = "unknown for a published table"
    return Section(
        name="left-out",
        title="Exclusions and interruptions",
        blocks=[
            _rules_line(found),
            Items(
                lines=[
                    f"rehearsals left out: {counts['rehearsals']}",
                    *(f"{why}: {n}" for why, n in counts.items() if why != "rehearsals"),
                    f"unfinished sessions: {unfinished}",
                ]
            ),
            _table(
                "left-out",
                "Data excluded from every number in this report, with the reasons.",
                ["participant", "session", "trial", "by", "reason"],
                [[e.participant, e.session, e.trial, e.by, e.why] for e in loaded.left_out],
                missing="all",
            ),
            _table(
                "incidents",
                "Interruptions and operator notes.",
                ["participant", "session", "trial", "event", "description"],
                [[e.participant, e.session, e.trial, e.what, e.text] for e in loaded.incidents],
                missing=MISSING,
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


_MOST_LINES = 12


def left_out_lines(loaded: StudyData) -> list[str]:
    """Return for the terminal who and what the report leaves out, and why."""
    said = [f"Left out: {_place(entry)} ({entry.by}): {entry.why}" for entry in loaded.left_out]
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


def _place(entry: Exclusion) -> str:
    parts = {"session": entry.session, "trial": entry.trial}
    return ", ".join(
        [entry.participant, *(f"{name} {of}" for name, of in parts.items() if of is not None)]
    )


def _rules_line(found: Findings) -> str:
    rules = rules_in_words(found.study.exclusions)
    if not rules:
        return "The study prespecified no exclusion rules."
    return f"Prespecified exclusion rules: {'; '.join(rules)}."


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


def _table(
    name: str, caption: str, names: Sequence[str], rows: Sequence[Sequence[object]], missing: str
) -> Table | None:
    """Return a table of texts with `missing` in place of None, or None without rows."""
    texts = [[missing if cell is None else str(cell) for cell in row] for row in rows]
    kinds = columns(*names, kind="text")
    return Table(name=name, caption=caption, columns=kinds, rows=texts) if rows else None
