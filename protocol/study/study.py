"""The study as data: the records that a study file is made of.

Every record is frozen and refuses unknown keys. Quantities are in SI units; a voltage is an
amplitude (peak), a frequency is relative to the resonance that the rig measures.
"""

from collections.abc import Iterator, Mapping
from hashlib import sha256
from itertools import chain, count, product
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BeforeValidator,
    Field,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticKnownError

from protocol.errors import shown
from protocol.study import rules
from protocol.study.factor import CONDITION, MOST_CONDITIONS, Factor, Group, cells, combinations
from protocol.study.fields import Line, Name, NotNegative, Positive, Record, Whole, setting
from protocol.study.languages import Code, KnownCode, Language
from protocol.study.rig_settings import ForceChannel, Rig
from protocol.study.study_question import (
    ANSWERS,
    Filename,
    InstructionPage,
    Question,
    StudyQuestion,
    When,
)
from protocol.study.surface import Surface, TableName
from protocol.study.touch import Slide, Touch, TouchDefaults
from protocol.study.track import Track

Level = Annotated[Positive, Field(ge=0.001, le=200)]
"""Of an amplitude: 200 makes 1 V the largest there is, and a thousandth drives nothing."""
Contrast = Annotated[float, Field(ge=-10, le=10, allow_inf_nan=False, strict=True)]
"""A change of the logarithm of friction: at 10 friction is 20,000 times as large."""
Spacing = Annotated[NotNegative, Field(le=0.05)]
"""Of ciliary bodies, m: at more than 50 mm there are not two under a finger."""


def _pairs(given: Any) -> Any:
    # A condition is a key of caches, which a mapping cannot be.
    return tuple(given.items()) if isinstance(given, Mapping) else given


CellOf = Annotated[tuple[tuple[Name, Name], ...], BeforeValidator(_pairs)]
"""A table of values by the name of their factor, as pairs."""
MOST_IMPORTED = 100
"""Conditions of imported scores."""


class Item(Record):
    """Something to touch and, unless `question` is missing, to answer."""

    question: Question | None = setting(None, "what is asked after the last touch")
    expected: str | None = setting(None, "the answer that agrees with the expectation")
    touches: tuple[Touch, ...] = Field(min_length=1, max_length=12)
    """the touches in their order; a table each, see below"""

    @model_validator(mode="after")
    def _expected_fits_question(self) -> Self:
        if self.question is None:
            if self.expected is not None:
                raise ValueError(
                    f"expected must be left out without a question, got {shown(self.expected)}"
                )
            return self
        allowed = ANSWERS[self.question]
        if self.expected not in allowed:
            raise ValueError(
                f"expected must be one of {', '.join(map(str, allowed))} "
                f"for the question {self.question}, got {shown(self.expected)}"
            )
        return self


class Opening(Item):
    """A trial that every session begins with; it is not scored."""

    kind: Literal["baseline", "signal"]
    """without a signal (0 V), or with the first one"""


class Condition(Item):
    """A parameter that changes and is scored: its effect or, without a question, what is felt."""

    _cell: dict[str, str] = PrivateAttr(default_factory=dict)
    _written: int = PrivateAttr(0)
    _given_twice: tuple[tuple[int, str], ...] = PrivateAttr(())

    @property
    def given_twice(self) -> tuple[tuple[int, str], ...]:
        """Numbers of touches, and the keys that they give although a factor sets them."""
        return self._given_twice

    @property
    def cell(self) -> dict[str, str]:
        """What each factor has here, by the factor's name; empty without factors."""
        return self._cell or dict(self.factors)

    @property
    def written(self) -> int:
        """Which condition of the file became this one, from 0."""
        return self._written

    name: Annotated[Name, Field(description="name in tables and reports")]
    touches: tuple[Touch, ...] = Field((), max_length=12, validate_default=True)
    """the touches in their order; a table each, see below; none in a study of imported scores"""
    question: Question | None = None
    """what is asked after the last touch; without it what was felt is scored at once, also in catch
    trials"""
    expected: str | None = setting(None, "the answer that agrees with the expectation")
    levels: tuple[Level, ...] = setting((1.0,), min_length=1, max_length=20)
    """the repeats take these levels in random order; a level multiplies every amplitude of its
    trial, so that predicted contrasts are spread"""
    contrast: Contrast | None = None
    """of imported scores: the change of the logarithm of friction that their author predicts"""
    factors: CellOf = setting((), max_length=6)
    """of imported scores: a table with the value of each factor here; conditions cross all of
    them"""

    @field_validator("touches")
    @classmethod
    def _given_with_question(cls, touches: tuple[Touch, ...], info: ValidationInfo) -> Any:
        if not touches and info.data.get("question") is not None:
            raise PydanticKnownError("missing")  # as of any key that must be given
        return touches

    @model_validator(mode="after")
    def _imported_alone(self) -> Self:
        for key in ("contrast", "factors"):
            if self.touches and getattr(self, key):
                raise ValueError(
                    f"{key} must be left out of a condition with touches, got "
                    f"{shown(getattr(self, key))}"
                )
        return self


