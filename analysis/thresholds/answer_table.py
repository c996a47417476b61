"""Tables of answers in tracks: a row per level, or a row per trial."""

import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations
from typing import Any, Literal

from analysis.estimates import Interval, Json, plain
from analysis.tables.answer_words import RIGHT, WRONG, told_meanings
from analysis.tables.roles import NAMES, ranked_columns, require_one, told_roles
from analysis.tables.roles import plain as plain_name
from analysis.tables.table_cells import (
    MOST_NAMED,
    Cells,
    TableError,
    cell_name,
    folded,
    is_excluded,
    is_missing,
)
from analysis.thresholds.psychometric import BELOW_CHANCE, NOTHING, Threshold, curve_share, fitted
from protocol.errors import BadInput, listed, typed_as

MOST_BYTES = 2**26
MOST_ROWS = 1_000_000
MOST_TRIALS = 1_000_000_000
"""Of one row."""
ROLES = ("subject", "condition", "level", "trials", "answer", "ignore")
"""What a column may be, as `--columns` says it."""
_SEVERAL = frozenset({"condition", "ignore"})
"""Roles that several columns may have: those of the condition name the track together."""
_OWN: Mapping[str, str] = {"subject": "participant", "condition": "track", "answer": "correct"}
"""Names of columns that are not those of their roles."""
_MOST_VALUES, _MOST_NUMBERS = 30, 6
"""Of a column of words, or of numbers, that may tell conditions apart."""
LEVEL_VALUE = "level_value"
"""Of trials that touchbeam recorded, whose column level has the number of a level."""
OF_TRIALS = frozenset({"trial_kind", "study_sha256"})
"""Columns of all trials that touchbeam recorded, also of those of no track."""
NO_TRACKS = "the study has no tracks; touchbeam report has its scores"
UNANSWERED, CATCH, OUT = "without an answer", "catch trials", "excluded"
LEFT_OUT: Mapping[str, str] = {UNANSWERED: UNANSWERED, CATCH: "catch trial", OUT: OUT}
"""Why rows are left out, of several and of one."""
RIGHT_OR_WRONG = dict.fromkeys(RIGHT, 1) | dict.fromkeys(WRONG, 0)

COLUMNS = (
    "participant",
    "track",
    "threshold",
    "95% interval",
    "slope",
    "JND",
    "lapses",
    "p",
    "note",
)
"""Of the table of thresholds that people read."""


@dataclass
class Track:
    """The answers of one participant in one track, an entry per row of the table.

    `left_out` counts rows by reason: without an answer, and recorded trials that are catch trials
    or excluded.
    """

    participant: str
    track: str
    levels: list[float] = field(default_factory=list)
    trials: list[int] = field(default_factory=list)
    correct: list[int] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)

    def record(self, found: Threshold) -> Json:
        """Return what was found, as `touchbeam fit --json` prints it."""
        told = {"participant": self.participant, "track": self.track, **plain(found)}
        del told["band"], told["likelihood"]  # of a report
        return {**told, "left_out": self.left_out.total()}


