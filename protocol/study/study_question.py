"""Questions to a participant, those of a study's own and the built-in ones, and pages to read.

A built-in question is an instance: what changed is a choice of one label, the score a scale.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from math import ceil, floor, inf, isfinite
from random import Random
from typing import Annotated, Literal, NamedTuple

from pydantic import AfterValidator, Field

from protocol.study.fields import (
    Count,
    Line,
    Name,
    Positive,
    Record,
    Whole,
    require_printable,
    required,
    setting,
)
from protocol.study.languages import KnownCode
from protocol.study.rules import Label, Rating, ScalePlace

# Questions after a touch, and the answers that each one allows.

Question = Literal["roughness", "strength", "places"]
Effect = Literal["friction", "depth", "places", "level"]
"""What is felt to change: friction, how much it varies along the path, or where it is high; or what
is rated without a question: the level of friction."""


@dataclass(frozen=True, kw_only=True)
class QuestionType:
    """A question after a touch; its texts and those of its answers are in each language's file.

    `meaning` is for exported data. For the answer `more` a predicted contrast is positive, `less`
    is its contrary, if there is one, and `same` says that nothing changed.
    """

    effect: Effect
    meaning: str
    more: str
    less: str | None = None
    same: str = "same"

    @property
    def answers(self) -> tuple[str, ...]:
        """All answers in the order in which they are shown."""
        return (self.more, *([self.less] if self.less else []), self.same)

    def contrary(self, answer: str) -> str | None:
        """Return the answer that says the contrary, or `None` if there is none.

        Places that swap from right to left also swap from left to right.

        >>> QUESTIONS["roughness"].contrary("smoother")
        'rougher'
        """
        return {self.more: self.less, self.less: self.more}.get(answer)


QUESTIONS: Mapping[Question, QuestionType] = {
    "roughness": QuestionType(
        effect="friction", meaning="how did the roughness change", more="smoother", less="rougher"
    ),
    "strength": QuestionType(
        effect="depth", meaning="how did the effect change", more="stronger", less="weaker"
    ),
    "places": QuestionType(
        effect="places",
        meaning="did the smooth and the rough places swap",
        more="swapped",
        same="not swapped",
    ),
}
"""The paper asks how the touch changed (section 5.2); the wording fits the condition."""
ANSWERS = {question: asked.answers for question, asked in QUESTIONS.items()}
MEANINGS = {
    "smoother": "about the roughness",
    "rougher": "about the roughness",
    "stronger": "about the strength of the effect",
    "weaker": "about the strength of the effect",
    "same": "no change of roughness or strength",
    "swapped": "the smooth and the rough places swapped",
    "not swapped": "they did not swap",
}
"""Of all answers, for exported data."""

IMPORTED_QUESTION = "as expected?"
"""Stands for the question of an imported table, of which only the meaning of answers is known."""
IMPORTED_ANSWERS = {
    "expected": "of imported scores: as expected",
    "contrary": "of imported scores: the contrary of what was expected",
}
"""Beside `same`."""

Kind = Literal["choice", "several", "scale", "analogue", "number", "text"]
Form = Literal["labels", "scale", "typed"]
"""How a question is asked: with labels to choose from, a scale, or a line to type in."""
When = Literal["desk", "before", "trial", "block", "after"]
ONCE = frozenset({"desk", "before", "after"})
"""When a question is asked at most once in a session."""
Answer = str | int | float | tuple[str, ...] | None
"""A label's value or several, a number, a text; None for a question that was skipped."""

BETWEEN = ";"
"""Between the values of several labels in an answer."""
LONGEST_IDENTIFIER = 40
MOST_LABELS = 9
"""So that each one has a key of its own."""
INTERVALS = ("first", "second", "third")
"""What participants answer who are asked which touch it was."""
ANALOGUE = (0.0, 100.0, 0.1)
"""Ends and resolution of an analogue scale."""


