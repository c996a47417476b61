"""Scores in a table of any shape, as a journal keeps them."""

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import islice
from math import ceil, floor
from statistics import median

from analysis.tables.answer_words import told_meanings
from analysis.tables.ratings import (
    ANSWERS,
    ANSWERS_EXAMPLE,
    CONTRARY,
    EXPECTED,
    SAME,
    Entry,
    Imported,
    Rating,
    Scale,
    Visit,
)
from analysis.tables.roles import is_recorded, plain
from analysis.tables.shape import Shape, cell_parts
from analysis.tables.summaries import (
    MEANS,
    have_codes,
    may_sum_up,
    numbers_in,
    summing_column,
    summing_up,
)
from analysis.tables.table_cells import (
    Cells,
    TableError,
    cell_name,
    folded,
    is_excluded,
    is_missing,
)
from analysis.tables.understood import left_out_lines, understood
from protocol.errors import listed, typed_as
from protocol.pseudonyms import pseudonyms

MOST_SUBJECTS = 100_000
MOST_CONDITIONS = 100
MOST_ROWS = 1_000_000
MOST_BYTES = 2**25
MOST_SESSIONS = 50
MOST_SCORES = 2_000_000
_LEAST_OF_RANGE = 3
_USUAL = 10
"""Up to this scores are on one scale, however far they lie apart."""
LARGEST = 1_000
"""Of a score, and of an end of a scale, on either side of 0."""
_CODES = frozenset({99, 999, 9999, 88, 888, 77, 777, -1, -9, -99, -999, -9999})
"""Numbers that often stand for no score."""


def scores_in(
    cells: Cells,
    shape: Shape,
    *,
    scale: Scale | None = None,
    answers: str | None = None,
    keep_means: bool = False,
) -> Imported:
    """Return the scores in a table of that shape.

    Args:
        cells: of the table.
        shape: which of its columns hold what.
        scale: the lowest and the highest score that could be given, if it is known.
        answers: what words in the column of answers mean: `smoother=expected,rougher=contrary`.
        keep_means: whether rows named as means are subjects.

    Raises:
        TableError: a cell breaks its rule, or could mean two things.
    """
    _require_scale(cells, scale)
    meanings = {word: word for word in ANSWERS} | told_meanings(answers, ANSWERS, ANSWERS_EXAMPLE)
    reader = _Reader(cells, shape, scale, meanings, keep_means)
    entries = list(islice(reader.entries(), MOST_SCORES + 1))
    if len(entries) > MOST_SCORES:
        raise TableError(
            f"{cells.source}: must have at most {MOST_SCORES} scores, got more; import it in parts"
        )
    if scale is None:
        _require_no_codes(cells, entries)
        if shape.is_wide and not shape.roles.headings:
            _require_one_range(cells, entries)
    _require_apart(cells, entries)
    _require_one_person(cells, shape, entries)
    silent = _silent(entries)
    told = [entry for entry in entries if not silent & {entry.subject, (entry.condition,)}]
    if not told:
        raise TableError(f"{cells.source}: must have a score, got none")
    if scale is None:
        _require_no_answers(cells, told)
    called, of_names = pseudonyms(list(dict.fromkeys(entry.subject for entry in told)))
    sessions, of_sessions = _sessions(told)
    groups = _groups(cells, told)
    conditions = _in_order(told)
    _require_few(cells, called, conditions)
    visits: dict[tuple[str, int], list[Rating]] = defaultdict(list)
    for entry in told:
        rating = Rating(
            condition=entry.condition,
            score=entry.score,
            answer=entry.answer,
            contrast=entry.contrast,
        )
        visits[entry.subject, sessions[entry.session]].append(rating)
    ends, is_known = _scale(told, scale)
    named = _factors(cells, shape)
    imported = Imported(
        visits=tuple(
            Visit(
                participant=called[who],
                session=session,
                group=groups.get(who),
                ratings=tuple(ratings),
            )
            for (who, session), ratings in visits.items()
        ),
        conditions=conditions,
        scale=ends,
        scale_known=is_known,
        cells=_crossed(named, told) if len(named) > 1 else {},
        groups=tuple(dict.fromkeys(groups.values())),
    )
    lines = (
        *understood(cells, shape, imported, told),
        *of_sessions,
        *of_names,
        *left_out_lines(shape, reader.rows_left_out, silent),
    )
    return replace(imported, lines=lines)