def tracks_in(
    cells: Cells, shape: str, told: str | None = None, answers: str | None = None
) -> list[Track]:
    """Return the tracks of a table, each participant's in the order in which the table has them.

    The columns participant, track, level, trials and correct, or what else tables call them, may
    stand in any order, with others between them, which are left out. Without the column track all
    rows are of one track, and without trials a row is one trial, and correct is 1 or 0. In yes-no
    correct counts "yes". Rows without an answer or excluded are left out, and counted.

    Trials that touchbeam recorded have the column level_value, which is taken for the level. Those
    of no track or without a level are left out.

    Args:
        cells: of the table.
        shape: of the curve that will be fitted: a Weibull curve has no levels below 0.
        told: what columns are, such as `subject=ID,level=volts`, before their names say it.
        answers: what words of answers mean, such as `longer=1,shorter=0`.

    Raises:
        TableError: a column is missing, stands twice or could be two things, or a cell breaks its
            rule; the message gives line, column, value and rule.
    """
    words = RIGHT_OR_WRONG | {
        word: int(meaning)
        for word, meaning in told_meanings(answers, ("1", "0"), "longer=1,shorter=0").items()
    }
    columns = _columns(cells, told, words)
    of = columns.of
    if not cells.rows:
        raise TableError(f"{cells.source}: must have a row of answers below the header, got none")
    if answers and "trials" in of:
        name = cells.named(of["trials"])
        raise TableError(
            f"{cells.source}: --answers needs a row per trial, and the column {name} counts them; "
            f"add --columns ignore={name} if it does not"
        )
    tracks: dict[tuple[str, str], Track] = {}
    for row, texts in enumerate(cells.rows):
        known = {role: texts[at] for role, at in of.items()}
        parts = [texts[at] for at in columns.parts]
        if columns.recorded and not any(parts):
            continue
        named = partial(_name, cells, row, recorded=columns.recorded)
        participant = named(of["subject"]) if "subject" in of else "1"
        name = ", ".join(map(named, columns.parts)) or "track"
        track = tracks.setdefault((participant, name), Track(participant, name))
        if why := _why_out(known, recorded=columns.recorded):
            track.left_out[why] += 1
            continue
        track.levels.append(_level(cells, row, of["level"], shape))
        trials, correct = _counts(cells, row, of, words)
        track.trials.append(trials)
        track.correct.append(correct)
    answered = [track for track in tracks.values() if track.levels]
    if not answered:
        raise TableError(
            f"{cells.source}: must have an answered trial at a level of a track, got none"
            f"{_all_out(tracks.values())}"
        )
    _require_apart(cells.source, answered)
    people, names = (list(dict.fromkeys(keys)) for keys in zip(*tracks, strict=True))
    places = [{key: at for at, key in enumerate(keys)} for keys in (people, names)]
    answered.sort(key=lambda track: (places[0][track.participant], places[1][track.track]))
    return answered


def _all_out(tracks: Iterable[Track]) -> str:
    """Return in words why all rows are left out."""
    counts = sum((track.left_out for track in tracks), Counter[str]())
    column = " (column excluded)" * (counts[OUT] > 0)
    return f"; {counts.total()} rows: {_reasons(counts)}{column}" * bool(counts)


def _require_apart(source: str, tracks: Iterable[Track]) -> None:
    """Refuse names of people, or of one's tracks, that are one but for case or form of letters."""
    tracks = list(tracks)
    people = [(track.participant,) for track in tracks]
    for names in (people, [(track.participant, track.track) for track in tracks]):
        seen: dict[tuple[str, ...], tuple[str, ...]] = {}
        for name in names:
            first = seen.setdefault(tuple(map(folded, name)), name)
            if first != name:
                raise TableError(
                    f"{source}: {name[-1]!r} and {first[-1]!r} may be one or two; write one alike "
                    "everywhere, or call two apart"
                )


def _why_out(cells: Mapping[str, str], *, recorded: bool) -> str:
    """Return why a row is left out, one of `LEFT_OUT`; nothing if it is not."""
    # A trial gets its level with its answer, a catch trial never.
    without_level = recorded and is_missing(cells["level"])
    if without_level and cells.get("track_role", "catch") == "catch":
        return CATCH
    if without_level or is_missing(cells["answer"]):
        return UNANSWERED
    return OUT if is_excluded(cells.get("excluded", "")) else ""


def fits_of(
    tracks: Iterable[Track], source: str, **options: Any
) -> Iterator[tuple[Track, Threshold]]:
    """Yield each track with its fit; `options` are those of `fitted`.

    Raises:
        BadInput: the definition of the threshold is wrong, or the answers of a track, whose the
            message says.
    """
    task = options.get("task", "two intervals")
    curve_share(options.get("threshold_at"), task, options.get("lapse"), options.get("guess"))
    for track in tracks:
        try:
            yield track, fitted(track.levels, track.trials, track.correct, **options)
        except BadInput as error:
            whose = f"participant {track.participant}, track {track.track}"
            raise BadInput(f"{source}, {whose}: {error}") from None