_NAME = re.compile("[a-z][a-z0-9_]*")
_OF_A_NAME = required(
    _NAME.fullmatch,
    "must begin with a small letter and hold only a to z, 0 to 9 and _",
)
Identifier = Annotated[str, Field(min_length=1, max_length=LONGEST_IDENTIFIER), _OF_A_NAME]


def is_identifier(name: str) -> bool:
    """Return whether a question can have the `name`."""
    return len(name) <= LONGEST_IDENTIFIER and _NAME.fullmatch(name) is not None


LongText = Annotated[str, Field(min_length=1, max_length=1_000), AfterValidator(require_printable)]
# No part begins with a point, so that no name leads out of the folder.
_PICTURE = re.compile(r"\w[\w. -]*(/\w[\w. -]*)*\.(png|jpg|jpeg)", re.IGNORECASE)


def is_picture_name(name: str) -> bool:
    """Return whether `name` may name a picture: a path that does not leave the study's folder."""
    return _PICTURE.fullmatch(name) is not None


def is_digest(known: str) -> bool:
    """Return whether what is known of a picture is its digest, and not what is wrong with it."""
    return re.fullmatch(r"[0-9a-f]+", known) is not None


PICTURE_NAME = "must name a .png or .jpg file in the study's folder, such as beam.png"
_OF_A_PICTURE = required(is_picture_name, PICTURE_NAME)
Filename = Annotated[Line, _OF_A_PICTURE]
_Shown = Annotated[Line, AfterValidator(require_printable)]


SCORE = "score"
"""Name of the question how strong the change is."""
RATING = "rating"
"""Name of the one how strong what was felt is, of conditions that do not ask about a change."""


class AskedIf(Record):
    """The answer on which a question depends."""

    question: Line
    """a question that is asked before this one, or of the trial `change`, `noticed` (`yes`, `no`),
    `agrees` (`yes`, `no`) or `score`; where conditions have no question, `score` alone"""
    answers: tuple[Name, ...] = setting((), "answers after which it is asked", alias="is")
    at_least: ScalePlace | None = setting(None, "smallest number after which it is asked")
    at_most: ScalePlace | None = setting(None, "largest number after which it is asked")

    def met_by(self, given: Mapping[str, Answer]) -> bool:
        """Return whether these answers, by question, ask for it; one that was skipped never does.

        Of several labels that were chosen, one is enough.
        """
        answer = given.get(self.question)
        if isinstance(answer, int | float):
            low, high = self.at_least, self.at_most
            return (low is None or answer >= low) and (high is None or answer <= high)
        chosen = answer if isinstance(answer, tuple | list) else (answer,)
        return any(each in self.answers for each in chosen)

    def __str__(self) -> str:
        """Return what is asked for.

        >>> str(AskedIf(question="age", at_least=60))
        'age is at least 60'
        """
        ends = [("at least", self.at_least), ("at most", self.at_most)]
        numbers = [f"{word} {end:g}" for word, end in ends if end is not None]
        return f"{self.question} is {' or '.join(self.answers) or ' and '.join(numbers)}"


