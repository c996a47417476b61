"""The columns of exported trials, in their order.

Every export has the same columns in the same order, whatever a study holds.
"""

from collections.abc import Callable, Sequence
from datetime import UTC, datetime

from analysis.cells import Cell
from analysis.export.dataset import YES_NO, Column
from analysis.export.touch_columns import TOUCH_COLUMNS
from analysis.loading.records import TrialRecord


def _planned(key: str) -> Callable[[TrialRecord], Cell]:
    return lambda trial: trial.planned.get(key)


def _answer(key: str) -> Callable[[TrialRecord], Cell]:
    return lambda trial: trial.answer.get(key)


def _opened(key: str) -> Callable[[TrialRecord], Cell]:
    return lambda trial: trial.session.opened.get(key)


def _noted(question: str) -> Callable[[TrialRecord], Cell]:
    return lambda trial: trial.session.operator_noted.get(question)


def _reaction_s(which: int) -> Callable[[TrialRecord], Cell]:
    def reaction_s(trial: TrialRecord) -> Cell:
        times: Sequence[float] = trial.answer.get("reaction_time_s", ())
        return times[which] if which < len(times) else None

    return reaction_s


def _utc(moment: datetime | None) -> str | None:
    """The moment as BIDS writes it: ISO 8601 to the microsecond, with Z."""
    if moment is None:
        return None
    return moment.astimezone(UTC).replace(tzinfo=None).isoformat(timespec="microseconds") + "Z"


def _duration_s(trial: TrialRecord) -> float | None:
    if trial.started_s is None or trial.answered_s is None:
        return None
    return round(trial.answered_s - trial.started_s, 6)


def _lines(texts: Sequence[str]) -> str | None:
    return "\n".join(texts) or None


_SESSION = (
    Column(
        name="participant",
        description="Pseudonym of the participant.",
        of=lambda trial: trial.session.participant,
    ),
    Column(
        name="session",
        description="Number of the participant's session.",
        of=lambda trial: trial.session.number,
    ),
    Column(
        name="session_kind",
        description="Who gave the answers.",
        levels={
            "participant": "a person on a real device",
            "rehearsal": "a dry run: simulated device, virtual answers, or declared a rehearsal",
            "published": "scores imported from a published table",
        },
        of=lambda trial: trial.session.kind,
    ),
    Column(
        name="session_completed",
        description="Whether the session came to its end.",
        levels=YES_NO,
        of=lambda trial: trial.session.completed,
    ),
)

_PLAN = (
    Column(
        name="trial_index",
        description="Place of the trial in the session's plan, from 0.",
        of=_planned("index"),
    ),
    Column(
        name="block",
        description="Block of the trial; 0 stands before the first block.",
        of=_planned("block"),
    ),
    Column(
        name="trial_kind",
        description="What the trial is for.",
        levels={
            "baseline": "first touch, without a signal, to remember",
            "signal": "first touch with a signal",
            "practice": "not analysed",
            "trial": "a parameter changes; its effect is scored",
            "catch": "at 0 V: nothing changes",
            "published": "a score of a published table, of which nothing else is known",
        },
        of=_planned("kind"),
    ),
    Column(
        name="condition",
        description="The parameter that changes.",
        of=_planned("condition"),
    ),
    Column(
        name="level",
        description="By what the amplitudes of the condition are multiplied; 0 in a catch trial.",
        of=_planned("level"),
    ),
    Column(
        name="opposite",
        description="Whether the touches come in the opposite order.",
        levels=YES_NO,
        of=_planned("opposite"),
    ),
    Column(
        name="question",
        description="What is asked after the last touch.",
        levels={
            "roughness": "how did the roughness change",
            "strength": "how did the effect change",
            "places": "did the smooth and the rough places swap",
        },
        of=_planned("question"),
    ),
    Column(
        name="expected",
        description="The answer that agrees with the expectation.",
        of=_planned("expected"),
    ),
)

