"""The shape of a table of scores: wide, a column per condition, or long, a row per score.

What could mean two things is refused, with both and the option that chooses.
"""

import re
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from types import MappingProxyType

from analysis.tables.roles import Roles, is_recorded, plain
from analysis.tables.summaries import (
    MEANS,
    beside_scores,
    difference_column,
    is_mean_of,
    may_sum_up,
    numbers_in,
    summing_column,
    summing_up,
)
from analysis.tables.table_cells import Cells, TableError, is_missing
from protocol.errors import listed, typed_as

_MOST_LEVELS = 30
"""Different values of a column that may tell conditions apart: a study has no more conditions."""

_LEAST_ALIKE = 6
"""Rows of other subjects whose numbers are those of the first one's: levels, and no chance."""

_FEW_TEXTS = 5
"""Different texts in a column of numbers that may all stand for no score."""


_YES_NO = frozenset(
    {"true", "false", "yes", "no", "ja", "nein", "oui", "non", "correct", "incorrect", "wrong", ""}
)
"""Words of a column that says of each row whether something is so, and names no condition."""


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Which columns hold what.

    - `scores`: columns of scores: one of a long table, one per condition of a wide one.
    - `parts`: columns whose values name the condition together; each is a factor if there are
      several, or if the table is wide.
    - `stems`: the condition of each column of a wide table.
    - `left_out`: columns that are nothing of this, by name.
    """

    is_wide: bool
    roles: Roles
    scores: tuple[int, ...]
    parts: tuple[int, ...]
    stems: Mapping[int, str]
    left_out: tuple[str, ...]
    notes: tuple[str, ...] = ()


class _Table:
    """A table with what is asked of its columns again and again."""

    def __init__(self, cells: Cells, roles: Roles, kept_means: bool) -> None:
        self.cells, self.roles, self.kept_means = cells, roles, kept_means

    def values(self, column: int) -> list[str]:
        return [row[column] for row in self.cells.rows]

    @cached_property
    def numeric(self) -> list[bool]:
        """Whether most of what stands in each column are numbers."""
        return [self.cells.is_numeric(at) for at in range(len(self.cells.header))]

    @cached_property
    def free(self) -> list[int]:
        """The columns without a role, and not a row number."""
        columns = range(len(self.cells.header))
        return [at for at in columns if at not in self.roles.of and not self.is_index(at)]

    def is_index(self, column: int) -> bool:
        """Whether a column without a name numbers the rows, perhaps anew in each part."""
        if self.cells.header[column]:
            return False
        numbers = [self.cells.number(cell) for cell in self.values(column)]
        first = numbers[0]
        steps = pairwise(numbers)
        rises = len(numbers) == 1 or len(set(numbers)) > 1
        return (
            first in {0.0, 1.0}
            and rises
            and all(
                after == first or (before is not None and after == before + 1)
                for before, after in steps
            )
        )

    def is_mean(self, column: int) -> bool:
        return not self.kept_means and plain(self.cells.header[column]) in MEANS

    def refuse(self, why: str) -> TableError:
        return TableError(f"{self.cells.source}: {why}")

    def names(self, columns: Sequence[int]) -> str:
        return self.cells.names(columns)


def shape_of(cells: Cells, roles: Roles, *, keep_means: bool = False) -> Shape:
    """Return the shape of a table of scores.

    Raises:
        TableError: there are no scores, no subject, or it could mean two things.
    """
    _require_names(cells)
    table = _Table(cells, roles, keep_means)
    numbers = [at for at in table.free if table.numeric[at] and not table.is_mean(at)]
    named = roles.columns("condition", "factor")
    if not roles.headings and (roles.column("score") is not None or named):
        _require_no_heading(table)
        return _long(table, numbers)
    if _is_long_unsaid(table, numbers):
        shape = _long(table, numbers)
        if len(shape.parts) > 1:
            raise _several(table, shape.parts)
        return shape
    return _wide(table, numbers)


def _require_names(cells: Cells) -> None:
    if not cells.rows:
        raise TableError(f"{cells.source}: must have a header and at least one row, got a header")
    seen: dict[str, int] = {}
    for at, name in enumerate(cells.header):
        if name and seen.setdefault(name.casefold(), at) != at:
            first = cells.header[seen[name.casefold()]]
            raise TableError(
                f"{cells.where()}: the columns {first!r} and {name!r} may be repeats or two "
                "conditions; call them apart, repeats with a number at the end"
            )


def _is_long_unsaid(table: _Table, numbers: Sequence[int]) -> bool:
    """Return whether a column of words tells apart each subject's rows, with one of numbers.

    It is the condition, whatever it is called.
    """
    roles = table.roles
    scores = [at for at in numbers if roles.of.get(at) is None]
    is_open = not (roles.headings or roles.subject_is or roles.repeat_is == "ending")
    return is_open and len(scores) == 1 and bool(_words_apart(table, roles))


def _words_apart(table: _Table, roles: Roles) -> list[int]:
    """Return the columns of words without a role that vary within subjects."""
    if roles.column("subject") is None:
        return []
    words = [at for at in table.free if at not in roles.of and not table.numeric[at]]
    told = {at: {word.casefold() for word in table.values(at)} for at in words}
    return [at for at in words if not told[at] <= _YES_NO and _varies_within(table, roles, at)]


def _numbers_apart(table: _Table, roles: Roles) -> list[int]:
    """Return the columns of numbers without a role that each subject meets once, all alike."""
    subject = roles.column("subject")
    assert subject is not None
    rows, who = table.cells.rows, set(table.values(subject))
    numbers = [at for at in table.free if at not in roles.of and table.numeric[at]]
    return [
        at
        for at in numbers
        if len(who) > 1 and len(who) * len({row[at] for row in rows}) == len(rows)
        and len({(row[subject], row[at]) for row in rows}) == len(rows)
    ]  # fmt: skip


# A wide table.


def _wide(table: _Table, numbers: Sequence[int]) -> Shape:
    cells, roles = table.cells, _with_subject(table)
    # A subject may be a number.
    free = [at for at in numbers if roles.of.get(at) != "subject"]
    _require_no_mixed(table, roles)
    sums = _sums(table, roles, free)
    scores = tuple(at for at in free if at not in sums)
    if not scores:
        raise table.refuse(
            f"no column holds scores, among {table.names(range(len(cells.header)))}; "
            "add --columns score=NAME"
        )
    unnamed = [at for at in scores if not cells.header[at]]
    if unnamed:
        raise TableError(
            f"{cells.where()}: every condition must have a name, got none in column "
            f"{unnamed[0] + 1}"
        )
    _require_no_levels(table, roles, scores)
    stems = _stems(table, scores)
    parts = tuple(roles.columns("factor", "condition"))
    _require_a_row_each(table, roles, parts)
    used = {*scores, *parts, *roles.columns("subject", "repeat", "session", "group")}
    return Shape(
        is_wide=True, roles=roles, scores=scores, parts=parts, stems=stems,
        left_out=_left_out(table, used, sums),
    )  # fmt: skip


def _require_no_levels(table: _Table, roles: Roles, scores: Sequence[int]) -> None:
    """Refuse a column of numbers that are the same in each subject's rows: levels of a stimulus."""
    subject, names = roles.column("subject"), [table.cells.named(at) for at in scores]
    if subject is None or roles.headings or len(scores) < 2:
        return
    by_subject: dict[str, list[Sequence[str]]] = defaultdict(list)
    for row in table.cells.rows:
        by_subject[row[subject]].append(row)
    several = [rows for rows in by_subject.values() if len(rows) > 1]
    # Of fewer rows scores, too, may be alike by chance.
    if sum(map(len, several[1:])) < _LEAST_ALIKE:
        return
    for at, name in zip(scores, names, strict=True):
        counts = {tuple(sorted(Counter(row[at] for row in rows).items())) for rows in several}
        (first, *others) = counts
        if not others and 1 < len(first) <= _MOST_LEVELS:
            rest = [other for other in names if other != name]
            score = rest[0] if len(rest) == 1 else "NAME"
            told = typed_as(f"condition={name},score={score}")
            raise table.refuse(
                f"{name} has the same numbers in each subject's rows: the condition (add --columns "
                f"{told}), or scores like {listed(rest)} (add --columns condition=heading)"
            )