PAPERS_CONDITIONS = {
    "frequency": ("strength", "stronger"),
    "structure": ("strength", "stronger"),
    "voltage": ("roughness", "smoother"),
    "direction": ("places", "swapped"),
    "pressure": ("roughness", "smoother"),
}
"""The paper's conditions (section 5.2): what is asked of each, and the expected answer."""


class Header(Record):
    """Which study this is."""

    schema_version: Literal[1] = setting(1, "version of this file's format", alias="schema")
    name: Annotated[Name, Field(description="name of the study")]
    seed: Whole = setting(1, "decides every random choice of the design")


class Study(Record):
    """A whole study, as `study.toml` gives it."""

    study: Annotated[Header, Field(description="Which study this is.")]
    # Records are frozen, so that a default can be one record that all studies share.
    rig: Rig = setting(Rig(), "The device, and limits that no trial may exceed.")
    surface: Surface = setting(Surface(), "What is touched, and where its friction comes from.")
    force_channel: ForceChannel = ForceChannel()
    """Forces and position, recorded at a high rate during each touch."""
    touch: TouchDefaults = TouchDefaults()
    """How the finger touches unless a trial says otherwise."""
    beams: dict[Name, Spacing] = Field(default_factory=dict)
    """Beams by name, each with the spacing of its ciliary bodies in m, at most 0.05; 0 means
    none."""
    slide: Slide = Slide()
    """The sliding experiment (paper, section 5.1), which `touchbeam slide` runs without a
    participant."""
    design: rules.Design = setting(rules.Design(), "Which trials there are, and their order.")
    timing: rules.Timing = rules.Timing()
    """Pauses, and assumptions about how long people take."""
    rating: rules.Rating = setting(rules.Rating(), "When and how the effect is scored.")
    session: rules.SessionRules = rules.SessionRules()
    """How a session is conducted and resumed."""
    as_instructed: rules.TouchRules = rules.TouchRules()
    """When a touch was made as instructed, and what follows if it was not. A rig without sensors of
    force and position judges no touch."""
    exclusions: rules.Exclusions = rules.Exclusions()
    """Rules, decided before the data, on who and what is left out."""
    publication: rules.Publication = rules.Publication()
    """Facts for exported data that only the author knows."""
    # Any name will do for a key, because a touch may name one as its instruction. What is neither
    # that nor built in is refused by `text_checks`.
    texts: dict[KnownCode, dict[Name, Annotated[str, Field(min_length=1)]]] = Field(
        default_factory=dict, description="Texts that replace the built-in ones, per language."
    )
    languages: dict[Code, Language] = Field(default_factory=dict)
    """Languages of the study's own, before the built-in ones: each a file `texts/CODE.toml` beside
    the study file."""
    question: tuple[StudyQuestion, ...] = setting((), max_length=40)
    """Questions of the study's own, in the order of asking."""
    page: tuple[InstructionPage, ...] = setting((), "Pages to read, in their order.", max_length=40)
    pictures: dict[Filename, Line] = Field(default_factory=dict)
    """Digests of the pictures (SHA-256), by name: `touchbeam` reads the files and adds them to the
    study, so that a changed picture is a changed study."""
    tables: dict[TableName, Line] = Field(default_factory=dict)
    """Digests of tables of friction (SHA-256), by name, likewise."""
    opening: tuple[Opening, ...] = setting((), "Trials that begin every session, not scored.")
    group: tuple[Group, ...] = setting((), max_length=12)
    """Groups of participants, between whom results are compared."""
    factor: tuple[Factor, ...] = setting((), max_length=6)
    """What varies, and is crossed into conditions."""
    condition: tuple[Condition, ...] = setting((), max_length=MOST_IMPORTED)
    """What is changed, and scored; a study has conditions, tracks or both."""
    track: tuple[Track, ...] = setting((), max_length=20)
    """Thresholds: questions asked again and again, at levels chosen."""

    @field_validator("condition")
    @classmethod
    def _touched_or_imported(cls, given: tuple[Condition, ...], info: ValidationInfo) -> Any:
        """Refuse too many conditions of sessions, and some without touches where others have any.

        Nothing is touched in a study that describes imported scores.
        """
        without = [number for number, each in enumerate(given) if not each.touches]
        parts = ("factor", "opening")
        if not without:
            if len(given) > MOST_CONDITIONS:
                told = {"field_type": "Tuple", "max_length": MOST_CONDITIONS}
                raise PydanticKnownError("too_long", {**told, "actual_length": len(given)})
        elif len(without) < len(given) or any(info.data.get(part) for part in parts):
            error: Any = {"type": "missing", "loc": (without[0], "touches"), "input": None}
            raise ValidationError.from_exception_data("condition", [error])
        return given

    @field_validator("track")
    @classmethod
    def _touched_with_tracks(cls, track: tuple[Track, ...], info: ValidationInfo) -> Any:
        if track and any(not each.touches for each in info.data.get("condition", ())):
            raise ValueError("must be left out where conditions have no touches")
        return track

    @model_validator(mode="after")
    def _worked_out(self) -> Self:
        """Cross conditions with factors, and give drives in Hz relative to the nominal resonance.

        All that reads a study then finds each condition as it is run. A cohort is as large as its
        groups.
        """
        if self.group and self.design.participants is None:
            size = {"participants": sum(group.size for group in self.group)}
            object.__setattr__(self, "design", self.design.model_copy(update=size))
        hz = self.rig.nominal_resonance_hz
        crossed = chain.from_iterable(map(self._crossed, count(), self.condition))
        for key, items in (("condition", crossed), ("opening", self.opening)):
            at_resonance = (
                item.model_copy(update={"touches": tuple(it.at(hz) for it in item.touches)})
                for item in items
            )
            # A frozen record sets its own fields in this way alone.
            object.__setattr__(self, key, tuple(at_resonance))
        return self

    def _crossed(self, number: int, condition: Condition) -> Iterator[Condition]:
        # What is crossed already stays; of too many conditions `study_file.limits` tells.
        if not condition.cell:
            condition._written = number
        many = combinations(self.factor) * len(self.condition)
        if not self.factor or condition.cell or many > MOST_CONDITIONS:
            yield condition
            return
        several, given = len(self.condition) > 1, condition.touches
        twice = [(at, each.varies) for each in self.factor for at in each.given_twice(given)]
        for places, named in cells(self.factor):
            name = ", ".join([condition.name] * several + [*named])
            touches = condition.touches
            for factor, place in zip(self.factor, places, strict=True):
                touches = factor.set_in(touches, factor.values[place])
            own = condition.model_copy(update={"name": name, "touches": touches})
            own._written, own._given_twice = number, tuple(twice)
            own._cell = {CONDITION: condition.name} if several else {}
            own._cell |= dict(zip((factor.name for factor in self.factor), named, strict=True))
            yield own

    @property
    def factors(self) -> dict[str, tuple[str, ...]]:
        """What the values of each factor are called; the conditions of the file may be one."""
        if any(each.factors for each in self.condition):
            return self._imported_factors
        own = {factor.name: factor.named for factor in self.factor}
        written = dict.fromkeys(each.cell.get(CONDITION, "") for each in self.condition)
        return {CONDITION: tuple(written), **own} if len(written) > 1 else own

    @property
    def _imported_factors(self) -> dict[str, tuple[str, ...]]:
        """Factors whose values are all crossed, the last one fastest; else none."""
        cells = [each.cell for each in self.condition]
        named = {name: tuple(dict.fromkeys(it.get(name, "") for it in cells)) for name in cells[0]}
        crossed = [dict(zip(named, values, strict=True)) for values in product(*named.values())]
        return named if named and crossed == cells else {}

    @property
    def imported(self) -> bool:
        """Whether it describes imported scores: nothing was touched, and it cannot be run."""
        return bool(self.condition) and not any(each.touches for each in self.condition)

    @property
    def conditions(self) -> tuple[str, ...]:
        """Names of the conditions in the order of the file."""
        return tuple(condition.name for condition in self.condition)

    @property
    def is_papers(self) -> bool:
        """Whether its table of scores is the paper's Table 4: of its conditions, on its scale.

        Touches, levels, repeats and orders may be others.
        """
        asked = {item.name: (item.question, item.expected) for item in self.condition}
        papers, own = rules.PAPERS_SCALE, self.rating
        same_scale = (own.minimum, own.maximum) == (papers.minimum, papers.maximum)
        return asked == PAPERS_CONDITIONS and same_scale

    @property
    def absolute(self) -> bool:
        """Whether what is felt is scored at once: no condition asks what changed."""
        return bool(self.condition) and all(each.question is None for each in self.condition)

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the groups in the order of the file; none in a study without groups."""
        return tuple(group.name for group in self.group)

    def track_of(self, name: str) -> Track:
        return {track.name: track for track in self.track}[name]

    def of_group(self, name: str | None) -> Self:
        """Return the study as one group runs it: with random streams of its own.

        Without a group it is this study itself.
        """
        if name not in self.groups:
            return self
        # The digest of the seed and the name, so that no two groups share a stream.
        seed = int(sha256(f"{self.study.seed}/group/{name}".encode()).hexdigest(), 16)
        return self.model_copy(update={"study": self.study.model_copy(update={"seed": seed})})

    def questions(self, when: When, session: int = 1) -> tuple[StudyQuestion, ...]:
        """Return the study's own questions of a time in a participant's session, from 1."""
        return tuple(
            question
            for question in self.question
            if question.when == when and (question.sessions == "every" or session == 1)
        )

    def pages(self, before: str, block: int = 0) -> tuple[int, ...]:
        """Return the numbers of the pages to read before the session, practice or a block."""
        return tuple(
            number
            for number, page in enumerate(self.page)
            if page.before == before and page.block in {None, block}
        )

    def questions_after(self, condition: str | None) -> tuple[StudyQuestion, ...]:
        """Return the study's own questions after a trial of `condition`; None for an opening."""
        return tuple(
            question
            for question in self.questions("trial")
            # A question that names no conditions is asked after all of them, but not after an
            # opening.
            if condition in (question.conditions or self.conditions)
        )