class StudyQuestion(Record):
    """A question of the study's own; its name becomes a column of exported data."""

    name: Identifier = Field(description="name in the data: small letters, digits and `_`")
    kind: Kind
    """`choice`: one of the labels; `several`: any number of them; `scale`: steps of a scale;
    `analogue`: a place on a line, 0 to 100 in steps of 0.1; `number`; `text`"""
    when: When = "trial"
    """`trial`: after the trials of conditions, also practice and catch trials; `block`: after each
    block; `before` the first trial or `after` the last one; `desk`: of the operator, before the
    first trial"""
    conditions: tuple[Name, ...] = ()
    """for `when = "trial"`: only after trials of these; none: after all"""
    sessions: Literal["every", "first"] = "every"
    """whether it is asked in every session of a participant"""
    required: bool = setting(True, strict=True)
    """whether it must be answered; if not, it may be skipped"""
    asked_if: AskedIf | None = None
    """only after this answer: a table, see below; always without it"""
    text: dict[KnownCode, _Shown] = Field(default_factory=dict)
    """the question, by the language's code"""
    labels: tuple[Label, ...] = setting((), "answers, or labels of a scale; a table each")
    minimum: ScalePlace | None = setting(None, "lowest place on a `scale`, or smallest `number`")
    maximum: ScalePlace | None = setting(None, "highest place on a `scale`, or largest `number`")
    step: Positive | None = setting(None, le=1e6)
    """distance between places of a `scale`; by default 1"""
    ticks: Literal["all", "labels", "ends"] = setting("all", "which places are marked on a `scale`")
    decimals: Whole | None = setting(None, le=6)
    """largest number of decimals of a `number`; by default 0"""
    unit: _Shown | None = setting(None, "unit of a `number`, shown beside it and in exported data")
    max_length: Count | None = setting(None, "longest `text`, in characters; by default 60", le=200)

    def follows(self, given: Mapping[str, Answer]) -> bool:
        """Return whether it is asked after these answers, by question."""
        return self.asked_if is None or self.asked_if.met_by(given)

    @property
    def values(self) -> tuple[str, ...]:
        """What may be chosen: the values of the labels; none where the labels name places."""
        return tuple(label.value for label in self.labels if label.value is not None)

    @property
    def scale(self) -> tuple[float, float, float]:
        """Lowest and highest place and the step of a scale."""
        if self.kind == "analogue":
            return ANALOGUE
        return self.minimum or 0.0, self.maximum or 0.0, self.step or 1.0

    @property
    def ends(self) -> tuple[float | None, float | None]:
        """Smallest and largest number that answers it, None where there is no end."""
        return self.scale[:2] if self.kind == "analogue" else (self.minimum, self.maximum)

    @property
    def grid(self) -> tuple[float, float]:
        """A number that answers it, and the distance between such numbers."""
        low, _, step = self.scale
        return (low, step) if self.form == "scale" else (0.0, 10.0 ** -(self.decimals or 0))

    def steps_within(self, low: float | None, high: float | None) -> tuple[float, float]:
        """Return the first and the last answer from `low` to `high`, in steps of the `grid`.

        If there is none, the first is above the last; where there is no end it is infinite.
        """
        start, step = self.grid
        lows, highs = (
            # Rounded, because steps such as 0.1 are not exact in binary.
            [round((end - start) / step, 6) for end in ends if end is not None]
            for ends in zip((low, high), self.ends, strict=True)
        )
        return ceil(max(lows)) if lows else -inf, floor(min(highs)) if highs else inf

    @property
    def places(self) -> int:
        """Number of steps from one end of the scale to the other."""
        low, high, step = self.scale
        return round((high - low) / step)

    @property
    def longest(self) -> int:
        """Most characters of an answer that is typed."""
        return (self.max_length or 60) if self.kind == "text" else 16

    def place(self, number: int) -> int | float:
        """Return a place on the scale, counted in steps from its lower end."""
        # In decimals, because steps of 0.1 add up to 0.30000000000000004 in binary.
        low, _, step = (Decimal(repr(each)) for each in self.scale)
        return plain_number(float(low + number * step))

    def reversed(self) -> "StudyQuestion":
        """Return the question with its answers in the opposite order."""
        return self.model_copy(update={"labels": self.labels[::-1]})

    @property
    def form(self) -> Form:
        """How it is asked."""
        return KINDS[self.kind].form

    @property
    def is_number(self) -> bool:
        return float in KINDS[self.kind].answers

    def answer(self, given: str) -> Answer:
        """Return what `given` means: a value, several with `;` between, a number or a text.

        If the question does not allow it, a ValueError says what it allows.
        """
        return KINDS[self.kind].read(self, given) if given or self.required else None

    def checked(self, given: str, allowed: bool, rule: str) -> str:
        """Return `given` if it is `allowed`, else raise a ValueError with the rule."""
        if not allowed:
            raise ValueError(f"the answer to {self.name} must {rule}, got {given!r}")
        return given


