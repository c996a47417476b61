"""d′, criterion and their test against numbers worked out by hand, enumeration and scipy."""

from itertools import combinations, product
from statistics import NormalDist

import numpy as np
import pytest
from scipy.special import ndtr, ndtri
from scipy.stats import beta, fisher_exact

from analysis.estimates import LEVEL, FloatArray, IntArray, Interval, NotEstimable
from analysis.statistics.detection import Detection, detection, noticed_p

Z = NormalDist().inv_cdf


def detected(hits: list[list[int]], alarms: list[list[int]]) -> Detection:
    found = detection(np.array(hits), np.array(alarms))
    assert isinstance(found, Detection)
    return found


def intervals(found: Detection) -> tuple[Interval, Interval]:
    """Of d′ and criterion."""
    assert not isinstance(found.d_prime_interval, NotEstimable)
    assert not isinstance(found.criterion_interval, NotEstimable)
    return found.d_prime_interval, found.criterion_interval


@pytest.mark.parametrize(
    ("hits", "alarms", "d_prime", "criterion"),
    [
        # Rates 17.5/21 = .8333 and 3.5/21 = .1667, whose z are .9674 and -.9674.
        ((17, 20), (3, 20), 1.9348, 0.0),
        # Rates 18.5/21 = .8810 and 1.5/5 = .3, whose z are 1.1797 and -.5244.
        ((18, 20), (1, 4), 1.7041, -0.3277),
        # Rates 20.5/21 = .9762 and .5/11 = .0455: all and none stay finite.
        ((20, 20), (0, 10), 3.6714, -0.1451),
        # Rates 5.5/11 on both.
        ((5, 10), (5, 10), 0.0, 0.0),
    ],
)
def test_d_prime_and_criterion_are_those_worked_out_by_hand(
    hits: tuple[int, int], alarms: tuple[int, int], d_prime: float, criterion: float
) -> None:
    found = detected([[*hits]], [[*alarms]])
    assert (found.d_prime, found.criterion) == pytest.approx((d_prime, criterion), abs=1e-4)
    d_prime_interval, criterion_interval = intervals(found)
    assert d_prime_interval[0] < found.d_prime < d_prime_interval[1]
    assert criterion_interval[0] < found.criterion < criterion_interval[1]


def test_of_several_people_they_are_those_of_the_average_rates() -> None:
    found = detected([[8, 10], [3, 10]], [[1, 4], [2, 4]])
    z_hit, z_alarm = Z(11.5 / 21), Z(3.5 / 9)
    assert found.d_prime == pytest.approx(z_hit - z_alarm)
    assert found.criterion == pytest.approx(-(z_hit + z_alarm) / 2)
    assert (found.people, found.hits.reported, found.false_alarms.trials) == (2, 11, 8)


def test_the_interval_of_a_person_is_that_of_two_posteriors() -> None:
    found = detected([[15, 20]], [[2, 8]])
    rng = np.random.default_rng(1)
    hit, alarm = (
        [Z(rate) for rate in rng.beta(a, b, 100_000)] for a, b in ((15.5, 5.5), (2.5, 6.5))
    )
    drawn = np.array([np.subtract(hit, alarm), -np.add(hit, alarm) / 2])
    ends = np.array(intervals(found))
    np.testing.assert_allclose(ends, np.quantile(drawn, [0.025, 0.975], axis=1).T, atol=0.02)
    rate = beta(15.5, 5.5).ppf([0.025, 0.975])
    assert found.hits.share_interval == pytest.approx(tuple(rate))


def test_a_share_of_all_or_none_lies_within_its_interval() -> None:
    found = detected([[10, 10]] * 3, [[0, 5]] * 3)
    assert found.hits.share_interval[1] == 1.0
    assert found.false_alarms.share_interval[0] == 0.0
    assert np.isfinite(intervals(found)).all()


def test_people_who_differ_make_wider_intervals() -> None:
    alike = detected([[5, 10]] * 6, [[1, 5]] * 6)
    apart = detected([[9, 10], [1, 10]] * 3, [[1, 5]] * 6)
    assert alike.hits.share == apart.hits.share
    assert np.ptp(apart.hits.share_interval) > 1.5 * np.ptp(alike.hits.share_interval)
    # Who reports much does so on both kinds of trial, which d′ is without and the criterion is not.
    together = detected([[9, 10], [4, 10]] * 4, [[4, 5], [1, 5]] * 4)
    against = detected([[9, 10], [4, 10]] * 4, [[1, 5], [4, 5]] * 4)
    widths = [np.ptp(intervals(one), axis=1) for one in (together, against)]
    assert widths[0][0] < widths[1][0]
    assert widths[0][1] > widths[1][1]


def test_signal_and_catch_trials_exchanged_turn_d_prime_round() -> None:
    hits, alarms = [[7, 10], [4, 10], [9, 10]], [[2, 6], [1, 6], [0, 6]]
    one, other = detected(hits, alarms), detected(alarms, hits)
    assert other.d_prime == pytest.approx(-one.d_prime)
    assert other.criterion == pytest.approx(one.criterion)
    low, high = intervals(one)[0]
    assert intervals(other)[0] == pytest.approx((-high, -low), abs=0.01)