_NAMES: Mapping[str, tuple[str, ...]] = {
    "subject": ("participant", *NAMES["subject"]),
    "level": (
        "level", "levels", "intensity", "stimuluslevel", "stimulusintensity", "stimulusstrength",
        "stimlevel", "voltage", "voltagev", "volts", "volt", "amplitude", "amplitudev", "contrast",
        "intensität", "reizstärke", "stufe", "spannung", "spannungv", "电压",
        "刺激强度", "stimulus", "stimuli", "stim", "reiz", "刺激",
    ),
    "condition": ("track", *NAMES["condition"]),
    "answer": (
        "correct", "iscorrect", "ncorrect", "numcorrect", "numbercorrect", "acc", "accuracy",
        "richtig", "korrekt", "keyrespcorr", "response", "resp", *NAMES["answer"], "yes", "ja",
        "k", "hit", "hits",
    ),
    "trials": ("trials", "n", "total", "ntrials", "numtrials", "numberoftrials", "trialcount"),
    "excluded": ("excluded",),
}  # fmt: skip
"""What tables call such columns, the best name first. A stimulus is a level if it is a number."""
_RECORDED: Mapping[str, tuple[str, ...]] = {
    "subject": ("participant",), "level": ("levelvalue",), "condition": ("track",),
    "answer": ("correct",), "excluded": ("excluded",), "track_role": ("trackrole",),
}  # fmt: skip
"""Columns of trials that touchbeam recorded."""


@dataclass(frozen=True)
class _Columns:
    """The role of each column that has one, and whether touchbeam recorded the trials."""

    roles: Mapping[int, str]
    ignored: frozenset[int]
    recorded: bool

    @property
    def of(self) -> dict[str, int]:
        """The column of each role that one column has."""
        return {role: at for at, role in self.roles.items() if role != "condition"}

    @property
    def parts(self) -> tuple[int, ...]:
        """The columns that name the track."""
        return tuple(at for at, role in self.roles.items() if role == "condition")


def _columns(cells: Cells, told: str | None, words: Mapping[str, int] = RIGHT_OR_WRONG) -> _Columns:
    names = [name.casefold() for name in cells.header]
    recorded = LEVEL_VALUE in names
    if OF_TRIALS.issubset(names) and not recorded and "track" not in names:
        raise TableError(f"{cells.source}: {NO_TRACKS}")
    of, given = told_roles(cells, told or "", ROLES, {"subject": ("one",)}, _SEVERAL)
    roles = {at: role for at, role in of.items() if role != "ignore"}
    for role, known in (_RECORDED if recorded else _NAMES).items():
        if role in roles.values() or role in given:
            continue
        ranked = ranked_columns(cells, known, {*of, *roles})
        if role == "level":
            stimuli = NAMES["condition"]
            ranked = [
                at
                for at in ranked
                if cells.is_numeric(at) or plain_name(cells.header[at]) not in stimuli
            ]
        if ranked:
            roles[ranked[0]] = role
            _require_clear(cells, role, ranked)
        elif role in {"subject", "level", "answer"}:
            raise TableError(_lacking(cells, role))
    columns = _Columns(roles, frozenset(of) - roles.keys(), recorded)
    counted = columns.of.get("trials") if "trials" not in of.values() else None
    if counted is not None and names[counted] != "trials":
        _require_counts(cells, columns, words)
    _require_one_condition(cells, columns)
    return columns


def _varying(cells: Cells, columns: _Columns) -> dict[int, list[str]]:
    """Return the values of each column that is not taken and varies within a track."""
    if columns.recorded:
        return {}
    place = [at for at, role in columns.roles.items() if role in {"subject", "condition"}]
    tracks = [tuple(row[at] for at in place) for row in cells.rows]
    values: dict[int, list[str]] = {}
    for at in sorted(set(range(len(cells.header))) - columns.roles.keys() - columns.ignored):
        pairs = {
            (track, row[at]): row[at]
            for track, row in zip(tracks, cells.rows, strict=True)
            if not is_missing(row[at])
        }
        if len(pairs) > len({track for track, _ in pairs}):
            values[at] = list(dict.fromkeys(pairs.values()))
    return values


