"""How long trials and sessions take: what the device does, pauses kept, and assumed reading."""

from collections.abc import Sequence

from protocol.beams import beams_of, swap_count
from protocol.programme import on_s
from protocol.study import Study
from protocol.touch import Touch
from protocol.trial import Plan, Trial


def touches_s(study: Study, touches: Sequence[Touch]) -> float:
    """Return how long the touches of a trial take, instructions and pauses included, s."""
    device_s = sum(on_s(touch, study.touch, study.rig) for touch in touches)
    timing = study.timing
    return (
        device_s + len(touches) * timing.reading_s + (len(touches) - 1) * timing.between_touches_s
    )


def trial_s(study: Study, trial: Trial) -> float:
    """Return the expected duration of a trial with the pause before it, s; beam swaps not in it."""
    timing = study.timing
    asked_s = (timing.answer_s if trial.question else 0.0) + (timing.score_s * trial.scored)
    return trial.break_s + timing.inter_trial_s + touches_s(study, trial.touches) + asked_s


def plan_swaps(study: Study, plan: Plan) -> int:
    """Return how often the operator swaps beams, the study's own one being mounted at first."""
    touches = [touch for trial in plan.trials for touch in trial.touches]
    return swap_count((study.touch.beam, *beams_of(touches, study.touch.beam)))


def session_s(study: Study, plan: Plan) -> float:
    """Return the expected duration of a session, s."""
    swaps_s = plan_swaps(study, plan) * study.timing.beam_swap_s
    return sum(trial_s(study, trial) for trial in plan.trials) + swaps_s