def _require_no_mixed(table: _Table, roles: Roles) -> None:
    """Refuse a column of texts and a few numbers, and one of formulas: each may be a condition."""
    cells = table.cells
    for at in table.free:
        if table.numeric[at] or roles.of.get(at) == "subject" or table.is_mean(at):
            continue
        for row in range(len(cells.rows)):
            cells.require_no_formula(row, at)
        given = [cell for cell in table.values(at) if not is_missing(cell)]
        texts = list(dict.fromkeys(cell for cell in given if cells.number(cell) is None))
        numbers = sum(cells.number(cell) is not None for cell in given)
        if numbers:
            name = cells.named(at)
            few = len(texts) <= _FEW_TEXTS and not any("," in text for text in texts)
            other = f"add --missing '{','.join(texts)}'" if few else "correct or blank the others"
            raise table.refuse(
                f"{numbers} of {len(given)} cells in {name} are numbers: scores ({other}), or no "
                f"condition (add --columns ignore={name})"
            )


def _sums(table: _Table, roles: Roles, columns: Sequence[int]) -> dict[int, str]:
    """Return the columns that sum up others, and what to say of those known by their values.

    Of rows that may sum up the others nothing is asked.
    """
    if table.kept_means:
        return {}
    subject = roles.column("subject")
    rows = [row for row in table.cells.rows if subject is None or not may_sum_up(row[subject])]
    sums: dict[int, str] = {}
    for known in (beside_scores, partial(summing_up, table.cells), partial(_by_value, table.cells)):
        rest = [at for at in columns if at not in sums]
        names = [table.cells.header[at] for at in rest]
        lines = [[row[at] for row in rows] for at in rest]
        said: Mapping[int, str] | Collection[int] = known(names, lines)
        why = said if isinstance(said, Mapping) else dict.fromkeys(said, "")
        sums |= {rest[place]: words for place, words in why.items()}
    return sums


