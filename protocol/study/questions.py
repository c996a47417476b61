"""Questions after a touch, the answers that each one allows, and the scale of scores."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from protocol.study.fields import Line, Record, Whole

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


Score = Annotated[Whole, Field(le=1_000)]
"""Whole, so that it can be typed and counted."""


class Band(Record):
    """A range of scores, and its name in each language by the language's code."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[
        str, Annotated[Line, Field(description="its name in that language, such as `en`")]
    ] = Field(init=False)

    first: Annotated[Score, Field(alias="from", description="lowest score of the band")]
    last: Annotated[Score, Field(alias="to", description="highest score of the band")]

    @property
    def names(self) -> dict[str, str]:
        """The names that the study file gives, by language."""
        return self.__pydantic_extra__


PAPERS_BANDS = {
    (0, 0): "no effect",
    (1, 4): "very weak",
    (5, 7): "general",
    (8, 10): "very effective",
}
"""The paper's names of its scores (section 5.2): first and last score, and the key in languages."""


class Rating(Record):
    """When and on which scale the effect is scored, and how the scores are named."""

    score_when: Annotated[
        Literal["agrees", "always"],
        Field(description="ask for the score only if the answer agrees with the expectation"),
    ] = "agrees"
    minimum: Annotated[Score, Field(description="lowest score")] = 0
    maximum: Annotated[Score, Field(description="highest score, above the lowest")] = 10
    ticks: Annotated[
        Literal["all", "bands", "ends"], Field(description="which scores are marked on the scale")
    ] = "all"
    bands: Annotated[
        tuple[Band, ...], Field(description="names of ranges, together the whole scale")
    ] = ()

    @model_validator(mode="after")
    def _ends_are_apart(self) -> Self:
        if self.minimum >= self.maximum:
            raise ValueError(f"maximum must be above minimum = {self.minimum}, got {self.maximum}")
        return self

    @model_validator(mode="after")
    def _bands_cover_the_scale(self) -> Self:
        covered = [score for band in self.bands for score in range(band.first, band.last + 1)]
        if self.bands and covered != list(range(self.minimum, self.maximum + 1)):
            spans = ", ".join(f"{band.first}-{band.last}" for band in self.bands)
            raise ValueError(
                f"bands must follow one another from {self.minimum} to {self.maximum}, got {spans}"
            )
        return self

    @property
    def span(self) -> int:
        """How far the ends of the scale are apart."""
        return self.maximum - self.minimum

    def checked_score(self, score: int) -> int:
        """Return `score` if it lies on the scale.

        Raises:
            ValueError: it does not.
        """
        if not self.minimum <= score <= self.maximum:
            raise ValueError(f"rating must lie in [{self.minimum}, {self.maximum}], got {score}")
        return score


PAPERS_SCALE = Rating()
"""From 0 to 10 (section 5.2)."""
