"""The README of an exported data set: what it holds, how to read it, what is not in it."""

from html import escape

from analysis.export.dataset import Dataset, counted
from analysis.loading.study_data import changed_journal

_REHEARSALS = (
    "**Rehearsals.** Data of dry runs are among these: simulated device or virtual answers. They "
    "are marked `rehearsal` in the column `session_kind` and are no results.\n"
)

_ROWS = (
    "A row is a trial that was begun. A column that holds a value for each touch of the trial "
    "has semicolons between them. Voltages are amplitudes (peak), lengths, forces and times "
    "are in SI units. A score that was not asked for or not given is missing, never zero. "
    "Trials that were taken out afterwards are still here, marked in the column `excluded` "
    "with the reason; the analysis leaves them out.\n"
)
_RULES = (
    "; the rules of exclusion in the study file are not applied here: the analysis applies them"
)
_PUBLISHED_ROWS = (
    "A row is a score of a subject under a condition; columns about what the table did not say, "
    "such as touches and times, are empty. A score that was not given is missing, never zero. "
    "Subjects that were taken out afterwards are still here, marked in the column `excluded` with "
    "the reason; the analysis leaves them out.\n"
)


def readme(data: Dataset, tables: str) -> str:
    """Return the text of the README.

    Args:
        data: what is exported.
        tables: one paragraph on which files there are and how missing values are written.
    """
    parts = [
        f"# {_line(data.title)}\n",
        # Warnings stand at the top, before anybody looks at a number.
        *([changed(data)] if data.broken_chains else []),
        *([_REHEARSALS] if "rehearsal" in data.kinds else []),
        f"{_line(data.description())}\n",
        f"{tables}\n",
        _PUBLISHED_ROWS if data.published else _ROWS,
        f"- {counted(data.people, 'participant')}, {counted(len(data.sessions), 'session')}, "
        f"{counted(len(data.tables.flat), 'trial')}\n"
        f"- excluded: {counted(data.trials_excluded, 'trial')}"
        f"{_RULES * bool(data.study.exclusions.model_dump(exclude_none=True))}\n"
        f"- not here: {counted(data.rehearsals_left_out, 'rehearsal')}, "
        f"{counted(data.tables.found.withdrawn, 'withdrawn session')}, "
        f"{counted(data.sessions_without_trials, 'session')} in which no trial was begun\n",
        *_facts(data),
        f"Written by touchbeam {data.touchbeam} from the study's journal "
        f"(SHA-256 of its events: {data.source_sha256}).\n",
    ]
    return "\n".join(parts)


def changed(data: Dataset) -> str:
    """Return what a reader of data from a changed journal must know first."""
    return f"**Changed journal.** {_line(changed_journal(data.broken_chains))}\n"


def _facts(data: Dataset) -> list[str]:
    """Return what the study's author gave, a list each; nothing where nothing was given."""
    facts = data.facts
    lists = {
        "Ethics approvals": facts.ethics_approvals,
        "Funding": facts.funding,
        "References": facts.references,
    }
    return [
        f"{title}:\n\n" + "".join(f"- {_line(entry)}\n" for entry in entries)
        for title, entries in lists.items()
        if entries
    ]


def _line(text: str) -> str:
    """Return the text as one line that stays text where the README is shown as a page."""
    # Titles and names may come from a stranger's study file.
    return escape(" ".join(text.split()), quote=False)