def answer_text(answer: Answer) -> str:
    if isinstance(answer, tuple | list):
        return ", ".join(answer)
    return "skipped" if answer is None else str(answer)


def plain_number(number: float) -> int | float:
    """Return a whole number as such.

    >>> plain_number(7.0), plain_number(0.5)
    (7, 0.5)
    """
    return int(number) if number.is_integer() else number


# The kinds of questions: what each asks for, which answers it allows, and how people may answer.


def _chosen(asked: StudyQuestion, given: str) -> str:
    return asked.checked(given, given in asked.values, f"be one of {', '.join(asked.values)}")


def _several(asked: StudyQuestion, given: str) -> tuple[str, ...]:
    chosen = set(given.split(BETWEEN))
    asked.checked(given, chosen <= set(asked.values), f"be some of {', '.join(asked.values)}")
    # In the order of the labels, so that the same choice is always the same answer.
    return tuple(value for value in asked.values if value in chosen)


def _on_scale(asked: StudyQuestion, given: str) -> int | float:
    low, high, step = asked.scale
    try:
        number = float(given)
    except ValueError:
        number = float("nan")
    whole = isfinite(number) and low <= number <= high
    # The answer is the scale's own number and not the one that came, which may be rounded.
    nearest = asked.place(round((number - low) / step)) if whole else None
    rule = f"lie on the scale from {low:.15g} to {high:.15g}"
    asked.checked(given, nearest is not None and abs(nearest - number) < step * 1e-6, rule)
    return plain_number(float(nearest or 0))


def _number(asked: StudyQuestion, given: str) -> int | float:
    low, high, decimals = asked.minimum, asked.maximum, asked.decimals or 0
    spoken = [f"a number with at most {decimals} decimals" if decimals else "a whole number"]
    spoken += [f"at least {low:.15g}"] if low is not None else []
    spoken += [f"at most {high:.15g}"] if high is not None else []
    # Many languages write a decimal comma, and a number has no other use for it here.
    plain = given.replace(",", ".")
    # A pattern and not `float` alone, which takes `1e9`, `nan` and digits of other scripts. 15
    # digits are what a float holds.
    form = rf"[+-]?\d{{1,15}}(\.\d{{0,{decimals}}})?" if decimals else r"[+-]?\d{1,15}"
    number = float(plain) if re.fullmatch(form, plain, re.ASCII) else float("nan")
    allowed = (-inf if low is None else low) <= number <= (inf if high is None else high)
    asked.checked(given, allowed, f"be {', '.join(spoken)}")
    return plain_number(number)


def _text(asked: StudyQuestion, given: str) -> str:
    rule = f"have 1 to {asked.longest} characters"
    return asked.checked(given, 0 < len(given) <= asked.longest, rule)


_CHOSEN = 0.4
"""How often one of several labels is chosen at random."""
_REMARKS = ("nothing", "quite smooth", "rough at first", "hard to tell")


def _any_of(asked: StudyQuestion, stream: Random) -> str:
    chosen = [value for value in asked.values if stream.random() < _CHOSEN]
    return BETWEEN.join(chosen or [stream.choice(asked.values)])


def _any_place(asked: StudyQuestion, stream: Random) -> str:
    # Most people avoid the ends of a scale.
    return str(asked.place(round(stream.betavariate(2, 2) * asked.places)))


def _any_number(asked: StudyQuestion, stream: Random) -> str:
    low, high, steps = asked.minimum, asked.maximum, 10 ** (asked.decimals or 0)
    if low is None:
        low = 20.0 if high is None else high - 50.0
    high = low + 50.0 if high is None else high
    # Rounded inwards, so that a number with these decimals cannot lie beyond an end.
    number = stream.uniform(ceil(low * steps) / steps, floor(high * steps) / steps)
    return f"{number:.{asked.decimals or 0}f}"


class KindOfQuestion(NamedTuple):
    """A kind of question.

    `keys` are those of the study file that it has beside those of all, `read` returns the answer
    that is given or raises a ValueError, and `drawn` a random but plausible one.
    """

    form: Form
    keys: Set[str]
    answers: tuple[type, ...]
    read: Callable[[StudyQuestion, str], Answer]
    drawn: Callable[[StudyQuestion, Random], str]


