"""The study that describes imported scores: its file, and the events of its sessions."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from statistics import fmean

from analysis.tables.ratings import EXPECTED, Imported, Visit
from protocol.journal.events import ScoresImported
from protocol.journal.records import ImportedRating
from protocol.study.rules import PAPERS_SCALE
from protocol.study.study import PAPERS_CONDITIONS
from protocol.study_file.loading import template
from protocol.study_file.toml import in_toml

_MOST_PLANNED, _MOST_REPEATS = 10_000, 20
"""Participants, and repeats, that a study file can plan."""


def is_papers(imported: Imported) -> bool:
    """Return whether the scores are like the paper's Table 4: of its conditions, on its scale."""
    names = {name.casefold() for name in imported.conditions}
    low, high = PAPERS_SCALE.minimum, PAPERS_SCALE.maximum
    on_scale = low <= imported.scale[0] and imported.scale[1] <= high
    told = not imported.scale_known or imported.scale == (low, high)
    return names == set(PAPERS_CONDITIONS) and imported.is_plain and on_scale and told


def described(imported: Imported, source: str, digest: str) -> tuple[str, Imported]:
    """Return the text of the study that the scores become, and them with its names.

    Scores like the paper's become a study of the paper's protocol, whose contrasts are known.
    """
    if is_papers(imported):
        alike = {each: each.casefold() for each in imported.conditions}
        return template("paper"), _renamed(imported, alike)
    return study_text(imported, source, digest), imported


def _renamed(imported: Imported, names: Mapping[str, str]) -> Imported:
    def of_paper(visit: Visit) -> Visit:
        ratings = (replace(each, condition=names[each.condition]) for each in visit.ratings)
        return replace(visit, ratings=tuple(ratings))

    conditions = tuple(names[name] for name in imported.conditions)
    visits = tuple(map(of_paper, imported.visits))
    return replace(imported, visits=visits, conditions=conditions)


def study_text(imported: Imported, source: str, digest: str) -> str:
    """Return the text of the study file that describes the scores.

    Args:
        imported: the scores.
        source: the name of their file.
        digest: its SHA-256.
    """
    low, high = imported.scale
    people: dict[str | None, set[str]] = defaultdict(set)
    for visit in imported.visits:
        people[visit.group].add(visit.participant)
    many = len({visit.participant for visit in imported.visits})
    repeats = min(_repeats(imported), _MOST_REPEATS)
    scored = [each for each in imported.ratings if each.score is not None]
    always = any(each.answer not in {None, EXPECTED} for each in scored)
    lines = [
        f"# Scores imported from {in_toml(source)}.",
        f"# SHA-256 of that file: {digest}",
        "# This study describes them and cannot be run: nothing says what was touched.",
        "[study]",
        'name = "imported"',
        "",
        "[session]",
        'languages = ["en"]',
        "",
        "[design]",
        *([] if imported.groups or many > _MOST_PLANNED else [f"participants = {many}"]),
        f"sessions = {len({visit.session for visit in imported.visits})}",
        *([f"repeats = {repeats}"] if repeats > 1 else []),
        "",
        "[rating]",
        f"minimum = {low}",
        f"maximum = {high}",
        *([] if imported.scale_known else ["known = false  # the lowest and the highest score"]),
        *(['score_when = "always"'] if always else []),
    ]
    for group in imported.groups:
        lines += ["", "[[group]]", f"name = {in_toml(group)}", f"size = {len(people[group])}"]
    for condition in imported.conditions:
        lines += ["", "[[condition]]", f"name = {in_toml(condition)}"]
        lines += _of_condition(imported, condition)
    return "\n".join(lines) + "\n"


def _repeats(imported: Imported) -> int:
    """Return how often most subjects scored a condition in a session."""
    counts = Counter[int]()
    for visit in imported.visits:
        counts.update(Counter(each.condition for each in visit.ratings).values())
    return counts.most_common(1)[0][0]


def _of_condition(imported: Imported, condition: str) -> Iterator[str]:
    if condition in imported.contrasts:
        yield f"contrast = {imported.contrasts[condition]!r}"
    if cell := imported.cells.get(condition):
        values = ", ".join(f"{in_toml(name)} = {in_toml(value)}" for name, value in cell.items())
        yield f"factors = {{ {values} }}"


def events_of(imported: Imported, source: str, digest: str) -> Iterator[ScoresImported]:
    """Yield the event of each subject's session; `source` and `digest` are those of the file."""
    plain = imported.is_plain
    for visit in imported.visits:
        yield ScoresImported(
            participant=visit.participant,
            session=visit.session,
            conditions=imported.conditions,
            scores=_means(imported, visit),
            source=source,
            source_sha256=digest,
            group=visit.group,
            ratings=None if plain else _ratings(visit),
        )


def _means(imported: Imported, visit: Visit) -> dict[str, float | None]:
    by_name: dict[str, list[float]] = defaultdict(list)
    for each in visit.ratings:
        if each.score is not None:
            by_name[each.condition].append(each.score)
    return {name: fmean(by_name[name]) if by_name[name] else None for name in imported.conditions}


def _ratings(visit: Visit) -> tuple[ImportedRating, ...]:
    return tuple(
        ImportedRating(
            condition=each.condition,
            score=each.score,
            answer=each.answer,
            contrast=each.contrast,
        )
        for each in visit.ratings
    )
