"""The report on a study that scores what is felt at once: 1 to 7, no question, no expectation."""

import re
from dataclasses import replace

import numpy as np
import pytest

from analysis.estimates import Estimate, NotEstimable
from analysis.loading.study_data import load_study_data
from analysis.report.hypotheses import how_tested, registered
from analysis.report.report import Report, report, report_files, report_html, report_json
from analysis.report.results import paragraphs
from analysis.trials.contrasts import trial_contrasts
from device.friction.calibration import Calibration
from device.friction.changes import LAW, predicted_contrast, trial_change
from device.friction.surfaces import GivenSurface
from protocol.registration.registration import FOLLOWS, ORDER
from tests.analysis.rated import RATED, rated_cohort, rated_data, rated_report, rated_study
from tests.analysis.reports import ORIGIN, ReadPage

PAPERS = r"0 to 10\b|very effective|Table 4|comprehensive"


def of_gain(gain: float) -> Report:
    chains = rated_cohort(gain=gain, rest=4.0 + gain / 2)
    found = load_study_data(chains, rehearsals=False, rules=RATED.exclusions)
    return report("How rough", found, RATED, ORIGIN)


def words(found: Report) -> str:
    return re.sub(r"\s+", " ", " ".join(ReadPage(report_html(found)).words))


def test_the_contrast_of_a_trial_is_that_of_its_last_touch_with_itself_at_rest() -> None:
    data = rated_data()
    contrasts = trial_contrasts(RATED, data.trials, data.touches).by_law[LAW]
    catch = data.trials["trial_kind"].eq("catch").to_numpy()
    assert not contrasts[catch].any()
    for condition in RATED.condition:
        own = data.trials["condition"].eq(condition.name).to_numpy() & ~catch
        planned = predicted_contrast(trial_change(RATED, None, None, condition.touches))
        assert planned < 0
        assert contrasts[own] == pytest.approx(planned)


def test_a_response_is_the_score_and_catch_trials_are_a_column_beside_the_means() -> None:
    found, data = rated_report(), rated_data()
    assert found.measure == "score"
    numbers = report_json(found)
    for trial in numbers["trials"]:
        assert trial["response"] == (trial["score"] if trial["kind"] == "trial" else None)
        assert trial["score"] is not None
    catch = data.trials[data.trials["trial_kind"].eq("catch")]
    means = catch.groupby("participant")["score"].mean()
    assert numbers["table4"]["catch"]["scores"] == pytest.approx(means.to_dict())
    assert numbers["table4"]["catch"]["mean"] == pytest.approx(means.mean())
    first = numbers["table4"]["rows"][0]
    assert first["comprehensive"] == pytest.approx(np.mean(first["scores"]))
    files = report_files(found, figures=False)
    header, line, *_ = files["table4.csv"].decode().splitlines()
    assert header == "subject,20 V,60 V,100 V,160 V,mean,catch trials"
    assert line.endswith(f",{first['comprehensive']:.2f},{means.iloc[0]:.2f}")
    assert "Mean and average are of the conditions, without catch trials" in (
        files["table4.tex"].decode()
    )


def test_nothing_is_noticed_expected_or_withheld() -> None:
    numbers = report_json(rated_report())
    assert "detection" not in numbers
    assert numbers["directions"] == []
    assert numbers["questions_p_holm"].keys() == {"conditions differ", FOLLOWS}
    page = words(rated_report())
    for word in ("as expected", "noticed", "d′", "selection", "response", "the other way"):
        assert word not in page, word


def test_nobody_reads_the_papers_words() -> None:
    files = report_files(rated_report(), figures=False)
    del files["report.json"]  # its keys are others' to read
    for name, content in files.items():
        assert not re.search(PAPERS, content.decode()), name
    assert "1 to 7 (1-3: smooth; 4-7: rough)" in files["table4.tex"].decode()


@pytest.mark.parametrize(("gain", "way"), [(4.0, "higher"), (-4.0, "lower")])
def test_scores_may_follow_friction_either_way(gain: float, way: str) -> None:
    found = of_gain(gain)
    told = dict(paragraphs(found))["Do responses follow the predicted change of friction?"]
    assert f"they are {way} where friction is predicted to be higher" in told
    follows, order = registered(RATED, [FOLLOWS, ORDER])
    judged = follows.judge(found)
    assert not isinstance(judged, NotEstimable)
    assert judged[2] is True
    assert "above 0" not in follows.test + order.test
    rating = found.sensitivity.rating
    assert not isinstance(rating, NotEstimable)
    assert rating.selection is None
    assert isinstance(rating.gain, Estimate)
    assert np.sign(rating.gain.interval) == pytest.approx([np.sign(gain)] * 2)


def test_gain_0_is_no_finding() -> None:
    found = of_gain(0.0)
    assert not found.questions.holds(FOLLOWS)
    rating = found.sensitivity.rating
    assert not isinstance(rating, NotEstimable)
    assert isinstance(rating.gain, Estimate)
    assert rating.gain.interval[0] < 0 < rating.gain.interval[1]


def test_no_hypothesis_is_about_noticing() -> None:
    names = how_tested(RATED)
    assert not [name for name in names if "noticed" in name]
    assert {"conditions differ", FOLLOWS, "160 V above 20 V"} <= names.keys()
    assert "responses" not in " ".join(names.values())


def test_groups_are_compared_by_scores() -> None:
    study = rated_study(groups=True)
    chains = rated_cohort()
    data = load_study_data(chains, rehearsals=False, rules=study.exclusions)
    groups = dict(zip(data.table.subjects, ["young", "old"] * 4, strict=True))
    found = report("How rough", replace(data, groups=groups), study, ORIGIN)
    assert "groups" in report_json(found)
    assert "mean scores" in how_tested(study)["old above young between groups"]


def test_methods_quote_the_question() -> None:
    assert "asked “How strong was what you felt? 1 to 7”" in words(rated_report())


def test_contrasts_are_told_as_relative_to_what_they_are_relative_to() -> None:
    found = rated_report()
    assert found.rest == "the same touch at 0 V"
    assert "relative to {rest}" not in words(found)
    plate = Calibration.of(GivenSurface(length_m=0.1))
    stated = replace(found, origin=replace(found.origin, rig=plate))
    assert stated.rest == "the mean of what touches state", "none of them is at 0 V"
    first, *others = stated.study.condition
    rested = first.touches[0].model_copy(update={"voltage_v": 0.0, "friction": 0.6})
    conditions = (first.model_copy(update={"touches": (rested,)}), *others)
    at_rest = replace(stated, study=stated.study.model_copy(update={"condition": conditions}))
    assert at_rest.rest == "the same touch at 0 V"
