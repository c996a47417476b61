"""What the columns of a table are: told with `--columns`, or known by their names."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from analysis.tables.table_cells import Cells, TableError
from protocol.errors import listed

ROLES: Mapping[str, str] = {
    "subject": "who scored",
    "condition": "what was scored",
    "factor": "a part of what was scored",
    "score": "the score",
    "answer": "whether the change was answered as expected",
    "repeat": "which time it was scored",
    "session": "in which session",
    "group": "the subject's group",
    "contrast": "a predicted change of the logarithm of friction",
    "ignore": "nothing",
}
"""What a column may be."""
SEVERAL = frozenset({"factor", "repeat", "ignore"})
"""Roles that several columns may have; of `condition` and `score` a wide table has none."""

NAMES: Mapping[str, tuple[str, ...]] = {
    # In each the better name comes first: of "name" and "id" one may be both.
    "subject": (
        "subject", "participant", "participantid", "participantprivateid", "subjectid", "subjects",
        "participants", "subj",
        "sub", "ppt", "pp", "vp", "vpn", "vpid", "vpcode", "versuchsperson", "proband", "probandin",
        "probandid", "teilnehmer", "teilnehmerin", "person", "personid", "sujet", "sujeto",
        "soggetto", "observer", "respondent", "respondentid", "rater", "assessor", "panelist",
        "judge", "user", "userid", "pid", "sid", "id", "code", "subjectcode", "subjectnumber",
        "subjectno", "subjectnr", "participantnumber", "participantno", "participantnr", "initials",
        "initialen", "kürzel", "受试者", "受试者编号", "被试", "被试编号", "受試者", "被試",
        "被験者", "参加者", "编号", "姓名", "prolificpid", "responseid", "name",
        "nr", "no", "number", "nummer",
    ),
    "condition": (
        "condition", "conditions", "cond", "stimulus", "stimuli", "stim", "stimulusid", "texture",
        "material", "surface", "sample", "treatment", "bedingung", "reiz", "item", "product",
        "conditionname", "stimulusname", "trialtype", "条件", "刺激", "材料",
    ),
    "score": (
        "score", "rating", "ratings", "scores", "bewertung", "urteil", "einschätzung", "vas",
        "magnitude", "estimate", "ratingvalue", "puntuación", "punteggio", "likert",
        "sliderresponse", "response", "value", "wert", "answer", "antwort", "评分", "得分",
    ),
    "answer": ("answer", "antwort", "judgement", "judgment", "response", "réponse"),
    "repeat": (
        "repeat", "rep", "repeats", "repetition", "replicate", "replication", "wiederholung",
        "durchgang", "durchlauf", "trial", "trialno", "trialnr", "trialnumber", "trialindex",
        "trialid", "block", "blockno", "run", "presentation", "attempt", "attempts",
        "thisrepn",
    ),
    "session": ("session", "ses", "sessionid", "sitzung", "visit", "termin", "sessionno"),
    "group": ("group", "grp", "gruppe", "groupe", "grupo", "cohort", "arm"),
    "contrast": ("contrast", "predictedcontrast", "kontrast"),
    "ignore": (
        "age", "alter", "sex", "gender", "geschlecht", "hand", "handedness", "date", "datum",
        "time", "uhrzeit", "timestamp", "datetime", "rt", "reactiontime", "reactiontimes", "rts",
        "rtms", "latency", "duration", "durations", "onset", "comment", "comments", "kommentar",
        "remark", "remarks", "bemerkung", "notes", "language", "experimenter", "order", "position",
        "height", "weight", "index", "unnamed0", "sliderrt", "framerate", "expname", "rownames",
        "row",
        # The own columns of PsychoPy, of which the first three count, and of Gorilla.
        "thisn", "thistrialn", "thisindex", "thisrowt", "started", "stopped", "psychopyversion",
        "eventindex", "utctimestamp", "utcdateandtime", "utcdate", "localtimestamp",
        "localtimezone", "localdateandtime", "localdate", "experimentid", "experimentversion",
        "treenodekey", "repeatkey", "scheduleid", "participantpublicid", "participantstatus",
        "participantdevicetype", "participantdevice", "participantos", "participantbrowser",
        "participantstartinggroup", "participantcompletioncode", "taskname", "taskversion",
        "spreadsheetname", "spreadsheetrow", "screennumber", "screenid", "zonename", "zonetype",
        "reactiononset", "responsetype", "xcoordinate", "ycoordinate", "timedout", "checkpoint",
    ),
}  # fmt: skip
"""What tables call such columns, as `plain` has it."""


def plain(name: str) -> str:
    """Return a name in lower case, of its letters and digits alone.

    >>> plain("Participant ID")
    'participantid'
    """
    return re.sub(r"[\W_]+", "", name.casefold())


@dataclass(frozen=True)
class Roles:
    """The role of each column that has one; `told` are those that `--columns` gave.

    `subject_is` is `row` where each row is a subject, `one` where all are one subject's;
    `headings` is whether each column of numbers is a condition; `repeat_is` is `row` where a
    subject's further rows are repeats, `ending` where the numbers that end headings count them.
    """

    of: Mapping[int, str]
    told: frozenset[int] = frozenset()
    subject_is: str = ""
    repeat_is: str = ""
    headings: bool = False
    second: tuple[int, ...] = field(default=())
    """columns that would be the subject if no better name were there"""

    def columns(self, *roles: str) -> list[int]:
        """Return the columns of any of the roles, in the table's order."""
        return sorted(at for at, role in self.of.items() if role in roles)

    def column(self, role: str) -> int | None:
        """Return the column of a role, if there is one."""
        return next(iter(self.columns(role)), None)