class _Reader:
    """The entries of a table, one for each cell of a score."""

    def __init__(
        self,
        cells: Cells,
        shape: Shape,
        scale: Scale | None,
        meanings: Mapping[str, str],
        keep_means: bool,
    ) -> None:
        self.cells, self.shape, self.scale = cells, shape, scale
        self.meanings, self.keep_means = meanings, keep_means
        self.rows_left_out: Counter[str] = Counter()
        columns = {role: shape.roles.column(role) for role in ("subject", "session", "group")}
        self.subject, self.session, self.group = columns.values()
        self.answer, self.contrast = map(shape.roles.column, ("answer", "contrast"))
        self.recorded = is_recorded(cells)
        self.excluded = None if self.recorded else _excluded(cells, shape)

    def entries(self) -> Iterator[Entry]:
        rehearsals = self.recorded and self._has_sessions()
        for row, texts in enumerate(self.cells.rows):
            if why := self._why_out(row, texts, rehearsals):
                self.rows_left_out[why] += 1
                continue
            yield from self._of_row(row, texts)

    def _of_row(self, row: int, texts: Sequence[str]) -> Iterator[Entry]:
        scores = {at: self._score(texts[at], row, at) for at in self.shape.scores}
        answer = self._answer(texts, row)
        if not (subject := self._subject(texts, row)):
            if answer is not None or any(score is not None for score in scores.values()):
                name = "" if self.subject is None else texts[self.subject]
                what = f"{name!r}, which says none; call the subject otherwise" * bool(name)
                raise TableError(
                    f"{self.cells.where(row)}: a subject must have a name, got "
                    f"{what or 'none; write it in each row'}"
                )
            self.rows_left_out["without a subject and a score"] += 1
            return
        for at, score in scores.items():
            parts = tuple(self._part(*part, row) for part in cell_parts(self.shape, texts, at))
            if not all(parts):
                if score is None and answer is None:
                    self.rows_left_out["without a condition and a score"] += 1
                    continue
                raise TableError(f"{self.cells.where(row)}: every condition must have a name")
            yield Entry(
                row=row,
                subject=subject,
                session="1" if self.session is None else self._value(texts[self.session]),
                group="" if self.group is None else self._value(texts[self.group]),
                parts=parts or ("score",),
                score=score,
                answer=answer,
                contrast=self._contrast(texts, row),
            )

    def _why_out(self, row: int, texts: Sequence[str], has_sessions: bool) -> str:
        """Return why a row holds no rating; '' if it does."""
        if self.recorded:
            known = dict(zip(self.cells.header, texts, strict=True))
            if known["trial_kind"] not in {"trial", "published"}:
                return "of catch trials, practice, openings and tracks"
            if is_excluded(known.get("excluded", "")):
                return "excluded"
            if has_sessions and known.get("session_kind") == "rehearsal":
                return "of rehearsals"
        elif self.excluded is not None and is_excluded(texts[self.excluded]):
            return "excluded"
        return self._sums.get(row, "")

    @cached_property
    def _sums(self) -> Mapping[int, str]:
        """The rows that sum up the others, and what to say of each.

        Of a long table they are called so, beside codes of subjects perhaps in short.
        """
        if self.subject is None or self.keep_means:
            return {}
        rows = self.cells.rows
        names = [row[self.subject] for row in rows]
        if not self.shape.is_wide:
            are_codes = not self.recorded and have_codes(names)
            return {
                at: f"named {name}"
                for at, name in enumerate(names)
                if plain(name) in MEANS or (are_codes and may_sum_up(name))
            }
        lines = [[row[at] for at in self.shape.scores] for row in rows]
        sums = {
            at: f"named {names[at]}"
            if names[at]
            else f"without a name ({self._line(at)}, a summary)"
            for at in sorted(summing_up(self.cells, names, lines, are_codes=True))
        }
        rest = [at for at in range(len(rows)) if at not in sums]
        scores = numbers_in(self.cells, [lines[at] for at in rest])
        if (found := summing_column(scores)) is not None:
            at, what = rest[found[0]], found[1]
            sums[at] = f"named {names[at]} ({self._line(at)}, {what}; --keep-means keeps it)"
        return sums

    def _line(self, row: int) -> str:
        return f"{self.cells.line_word} {self.cells.lines[row + 1]}"

    def _has_sessions(self) -> bool:
        header = list(self.cells.header)
        at = header.index("session_kind") if "session_kind" in header else None
        return at is not None and any(row[at] != "rehearsal" for row in self.cells.rows)

    def _value(self, text: str) -> str:
        return "" if is_missing(text) else text

    def _subject(self, texts: Sequence[str], row: int) -> str:
        if self.subject is None:
            return "1" if self.shape.roles.subject_is == "one" else str(row + 1)
        return self._value(
            _whole(self.cells, cell_name(texts[self.subject], self.cells.where(row)))
        )

    def _part(self, column: int | None, text: str, row: int) -> str:
        name = cell_name(text, self.cells.where(None if column is None else row))
        if column is None:
            return name
        return self._value(_whole(self.cells, name) if column in self._of_wholes else name)

    @cached_property
    def _of_wholes(self) -> frozenset[int]:
        """The columns that name conditions and hold no number with a fraction."""
        numbers = {
            at: {self.cells.number(row[at]) or 0 for row in self.cells.rows}
            for at in self.shape.parts
        }
        return frozenset(at for at in numbers if not any(number % 1 for number in numbers[at]))

    def _score(self, text: str, row: int, column: int) -> float | None:
        if is_missing(text):
            return None
        where, number = self.cells.where(row, column), self.cells.number(text)
        if number is None:
            self.cells.require_no_formula(row, column)
            raise TableError(
                f"{where}: a score must be a number or blank, got {text[:40]!r}; if it stands for "
                "a missing score, add --missing with it"
            )
        low, high = self.scale or (-LARGEST, LARGEST)
        if not low <= number <= high:
            said = f"{where}: a score must lie in [{low}, {high}], got {text[:40]}"
            name = self.cells.header[column]
            if not self.scale:
                said += "; divide the scores, such as by 100 or 1000"
            elif self.shape.is_wide:
                said += (
                    f"; if it stands for a missing score, add --missing {text}; if the column "
                    f"holds no scores, add --columns {typed_as(f'ignore={name}')}"
                )
            raise TableError(said)
        return number

    def _contrast(self, texts: Sequence[str], row: int) -> float | None:
        if self.contrast is None or is_missing(texts[self.contrast]):
            return None
        number = self.cells.number(texts[self.contrast])
        if number is None or abs(number) > 10:
            raise TableError(
                f"{self.cells.where(row, self.contrast)}: a contrast must be a number from -10 to "
                f"10, the change of the logarithm of friction, got {texts[self.contrast][:40]!r}"
            )
        return number

    def _answer(self, texts: Sequence[str], row: int) -> str | None:
        if self.answer is None or is_missing(texts[self.answer]):
            return None
        word = texts[self.answer].casefold()
        if self.recorded and word in {"true", "false"}:
            change = dict(zip(self.cells.header, texts, strict=True)).get("change", "")
            contrary = SAME if change in {"same", "not swapped"} else CONTRARY
            return EXPECTED if word == "true" else contrary
        if (meaning := self.meanings.get(word)) is None:
            words = {row[self.answer] for row in self.cells.rows}
            given = {word for word in words if not is_missing(word)}
            unknown = sorted(word for word in given if word.casefold() not in self.meanings)
            raise TableError(
                f"{self.cells.where(row, self.answer)}: answers must be {', '.join(ANSWERS)}, got "
                f"{listed(unknown[:9])}; say what each means: --answers "
                f"'{','.join(f'{word}=…' for word in unknown[:9])}'"
            )
        return meaning


