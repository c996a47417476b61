"""Precision by session length: Student's t against scipy, laws, and recovery by simulation."""

from math import inf, isinf

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.stats import t

from protocol.plan.plan import plan
from protocol.plan.trials import session_s
from protocol.preview.precision import (
    RESIDUAL_SD,
    half_width,
    precisions,
    squared_spread,
    t_quantile,
)
from protocol.preview.session_length import SessionLength, session_lengths
from protocol.study.rating import PAPERS_SCALE, Rating
from protocol.study.study import Study
from protocol.study_file.limits import problems
from protocol.study_file.loading import StudyError, parsed_study, template
from tests.protocol.studies import Document, documents, small_document


@pytest.mark.parametrize("df", [1, 2, 3, 4, 5, 7, 18, 31, 200])
def test_quantiles_of_t(df: int) -> None:
    assert t_quantile(0.975, df) == pytest.approx(float(t.ppf(0.975, df)), rel=1e-9)


def test_twice_the_spread_of_contrasts_equals_four_times_the_repeats() -> None:
    contrasts = [0.1, 0.2, 0.3, 0.4] * 50
    wide = [2 * contrast for contrast in contrasts]
    narrow, spread = (half_width(squared_spread(x), 200) for x in (contrasts * 4, wide))
    assert narrow == pytest.approx(spread)


def test_the_interval_covers_the_true_gain_at_its_nominal_rate() -> None:
    rng = np.random.default_rng(1)
    x = np.linspace(0, 0.6, 20)
    y = 3 + 5 * x + rng.normal(0, RESIDUAL_SD, (4_000, 20))
    slopes = (y - y.mean(axis=1, keepdims=True)) @ (x - x.mean()) / squared_spread(list(x))
    width = half_width(squared_spread(list(x)), 20)
    by_normal = width / t_quantile(0.975, 18) * 1.959964
    assert np.mean(np.abs(slopes - 5) < by_normal) == pytest.approx(0.95, abs=0.01)


def test_longer_sessions_give_narrower_intervals() -> None:
    sessions = [
        SessionLength(repeats=n, duration_s=100 + 200 * n, whole=True) for n in (1, 2, 4, 5, 8, 16)
    ]
    found = precisions([0.1, 0.2, 0.3, 0.4] * 5, 4, sessions, PAPERS_SCALE)
    assert [b.repeats for b in found] == [1, 2, 4, 5, 8, 16]
    assert [b.duration_s for b in found][2] == 900
    widths = [b.half_width for b in found]
    assert widths == sorted(widths, reverse=True)
    assert found[2].trials == 20


def test_equal_contrasts_do_not_determine_a_slope() -> None:
    found = precisions(
        [0.3] * 5, 1, [SessionLength(repeats=1, duration_s=60, whole=True)], PAPERS_SCALE
    )
    assert all(isinf(b.half_width) and b.relative == inf for b in found)
    assert half_width(1.0, 2) == inf


def test_a_longer_scale_changes_the_points_and_not_their_share_of_it() -> None:
    sessions = [SessionLength(repeats=4, duration_s=60, whole=True)]
    tens, hundreds = (
        precisions([0.1, 0.2, 0.3, 0.4] * 5, 4, sessions, Rating(minimum=low, maximum=high))[0]
        for low, high in ((0, 10), (100, 200))
    )
    assert hundreds.half_width == pytest.approx(10 * tens.half_width)
    assert hundreds.relative == pytest.approx(tens.relative)


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