_NUMBERS = (int, float)
_SCALE = {"labels", "minimum", "maximum", "step", "ticks"}
_OF_NUMBERS = {"minimum", "maximum", "decimals", "unit"}
KINDS: Mapping[Kind, KindOfQuestion] = {
    "choice": KindOfQuestion(
        "labels", {"labels"}, (str,), _chosen, lambda asked, stream: stream.choice(asked.values)
    ),
    "several": KindOfQuestion("labels", {"labels"}, (tuple,), _several, _any_of),
    "scale": KindOfQuestion("scale", _SCALE, _NUMBERS, _on_scale, _any_place),
    "analogue": KindOfQuestion("scale", {"labels"}, _NUMBERS, _on_scale, _any_place),
    "number": KindOfQuestion("typed", _OF_NUMBERS, _NUMBERS, _number, _any_number),
    "text": KindOfQuestion(
        "typed",
        {"max_length"},
        (str,),
        _text,
        lambda asked, stream: stream.choice(_REMARKS)[: asked.longest].strip(),
    ),
}


class InstructionPage(Record):
    """A page to read, with a picture if wanted, until the participant goes on."""

    before: Literal["session", "practice", "block"] = setting("session", "what the page introduces")
    block: Count | None = setting(None, "number of the block, from 1; none: every block")
    text: dict[KnownCode, LongText] = Field(default_factory=dict)
    """the text, by the language's code; a line feed begins a new line"""
    picture: Filename | None = setting(None, "a PNG or JPEG file in the study's folder")


def _choice_of(name: str, values: Iterable[str]) -> StudyQuestion:
    labels = tuple(Label(value=value) for value in values)
    return StudyQuestion(name=name, kind="choice", labels=labels)


@cache
def change_question(question: Question) -> StudyQuestion:
    """Return a built-in question about the change; its texts are those of the language."""
    return _choice_of(question, ANSWERS[question])


@cache
def track_question(found: str, intervals: int) -> StudyQuestion:
    """Return the question of a track: which of its touches was it, or was the only one so.

    The texts are `question.which_smoother`, `question.is_smoother` and so on, `answer.first`,
    `answer.second`, `answer.third`, `answer.yes` and `answer.no` of the language.

    >>> track_question("different", 3).name, track_question("smoother", 2).values
    ('which_different', ('first', 'second'))
    """
    if intervals > 1:
        return _choice_of(f"which_{found}", INTERVALS[:intervals])
    return _choice_of(f"is_{found}", ("yes", "no"))


def score_question(rating: Rating, name: str = SCORE) -> StudyQuestion:
    """Return the question `SCORE` or `RATING`, on the scale of scores."""
    return StudyQuestion(
        name=name,
        kind="scale",
        minimum=rating.minimum,
        maximum=rating.maximum,
        ticks="labels" if rating.ticks == "bands" else rating.ticks,
        labels=rating.labels,
    )


_YES_NO = ("no", "yes")


def trial_facts(rating: Rating) -> Iterator[StudyQuestion]:
    """Yield what is known of every answered trial, as questions that others may depend on.

    Without a question about a change it is the score alone.
    """
    changes = dict.fromkeys(answer for answers in ANSWERS.values() for answer in answers)
    for name, values in (("change", changes), ("noticed", _YES_NO), ("agrees", _YES_NO)):
        yield _choice_of(name, values)
    yield score_question(rating)


def facts_of_trial(
    question: Question | None, change: str | None, expected: str | None, score: int | None
) -> dict[str, Answer]:
    """Return what the answer to a trial says, by the names of `trial_facts`."""
    if question is None or change is None:
        return {} if score is None else {SCORE: score}
    return {
        "change": change,
        "noticed": _YES_NO[change != QUESTIONS[question].same],
        "agrees": _YES_NO[change == expected],
        SCORE: score,
    }