def _whole(cells: Cells, text: str) -> str:
    """Return a whole number without the zeros that pandas writes where others are missing."""
    number = cells.number(text)
    whole = number is not None and number % 1 == 0 and re.search(r"[.,]0*$", text)
    return text[: whole.start()] if whole else text


def _excluded(cells: Cells, shape: Shape) -> int | None:
    """Return the column that says of each row whether it is excluded, unless it has a role."""
    words = {"yes", "no", "true", "false", "1", "0", "1.0", "0.0"}
    for at, name in enumerate(cells.header):
        if plain(name) == "excluded" and at not in shape.roles.told:
            values = {row[at].casefold() for row in cells.rows if not is_missing(row[at])}
            return at if values <= words else None
    return None


def _require_scale(cells: Cells, scale: Scale | None) -> None:
    if scale is not None and not -LARGEST <= scale[0] < scale[1] <= LARGEST:
        raise TableError(
            f"{cells.source}: --scale must be the lowest and the highest score, from -{LARGEST} to "
            f"{LARGEST}, got {scale[0]} {scale[1]}"
        )


def _require_no_codes(cells: Cells, entries: Sequence[Entry]) -> None:
    """Refuse a number far from all others that often stands for no score."""
    scores = Counter(entry.score for entry in entries if entry.score is not None)
    for code in sorted(_CODES & scores.keys(), key=abs, reverse=True):
        others = [score for score in scores if score != code]
        low, high = min(others, default=code), max(others, default=code)
        if len(others) > 1 and not low - (high - low) <= code <= high + (high - low):
            many = scores[code]
            raise TableError(
                f"{cells.source}: {code} stands in {many} cell{'s' * (many > 1)}, and all other "
                f"scores lie from {low:g} to {high:g}: no score (add --missing {code}), or one "
                "(add --scale with the ends of the scale)"
            )


