"""Null cohorts: what is true and false of their people."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.power.null_cohorts import (
    DIFFERING,
    KINDS,
    NOTICING,
    NUMB,
    SHUFFLED,
    kind_named,
    nature,
    null_tables,
    without_effect,
)
from analysis.power.people_cohorts import PeopleCohorts
from analysis.power.power_summary import claims, share
from analysis.power.study_records import GROUP_SCORE, Records, asked_by, record_of_tables
from analysis.simulation import responses
from device.people.person import DEFAULT, Population
from protocol.registration.registration import FOLLOWS, OMNIBUS
from protocol.study.factor import Group
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template

PAPER = parsed_study(template("paper"))
# Old people score 3 points lower, and feel more.
OLD = replace(
    DEFAULT,
    typical=replace(DEFAULT.typical, skin=2.0, bias=4.0),
    varied={name: how for name, how in DEFAULT.varied.items() if name not in {"skin", "bias"}},
)
APART = replace(DEFAULT, groups={"old": OLD})


def grouped(study: Study, size: int) -> Study:
    groups = tuple(Group(name=name, size=size) for name in ("young", "old"))
    return study.model_copy(update={"group": groups})


def test_people_keep_what_a_kind_does_not_take() -> None:
    assert SHUFFLED.population(APART) == APART
    assert [kind_named(kind.name) for kind in KINDS] == [*KINDS]
    for kind in (DIFFERING, NOTICING):
        people = kind.population(APART)
        old, given = people.groups["old"], set(kind.typical)
        assert old.typical.bias == 4.0
        for made, usual in ((people, APART), (old, OLD)):
            assert all(getattr(made.typical, name) == kind.typical[name] for name in given)
            assert made.varied.keys() == usual.varied.keys() - given
    assert NOTICING.population(APART).groups["old"].typical.skin == 2.0
    assert DIFFERING.typical.items() > NUMB.items()


@pytest.mark.parametrize("high", [10, 100])
def test_conditions_of_their_own_nature_are_scored_higher_by_it(high: int) -> None:
    rating = PAPER.rating.model_copy(update={"maximum": high, "bands": ()})
    study = PAPER.model_copy(update={"rating": rating})
    sure = {**NUMB, "criterion": -10.0, "bias": 5.0, "number_step": 1.0, "end_aversion": 0.0}
    people = Population(typical=replace(DEFAULT.typical, **sure))
    cohorts = PeopleCohorts(study=study, participants=500, population=people)
    kind = replace(DIFFERING, typical=sure, spread=0.5)
    (table,) = null_tables(kind, cohorts, ["a"]).responses
    wanted = (5.0 + nature("a", 0.5, 5)) * high / 10 + 1
    # Rounding at random adds half a whole score, and takes it off.
    np.testing.assert_allclose(table.mean(axis=0), wanted, atol=0.25 * high / 10)
    spread = nature("b", 2.0, 5)
    assert (spread == nature("b", 2.0, 5)).all()
    assert (spread != nature("a", 2.0, 5)).any()


def test_noticing_by_contrast_makes_responses_follow_and_scores_equal() -> None:
    people = NOTICING.population(DEFAULT)
    cohorts = PeopleCohorts(study=PAPER, participants=400, population=people)
    _, everybody = cohorts.simulation.studies(400, "a")
    answered = responses(cohorts.simulation.planned, everybody)
    kinds = [kind.trial.condition for kind in cohorts.simulation.planned.kinds]
    of = np.array([name or "" for name in kinds])[everybody.kinds]
    weak, strong = (answered[of == name] for name in ("pressure", "voltage"))
    assert (strong > 0).mean() > (weak > 0).mean() + 0.1
    assert not people.typical.gain


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_few_reports_claim_what_is_false_of_groups_that_are_unlike(kind: object) -> None:
    kind = next(one for one in KINDS if one is kind)
    study, asked = grouped(PAPER, 8), asked_by(grouped(PAPER, 8))
    keys = [f"{kind.name}/{number}" for number in range(90)]
    cohorts = PeopleCohorts(study=study, participants=16, population=kind.population(APART))
    tables = null_tables(kind, cohorts, keys)
    assert (np.sort(tables.groups) == np.repeat([0, 1], 8)).all()
    records = [record_of_tables(asked, *table) for table in zip(*tables, strict=True)]
    made = claims(asked, Records.of(asked, records).p)
    false = [of for name, of in made.items() if kind.is_false(asked, name)]
    assert made[GROUP_SCORE].mean() < 0.1
    anything = share(np.logical_or.reduce(false))
    assert anything.value <= 0.05 + 2 * anything.error
    assert kind.is_false(asked, GROUP_SCORE)
    assert kind.is_false(asked, OMNIBUS) == (kind is SHUFFLED)
    assert kind.is_false(asked, FOLLOWS) == (kind is not NOTICING)
    if kind is not SHUFFLED:
        assert made[OMNIBUS].mean() > 0.3, "what is true is found"


def test_without_effect_each_subject_keeps_responses_and_reports() -> None:
    study = parsed_study(template("extended"))
    design = study.design.model_copy(update={"sessions": 2})
    rating = study.rating.model_copy(update={"score_when": "always"})
    study = grouped(study, 3).model_copy(update={"design": design, "rating": rating})
    made = PeopleCohorts(study=study, participants=6).simulation.studies(6, "1", "2")[0]
    made.responses[0, 2, 3] = made.by_session[0, 2, 3] = np.nan
    drawn = without_effect(made, map(np.random.default_rng, (1, 2)))
    np.testing.assert_array_equal(np.sort(drawn.responses, axis=2), np.sort(made.responses, axis=2))
    assert not np.array_equal(drawn.responses, made.responses, equal_nan=True)
    # The responses of a condition's sessions go together, and may change places.
    np.testing.assert_allclose(drawn.by_session.mean(axis=3), drawn.responses, rtol=1e-12)
    assert (drawn.by_session != made.by_session).any()
    assert (np.sort(drawn.groups) == [0, 0, 0, 1, 1, 1]).all()
    assert (drawn.groups != made.groups).any()
    np.testing.assert_array_equal(drawn.noticed[..., 1], made.noticed[..., 1])
    reports = [each.noticed[..., 0].sum(axis=2) for each in (drawn, made)]
    np.testing.assert_array_equal(*reports)
    assert (drawn.noticed[..., 0] <= drawn.noticed[..., 1]).all()
    assert (drawn.noticed != made.noticed).any()
