"""Variants of a condition: its touches at another level, at 0 V, or in the opposite order."""

from functools import lru_cache

from protocol.study.questions import opposite_answer
from protocol.study.study import Condition
from protocol.study.touch import Touch


def scaled(touch: Touch, level: float) -> Touch:
    """Return `touch` with its amplitudes multiplied by `level`."""
    ramp_to_v = None if touch.ramp_to_v is None else touch.ramp_to_v * level
    return touch.model_copy(update={"voltage_v": touch.voltage_v * level, "ramp_to_v": ramp_to_v})


@lru_cache(maxsize=4096)
def at_level(touches: tuple[Touch, ...], level: float) -> tuple[Touch, ...]:
    """Return the touches with every amplitude multiplied by `level`; at 0 it is a catch trial."""
    return touches if level == 1 else tuple(scaled(touch, level) for touch in touches)


@lru_cache(maxsize=4096)
def opposite(touches: tuple[Touch, ...]) -> tuple[Touch, ...]:
    """Return the touches in the opposite order, each ramp and sweep run backwards."""
    return tuple(_backwards(touch) for touch in reversed(touches))


def _backwards(touch: Touch) -> Touch:
    update: dict[str, float] = {}
    if touch.ramp_to_v is not None:
        update |= {"voltage_v": touch.ramp_to_v, "ramp_to_v": touch.voltage_v}
    if touch.sweep_to is not None:
        update |= {"frequency": touch.sweep_to, "sweep_to": touch.frequency}
    return touch.model_copy(update=update)


@lru_cache(maxsize=1024)
def opposite_expected(condition: Condition) -> str | None:
    """Return the answer expected of the opposite trial, or `None` if the condition has none."""
    answer = opposite_answer(condition.question, condition.expected)
    there, back = map(_courses, (condition.touches, opposite(condition.touches)))
    return None if there == back else answer


def _courses(touches: tuple[Touch, ...]) -> list[Touch]:
    """The touches with their ends written out: a ramp from 100 V to 100 V is a hold."""
    return [
        touch.model_copy(update={"ramp_to_v": touch.end_voltage_v, "sweep_to": touch.end_frequency})
        for touch in touches
    ]
