"""Checks of the ratings: drift, carry-over, order effects, catch trials, and the order as run."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import betaincinv, fdtrc, ndtri, stdtr, stdtrit

from analysis.estimates import LOWER, UPPER, FloatArray, IntArray, Interval, NotEstimable
from analysis.loading.study_data import SessionOrder, StudyData
from analysis.sensitivity.lines import Ratings
from protocol.plan.plan import plan
from protocol.plan.trials import Plan
from protocol.proof import trial_checks as proof
from protocol.registration.registration import locked
from protocol.study.study import Study

_POOLED = NotEstimable(
    "trials of several subjects are pooled, and trials of one subject are not independent"
)


@dataclass(frozen=True, kw_only=True)
class Drift:
    """Mean over subjects of the change of the rating per trial, adjusted for condition."""

    points_per_trial: float
    interval: Interval
    df: int
    p: float


@dataclass(frozen=True, kw_only=True)
class FTest:
    """An F test of added effects."""

    f: float
    df: tuple[int, int]
    p: float


@dataclass(frozen=True, kw_only=True)
class Proportion:
    """A share of independent trials with its exact 95% interval (Clopper and Pearson 1934)."""

    count: int
    trials: int
    share: float
    interval: Interval | NotEstimable


@dataclass(frozen=True, kw_only=True)
class Discrimination:
    """Changes reported with a signal (hits) and without, with d′ and criterion.

    Rates are (count + 0.5) / (trials + 1), which is never 0 or 1 (Hautus, Behavior Research
    Methods 27, 1995). d′ = z(hits) - z(false alarms), c = -(z(hits) + z(false alarms)) / 2.
    """

    hits: Proportion
    false_alarms: Proportion
    d_prime: float
    criterion: float


def drift(ratings: Ratings, position: IntArray) -> Drift | NotEstimable:
    """Return the mean of the subjects' slopes on the trial's position, or why it is not estimable.

    Rating = subject + condition + own slope × position by least squares; t tests the mean slope
    against the spread of the slopes, with a degree of freedom less than there are subjects. People
    who drift apart, some up and some down, so do not count as a drift of all.

    `position` has shape (trials,): the place in the session, 1 for a subject's first trial.
    """
    rated = ratings.given
    if not len(rated.rating):
        return NotEstimable("no trial was rated")
    slopes = _slopes(rated, position[~np.isnan(ratings.rating)].astype(np.float64))
    if isinstance(slopes, NotEstimable):
        return slopes
    df = len(slopes) - 1
    slope, error = float(slopes.mean()), float(slopes.std(ddof=1) / np.sqrt(len(slopes)))
    # Slopes that are equal leave a spread that is rounding alone.
    if error <= 1e-12 * max(1.0, abs(slope)):
        return NotEstimable("the subjects' slopes do not vary, so their mean cannot be tested")
    half = float(stdtrit(df, UPPER)) * error
    p = float(2 * stdtr(df, -abs(slope) / error))
    return Drift(points_per_trial=slope, interval=(slope - half, slope + half), df=df, p=p)


def _slopes(trials: Ratings, place: FloatArray) -> FloatArray | NotEstimable:
    """Return the slope of each subject whose trials differ in position, adjusted for condition."""
    columns = np.column_stack([place, trials.rating, _dummies(trials.condition)])
    within, person = _within(columns, trials)
    moved = _sums(within[:, 0] ** 2, person)
    if (moved > 0).sum() < 2:
        return NotEstimable("fewer than 2 subjects have rated trials at different positions")
    moving = (moved > 0)[person]
    within, person = within[moving], np.unique(person[moving], return_inverse=True)[1]
    steps = within[:, 0]
    raw = _sums(within[:, 1:] * steps[:, None], person) / moved[moved > 0][:, None]
    # Conditions are fitted to what each subject's own line leaves, which gives the same effects as
    # one large fit of all (Frisch and Waugh, Econometrica 1, 1933).
    rest = within[:, 1:] - steps[:, None] * raw[person]
    y, conditions = rest[:, 0], rest[:, 1:]
    information = conditions.T @ conditions
    # A pseudoinverse, because the columns of all conditions add up to a constant, which the
    # subjects' levels took already.
    inverse = np.linalg.pinv(information, rtol=1e-10, hermitian=True)
    # Effects of conditions that nothing determines must not move the slopes.
    free = np.eye(len(inverse)) - inverse @ information
    if np.abs(raw[:, 1:] @ free).max() > 1e-8:
        return NotEstimable(
            "subject and condition determine the position, so drift cannot be separated"
        )
    # Each subject takes a level and a slope.
    if len(y) - 2 * len(raw) - np.linalg.matrix_rank(information, tol=1e-8, hermitian=True) < 1:
        return NotEstimable("there is no residual to test the drift against")
    return np.asarray(raw[:, 0] - raw[:, 1:] @ (inverse @ (conditions.T @ y)))


def _within(values: FloatArray, trials: Ratings) -> tuple[FloatArray, IntArray]:
    """Return values about each subject's mean, and the number of each subject, from 0."""
    _, person, counts = np.unique(trials.subject, return_inverse=True, return_counts=True)
    return values - (_sums(values, person) / counts[:, None])[person], person


def _sums(values: FloatArray, person: IntArray) -> FloatArray:
    totals = np.zeros((int(person.max()) + 1, *values.shape[1:]))
    np.add.at(totals, person, values)
    return totals


def carry_over(ratings: Ratings, previous: IntArray) -> FTest | NotEstimable:
    """Return the test of the preceding trial's condition, or why it is not possible.

    `previous` has shape (trials,): the position of the preceding trial's condition, -1 for trials
    without a preceding one, which are left out.
    """
    if not (~np.isnan(ratings.rating) & (previous >= 0)).any():
        return NotEstimable("no rated trial follows another")
    # The same test, of another factor than the position.
    return order_effect(ratings.where(previous >= 0), previous[previous >= 0])