def _require_one_range(cells: Cells, entries: Sequence[Entry]) -> None:
    """Refuse columns of a wide table with numbers that lie far from those of most others.

    Such are ages, temperatures and totals beside scores. Columns of a few numbers say nothing.
    """
    scores: dict[str, list[float]] = defaultdict(list)
    for entry in entries:
        if entry.score is not None:
            scores[entry.parts[0]].append(entry.score)
    named = [name for name, given in scores.items() if len(given) >= _LEAST_OF_RANGE]
    alike: list[list[str]] = []
    for name in sorted(named, key=lambda name: (median(scores[name]), name)):
        near = [
            others
            for others in alike
            if any(_are_near(scores[one], scores[name]) for one in others)
        ]
        alike = [others for others in alike if others not in near]
        alike.append([*(one for others in near for one in others), name])
    most = max(alike, key=len, default=[])
    far = [name for name in named if name not in most]
    if far:
        first, rest = scores[far[0]], [score for name in most for score in scores[name]]
        raise TableError(
            f"{cells.source}: {listed(far)} lie{'s' * (len(far) == 1)} far from the scores of "
            f"{listed(sorted(most, key=named.index))} ({min(first):g} to {max(first):g}, and "
            f"{min(rest):g} to {max(rest):g}): no condition (add --columns "
            f"{','.join(f'ignore={name}' for name in far)}), or conditions like the others (add "
            "--columns condition=heading, or --scale with the ends of the scale)"
        )


def _are_near(one: Sequence[float], other: Sequence[float]) -> bool:
    """Return whether numbers overlap, almost do, are of one size, or all on a usual scale."""
    low, high = sorted((one, other), key=median)
    gap = min(high) - max(low)
    span = max(max(one) - min(one), max(other) - min(other))
    usual = max(map(abs, (*low, *high))) <= _USUAL
    return usual or gap <= span / 2 or median(map(abs, high)) < 2 * max(map(abs, low))


def _require_no_answers(cells: Cells, entries: Sequence[Entry]) -> None:
    """Refuse answers beside scores: the lowest score seen need not be the lowest of the scale."""
    has_answers = any(entry.answer is not None for entry in entries)
    if has_answers and any(entry.score is not None for entry in entries):
        raise TableError(
            f"{cells.source}: an answer counts with its score above the lowest of the scale: add "
            "--scale LOW HIGH"
        )


def _require_apart(cells: Cells, entries: Sequence[Entry]) -> None:
    """Refuse names that people and spreadsheets take for one."""
    kinds = {
        "subjects": [(entry.subject, entry.row) for entry in entries],
        "conditions": [(entry.condition, entry.row) for entry in entries],
        "groups": [(entry.group, entry.row) for entry in entries],
        "sessions": [(entry.session, entry.row) for entry in entries],
    }
    for kind, names in kinds.items():
        seen: dict[str, tuple[str, int]] = {}
        for name, row in dict(reversed(names)).items():
            # As numbers, 2.5 and 2.50 are one; as codes, two.
            number = cells.number(name) if kind == "conditions" else None
            alike = folded(name) if number is None else repr(number)
            first, other = seen.setdefault(alike, (name, row))
            if first != name:
                lines = f"{cells.line_word}s {cells.lines[row + 1]} and {cells.lines[other + 1]}"
                raise TableError(
                    f"{cells.source}: the {kind} {name!r} and {first!r} ({lines}) may be one or "
                    "two; write one alike everywhere, or call two apart"
                )


_AGES = frozenset({"age", "alter", "edad", "âge", "年龄"})
"""Columns of what a person has once, or one more of in a later session."""
_FACTS = _AGES | {"sex", "gender", "geschlecht", "性别"}


