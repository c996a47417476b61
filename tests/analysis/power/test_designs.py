"""Designs of a study, and those that it cannot have."""

import numpy as np
import pytest

from analysis.power.designs import Design, designed, designs, simulated
from analysis.power.study_records import asked_by
from device.friction.calibration import Calibration
from device.friction.surfaces import GivenSurface
from protocol.errors import BadInput
from protocol.study.factor import Group
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template


@pytest.fixture
def paper() -> Study:
    return parsed_study(template("paper"))


def test_every_combination_is_a_design(paper: Study) -> None:
    found = designs(paper, [9, 12], [1, 2], [])
    assert [(one.participants, one.repeats, one.levels) for one in found] == [
        (9, 1, 0),
        (9, 2, 0),
        (12, 1, 0),
        (12, 2, 0),
    ]


def test_without_options_it_is_the_study_s_own(paper: Study) -> None:
    own = paper.design.participants or 9
    assert designs(paper, [], [], []) == [Design(participants=own, repeats=1)]


def test_levels_are_spread_evenly_up_to_the_whole_amplitude(paper: Study) -> None:
    made = designed(paper, Design(participants=9, repeats=4, levels=2))
    assert {condition.levels for condition in made.condition} == {(0.5, 1.0)}
    assert (made.design.repeats, made.design.participants) == (4, 9)


def test_groups_keep_their_proportion(paper: Study) -> None:
    groups = tuple(Group(name=name, size=size) for name, size in (("young", 10), ("old", 5)))
    study = paper.model_copy(update={"group": groups})
    sizes = [
        [group.size for group in designed(study, Design(participants=people, repeats=1)).group]
        for people in (15, 30, 8)
    ]
    assert sizes == [[10, 5], [20, 10], [5, 3]]
    uneven = tuple(Group(name=name, size=size) for name, size in (("young", 99), ("old", 1)))
    with pytest.raises(BadInput, match="2 participants are too few for the study's 2 groups"):
        designed(paper.model_copy(update={"group": uneven}), Design(participants=2, repeats=1))


@pytest.mark.parametrize(
    ("design", "message"),
    [
        (Design(participants=1, repeats=1), r"participants must lie in \[2, 1000\], got 1"),
        (Design(participants=9, repeats=30), "9 participants x 30 repeats cannot be planned"),
        (Design(participants=9, repeats=3, levels=2), "must divide design.repeats = 3"),
        (Design(participants=9, repeats=1, levels=10**12), "levels must be at most repeats"),
    ],
)
def test_what_the_study_cannot_have_is_refused(paper: Study, design: Design, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        designed(paper, design)


def test_the_rule_between_two_numbers_is_told_in_words(paper: Study) -> None:
    opposite = paper.design.model_copy(update={"opposite_repeats": 2, "repeats": 3})
    study = paper.model_copy(update={"design": opposite})
    rule = "planned: study.toml: opposite_repeats: must be less than repeats = 1, got 2"
    with pytest.raises(BadInput, match=rule):
        designed(study, Design(participants=9, repeats=1))


IMPORTED = """
[study]
name = "table"
[session]
languages = ["en"]
[design]
sessions = 2
[rating]
minimum = 1
maximum = 7
score_when = "always"
[[group]]
name = "young"
size = 4
[[group]]
name = "old"
size = 4
[[condition]]
name = "rough, slow"
contrast = 0.5
factors = { material = "rough", speed = "slow" }
[[condition]]
name = "rough, fast"
contrast = 0.4
factors = { material = "rough", speed = "fast" }
[[condition]]
name = "fine, slow"
contrast = -0.1
factors = { material = "fine", speed = "slow" }
[[condition]]
name = "fine, fast"
contrast = 0.2
factors = { material = "fine", speed = "fast" }
"""


@pytest.mark.parametrize("answered", [False, True])
def test_a_study_of_imported_scores_is_simulated_as_it_was_asked(answered: bool) -> None:
    study = simulated(IMPORTED, answered=answered)
    asks = asked_by(study, Calibration.of(GivenSurface(length_m=0.1)))
    assert asks.groups == ("young", "old")
    assert asks.factors == {
        "material": ("rough", "fine"),
        "speed": ("slow", "fast"),
        "session": ("1", "2"),
    }
    apart = np.subtract(asks.contrasts, asks.contrasts[0])
    np.testing.assert_allclose(apart, [0, -0.1, -0.6, -0.3], atol=1e-12)
    assert study.absolute is not answered
    if answered:
        assert asks.contrasts[0] == pytest.approx(0.5)
        assert study.rating.score_when == "always"
    assert designed(study, Design(participants=6, repeats=2)).factors == study.factors


def test_contrasts_of_imported_scores_are_known_of_all_and_of_a_size_that_can_be_felt() -> None:
    with pytest.raises(BadInput, match="a contrast of each condition, or of none"):
        simulated(IMPORTED.replace("contrast = 0.4\n", ""))
    with pytest.raises(BadInput, match="at most 3 from 0"):
        simulated(IMPORTED.replace("contrast = 0.4", "contrast = 4"), answered=True)
