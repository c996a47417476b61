"""What stands above the results: title, authors, and the facts that a reader asks for first."""

from dataclasses import dataclass
from importlib.metadata import version

from analysis.report.findings import Findings
from analysis.report.wording import count_of
from protocol.journal.shared_form import UNKNOWN_UTC


@dataclass(frozen=True, kw_only=True)
class Masthead:
    """Title and authors of the study, and its facts by name, those that are known."""

    title: str
    authors: str
    facts: dict[str, str]


def masthead(found: Findings) -> Masthead:
    """Return the head of the page."""
    publication = found.study.publication
    facts = {
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
        authors=", ".join(publication.authors),
        facts={name: text for name, text in facts.items() if text},
    )


def _participants(found: Findings) -> str:
    table = found.loaded.table
    scored, conditions = (int(table.given.any(axis=axis).sum()) for axis in (1, 0))
    ratings = count_of(int(found.loaded.scored["score"].notna().sum()), "rating")
    return f"{scored}, with {ratings} of {count_of(conditions, 'condition')}"


def _sessions(found: Findings) -> str:
    """Return the known days of the sessions, in UTC; of a published table the file it came from."""
    if found.published:
        return f"a published table, {'; '.join(found.loaded.recording.sources) or 'no file named'}"
    answered = found.loaded.trials["answered_utc"].dropna()
    known = answered[answered.dt.year > UNKNOWN_UTC.year]
    days = sorted(known.dt.strftime("%Y-%m-%d").unique())
    when = "" if not days else days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
    kind = " (rehearsals)" if found.rehearsals else ""
    return f"{when}{kind}".strip()
