"""The question after a trial: what changed, whether that was expected, and how strong it is."""

from typing import Any

from protocol.plan import Trial
from protocol.questions import checked_answer
from runner.ports import Clock, Device, Participant
from runner.screens import AskChange, AskScore, Instruction, Response
from runner.session import Session
from runner.waiting import response


def answers(
    session: Session, trial: Trial, device: Device, participant: Participant, clock: Clock
) -> dict[str, Any]:
    """Ask what `trial` has to ask and return it as the journal holds it.

    The score is missing where the answer disagrees with the expectation and the study asks only
    for scores of effects that agree (the paper's rule, section 5.2).
    """
    if trial.question is None:
        participant.show(Instruction(text="remember"))
        remembered = response(participant, device, clock)
        return _record(trial, None, None, [remembered])
    participant.show(AskChange(question=trial.question))
    change = response(participant, device, clock)
    checked_answer(trial.question, change.answer)
    agrees = change.answer == trial.expected
    if not trial.scored or not (agrees or session.study.rating.score_when == "always"):
        return _record(trial, change.answer, None, [change])
    participant.show(AskScore(rating=session.study.rating))
    score = response(participant, device, clock)
    checked = session.study.rating.checked_score(int(score.answer))
    return _record(trial, change.answer, checked, [change, score])


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
        "reaction_time_s": [entry.reaction_time_s for entry in given],
    }
