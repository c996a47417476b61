"""The columns of a study's data in their order: meaning, unit and levels of each one.

Every export of a format has the same columns in the same order, whatever a study holds.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import partial
from typing import Any

from protocol.study.study import Study
from protocol.study.study_question import (
    IMPORTED_ANSWERS,
    IMPORTED_QUESTION,
    INTERVALS,
    MEANINGS,
    QUESTIONS,
    StudyQuestion,
)

REACTION_TIME = "_reaction_time_s"
"""Ending of the exported column beside a question's own."""
YES_NO = {"true": "yes", "false": "no"}


@dataclass(frozen=True)
class Column:
    """One column.

    A column `per_touch` lists a value for each touch of the trial; one with `several` lists as
    many as were chosen. One that is `private` stays out of data sets that are made to be shared.
    One `of_session` stands in a table of sessions, too. `of_condition` is what it holds in trials
    of each condition.

    A column holds what the tables of `analysis/loading` have under its name, or what is `made` of
    their columns. `planned` is the field of a planned trial or touch that it holds, a number if a
    column of touches has no levels.
    """

    name: str
    description: str
    unit: str | None = None
    _: KW_ONLY
    levels: Mapping[str, str] = field(default_factory=dict)
    per_touch: bool = False
    several: bool = False
    private: bool = False
    of_session: bool = False
    of_condition: Mapping[str, str | float] = field(default_factory=dict)
    planned: str = ""
    made: Callable[[Any], Any] | None = None

    @property
    def of_lists(self) -> str:
        """What a list in a cell holds; empty where there are no lists."""
        return "A value per touch." if self.per_touch else "Any of these." * self.several


_session = partial(Column, of_session=True)
_touch = partial(Column, per_touch=True)


def _plan(name: str, description: str, planned: str = "", **known: Any) -> Column:
    return Column(name, description, planned=planned or name, **known)


def _planned(name: str, description: str, unit: str | None = None) -> Column:
    return _touch(f"planned_{name}", description, unit, planned=name)


_SESSION = (
    _session("participant", "Pseudonym of the participant."),
    _session("session", "Number of the participant's session."),
    _session(
        "session_kind",
        "Who gave the answers.",
        levels={
            "participant": "a person on a real device",
            "rehearsal": "a dry run: simulated device, virtual answers, or declared a rehearsal",
            "published": "scores imported from a table",
        },
    ),
    _session("session_completed", "Whether the session came to its end.", levels=YES_NO),
)

_PLAN = (
    _plan("trial_index", "Place of the trial in the session's plan, from 0.", planned="index"),
    _plan("block", "Block of the trial; 0 stands before the first block."),
    _plan(
        "trial_kind",
        "What the trial is for.",
        planned="kind",
        levels={
            "baseline": "first touch, without a signal, to remember",
            "signal": "first touch with a signal",
            "practice": "not analysed",
            "trial": "a condition; its effect or, without a question, what is felt is scored",
            "catch": "at 0 V: nothing changes",
            "published": "an imported score; how it was given is not known",
        },
    ),
    _plan("condition", "The parameter that changes."),
    _plan("level", "By what the amplitudes of the condition are multiplied; 0 in a catch trial."),
    _plan("opposite", "Whether the touches come in the opposite order.", levels=YES_NO),
    _plan(
        "question",
        "What is asked after the last touch.",
        levels={
            **{question: asked.meaning for question, asked in QUESTIONS.items()},
            IMPORTED_QUESTION: "of imported scores: whether something changed as expected",
        },
    ),
    _plan("expected", "The answer that agrees with the expectation."),
)

_ANSWER = (
    Column("change", "The participant's answer.", levels={**MEANINGS, **IMPORTED_ANSWERS}),
    Column("agrees", "Whether the answer agrees with the expectation.", levels=YES_NO),
    Column(
        "score",
        "Score of the effect or, without a question, of what was felt, from {scale}. Missing where "
        "it was not asked for or not given, never 0 instead.",
    ),
    Column(
        "reaction_time_s", "From the question, or the instruction to remember, to the answer.", "s"
    ),
    Column("score_reaction_time_s", "From the scale's appearance to the score.", "s"),
)