_ANSWER = (
    Column(
        name="change",
        description="The participant's answer.",
        levels={
            "smoother": "about the roughness",
            "rougher": "about the roughness",
            "stronger": "about the strength of the effect",
            "weaker": "about the strength of the effect",
            "same": "no change of roughness or strength",
            "swapped": "the smooth and the rough places swapped",
            "not swapped": "they did not swap",
        },
        of=_answer("change"),
    ),
    Column(
        name="agrees",
        description="Whether the answer agrees with the expectation.",
        levels=YES_NO,
        of=_answer("agrees"),
    ),
    Column(
        name="score",
        description="Strength of the effect from 0 (none) to 10 (very effective). Missing where it "
        "was not asked for or not given, never 0 instead.",
        of=_answer("score"),
    ),
    Column(
        name="reaction_time_s",
        description="From the question, or the instruction to remember, to the answer.",
        unit="s",
        of=_reaction_s(0),
    ),
    Column(
        name="score_reaction_time_s",
        description="From the scale's appearance to the score.",
        unit="s",
        of=_reaction_s(1),
    ),
)

_COURSE = (
    Column(
        name="excluded",
        description="Whether it was taken out of the analysis afterwards.",
        levels={"no": "it counts", "trial": "this trial", "session": "the whole session"},
        of=lambda trial: trial.excluded,
    ),
    Column(
        name="exclusion_reason",
        description="Why it was taken out.",
        of=lambda trial: trial.session.exclusion or trial.exclusion,
    ),
    Column(
        name="attempts",
        description="How often the trial was begun; all else is of the last attempt.",
        of=lambda trial: trial.attempts,
    ),
    Column(
        name="aborted",
        description="How many of the attempts were broken off.",
        of=lambda trial: None if trial.attempts is None else len(trial.abort_reasons),
    ),
    Column(
        name="abort_reasons",
        description="Why, a line each.",
        of=lambda trial: _lines(trial.abort_reasons),
    ),
    Column(
        name="notes",
        description="What the operator noted in or after the trial, a line each.",
        of=lambda trial: _lines(trial.notes),
    ),
    Column(
        name="started_utc",
        description="When the trial began, UTC.",
        of=lambda trial: _utc(trial.started_utc),
    ),
    Column(
        name="answered_utc",
        description="When the last answer was given, UTC.",
        of=lambda trial: _utc(trial.answered_utc),
    ),
    Column(
        name="started_monotonic_s",
        description="When the trial began by a clock that never runs backwards; it begins anew "
        "when an interrupted session goes on.",
        unit="s",
        of=lambda trial: trial.started_s,
    ),
    Column(
        name="duration_s",
        description="From the trial's beginning to its last answer, by the same clock.",
        unit="s",
        of=_duration_s,
    ),
)


_SETTING = (
    Column(
        name="resonance_hz",
        description="Resonance of the rig as measured before the trial.",
        unit="Hz",
        of=lambda trial: trial.resonance.get("frequency_hz"),
    ),
    Column(
        name="resonance_tip_m_per_v",
        description="Amplitude of the beam's tip at the resonance, per volt.",
        unit="m/V",
        of=lambda trial: trial.resonance.get("tip_m_per_v"),
    ),
    Column(
        name="device",
        description="What the device said it is.",
        of=lambda trial: trial.session.device,
    ),
    Column(
        name="skin_state",
        description="Skin of the participant, as the operator noted it.",
        of=_noted("skin state"),
    ),
    Column(
        name="room_temperature",
        description="Temperature of the room, as the operator noted it.",
        of=_noted("room temperature"),
    ),
    Column(
        name="humidity",
        description="Humidity of the room, as the operator noted it.",
        of=_noted("humidity"),
    ),
    Column(
        name="cleaning",
        description="Cleaning of beam and finger, as the operator noted it.",
        of=_noted("cleaning"),
    ),
    Column(
        name="language",
        description="What the participant read.",
        of=_opened("language"),
    ),
    Column(
        name="slot",
        description="Place of the participant in the design, from 0; rehearsals have their own.",
        of=_opened("slot"),
    ),
    Column(
        name="seed",
        description="Seed of the session's random choices.",
        of=_opened("seed"),
    ),
    Column(
        name="study_sha256",
        description="Digest of the study file that was in force when the trial was last begun.",
        of=lambda trial: trial.study_sha256,
    ),
    Column(
        name="touchbeam_version",
        description="Version of touchbeam that ran the session.",
        of=lambda trial: trial.session.opened.get("versions", {}).get("touchbeam"),
    ),
)

COLUMNS = (*_SESSION, *_PLAN, *_ANSWER, *_COURSE, *TOUCH_COLUMNS, *_SETTING)


def cells(trial: TrialRecord) -> list[Cell]:
    """Return the values of `trial`, one per column."""
    return [column.of(trial) for column in COLUMNS]