def _require_one_condition(cells: Cells, columns: _Columns) -> None:
    """Refuse further conditions, sessions or groups in which the answers of a track were given."""
    known = {*_NAMES["condition"], *NAMES["session"], *NAMES["group"]}
    others = [at for at in _varying(cells, columns) if plain_name(cells.header[at]) in known]
    if others:
        names, vary = cells.names(others), "vary" if others[1:] else "varies"
        ignored = ",".join(f"ignore={cells.named(at)}" for at in others)
        raise TableError(
            f"{cells.source}: {names} {vary} within a track: a threshold for each (add "
            f"{_with_parts(cells, columns, others)}), or one for all (add --columns "
            f"{typed_as(ignored)})"
        )


def _with_parts(cells: Cells, columns: _Columns, others: Sequence[int]) -> str:
    parts = ",".join(f"condition={cells.named(at)}" for at in (*columns.parts, *others))
    return f"--columns {typed_as(parts)}"


def pooled_line(cells: Cells, told: str | None) -> str:
    """Return in words which columns are left out though they vary within a track, of few values.

    Numbers 0, 1 and 2 say which answer or interval it was.
    """
    columns = _columns(cells, told)
    few = {
        at: f"{cells.named(at)} ({len(values)} values: {', '.join(values[:5])}"
        f"{', …' * (len(values) > 5)})"
        for at, values in _varying(cells, columns).items()
        if len(values) <= min(_most(cells, at, values), len(cells.rows) - 1)
    }
    if not few:
        return ""
    more = f" and {len(few) - MOST_NAMED} more" * (len(few) > MOST_NAMED)
    names = "; ".join(list(few.values())[:MOST_NAMED])
    return (
        f"Left out: column{'s' * (len(few) > 1)} {names}{more}. A threshold for each value: add "
        f"{_with_parts(cells, columns, list(few)[:1])}."
    )


def _most(cells: Cells, column: int, values: Collection[str]) -> int:
    """Return how many values of a column may be conditions."""
    if not cells.is_numeric(column):
        return _MOST_VALUES
    return 0 if {cells.number(value) for value in values} <= {0, 1, 2, None} else _MOST_NUMBERS


def _lacking(cells: Cells, role: str) -> str:
    """Return what to say of a table without a column of a role."""
    one = ", or subject=one if there was one" * (role == "subject")
    return (
        f"{cells.where()}: must have the column {_OWN.get(role, role)}, got {cells.names()}; add "
        f"--columns {role}=NAME{one}"
    )


def _require_clear(cells: Cells, role: str, ranked: Sequence[int]) -> None:
    """Refuse a name that stands twice, or two names of which neither is the better one."""
    best = plain_name(cells.header[ranked[0]])
    if sum(plain_name(cells.header[at]) == best for at in ranked) > 1:
        raise TableError(
            f"{cells.where()}: the column {cells.header[ranked[0]]} must stand once; rename the "
            "others"
        )
    if role in {"condition", "level"} and best not in {role, _OWN.get(role)}:
        require_one(cells, role, ranked, "ignore=NAME")


def columns_line(cells: Cells, told: str | None) -> str:
    """Return in words which columns were taken, if any has a name of its own; else nothing."""
    columns = _columns(cells, told)
    own = ((cells.named(at), _OWN.get(role, role)) for at, role in columns.roles.items())
    other = [f"{name} is {as_own}" for name, as_own in own if name.casefold() != as_own]
    return "" if columns.recorded or not other else f"Columns: {listed(other)}."


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """The thresholds of two tracks of one participant, with a 95% interval.

    `value` is the ratio of that of `b` to that of `a`, or, of a curve of the level as given, the
    difference. Without it `reason` says why there is none.
    """

    participant: str
    a: str
    b: str
    of: Literal["ratio", "difference"]
    value: float = math.nan
    ci: Interval = NOTHING
    reason: str | None = None