_FELT = (
    Column(
        "measured_contrast",
        "Change of the logarithm of friction as measured at the finger, positive in the expected "
        "direction or, without a question, where friction is above that at rest; missing where "
        "touches were not recorded.",
    ),
    Column("measured_contrast_error", "Standard error of the measured contrast."),
)

_COURSE = (
    Column(
        "excluded",
        "Whether it was taken out of the analysis afterwards, by hand; rules of the study file are "
        "not applied here.",
        levels={"no": "it was not", "trial": "this trial", "session": "the whole session"},
        made=lambda trials: (
            trials["exclusion"]
            .notna()
            .map({True: "trial", False: "no"})
            .mask(trials["session_exclusion"].notna(), "session")
        ),
    ),
    _session(
        "exclusion_reason",
        "Why it was taken out.",
        # A session's exclusion holds for all its trials, whatever else was said of one.
        made=lambda trials: trials["session_exclusion"].fillna(trials["exclusion"]),
    ),
    _session(
        "inclusion_reason",
        "Why an exclusion of it was taken back, if one was.",
        made=lambda trials: trials["session_inclusion"].fillna(trials["inclusion"]),
    ),
    Column("attempts", "How often the trial was begun; all else is of the last attempt."),
    Column("aborted", "How many of the attempts were broken off."),
    Column("abort_reasons", "Why, a line each."),
    Column("notes", "What the operator noted in or after the trial, a line each.", private=True),
    Column("started_utc", "When the trial began, UTC.", private=True),
    Column("answered_utc", "When the last answer was given, UTC.", private=True),
    Column(
        "started_monotonic_s",
        "When the trial began by a clock that never runs backwards; it begins anew "
        "when an interrupted session goes on.",
        "s",
    ),
    Column("duration_s", "From the trial's beginning to its last answer, by the same clock.", "s"),
)


_TOUCHES = (
    Column("touches", "How many touches the attempt had."),
    _touch("beam", "The beam that was mounted."),
    _touch(
        "place",
        "Where the surface was to be touched.",
        planned="place",
        levels={"smooth": "one place", "path": "sliding along the surface"},
    ),
    _touch(
        "direction",
        "Direction of a sliding finger.",
        planned="direction",
        levels={"right": "left to right", "left": "right to left"},
    ),
    _touch(
        "coverage",
        "How much of the surface was to be covered.",
        planned="coverage",
        levels={"local": "one finger", "full": "several fingers"},
    ),
    _touch("press", "Touch force asked for, relative to the study's.", planned="press"),
    _touch(
        "sliding_speed_m_s",
        "Speed of a slide asked for, where the touch has one of its own.",
        "m/s",
        planned="sliding_speed_m_s",
    ),
    _planned("voltage_v", "Planned amplitude (peak) at the start.", "V"),
    _planned("end_voltage_v", "Planned amplitude (peak) at the end.", "V"),
    _planned("frequency", "Planned drive at the start, relative to the resonance."),
    _planned("end_frequency", "Planned drive at the end, relative to the resonance."),
    _touch("commanded_voltage_v", "Amplitude (peak) commanded at the start.", "V"),
    _touch("commanded_frequency_hz", "Frequency commanded at the start.", "Hz"),
    _touch("start_voltage_v", "Amplitude (peak) read back at the start, 0 if it was off.", "V"),
    _touch("end_voltage_v", "Amplitude (peak) read back at the end, likewise.", "V"),
    _touch("start_frequency_hz", "Frequency read back at the start.", "Hz"),
    _touch("end_frequency_hz", "Frequency read back at the end.", "Hz"),
    _touch("start_monitor_v", "The device's monitor of its output at the start.", "V"),
    _touch("end_monitor_v", "The device's monitor of its output at the end.", "V"),
    _touch("force_n", "Median force of the finger.", "N"),
    _touch("force_ok", "Whether the force was the one asked for.", levels=YES_NO),
    _touch("place_ok", "Whether the finger was, or moved, where it should.", levels=YES_NO),
    _touch("speed_ok", "Whether the finger slid as fast as it should.", levels=YES_NO),
    _touch("friction", "Friction coefficient as measured, geometric mean over the touch."),
    _touch("friction_error", "Standard error of the friction coefficient."),
    _touch("normal_n", "Normal force as recorded, mean over the touch.", "N"),
    _touch("vector_n", "Amplitude of the vector of tangential and normal force, mean.", "N"),
    _touch("speed_m_s", "Speed of the finger as recorded, median.", "m/s"),
    _touch("rate_n_per_s", "Rate of change of the tangential force, rms.", "N/s"),
    _touch("stick_slip", "Stick-slip index: SD of the tangential force in 0.1 s over its mean."),
)

