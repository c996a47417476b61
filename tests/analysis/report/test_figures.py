"""Figures of single trials: what is drawn of levels, people, touches and reaction times."""

from dataclasses import replace

import numpy as np

from analysis.estimates import NotEstimable
from analysis.report.figure_data import MOST_PEOPLE, levels, model_curve, people
from analysis.report.sections import predictions
from analysis.sensitivity.answers_model import Sensitivity
from analysis.statistics.summary import TableStatistics
from tests.analysis.reports import imported, plain_report, study_report, with_sensitivity


def test_conditions_with_several_levels_are_drawn_against_them() -> None:
    found = levels(study_report())
    several = {entry.name for entry in study_report().study.condition if len(entry.levels) > 1}
    assert {own.condition for own in found} == several
    for own in found:
        assert own.counts.sum() == len(own.score)
        for at, mean in zip(own.at, own.mean, strict=True):
            np.testing.assert_allclose(own.score[own.level == at].mean(), mean)
        assert own.expected is None or len(own.expected) == len(own.at)
    assert levels(plain_report()) == ()


def test_each_subject_has_a_panel_with_all_scores() -> None:
    found = people(study_report())
    scored = study_report().loaded.scored.dropna(subset=["score"])
    shown = sum(len(own) for scores in found.values() for own in scores)
    assert shown == len(scored)


def test_of_many_subjects_the_extreme_ones_are_drawn() -> None:
    scores = np.clip(np.arange(70)[:, None] * 0.1 + np.array([0.0, 1.0, 2.0]), 0, 10)
    scores[5] = [0, 10, 0]
    loaded = imported(scores)
    table = TableStatistics(table=loaded.table)
    found = people(replace(plain_report(), loaded=loaded, table=table))
    assert MOST_PEOPLE < len(scores) == 70
    assert {"P00", "P05", "P069"} <= found.keys()
    assert len(found) <= 8
    assert loaded.table.subjects[0] == "P00"


def test_the_caption_names_the_curve_if_it_is_drawn() -> None:
    whole = study_report()
    withheld = with_sensitivity(
        whole, Sensitivity(noticing=whole.sensitivity.noticing, rating=NotEstimable("withheld"))
    )
    for found, fitted in ((whole, True), (withheld, False)):
        figure = predictions.section(found).figures[0]
        assert ("The line is the group's in the model of the ratings" in figure.caption) == fitted
        assert figure.drawing is not None
        drawn = [b"group, model" in file for file in figure.drawing.files().values()]
        assert any(drawn) == fitted
        assert (model_curve(found) is not None) == fitted
