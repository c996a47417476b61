"""Questions after a touch, and the answers that each one allows."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Question = Literal["roughness", "strength", "places"]
Effect = Literal["friction", "depth", "places"]
"""What is felt to change: friction, how much it varies along the path, or where it is high."""


@dataclass(frozen=True, kw_only=True)
class QuestionType:
    """A question after a touch; its texts and those of its answers are in each language's file.

    Attributes:
        effect: what the question is about.
        meaning: of the question, for exported data.
        answers: each with its meaning. The first is the one for which a predicted contrast is
            positive, and the last says that nothing changed; one between them is the contrary of
            the first.
    """

    effect: Effect
    meaning: str
    answers: Mapping[str, str]


_SAME = {"same": "no change of roughness or strength"}
QUESTIONS: Mapping[Question, QuestionType] = {
    "roughness": QuestionType(
        effect="friction",
        meaning="how did the roughness change",
        answers={"smoother": "about the roughness", "rougher": "about the roughness", **_SAME},
    ),
    "strength": QuestionType(
        effect="depth",
        meaning="how did the effect change",
        answers={
            "stronger": "about the strength of the effect",
            "weaker": "about the strength of the effect",
            **_SAME,
        },
    ),
    "places": QuestionType(
        effect="places",
        meaning="did the smooth and the rough places swap",
        answers={
            "swapped": "the smooth and the rough places swapped",
            "not swapped": "they did not swap",
        },
    ),
}
"""The paper asks how the touch changed (section 5.2); the wording fits the condition."""
ANSWERS = {question: tuple(asked.answers) for question, asked in QUESTIONS.items()}


CONTRARIES = {answers[0]: answers[1] for answers in ANSWERS.values() if len(answers) > 2}
"""Answers and their contraries; a predicted contrast is positive for the former."""


def opposite_answer(question: Question, answer: str) -> str | None:
    """Return the answer that says the contrary, or `None` if there is none.

    Places that swap from right to left also swap from left to right.

    >>> opposite_answer("roughness", "smoother")
    'rougher'
    """
    *changes, same = ANSWERS[question]
    return next((other for other in changes if answer not in {other, same}), None)


def no_change(question: Question) -> str:
    """Return the answer that says that nothing changed.

    >>> no_change("places")
    'not swapped'
    """
    return ANSWERS[question][-1]