def _require_one_person(cells: Cells, shape: Shape, entries: Sequence[Entry]) -> None:
    """Refuse a subject who has two ages or sexes: two persons may share their initials."""
    for at, heading in enumerate(cells.header):
        if plain(heading) not in _FACTS or at in shape.roles.told:
            continue
        first: dict[str, str] = {}
        for entry in entries:
            text = cells.rows[entry.row][at]
            before = first.setdefault(entry.subject, text) if not is_missing(text) else text
            ages = [cells.number(value) or 0.0 for value in (before, text)]
            older = plain(heading) in _AGES and 0 < abs(ages[1] - ages[0]) <= 1
            if older or before.casefold() == text.casefold():
                continue
            name = cells.named(at)
            raise TableError(
                f"{cells.where(entry.row)}: {entry.subject} has the {name} {before} and {text}: "
                "two persons (give each a name of its own), or one (add --columns "
                f"{typed_as(f'ignore={name}')})"
            )


def _silent(entries: Sequence[Entry]) -> set[str | tuple[str, ...]]:
    """Return the subjects without any rating, and as tuples of one the conditions."""
    by_name: dict[str | tuple[str, ...], bool] = defaultdict(bool)
    for entry in entries:
        given = entry.score is not None or entry.answer is not None
        by_name[entry.subject] |= given
        by_name[entry.condition,] |= given
    return {name for name, given in by_name.items() if not given}


_SESSION = re.compile(r"(?:ses|session)?[-_ ]?0*([1-9]\d{0,3})(?:\.0)?", re.IGNORECASE)


def _sessions(entries: Sequence[Entry]) -> tuple[dict[str, int], list[str]]:
    """Return the number of each session, and what to say of it: words count as they come."""
    names = list(dict.fromkeys(entry.session for entry in entries))
    numbers = ((name, _SESSION.fullmatch(name)) for name in names)
    told = {name: int(number[1]) for name, number in numbers if number}
    if len(names) > MOST_SESSIONS or max(told.values(), default=0) > 10_000:
        raise TableError(f"a subject must have at most {MOST_SESSIONS} sessions, got {len(names)}")
    if len(set(told.values())) == len(names):
        return told, []
    counted = {name: number for number, name in enumerate(names, start=1)}
    said = listed(f"{name or '(blank)'} is {number}" for name, number in counted.items())
    return counted, [f"Sessions are numbered as they come: {said}."]


def _groups(cells: Cells, entries: Sequence[Entry]) -> dict[str, str]:
    """Return the group of each subject who has one, if there are several groups."""
    groups: dict[str, str] = {}
    for entry in entries:
        if entry.group and groups.setdefault(entry.subject, entry.group) != entry.group:
            raise TableError(
                f"{cells.where(entry.row)}: {entry.subject} is in the group {entry.group} and in "
                f"{groups[entry.subject]} before: if that varies within subjects, add --columns "
                "factor=NAME, or session=NAME; else correct it"
            )
    groups = {who: cell_name(group, cells.source) for who, group in groups.items()}
    return groups if len(set(groups.values())) > 1 else {}


def _require_few(cells: Cells, subjects: Mapping[str, str], conditions: Sequence[str]) -> None:
    for names, most, of in (
        (subjects, MOST_SUBJECTS, "subjects"),
        (conditions, MOST_CONDITIONS, "conditions"),
    ):
        if len(names) > most:
            raise TableError(
                f"{cells.source}: must have at most {most} {of}, got {len(names)}; import them in "
                "parts"
            )
    for name in conditions:
        cell_name(name, cells.source)


def _factors(cells: Cells, shape: Shape) -> list[str]:
    """Return the names of what names conditions together."""
    return ["condition"] * shape.is_wide + [cells.named(at) for at in shape.parts]


def _in_order(entries: Sequence[Entry]) -> tuple[str, ...]:
    """Return the conditions as they come; of factors that are crossed the last varies fastest."""
    by_name = {entry.condition: entry.parts for entry in entries}
    many = len(next(iter(by_name.values())))
    if many == 1:
        return tuple(by_name)
    values = zip(*by_name.values(), strict=True)
    places = [{value: at for at, value in enumerate(dict.fromkeys(each))} for each in values]

    def order(name: str) -> list[int]:
        return [at[value] for at, value in zip(places, by_name[name], strict=True)]

    return tuple(sorted(by_name, key=order))


def _crossed(names: Sequence[str], entries: Iterable[Entry]) -> dict[str, dict[str, str]]:
    return {entry.condition: dict(zip(names, entry.parts, strict=True)) for entry in entries}


def _scale(entries: Sequence[Entry], scale: Scale | None) -> tuple[Scale, bool]:
    if scale is not None:
        return scale, True
    scores = [entry.score for entry in entries if entry.score is not None] or [0.0]
    low, high = floor(min(scores)), ceil(max(scores))
    return (low, max(high, low + 1)), False