_SETTING = (
    Column("resonance_hz", "Resonance of the rig as measured before the trial.", "Hz"),
    Column(
        "resonance_tip_m_per_v",
        "Amplitude at the resonance, per volt: of a beam's tip, on another surface of the place "
        "where the device measures it.",
        "m/V",
    ),
    _session("device", "What the device said it is."),
    _session("skin_state", "Skin of the participant, as the operator noted it."),
    _session("room_temperature", "Temperature of the room, as the operator noted it."),
    _session("humidity", "Humidity of the room, as the operator noted it."),
    _session("cleaning", "Cleaning of beam and finger, as the operator noted it."),
    _session("language", "What the participant read."),
    _session(
        "answer_order",
        "Order in which the answers to choices were shown.",
        levels={"forward": "as in the study file", "reversed": "from last to first"},
    ),
    _session("slot", "Place of the participant in the design, from 0; rehearsals have their own."),
    _session("seed", "Seed of the session's random choices."),
    Column(
        "study_sha256", "Digest of the study file that was in force when the trial was last begun."
    ),
    _session("touchbeam_version", "Version of touchbeam that ran the session."),
)

GROUP = _session("group", "Group of the participant.")
"""Only where sessions have one, so that other studies are exported as before."""

TRACK_COLUMNS = (
    Column("track", "Track of the trial: a question asked again and again at levels of its own."),
    Column(
        "track_role",
        "What the trial is for in its track.",
        levels={
            "level": "the method chose its level",
            "easy": "at the easiest level, for lapses",
            "catch": "the standard alone, for false alarms",
        },
    ),
    Column("level_value", "The level in the unit of the track's axis; missing in a catch trial."),
    Column(
        "interval",
        "Which touch was the comparison, from 1; missing in a catch trial, and in yes or no.",
    ),
    Column(
        "correct",
        "Whether the answer was right, in yes or no whether it was yes; missing where none is "
        "right.",
        levels=YES_NO,
    ),
    Column(
        "reversal",
        "Whether the rule of the track turned at this answer; missing where no rule turns.",
        levels=YES_NO,
    ),
)
"""Likewise only where trials are of tracks, and so are these meanings of other columns."""
_LEVEL = " In a track, the number of its level, 0 the hardest; missing in a catch trial."
_IN_TRACKS: Mapping[str, Mapping[str, str]] = {
    "trial_kind": {"track": "of a track: its level follows from the answers before"},
    "change": {
        **dict.fromkeys(INTERVALS, "the touch that was asked for"),
        "yes": "what was asked for was felt",
        "no": "it was not felt",
    },
}


def in_tracks(column: Column) -> Column:
    """Return a column as a study with tracks describes it."""
    said = column.description + (_LEVEL if column.name == "level" else "")
    levels = {**column.levels, **_IN_TRACKS.get(column.name, {})}
    return replace(column, description=said, levels=levels)


_TIMES = {
    "desk": "of the operator before the first trial of the session",
    "before": "before the first trial of the session",
    "trial": "after the trial",
    "block": "after the block",
    "after": "after the last trial of the session",
}


def question_columns(questions: Iterable[StudyQuestion]) -> tuple[Column, ...]:
    """Return two columns for each question of a study's own: its answer and the time it took."""
    return tuple(column for question in questions for column in _of_question(question))


def _of_question(question: StudyQuestion) -> Iterator[Column]:
    text = next(iter(question.text.values()), "A question that the study file no longer has.")
    # A label's value stands in the table; its name is what participants read.
    names = {
        # Fifteen digits show every number as it was typed, without the rest of a binary fraction.
        f"{label.at:.15g}" if label.value is None else label.value: next(iter(label.names.values()))
        for label in question.labels
    }
    scale = ""
    if question.form == "scale":
        low, high, step = question.scale
        named = "".join(f"; {value}: {name}" for value, name in names.items())
        scale = f" From {low:.15g} to {high:.15g} in steps of {step:.15g}{named}."
    yield Column(
        question.name,
        f"Answer to the question: {text} Asked {_TIMES[question.when]}.{scale}",
        unit=question.unit,
        levels=names if question.values else {},
        several=question.kind == "several",
    )
    yield Column(question.name + REACTION_TIME, f"From the question to {question.name}.", "s")


