"""The questions a participant can be asked after a touch, and the answers each one allows."""

from typing import Literal

Question = Literal["roughness", "strength", "places"]

ANSWERS: dict[Question, tuple[str, ...]] = {
    "roughness": ("smoother", "rougher", "same"),
    "strength": ("stronger", "weaker", "same"),
    "places": ("swapped", "not swapped"),
}
"""The paper asks how the touch changed (section 5.2); the wording fits the condition."""


def checked_answer(question: Question, answer: str) -> str:
    """Return `answer` if `question` allows it.

    Raises:
        ValueError: it does not; the message names the answers that are allowed.
    """
    if answer not in ANSWERS[question]:
        raise ValueError(
            f"the answer about {question} must be one of {', '.join(ANSWERS[question])}, "
            f"got {answer!r}"
        )
    return answer


_OPPOSITES = {"smoother": "rougher", "stronger": "weaker"}
_OPPOSITES |= {other: answer for answer, other in _OPPOSITES.items()}


def opposite_answer(question: Question, answer: str) -> str | None:
    """Return the answer that says the contrary, or `None` if there is none.

    Places that swap from right to left also swap from left to right.

    >>> opposite_answer("roughness", "smoother")
    'rougher'
    """
    opposite = _OPPOSITES.get(answer)
    return opposite if opposite in ANSWERS[question] else None


def no_change(question: Question) -> str:
    """Return the answer that says that nothing changed.

    >>> no_change("places")
    'not swapped'
    """
    return ANSWERS[question][-1]
