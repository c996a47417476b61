"""Designs of a study: how many participants, repeats and levels."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from itertools import product
from math import exp

import numpy as np
from pydantic import ValidationError

from protocol.errors import BadInput
from protocol.study.factor import Group
from protocol.study.rules import MOST_REPEATS
from protocol.study.rules import Design as DesignOfStudy
from protocol.study.study import Study
from protocol.study_file.limits import problems
from protocol.study_file.loading import parsed_study, schema_problems
from protocol.study_file.toml import in_toml

PAPERS_PARTICIPANTS = 9
MOST_PARTICIPANTS = 1_000


@dataclass(frozen=True, kw_only=True, order=True)
class Design:
    """Participants, repeats of a condition per session, and levels; 0 levels are the study's own.

    >>> str(Design(participants=20, repeats=4))
    '20 participants x 4 repeats'
    """

    participants: int
    repeats: int
    levels: int = 0

    def __str__(self) -> str:
        words = [f"{self.participants} participants", f"{self.repeats} repeats"]
        words += [f"{self.levels} levels"] * bool(self.levels)
        return " x ".join(words).replace(" 1 repeats", " 1 repeat").replace(" 1 levels", " 1 level")

    @property
    def key(self) -> str:
        """A name without spaces, under which its studies are drawn."""
        return "x".join(map(str, astuple(self)))


def designs(
    study: Study, participants: Sequence[int], repeats: Sequence[int], levels: Sequence[int]
) -> list[Design]:
    """Return every combination; where a list is empty, what the study says.

    A study that plans no number of participants has the paper's nine.
    """
    return [
        Design(participants=people, repeats=often, levels=steps)
        for people, often, steps in product(
            participants or [study.design.participants or PAPERS_PARTICIPANTS],
            repeats or [study.design.repeats],
            levels or [0],
        )
    ]


def designed(study: Study, design: Design) -> Study:
    """Return the study with that design; levels are spread evenly up to the whole amplitude.

    Raises:
        BadInput: the study cannot be run so; the message gives the first problem.
    """
    people, refused = design.participants, f"{design} cannot be planned"
    # Every test compares people, and one has nobody to be compared with.
    if not 2 <= people <= MOST_PARTICIPANTS:
        rule = f"participants must lie in [2, {MOST_PARTICIPANTS}], got {people}"
        raise BadInput(f"{rule}; give other numbers with --participants")
    if design.repeats > MOST_REPEATS:
        rule = f"repeats must be at most {MOST_REPEATS}; give fewer with --repeats"
        raise BadInput(f"{refused}: {rule}")
    if design.levels > design.repeats:
        rule = "levels must be at most repeats, so that each comes equally often"
        raise BadInput(f"{refused}: {rule}; give fewer with --levels, or more with --repeats")
    levels = {"levels": tuple(step / design.levels for step in range(1, design.levels + 1))}
    conditions = (
        condition.model_copy(update=levels if design.levels else {})
        for condition in study.condition
    )
    # Validated anew, because `model_copy` checks nothing.
    keys = study.design.model_dump() | {"participants": people, "repeats": design.repeats}
    try:
        section = DesignOfStudy.model_validate(keys)
    except ValidationError as error:
        problem = schema_problems(keys, error)[0].located("study.toml")
        raise BadInput(f"{refused}: {problem}") from error
    groups = _resized(study.group, people)
    changed = {"design": section, "condition": tuple(conditions), "group": groups}
    resized = study.model_copy(update=changed)
    if wrong := problems(resized):
        raise BadInput(f"{refused}: {wrong[0].located('study.toml')}")
    return resized


def _resized(groups: Sequence[Group], participants: int) -> tuple[Group, ...]:
    """Return groups that have so many participants together, in proportion to their sizes.

    Raises:
        BadInput: a group would have nobody.
    """
    if not groups:
        return ()
    ends = np.cumsum([group.size for group in groups])
    shares = [round(participants * end / ends[-1]) for end in ends.tolist()]
    sizes = np.diff([0, *shares]).tolist()
    if 0 in sizes:
        rule = f"{participants} participants are too few for the study's {len(groups)} groups"
        raise BadInput(f"{rule}; give more with --participants")
    pairs = zip(groups, sizes, strict=True)
    return tuple(group.model_copy(update={"size": size}) for group, size in pairs)


_MIDDLE = 0.4
"""The friction of a condition in the middle of the contrasts, which changes no slope."""


def simulated(text: str, *, answered: bool = False) -> Study:
    """Return the study that is simulated: that of the text or, of imported scores, one like theirs.

    Conditions, contrasts, factors, groups, sessions and the scale are those of the scores. What is
    felt is scored at once; if the scores were `answered`, a change is, and asked about before. A
    touch has the friction that follows from the contrast that the author predicts; without
    contrasts none is known.

    Raises:
        BadInput: some conditions alone have a contrast, or contrasts are too far apart.
    """
    study = parsed_study(text)
    if not study.imported:
        return study
    known = [each.contrast for each in study.condition if each.contrast is not None]
    if known and len(known) < len(study.condition):
        raise BadInput("a power analysis needs a contrast of each condition, or of none")
    middle = 0.0 if answered else sum(known) / max(len(known), 1)
    if any(abs(each - middle) > 3 for each in known):
        raise BadInput("a power analysis needs contrasts at most 3 from " + _FROM[answered])
    like = parsed_study(_like(study, middle, answered=answered))
    conditions = (
        condition.model_copy(update={"factors": own.factors})
        for condition, own in zip(like.condition, study.condition, strict=True)
    )
    return like.model_copy(update={"condition": tuple(conditions)})


_FROM = {False: "their mean", True: "0"}


def _like(study: Study, middle: float, *, answered: bool) -> str:
    """Return the text of a study like that of imported scores, but for its factors."""
    design, rating = study.design, study.rating
    lines = [
        *("[study]", f"name = {in_toml(study.study.name)}", f"seed = {study.study.seed}"),
        *("[session]", 'languages = ["en"]', "[surface]", 'kind = "given"', "length_m = 0.1"),
        *("[touch]", "path_m = [0.01, 0.08]", "smooth_place_m = 0.04"),
        *("[design]", f"sessions = {design.sessions}", f"repeats = {design.repeats}"),
        *([] if study.group else [f"participants = {design.participants or 9}"]),
        *("[rating]", f"minimum = {rating.minimum}", f"maximum = {rating.maximum}"),
        *([f'score_when = "{rating.score_when}"'] if answered else []),
    ]
    for group in study.group:
        lines += ["[[group]]", f"name = {in_toml(group.name)}", f"size = {group.size}"]
    for condition in study.condition:
        lines += ["[[condition]]", f"name = {in_toml(condition.name)}"]
        # A change is positive where friction falls, what is felt at once where it is higher.
        lines += ['question = "roughness"', 'expected = "smoother"'] if answered else []
        change = None if condition.contrast is None else condition.contrast - middle
        ends = (0.5, -0.5) if answered else (1.0,)
        touches = ", ".join(_touch(None if change is None else end * change) for end in ends)
        lines += [f"touches = [{touches}]"]
    return "\n".join(lines) + "\n"


def _touch(log_friction: float | None) -> str:
    """Return a touch whose friction is so far from the middle."""
    stated = "" if log_friction is None else f", friction = {_MIDDLE * exp(log_friction)!r}"
    return f'{{ place = "smooth", voltage_v = 0{stated} }}'