_WORDS = {"subject": ("row", "one"), "repeat": ("row", "ending"), "condition": ("heading",)}


def roles_in(cells: Cells, columns: str | None) -> Roles:
    """Return what the columns are, by `--columns` first and then by their names.

    Raises:
        TableError: `columns` names what there is not, or two columns are equally well the
            condition, the score, the session or the group.
    """
    of, words = told_roles(cells, columns or "", ROLES, _WORDS)
    told, second = frozenset(of), list[int]()
    if is_recorded(cells):
        of = {
            at: role for at, name in enumerate(cells.header) if (role := _RECORDED.get(name))
        } | of
        rest = range(len(cells.header))
        return Roles(of={**dict.fromkeys(rest, "ignore"), **of}, told=told)
    # Where headings are the conditions, a name is no role of a score.
    settled = {*words, *of.values(), *(("condition", "score") if "condition" in words else ())}
    for role, names in NAMES.items():
        if role in settled and role not in SEVERAL:
            continue
        ranked = ranked_columns(cells, names, of)
        if role in {"score", "answer"}:  # a response may be either
            ranked = [at for at in ranked if cells.is_numeric(at) is (role == "score")]
        if role in SEVERAL:
            of |= dict.fromkeys(ranked, role)
        elif ranked:
            of[ranked[0]] = role
            second = ranked[1:] if role == "subject" else second
            if role in {"condition", "score", "session", "group"}:
                require_one(cells, role, ranked, "ignore=NAME or factor=NAME")
    return Roles(
        of=of,
        told=told,
        subject_is=words.get("subject", ""),
        repeat_is=words.get("repeat", ""),
        headings="condition" in words,
        second=tuple(second),
    )


_RECORDED = {
    "participant": "subject", "session": "session", "session_number": "session",
    "trial_index": "repeat", "group": "group",
    "condition": "condition", "score": "score", "agrees": "answer",
}  # fmt: skip
"""Columns of trials that touchbeam recorded."""


def is_recorded(cells: Cells) -> bool:
    """Return whether the table is one of trials that touchbeam recorded and exported."""
    return {"participant", "trial_index", "trial_kind", "score"} <= set(cells.header)