COLUMNS = (*_SESSION, *_PLAN, *_ANSWER, *_FELT, *_COURSE, *_TOUCHES, *_SETTING)
"""Of the table of trials."""
TAKEN = frozenset(("subject", "participant_id", "pseudonym", "session_kinds", "sessions")).union(
    QUESTIONS, (column.name for column in COLUMNS)
)
"""Names of the columns that every export has, and of the built-in questions."""
BY_NAME = {column.name: column for column in COLUMNS}
PLANNED, PLANNED_PER_TOUCH = (
    tuple(column for column in COLUMNS if column.planned and column.per_touch is per_touch)
    for per_touch in (False, True)
)
"""Of a table of planned trials."""
SESSION_COLUMNS = tuple(column for column in COLUMNS if column.of_session)
"""Of a table of sessions."""
_TRIAL = (*_SESSION[:3], BY_NAME["trial_index"])
_TOUCH = (*_TRIAL, Column("touch", "Number of the touch in its trial, from 0."))
TOUCH_COLUMNS = (
    *_TOUCH,
    *(replace(column, per_touch=False) for column in COLUMNS if column.per_touch),
)
"""Of a table of touches."""
TRACE_COLUMNS = (
    *_TOUCH,
    Column("t_s", "When the sample was taken, by the device's clock.", "s"),
    Column("force_n", "Force of the finger.", "N"),
    Column("position_m", "Position of the finger along the surface.", "m"),
)
"""Of a table of samples."""
PARTICIPANT_COLUMNS = (
    _SESSION[0],
    Column("sessions", "How many of the participant's sessions are here."),
    replace(_SESSION[2], name="session_kinds", several=True),
)
"""Of a table of participants; the answers that each of them gave once follow."""


def response_column(questions: Iterable[StudyQuestion]) -> Column:
    """Return the column of responses; a question of an older study may have its name."""
    name, taken = "response", set(names_of(question_columns(questions)))
    while name in taken:
        name = f"trial_{name}"
    return Column(
        name,
        "The score, counted from 1 at the lowest, if the change was answered as expected; 0 if it "
        "was answered otherwise; the score itself of a trial without a question. Missing where "
        "nothing was answered, and in catch trials.",
    )


def factor_columns(study: Study, questions: Iterable[StudyQuestion]) -> tuple[Column, ...]:
    """Return a column for each factor, and one for the value of each whose values are numbers.

    It has the factor's name, or `factor_` before one that is taken. Levels are in the order of the
    study file.
    """
    asked = tuple(questions)
    others = (GROUP, response_column(asked), *question_columns(asked))
    taken = set(names_of((*COLUMNS, *others)))
    taken |= set(names_of(TRACK_COLUMNS)) if study.track else set()
    crossed = {factor.name: factor for factor in study.factor}
    made = []
    for name, levels in study.factors.items():
        own = f"factor_{name}" if name in taken else name
        told, values = "Condition of the study file that is crossed with factors.", levels
        if factor := crossed.get(name):
            told = f"Factor of the condition, which sets {factor.varies} of a touch."
            values = tuple(map(str, factor.values))
        of_condition = {each.name: each.cell[name] for each in study.condition}
        made.append(
            Column(
                own,
                told,
                levels=dict(zip(levels, values, strict=True)),
                of_condition=of_condition,
            )
        )
        numbers = {
            level: float(value)
            for level, value in zip(levels, factor.values if factor else (), strict=False)
            if not isinstance(value, str)
        }
        if factor and len(numbers) == len(levels):
            in_use = taken | set(study.factors)
            made.append(
                Column(
                    f"factor_{name}_value" if f"{own}_value" in in_use else f"{own}_value",
                    f"What {own} sets {factor.varies} of a touch to.",
                    factor.unit,
                    of_condition={one: numbers[level] for one, level in of_condition.items()},
                )
            )
    return tuple(made)


def names_of(columns: Iterable[Column]) -> list[str]:
    """Return the names of columns, in their order."""
    return [column.name for column in columns]
