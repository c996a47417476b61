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