def _by_value(cells: Cells, names: Sequence[str], lines: Sequence[Sequence[str]]) -> dict[int, str]:
    """Return the places of columns that are the mean or sum of all others, or of repeats."""
    scores = numbers_in(cells, lines)
    if (summing := summing_column(scores)) is not None:
        return dict([summing])
    few = 3 <= len(names) <= _MOST_LEVELS
    if few and (difference := difference_column(scores)) is not None:
        place, *two = difference
        return {place: f"the difference of {listed(names[at] for at in two)}"}
    of = _repeated(dict(enumerate(names)))
    sums: dict[int, str] = {}
    for stem in dict.fromkeys(of.values()):
        repeats = [at for at, each in of.items() if each == stem]
        for place in range(len(names)):
            if place not in of and is_mean_of(scores[:, place], scores[:, repeats]):
                sums[place] = f"the mean of {listed(names[at] for at in repeats)}"
    return sums


def _with_subject(table: _Table) -> Roles:
    """Return the roles with the column of subjects: named so, or the only one that can be."""
    cells, roles = table.cells, table.roles
    if roles.subject_is or roles.column("subject") is not None:
        return _settled(table, roles)
    texts = [at for at in table.free if not table.numeric[at] and _tells_rows_apart(table, at)]
    unnamed = [at for at in table.free if not cells.header[at] and _tells_rows_apart(table, at)]
    for candidates in (unnamed, texts):
        if len(candidates) == 1:
            return replace(roles, of={**roles.of, candidates[0]: "subject"})
    names = table.names(texts or range(len(cells.header)))
    raise table.refuse(
        f"no column says who scored, among {names}: add --columns subject=NAME if one does, or "
        "subject=row if each row is a subject"
    )


def _settled(table: _Table, roles: Roles) -> Roles:
    """Refuse a second column that names subjects, unless it follows from the first or numbers more.

    Such are a code beside a name, and the number of a row.
    """
    first = roles.column("subject")
    for other in roles.second if first is not None and first not in roles.told else ():
        assert first is not None
        if not (_determines(table, first, other) or _determines(table, other, first)):
            raise table.refuse(
                f"both {table.names([first])} and {table.names([other])} may say who scored; add "
                "--columns subject=NAME"
            )
    return roles


def _tells_rows_apart(table: _Table, column: int) -> bool:
    values = table.values(column)
    return len(set(values)) == len(values) and not any(map(is_missing, values))


_ENDING = re.compile(r"(.*?)[\s_.\-#(]*(\d{1,3})\)?")


def _stems(table: _Table, scores: Sequence[int]) -> Mapping[int, str]:
    """Return the condition of each column: its heading, or that without a number at its end."""
    names = {at: table.cells.header[at] for at in scores}
    of = _repeated(names)
    # Conditions that have repeats; one alone would compare nothing.
    is_crossed = len(set(of.values())) > 1
    others = [names[at] for at in scores if at not in of]
    ignored = "".join(f",ignore={name}" for name in others)
    if table.roles.repeat_is == "ending":
        if not is_crossed or others:
            without = f"; leave others out with {ignored[1:]}" if is_crossed else ""
            raise table.refuse(
                "--columns repeat=ending needs headings that all end with the same numbers, such "
                f"as rough_1, rough_2, smooth_1, smooth_2; got {table.names(scores)}{without}"
            )
        return of
    if is_crossed and not table.roles.headings:
        first = [names[at] for at in of if of[at] == next(iter(of.values()))]
        raise table.refuse(
            f"{listed(first)} may be {len(first)} repeats of a condition (add --columns "
            f"repeat=ending{ignored}) or conditions of their own (add --columns condition=heading)"
        )
    return names


