"""Precision by session length: Student's t against scipy, and laws of the forecast."""

from dataclasses import replace
from math import inf, sqrt

import pytest
from hypothesis import given, settings
from scipy.stats import t

from protocol.plan.plan import plan
from protocol.plan.trials import session_s
from protocol.preview.preview import (
    Cohort,
    SessionLength,
    cohort,
    confounded,
    precisions,
    relative_gain_half_width,
    session_lengths,
    squared_spread,
    t_quantile,
)
from protocol.study.rules import PAPERS_SCALE, Forecast, Rating
from protocol.study.study import Study
from protocol.study_file.limits import problems
from protocol.study_file.loading import StudyError, parsed_study, template
from tests.protocol.studies import Document, documents, small_document


@pytest.mark.parametrize("df", [1, 2, 3, 4, 5, 7, 18, 31, 200])
def test_quantiles_of_t(df: int) -> None:
    assert t_quantile(0.975, df) == pytest.approx(float(t.ppf(0.975, df)), rel=1e-9)


PEOPLE = Cohort(participants=9, residual_sd=1.48, off_the_line_sd=1.8, gain_sd=4.1)
FOUR = {f"condition {number}": [number / 10] * 5 for number in (1, 2, 3, 4)}
GRADED = {name: [level * own[0] for level in (0.5, 0.8, 1, 1.2, 1.5)] for name, own in FOUR.items()}


def lengths(*repeats: int) -> list[SessionLength]:
    return [SessionLength(repeats=n, duration_s=100 + 200 * n, whole=True) for n in repeats]


def test_without_pooling_twice_the_spread_equals_four_times_the_repeats() -> None:
    apart = replace(PEOPLE, gain_sd=1e6)
    wide = {name: [2 * contrast for contrast in own] for name, own in FOUR.items()}
    repeated, spread = (
        relative_gain_half_width(contrasts, share, apart)
        for contrasts, share in ((FOUR, 40.0), (wide, 10.0))
    )
    assert repeated == pytest.approx(spread, rel=1e-3)


def test_longer_sessions_give_narrower_intervals() -> None:
    found = precisions(FOUR, 4, lengths(1, 2, 4, 5, 8, 16), PAPERS_SCALE, PEOPLE)
    assert [b.repeats for b in found] == [1, 2, 4, 5, 8, 16]
    assert [b.duration_s for b in found][2] == 900
    for widths in ([b.half_width for b in found], [b.gain_half_width for b in found]):
        assert widths == sorted(widths, reverse=True)
    assert found[2].trials == 20


def test_repeats_do_not_average_out_conditions_off_the_line() -> None:
    once, often = precisions(FOUR, 1, lengths(1, 16), PAPERS_SCALE, PEOPLE)
    assert often.half_width < 0.4 * once.half_width
    floor = t_quantile(0.975, 2) * 1.8 / sqrt(squared_spread([0.1, 0.2, 0.3, 0.4]))
    assert often.gain_half_width > floor


def test_graded_levels_break_the_confounding_of_contrast_and_condition() -> None:
    plain, graded = (
        precisions(contrasts, 5, lengths(5), PAPERS_SCALE, PEOPLE)[0]
        for contrasts in (FOUR, GRADED)
    )
    assert graded.gain_half_width < 0.4 * plain.gain_half_width
    assert confounded(FOUR)
    assert not confounded(GRADED)


def test_equal_contrasts_do_not_determine_a_slope() -> None:
    equal = {"one": [0.3] * 5, "other": [0.3] * 5}
    for option in precisions(equal, 1, lengths(1), PAPERS_SCALE, PEOPLE):
        assert option.half_width == option.gain_half_width == option.relative == inf
    assert relative_gain_half_width({"one": [0.1, 0.5]}, 1.0, PEOPLE) == inf


def test_two_conditions_alone_do_not_determine_gains() -> None:
    two = {"one": [0.1] * 5, "other": [0.4] * 5}
    option = precisions(two, 5, lengths(5), PAPERS_SCALE, PEOPLE)[0]
    assert option.half_width < inf
    assert option.gain_half_width == inf


def test_a_longer_scale_changes_the_points_and_not_their_share_of_it() -> None:
    tens, hundreds = (
        precisions(FOUR, 4, lengths(4), rating, cohort(9, Forecast(), rating))[0]
        for rating in (PAPERS_SCALE, Rating(minimum=100, maximum=200))
    )
    assert hundreds.half_width == pytest.approx(10 * tens.half_width)
    assert hundreds.gain_half_width == pytest.approx(10 * tens.gain_half_width)
    assert hundreds.relative == pytest.approx(tens.relative)


def test_one_participant_is_forecast_as_one_of_the_papers_nine() -> None:
    assert cohort(1, Forecast(), PAPERS_SCALE) == cohort(9, Forecast(), PAPERS_SCALE)


def test_sessions_the_study_does_not_allow_are_marked() -> None:
    text = template("extended")
    for option in session_lengths(parsed_study(text)):
        other = text.replace("repeats = 4", f"repeats = {option.repeats}", 1)
        if option.whole:
            study = parsed_study(other)
            assert session_s(study, plan(study, 0)) == option.duration_s
        else:
            with pytest.raises(StudyError):
                parsed_study(other)


@pytest.mark.parametrize("repeats", [1, 2, 4, 8])
def test_each_session_counts_its_own_breaks_and_beam_swaps(repeats: int) -> None:
    wishes = {"group_by_beam": "session", "break_every_blocks": 4, "break_s": 300}
    wishes |= {"max_alike_in_row": 8}
    study = Study.model_validate(small_document(3, 2, repeats=repeats, **wishes))
    for option in session_lengths(study):
        document = small_document(3, 2, repeats=option.repeats, **wishes)
        if option.whole:
            other = Study.model_validate(document)
            assert option.duration_s == session_s(other, plan(other, 0))
    assert [option.repeats for option in session_lengths(study) if option.whole].count(repeats) == 1


@settings(max_examples=60, deadline=None)
@given(documents())
def test_every_valid_study_has_shorter_or_longer_sessions(document: Document) -> None:
    study = Study.model_validate(document)
    if problems(study):
        return
    options = {option.repeats: option for option in session_lengths(study)}
    own = options[study.design.repeats]
    assert own.whole
    assert own.duration_s == session_s(study, plan(study, 0))
    assert len(options) > 1


@pytest.mark.parametrize("order", ["random", "blocks"])
def test_repeats_stay_within_what_a_study_file_may_set(order: str) -> None:
    study = Study.model_validate(small_document(2, repeats=12, order=order))
    assert [option.repeats for option in session_lengths(study)] == [1, 2, 6, 12, 13]


def test_relaxed_constraints_allow_shorter_and_longer_sessions() -> None:
    text = template("extended").replace("catch_trials = 4", "catch_trials = 6")
    options = list(session_lengths(parsed_study(text)))
    assert [option.repeats for option in options] == [1, 2, 4, 5, 8, 16]
    durations = [option.duration_s for option in options]
    assert durations == sorted(durations)