def test_two_people_have_no_interval_of_d_prime_and_criterion() -> None:
    """Their two points lie on a line, whatever they are like, so that nothing seems uncertain."""
    found = detected([[10, 20], [20, 20]], [[3, 6], [6, 6]])
    why = NotEstimable("two people do not tell how hits and false alarms go together")
    assert (found.d_prime_interval, found.criterion_interval) == (why, why)
    assert found.d_prime == pytest.approx(Z(30.5 / 41) - Z(9.5 / 13))
    assert 0 < found.p < 1


def test_with_fewer_catch_trials_the_correction_can_enlarge_d_prime() -> None:
    assert detected([[0, 20]], [[0, 4]]).d_prime == pytest.approx(-0.70, abs=0.005)


@pytest.mark.parametrize("people", [3, 6])
def test_intervals_hold_the_truth_from_three_people_on(people: int) -> None:
    rng = np.random.default_rng(people)

    def rates(number: int) -> FloatArray:
        lean, own = rng.normal(0, 0.5, number), 1.2 + rng.normal(0, 0.3, number)
        return np.array([ndtr(own / 2 + lean), ndtr(-own / 2 - 0.3 + lean)])

    hit, alarm = ndtri(rates(400_000).mean(axis=1)).tolist()
    held = 0
    for _ in range(300):
        counts = [
            np.stack([rng.binomial(trials, own), np.full(people, trials)], axis=1)
            for trials, own in zip((40, 20), rates(people), strict=True)
        ]
        found = detection(*counts)
        assert isinstance(found, Detection)
        low, high = intervals(found)[0]
        held += low < hit - alarm < high
    assert 0.91 <= held / 300 <= 0.98


def test_without_trials_of_both_kinds_nothing_is_known() -> None:
    none = NotEstimable("nobody answered both trials with a signal and catch trials")
    assert detection(np.array([[3, 4], [0, 0]]), np.array([[0, 0], [1, 2]])) == none
    assert detected([[3, 4], [2, 4]], [[0, 0], [1, 2]]).people == 1


def enumerated(hits: IntArray, alarms: IntArray) -> float:
    """p by going through every choice of each person's trials with a signal."""
    each = []
    for (told, trials), (false, catches) in zip(hits, alarms, strict=True):
        reports = [1] * (told + false) + [0] * (trials + catches - told - false)
        each.append([sum(chosen) for chosen in combinations(reports, int(trials))])
    sums = [sum(chosen) for chosen in product(*each)]
    return float(np.mean(np.array(sums) >= hits[:, 0].sum()))


@pytest.mark.parametrize("seed", range(6))
def test_p_is_that_of_every_choice_of_trials(seed: int) -> None:
    rng = np.random.default_rng(seed)
    trials, catches = rng.integers(1, 5, 3), rng.integers(0, 4, 3)
    hits = np.stack([rng.integers(0, trials + 1), trials], axis=1)
    alarms = np.stack([rng.integers(0, catches + 1), catches], axis=1)
    assert noticed_p(hits[None], alarms[None])[0] == pytest.approx(enumerated(hits, alarms))


@pytest.mark.parametrize(("hits", "alarms"), [((18, 20), (1, 4)), ((200, 300), (90, 150))])
def test_p_of_one_person_is_fishers(hits: tuple[int, int], alarms: tuple[int, int]) -> None:
    (a, n), (b, m) = hits, alarms
    table = np.array([[a, n - a], [b, m - b]])
    expected = fisher_exact(table, alternative="greater").pvalue
    assert detected([[*hits]], [[*alarms]]).p == pytest.approx(expected, rel=1e-9)


def test_studies_are_tested_together_as_alone() -> None:
    rng = np.random.default_rng(3)
    trials = rng.integers(0, 6, (40, 5, 2))
    counts = np.stack([rng.integers(0, trials + 1), trials], axis=-1)
    together = noticed_p(counts[:, :, 0], counts[:, :, 1])
    alone = [noticed_p(each[None, :, 0], each[None, :, 1])[0] for each in counts]
    np.testing.assert_allclose(together, alone, rtol=1e-12)


def test_where_nothing_is_noticed_at_most_one_test_in_twenty_says_so() -> None:
    rng = np.random.default_rng(4)
    # People differ widely in how often they report a change, of which the test supposes nothing.
    rate = rng.beta(0.5, 1.0, (4000, 9))
    hits = np.stack([rng.binomial(4, rate), np.full(rate.shape, 4)], axis=-1)
    alarms = np.stack([rng.binomial(6, rate), np.full(rate.shape, 6)], axis=-1)
    share = float((noticed_p(hits, alarms) < LEVEL).mean())
    assert share <= LEVEL + 2 * np.sqrt(LEVEL / 4000)
    more = np.stack([rng.binomial(4, np.minimum(rate + 0.3, 1)), hits[..., 1]], axis=-1)
    assert (noticed_p(more, alarms) < LEVEL).mean() > 0.5