def order_effect(ratings: Ratings, position: IntArray) -> FTest | NotEstimable:
    """Return the test of the trial's position, as a factor, or why it is not possible."""
    rated = ratings.given
    if not len(rated.rating):
        return NotEstimable("no trial was rated")
    added = _dummies(position[~np.isnan(ratings.rating)])
    return _test_of(rated, _dummies(rated.condition), added)


def proportion(count: int, trials: int) -> Proportion | NotEstimable:
    """Return the share of `count` in `trials` with its exact interval, or why it is undefined.

    Raises:
        ValueError: a count below 0 or above the number of trials.
    """
    if not 0 <= count <= trials:
        raise ValueError(f"count must lie in [0, {trials}], got {count}")
    if trials == 0:
        return NotEstimable("there were no such trials")
    # At no or at all successes the beta distribution of one limit does not exist.
    low = float(betaincinv(count, trials - count + 1, LOWER)) if count > 0 else 0.0
    high = float(betaincinv(count + 1, trials - count, UPPER)) if count < trials else 1.0
    return Proportion(count=count, trials=trials, share=count / trials, interval=(low, high))


def discrimination(
    hits: tuple[int, int], false_alarms: tuple[int, int], *, people: int = 1
) -> Discrimination | NotEstimable:
    """Return d′ and criterion from (count, trials) of signal and of catch trials.

    Both count the same event: a change was reported. Trials pooled over several `people` have no
    intervals.

    >>> found = discrimination((18, 20), (1, 4))
    >>> round(found.d_prime, 3), round(found.criterion, 3)
    (1.704, -0.328)
    """
    hit, alarm = proportion(*hits), proportion(*false_alarms)
    if isinstance(hit, NotEstimable):
        return NotEstimable("there were no signal trials")
    if isinstance(alarm, NotEstimable):
        return NotEstimable("there were no catch trials")
    z_hit, z_alarm = (float(ndtri((p.count + 0.5) / (p.trials + 1))) for p in (hit, alarm))
    return Discrimination(
        hits=hit if people == 1 else replace(hit, interval=_POOLED),
        false_alarms=alarm if people == 1 else replace(alarm, interval=_POOLED),
        d_prime=z_hit - z_alarm,
        criterion=-(z_hit + z_alarm) / 2,
    )


def _test_of(trials: Ratings, common: FloatArray, added: FloatArray) -> FTest | NotEstimable:
    """Return the test of the columns `added` to those `common` to both fits, within subjects."""
    without, rank, _ = _residual(trials, common)
    squares, whole_rank, left = _residual(trials, np.column_stack([common, added]))
    df = (whole_rank - rank, left)
    if df[0] < 1:
        return NotEstimable("subject and condition determine the effect, so it cannot be separated")
    # A fit that is perfect leaves squares that are rounding alone.
    if df[1] < 1 or squares <= 1e-20 * max(1.0, without):
        return NotEstimable("there is no residual to test the effect against")
    f = (without - squares) / df[0] / (squares / df[1])
    # Rounding can make the difference of two equal sums negative.
    return FTest(f=f, df=df, p=float(fdtrc(*df, max(f, 0.0))))


def _dummies(group: IntArray) -> FloatArray:
    return np.asarray(group[:, None] == np.unique(group), dtype=np.float64)


def _residual(trials: Ratings, design: FloatArray) -> tuple[float, int, int]:
    """Return squares left by a least-squares fit within subjects, its rank and what is free."""
    within, person = _within(np.column_stack([design, trials.rating]), trials)
    columns, y = within[:, :-1], within[:, -1]
    solution, _, rank, _ = np.linalg.lstsq(columns, y, rcond=1e-10)
    residual = y - columns @ solution
    # Each subject's level, taken off before the fit, was estimated, too.
    return float(residual @ residual), int(rank), len(y) - int(rank) - len(np.unique(person))


@dataclass(frozen=True, kw_only=True)
class OrderAsRun:
    """The trials of all sessions in the order of their answers.

    `attempts_repeated` counts the attempts that ended because a touch was not as instructed.
    `problems` lists the rules of the plan that the order breaks.
    """

    attempts_repeated: int
    carry_over: proof.CarryOver
    problems: tuple[str, ...]


def order_as_run(data: StudyData, study: Study) -> OrderAsRun | NotEstimable:
    """Return the order in which the trials of all sessions were answered."""
    if not data.orders:
        return NotEstimable("the order of imported scores is not known")
    if data.lock is not None:
        # A registration's digest seeds the plan, which is drawn again here.
        study = locked(study, data.lock.registration.digest)
    planned = [plan(study.of_group(it.group), it.slot, it.session) for it in data.orders]
    # Rules of the present file say nothing about a plan that another one made.
    if not all(map(_is_planned, data.orders, planned)):
        return NotEstimable("some sessions ran under another version of the study file")
    as_run = [
        replace(planned, trials=tuple(planned.trials[index] for index in order.trials))
        for order, planned in zip(data.orders, planned, strict=True)
    ]
    problems = [
        problem
        for order, own in zip(data.orders, planned, strict=True)
        for problem in proof.order_problems(study, own, order.trials)
    ]
    return OrderAsRun(
        attempts_repeated=sum(it.what == "trial repeated" for it in data.incidents),
        carry_over=proof.carry_over(study, as_run),
        problems=tuple(map(str, problems)),
    )


def _is_planned(order: SessionOrder, planned: Plan) -> bool:
    conditions = [trial.condition for trial in planned.trials]
    return all(
        index < len(conditions) and conditions[index] == condition
        for index, condition in zip(order.trials, order.conditions, strict=True)
    )
