"""What was understood of a table of scores, in words."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence, Set

from analysis.tables.ratings import ANSWERS, CONTRARY, EXPECTED, SAME, Entry, Imported
from analysis.tables.shape import Shape
from analysis.tables.table_cells import MOST_NAMED, Cells
from protocol.errors import listed


def understood(
    cells: Cells, shape: Shape, imported: Imported, entries: Sequence[Entry]
) -> Iterator[str]:
    """Yield in lines what a table holds: its scores, and the same as they stand in it."""
    yield from _shape_lines(cells, shape, imported)
    yield _scale_line(imported, entries)
    yield _missing_line(imported, entries)
    yield from _copies(cells, shape)


def _shape_lines(cells: Cells, shape: Shape, imported: Imported) -> Iterator[str]:
    what = "wide, a column per condition" if shape.is_wide else "long, a row per score"
    yield f"{cells.source}: {what}; {', '.join(cells.understood)}."
    people = {visit.participant for visit in imported.visits}
    subject = shape.roles.column("subject")
    whose = f" (column {cells.named(subject)})" if subject is not None else ""
    columns = listed(cells.named(at) for at in shape.parts)
    of = f" (column{'s' * (len(shape.parts) > 1)} {columns})" if shape.parts else ""
    yield (
        f"Subjects: {len(people)}{whose}. "
        f"Conditions: {len(imported.conditions)}{of}: {listed(imported.conditions)}."
    )
    if (score := shape.roles.column("score")) is not None:
        yield f"Scores: column {cells.named(score)}."
    counts = Counter(
        (visit.participant, visit.session, each.condition)
        for visit in imported.visits
        for each in visit.ratings
    )
    if max(counts.values()) > 1:
        least, most = min(counts.values()), max(counts.values())
        times = f"{most}" if least == most else f"{least} to {most}"
        yield f"Repeats: {times} of each subject and condition."
    sessions = {visit.session for visit in imported.visits}
    if len(sessions) > 1:
        yield f"Sessions: {listed(map(str, sorted(sessions)))}."
    if imported.groups:
        yield f"Groups: {listed(imported.groups)}."
    if contrasts := imported.contrasts:
        given = (f"{name} {contrast:g}" for name, contrast in contrasts.items())
        yield f"Contrasts: {', '.join(given)}."
    elif any(rating.contrast is not None for rating in imported.ratings):
        yield "Contrasts: they differ by row."


def _copies(cells: Cells, shape: Shape) -> Iterator[str]:
    """Yield how many rows of a long table are copies, or a score that was given again."""
    copies = len(cells.rows) - len(set(map(tuple, cells.rows)))
    if copies and not shape.is_wide:
        rows = "1 row is" if copies == 1 else f"{copies} rows are"
        yield f"{rows} like another one in every cell; each counts as a repeat."


def _scale_line(imported: Imported, entries: Sequence[Entry]) -> str:
    scores = [entry.score for entry in entries if entry.score is not None]
    seen = f"scores from {min(scores):g} to {max(scores):g}" if scores else "no scores"
    low, high = imported.scale
    if imported.scale_known:
        return f"Scale: {low} to {high}; {seen}."
    return f"Scale: not known (--scale LOW HIGH says it); {seen}."


def _missing_line(imported: Imported, entries: Sequence[Entry]) -> str:
    blank = sum(entry.score is None and entry.answer in {None, EXPECTED} for entry in entries)
    people = {visit.participant for visit in imported.visits}
    met = {
        (visit.participant, each.condition) for visit in imported.visits for each in visit.ratings
    }
    withheld = sum(entry.score is None and entry.answer in {CONTRARY, SAME} for entry in entries)
    absent = len(people) * len(imported.conditions) - len(met)
    answers = Counter(entry.answer for entry in entries if entry.answer)
    told = [f"{blank} score{'s' * (blank > 1)} blank"] * bool(blank)
    told += [f"{withheld} without a score after another answer"] * bool(withheld)
    unanswered = sum(entry.answer is None and entry.score is not None for entry in entries)
    if any(entry.answer for entry in entries) and unanswered:
        told += [f"{unanswered} without an answer, which do not count"]
    told += [f"{absent} of a subject and condition without a row"] * bool(absent)
    said = f"Missing: {', '.join(told) or 'none'}."
    if answers:
        counts = (f"{answers[it]} {it}" for it in ANSWERS if answers[it])
        said += f" Answers: {', '.join(counts)}."
    return said


def left_out_lines(
    shape: Shape, rows: Mapping[str, int], silent: Set[str | tuple[str, ...]]
) -> Iterator[str]:
    """Yield what is left out, if anything is.

    Args:
        shape: which columns hold what.
        rows: how many rows hold no rating, by reason.
        silent: the subjects without any score, and as tuples of one the conditions.
    """
    many, named = len(shape.left_out), listed(shape.left_out[:MOST_NAMED])
    more = f" and {many - MOST_NAMED} more" if many > MOST_NAMED else ""
    told = [f"column{'s' * (many > 1)} {named}{more}"] * bool(many)
    told += [f"{many} row{'s' * (many > 1)} {why}" for why, many in rows.items()]
    subjects = sorted(name for name in silent if isinstance(name, str))
    conditions = sorted(name[0] for name in silent if isinstance(name, tuple))
    for kind, names in (("subject", subjects), ("condition", conditions)):
        if names:
            told.append(f"{kind}{'s' * (len(names) > 1)} without any score: {listed(names)}")
    if told:
        yield f"Left out: {'; '.join(told)}."