def comparisons(fits: Sequence[tuple[Track, Threshold]], shape: str) -> Iterator[Comparison]:
    """Yield the comparison of each two tracks of a participant, in the order of the table.

    The interval combines those of the thresholds, of which neither need be symmetric (MOVER; Zou
    and Donner, Statistics in Medicine 27, 2008). That takes the answers of two tracks as
    independent, which those of one session need not be.
    """
    of: Literal["ratio", "difference"] = "difference" if shape == "normal" else "ratio"
    for participant in dict.fromkeys(track.participant for track, _ in fits):
        own = [(track.track, fit) for track, fit in fits if track.participant == participant]
        for (a, one), (b, other) in combinations(own, 2):
            compared = partial(Comparison, participant=participant, a=a, b=b, of=of)
            if lacking := one.reason or other.reason:
                name = a if one.reason else b
                yield compared(reason=f"{name}: {lacking}")
                continue
            value, ci = _between(one, other, of)
            yield compared(value=value, ci=ci)


def _between(one: Threshold, other: Threshold, of: str) -> tuple[float, Interval]:
    def on_axis(fit: Threshold) -> tuple[float, float, float]:
        low, high = fit.threshold_ci
        places = (low, fit.threshold, high)
        first, middle, last = places if of == "difference" else map(math.log, places)
        return first, middle, last

    (low_a, a, high_a), (low_b, b, high_b) = on_axis(one), on_axis(other)
    value = b - a
    low = value - math.hypot(b - low_b, high_a - a)
    high = value + math.hypot(high_b - b, a - low_a)
    if of == "difference":
        return value, (low, high)
    return math.exp(value), (math.exp(low), math.exp(high))


def comparison_lines(compared: Sequence[Comparison]) -> Iterator[tuple[str, ...]]:
    """Yield the lines of a table of comparisons for people."""
    yield ("participant", "a", "b", f"{compared[0].of} b to a", "95% interval")
    for each in compared:
        told = (each.reason or f"{each.value:.4g}", "–")
        if each.reason is None:
            told = (told[0], " to ".join(f"{end:.4g}" for end in each.ci))
        yield (each.participant, each.a, each.b, *told)


def left_out_line(tracks: Iterable[Track]) -> str:
    """Return in words how many rows are not in the fits, and why; nothing if all are."""
    counts = sum((track.left_out for track in tracks), Counter[str]())
    if not (rows := counts.total()):
        return ""
    were = "row was" if rows == 1 else "rows were"
    return f"{rows} {were} left out: {_reasons(counts)}."


def _reasons(counts: Mapping[str, int]) -> str:
    return ", ".join(
        f"{counts[why]} {one if counts[why] == 1 else why}"
        for why, one in LEFT_OUT.items()
        if counts[why]
    )


def yes_or_no_line(fits: Iterable[tuple[Track, Threshold]]) -> str:
    """Return what to do where answers look like yes and no; nothing if none do."""
    many = sum(BELOW_CHANCE in fit.flags for _, fit in fits)
    said = 'Far below chance at low levels: if the answers are yes and no, add --task "yes or no".'
    return said * bool(many)


def _name(cells: Cells, row: int, column: int, *, recorded: bool) -> str:
    where = cells.where(row, column)
    name = cell_name(cells.rows[row][column], where)
    # A study may call a track none.
    if not name or (is_missing(name) and not recorded):
        got = repr(name) if name else "none"
        raise TableError(f"{where}: must have a name, got {got}; write one in each row")
    return name


def _level(cells: Cells, row: int, column: int, shape: str) -> float:
    text, where = cells.rows[row][column], cells.where(row, column)
    level = cells.number(text)
    if level is None or abs(level) > 1e100:
        cells.require_no_formula(row, column)
        rule = "a level must be a number from -1e100 to 1e100"
        raise TableError(f"{where}: {rule}, got {text[:40]!r}")
    if shape == "weibull" and level < 0:
        raise TableError(
            f"{where}: a level must be at least 0 for the shape weibull, which is a curve of its "
            f"logarithm, got {text[:40]}; use --shape normal"
        )
    return level


