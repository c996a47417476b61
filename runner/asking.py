"""The question after a trial: what changed, whether that was expected, and how strong it is."""

from typing import Any

from protocol.questions import checked_answer
from protocol.trial import Trial
from runner.room import Room
from runner.screens import AskChange, AskScore, Instruction, Response
from runner.waiting import response


def answers(room: Room, trial: Trial) -> dict[str, Any]:
    """Ask what `trial` has to ask and return it as the journal holds it.

    The score is missing where the answer disagrees with the expectation and the study asks only
    for scores of effects that agree (the paper's rule, section 5.2).
    """
    if trial.question is None:
        room.participant.show(Instruction(text="remember"))
        return _record(trial, None, None, [response(room)])
    rating = room.session.study.rating
    room.participant.show(AskChange(question=trial.question))
    change = response(room)
    checked_answer(trial.question, change.answer)
    agrees = change.answer == trial.expected
    if not trial.scored or not (agrees or rating.score_when == "always"):
        return _record(trial, change.answer, None, [change])
    room.participant.show(AskScore(rating=rating))
    score = response(room)
    return _record(trial, change.answer, rating.checked_score(int(score.answer)), [change, score])


def _record(
    trial: Trial, change: str | None, score: int | None, given: list[Response]
) -> dict[str, Any]:
    return {
        "index": trial.index,
        "kind": trial.kind,
        "condition": trial.condition,
        "change": change,
        "agrees": None if change is None else change == trial.expected,
        "score": score,
        "level": trial.level,
        "opposite": trial.opposite,
        "reaction_time_s": [entry.reaction_time_s for entry in given],
        "traces": [entry.trace for entry in given],
    }