def _repeated(names: Mapping[int, str]) -> Mapping[int, str]:
    """Return the stem of each heading that ends with a number, of those that count from 0 or 1."""
    numbers: dict[str, dict[int, int]] = defaultdict(dict)
    for at, name in names.items():
        if (end := _ENDING.fullmatch(name)) and end[1].strip(" _.-"):
            numbers[end[1]][at] = int(end[2])
    return {
        at: stem
        for stem, counts in numbers.items()
        if len(counts) > 1 and sorted(counts.values()) in (
            list(range(len(counts))), list(range(1, len(counts) + 1))
        )
        for at in counts
    }  # fmt: skip


def _require_a_row_each(table: _Table, roles: Roles, parts: Sequence[int]) -> None:
    """Refuse a subject with several rows, unless something tells them apart or says why."""
    subject = roles.column("subject")
    apart = [*parts, *roles.columns("repeat", "session")]
    if subject is None or roles.repeat_is:
        return
    lines: dict[tuple[str, ...], int] = {}
    for number, row in enumerate(table.cells.rows):
        key = tuple(row[at] for at in (subject, *apart))
        if row[subject] and lines.setdefault(key, number) != number:
            first = table.cells.lines[lines[key] + 1]
            repeats = "repeats (add --columns repeat=row), or another subject (give it a name of"
            columns = _words_apart(table, roles) or _numbers_apart(table, roles)
            names = [table.cells.named(at) for at in columns]
            if names:
                told = names[0] if len(names) == 1 else "NAME"
                repeats = (
                    f"{listed(names)} may tell its rows apart, as a session (add --columns "
                    f"session={told}) or a part of the condition (add --columns condition=heading,"
                    f"factor={told}); else {repeats}"
                )
            raise TableError(
                f"{table.cells.where(number)}: {', '.join(key)} stands in {table.cells.line_word} "
                f"{first}, too: {repeats} its own)"
            )


# A long table.


def _require_no_heading(table: _Table) -> None:
    """Refuse numbers that only their heading calls the condition, if each subject has one row."""
    roles = table.roles
    condition, subject = roles.column("condition"), roles.column("subject")
    if condition is None or subject is None or is_recorded(table.cells):
        return
    is_told = bool(roles.told & {condition, roles.column("score")})
    if table.numeric[condition] and not is_told and _tells_rows_apart(table, subject):
        name = table.cells.named(condition)
        raise table.refuse(
            f"{name} may be the condition or be scored: add --columns condition={name}, or "
            "condition=heading"
        )


def _long(table: _Table, numbers: Sequence[int]) -> Shape:
    roles = _long_subject(table)
    score = roles.column("score")
    if score is None:
        score = _only_score(table, roles, [at for at in numbers if roles.of.get(at) is None])
    parts = tuple(roles.columns("condition", "factor"))
    taken = {score, *(at for at in roles.of if roles.of[at] != "ignore")}
    free = [at for at in table.free if at not in taken and not table.is_mean(at)]
    notes: tuple[str, ...] = ()
    if not parts:
        parts = _conditions_among(table, roles, free)
        said = "condition" if len(parts) == 1 else "factors"
        notes = (f"{said}: {table.names(parts)}",)
    else:
        _require_no_other_part(table, roles, parts, free)
    used = {
        score,
        *parts,
        *roles.columns("subject", "repeat", "session", "group", "answer", "contrast"),
    }
    return Shape(
        is_wide=False, roles=roles, scores=(score,), parts=parts, stems={},
        left_out=_left_out(table, used), notes=notes,
    )  # fmt: skip


def _long_subject(table: _Table) -> Roles:
    roles = _settled(table, table.roles)
    if roles.subject_is == "row":
        raise table.refuse(
            "a row per score cannot have a subject per row; add --columns subject=NAME"
        )
    if roles.subject_is or roles.column("subject") is not None:
        return roles
    numeric = [at for at in table.free if table.numeric[at]]
    if roles.column("score") is None and len(numeric) > 1:
        raise table.refuse(
            f"a row per condition: {table.names(numeric)} may be the subjects (turn the table, so "
            "that each has a row) or different measures (add --columns subject=NAME,score=NAME)"
        )
    raise table.refuse(
        f"no column says who scored, among {table.names(range(len(table.cells.header)))}: add "
        "--columns subject=NAME if one does, or subject=one if one person gave all scores"
    )