def _require_counts(cells: Cells, columns: _Columns, words: Mapping[str, int]) -> None:
    """Refuse trials that count on from 1 with each answer: they may be its number."""
    of = columns.of
    answers = {row[of["answer"]] for row in cells.rows}
    if any(not is_missing(text) and _answer(cells, text, words) is None for text in answers):
        return
    # Trials are numbered in a track, through all tracks of a participant, or through the table.
    person = tuple(of[role] for role in ("subject",) if role in of)
    for place in ((*person, *columns.parts), person, ()):
        numbers: dict[tuple[str, ...], list[float | None]] = {}
        for row in cells.rows:
            key = tuple(row[at] for at in place)
            numbers.setdefault(key, []).append(cells.number(row[of["trials"]]))
        rising = all(own == list(range(1, len(own) + 1)) for own in numbers.values())
        if rising and len(cells.rows) > len(numbers):  # a lone 1 is a count of 1, too
            name = cells.header[of["trials"]]
            raise TableError(
                f"{cells.where()}: the column {name} may number the trials or "
                f"count them: add --columns trials={name}, or ignore={name}"
            )


def _counts(
    cells: Cells, row: int, columns: Mapping[str, int], words: Mapping[str, int]
) -> tuple[int, int]:
    """Return the trials and the correct ones of a row."""
    at = columns["answer"]
    text, where = cells.rows[row][at], cells.where(row, at)
    if "trials" not in columns:
        if (answer := _answer(cells, text, words)) is None:
            cells.require_no_formula(row, at)
            raise TableError(
                f"{where}: must be 1 or 0 in a row per trial, got {text[:40]!r}; "
                f"{_remedy(cells, row, at, words)}"
            )
        return 1, answer
    trials, correct = (_count(cells, row, columns[role]) for role in ("trials", "answer"))
    if correct > trials:
        raise TableError(f"{where}: must be at most the {trials} trials, got {correct}")
    return trials, correct


def _remedy(cells: Cells, row: int, column: int, words: Mapping[str, int]) -> str:
    """Return what to do about an answer that is neither right nor wrong."""
    text = cells.rows[row][column]
    missing = f"--missing {typed_as(text)} if it stands for no answer"
    if cells.number(text) is not None:
        return f"add --columns trials=NAME if it is a count, or {missing}"
    given = dict.fromkeys(each[column].casefold() for each in cells.rows)
    others = [word for word in given if not is_missing(word) and word not in words]
    known = {words[word] for word in given if word in words}
    first = 0 if known == {1} else 1
    pairs = ",".join(f"{word}={first if at == 0 else 1 - first}" for at, word in enumerate(others))
    if len(others) > 6:
        return "keep 1 and 0, or say what words mean, such as --answers longer=1,shorter=0"
    return f"say what each means, such as --answers {typed_as(pairs)}, or add {missing}"


def _answer(cells: Cells, text: str, words: Mapping[str, int]) -> int | None:
    """Return 1 or 0, also of the 1.0 and 0.0 of a column that has missing ones."""
    number = cells.number(text)
    word = text.casefold() if number is None else f"{number:g}"
    if (answer := words.get(word)) is not None:
        return answer
    return int(number) if number in {0.0, 1.0} else None


def _count(cells: Cells, row: int, column: int) -> int:
    text = cells.rows[row][column]
    value = cells.number(text)
    # Spreadsheets and pandas may write a whole number with a point.
    if value is None or not 0 <= value <= MOST_TRIALS or value % 1:
        cells.require_no_formula(row, column)
        raise TableError(
            f"{cells.where(row, column)}: must be a whole number from 0 to {MOST_TRIALS}, got "
            f"{text[:40]!r}"
        )
    return int(value)


def lines_of(found: Sequence[tuple[Track, Threshold]]) -> Iterator[tuple[str, ...]]:
    """Yield the lines of a table of thresholds for people."""
    yield COLUMNS
    for track, fit in found:
        cells = ["–", "–", "–", "", "–", "–"]
        if not math.isnan(fit.slope):  # as where the levels have no range
            jnd = "" if fit.jnd is None else f"{fit.jnd:.3g}"
            cells[2:] = f"{fit.slope:.3g}", jnd, f"{fit.lapse:.3f}", f"{fit.deviance_p:.2f}"
            cells[0] = fit.reason or f"{fit.threshold:.4g}"
        if fit.reason is None:
            cells[1] = " to ".join(f"{end:.4g}" for end in fit.threshold_ci)
        yield (track.participant, track.track, *cells, "; ".join(fit.flags))