def told_roles(
    cells: Cells,
    columns: str,
    roles: Collection[str],
    words: Mapping[str, Collection[str]],
    several: Collection[str] = SEVERAL,
) -> tuple[dict[int, str], dict[str, str]]:
    """Return the roles of `--columns` by column, and those that a word gives.

    Args:
        cells: of the table.
        columns: pairs such as `subject=ID,level=volts`.
        roles: those that there are.
        words: what a role may be instead of a column, as `subject=one`.
        several: roles that several columns may have.

    Raises:
        TableError: a pair is none, or names what there is not.
    """
    of: dict[int, str] = {}
    given: dict[str, str] = {}
    for role, name in _told(cells, columns, roles):
        at = column_named(cells, name)
        if at is None and name in words.get(role, ()):
            given[role] = name
        elif at is None:
            raise TableError(
                f"{cells.source}: --columns: no column {name!r}; there are {cells.names()}"
            )
        elif at in of or (role in of.values() and role not in several):
            raise TableError(f"{cells.source}: --columns: {role}={name} is said twice")
        else:
            of[at] = role
    return of, given


def ranked_columns(cells: Cells, known: Sequence[str], taken: Collection[int]) -> list[int]:
    """Return the columns that are not taken and have one of the known names, the best first."""
    names = enumerate(_plain_names(cells))
    ranked = sorted(
        (known.index(name), at) for at, name in names if name in known and at not in taken
    )
    return [at for _, at in ranked]


_OF_PSYCHOPY = re.compile(r".+\.(this(?:N|TrialN|Index|RepN)|started|stopped|rt|response|rating)")


def _plain_names(cells: Cells) -> list[str]:
    """Return the names of all columns as `plain` has them; PsychoPy's without their component."""
    if not any(name.endswith(".thisN") for name in cells.header):
        return list(map(plain, cells.header))
    own = map(_OF_PSYCHOPY.fullmatch, cells.header)
    return [plain(part[1] if part else name) for name, part in zip(cells.header, own, strict=True)]


def require_one(cells: Cells, role: str, columns: Sequence[int], others: str) -> None:
    """Refuse several columns that may have a role; `others` is what to say of the other ones."""
    if len(columns) > 1:
        raise TableError(
            f"{cells.source}: each of {cells.names(columns)} may be the {role}; add "
            f"--columns {role}=NAME, and {others} for the others"
        )


def _told(cells: Cells, columns: str, roles: Collection[str]) -> Iterator[tuple[str, str]]:
    """Yield role and name of each part of `--columns`; a name may hold commas."""
    rest = columns.strip()
    known = {cells.named(at).casefold() for at in range(len(cells.header))}
    longest = max(map(len, known))
    while rest:
        role, separator, name = (text.strip() for text in rest.partition("="))
        # Each may be the last of its name; the longest that is a column's is meant.
        ends = [part.span() for part in re.finditer(r"\s*,\s*(?=\w+\s*=)", name[: longest + 99])]
        ends.append((len(name), len(name)))
        whole = (end for end in ends[::-1] if name[: end[0]].casefold() in known)
        end, start = next(whole, ends[0])
        part, rest = rest[: len(rest) - len(name) + end], name[start:]
        if role not in roles or not separator or not name[:end]:
            raise TableError(
                f"--columns must be pairs such as subject=ID,condition=material, of "
                f"{listed(roles)}, got {part.strip()!r}"
            )
        yield role, name[:end]


def column_named(cells: Cells, name: str) -> int | None:
    """Return the column of that name, exact or else in any case; or of its number, as `#2`."""
    names = [cells.named(at) for at in range(len(cells.header))]
    if name in names:
        return names.index(name)
    alike = [at for at, each in enumerate(names) if each.casefold() == name.casefold()]
    if len(alike) == 1:
        return alike[0]
    number = re.fullmatch(r"#(\d{1,4})", name)
    return int(number[1]) - 1 if number and 0 < int(number[1]) <= len(names) else None