def _only_score(table: _Table, roles: Roles, numbers: Sequence[int]) -> int:
    if len(numbers) == 1:
        return numbers[0]
    if not numbers:
        raise table.refuse(
            f"no column holds scores, among {table.names(range(len(table.cells.header)))}; add "
            "--columns score=NAME"
        )
    named = table.names(roles.columns("condition", "factor"))
    raise table.refuse(
        f"each of {table.names(numbers)} may hold the scores (add --columns score=NAME), or each "
        f"is a condition and {named} a factor (add --columns condition=heading,factor={named})"
    )


def _conditions_among(table: _Table, roles: Roles, free: Sequence[int]) -> tuple[int, ...]:
    """Return the columns that tell a subject's scores apart."""
    candidates = [at for at in free if _varies_within(table, roles, at)]
    apart = [
        at
        for at in candidates
        if not any(
            other != at
            and _determines(table, other, at)
            and (other < at or not _determines(table, at, other))
            for other in candidates
        )
    ]
    if not apart:
        raise table.refuse(
            f"no column says what was scored, among {table.names(range(len(table.cells.header)))}; "
            "add --columns condition=NAME, or condition=heading if there was one condition"
        )
    if len(apart) > 1 and any(table.numeric[at] for at in apart):
        raise _several(table, apart)
    return tuple(apart)


def _several(table: _Table, columns: Sequence[int]) -> TableError:
    return table.refuse(
        f"each of {table.names(columns)} may be the condition, or a factor of it; add --columns "
        "condition=NAME, or factor=NAME for each of them, and ignore=NAME for the others"
    )


def _varies_within(table: _Table, roles: Roles, column: int) -> bool:
    """Return whether subjects meet several of a column's few values."""
    values = table.values(column)
    given = {value for value in values if not is_missing(value)}
    if not 1 < len(given) <= min(_MOST_LEVELS, len(values) - 1):
        return False
    subject = roles.column("subject")
    if subject is None:
        return True
    met: dict[str, set[str]] = defaultdict(set)
    for who, value in zip(table.values(subject), values, strict=True):
        met[who].add(value)
    return 2 * sum(len(each) > 1 for each in met.values()) > len(met)


def _require_no_other_part(
    table: _Table, roles: Roles, parts: Sequence[int], free: Sequence[int]
) -> None:
    """Refuse a column that most subjects meet several values of in each condition."""
    subject = roles.column("subject")
    keys = [*([] if subject is None else [subject]), *parts, *roles.columns("session")]
    others = []
    for column in free:
        values = {value for value in table.values(column) if not is_missing(value)}
        if not 1 < len(values) <= _MOST_LEVELS or len(values) == len(table.cells.rows):
            continue
        met: dict[tuple[str, ...], set[str]] = defaultdict(set)
        for row in table.cells.rows:
            met[tuple(row[at] for at in keys)].add(row[column])
        crossed = sum(len(each) > 1 for each in met.values())
        if 2 * crossed > len(met) and not _has_fractions(table, column):
            others.append(table.cells.named(column))
    if not others:
        return
    factors, repeats, ignored = (
        ",".join(f"{role}={name}" for name in others) for role in ("factor", "repeat", "ignore")
    )
    if not others[1:]:
        raise table.refuse(
            f"the column {others[0]} may be a factor (add --columns {factors}), count repeats "
            f"({repeats}), or say something else of each score ({ignored})"
        )
    raise table.refuse(
        f"each of {listed(others)} may be a factor, count repeats, or say something else of each "
        f"score: add --columns {typed_as(ignored)}, with factor= or repeat= for those that are one"
    )


def _has_fractions(table: _Table, column: int) -> bool:
    """Return whether a column measures something."""
    numbers = [table.cells.number(cell) for cell in table.values(column)]
    return any(number is not None and number % 1 for number in numbers)


def _determines(table: _Table, one: int, other: int) -> bool:
    """Return whether each value of a column goes with a single one of another."""
    told: dict[str, str] = {}
    pairs = zip(table.values(one), table.values(other), strict=True)
    return all(told.setdefault(value, beside) == beside for value, beside in pairs)


def _left_out(
    table: _Table, used: set[int], why: Mapping[int, str] = MappingProxyType({})
) -> tuple[str, ...]:
    return tuple(
        table.cells.named(at) + (f" ({why[at]}; --keep-means keeps it)" if why.get(at) else "")
        for at in range(len(table.cells.header))
        if at not in used and not table.is_index(at)
    )


def cell_parts(shape: Shape, row: Sequence[str], column: int) -> Iterator[tuple[int | None, str]]:
    """Yield the parts that name the condition of a score: column and text, None for the heading."""
    if shape.is_wide:
        yield None, shape.stems[column]
    for at in shape.parts:
        yield at, row[at]
