"""Lapses in noticing, and columns of one's own in ratings: derivatives and modes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.special import ndtr

from analysis.estimates import FloatArray
from analysis.sensitivity.curvature import LatentTrials, OrdinalTrials, edge_slopes
from analysis.sensitivity.laplace import Components, LatentField
from analysis.sensitivity.noticing_stage import NoticingTrials
from tests.analysis.sensitivity.test_laplace import a_field

COMPONENTS = Components(
    residual_sd=np.ones(1),
    root=np.linalg.cholesky(np.array([[[0.8, 0.1], [0.1, 0.5]]])),
    discrepancy_sd=np.array([0.6]),
)
WIDER = Components(
    residual_sd=np.ones(5),
    root=np.exp(np.linspace(-2, 3, 5))[:, None, None] * COMPONENTS.root,
    discrepancy_sd=np.full(5, 0.6),
)


def noticing(lapse: float, subjects: int = 3, repeats: int = 1) -> NoticingTrials:
    """Return trials with answers that do not fit the others."""
    count, rng = 10 * subjects * repeats, np.random.default_rng(subjects)
    x = np.tile([1.0, 0.5, 2.5, 0.0, 0.3, 0.0, 0.8, 3.0, 0.2, 0.6], subjects * repeats)
    felt = 1.5 * x + rng.normal(size=count)
    answer = np.select([felt > 0.8, felt < -0.8], [1, -1], 0)
    answer[x == 3.0] = np.where(rng.random(subjects * repeats) < 0.4, -1, 1)
    return NoticingTrials(
        subjects=subjects,
        conditions=2,
        subject=np.repeat(np.arange(subjects), 10 * repeats),
        condition=np.arange(count) % 2,
        x=x,
        answer=np.where(np.arange(count) % 3 == 1, np.maximum(answer, 0), answer),
        two_sided=np.arange(count) % 3 != 1,
        towards=np.where(np.arange(count) % 4 < 2, 1.0, -1.0),
        weight=np.ones(count),
        lapse=lapse,
    )


def with_columns(**changes: FloatArray) -> OrdinalTrials:
    trials = a_field().trials
    assert isinstance(trials, OrdinalTrials)
    extra = np.random.default_rng(3).normal(size=(10, 2))
    parts = {"extra": extra, "extra_sd": np.array([0.5, 3.0]), **changes}
    return replace(trials, **parts)  # type: ignore[arg-type]


def dense(field: LatentField, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return gradient and curvature of the log posterior by all parameters in a row."""
    size = len(field.trials.shared_start)
    shared, z = at[None, :size], at[size:].reshape(1, -1, 2)
    found = field.evaluated(shared, z, COMPONENTS).curvature
    whole = np.zeros((len(at), len(at)))
    whole[:size, :size] = found.whole[..., 0]
    for number in range(field.trials.subjects):
        block = slice(size + 2 * number, size + 2 * number + 2)
        first, mixed, second = found.own_precision[:, number, 0]
        whole[block, block] = [[first, mixed], [mixed, second]]
        whole[block, :size] = found.cross[:, number, :, 0]
        whole[:size, block] = found.cross[:, number, :, 0].T
    return np.concatenate([found.shared_gradient[:, 0], found.own_gradient.T.ravel()]), whole


def value(field: LatentField, at: FloatArray, components: Components = COMPONENTS) -> float:
    size = len(field.trials.shared_start)
    shared, z = at[None, :size], at[size:].reshape(1, -1, 2)
    return float(field.evaluated(shared, z, components).value[0])


def optimised(
    field: LatentField, start: FloatArray, components: Components
) -> tuple[float, FloatArray]:
    """Return the highest value near `start`, and where it is."""

    def loss(at: FloatArray) -> float:
        # Edges out of order have no value; differences must not meet infinity.
        return -max(value(field, at, components), -1e6)

    best = minimize(loss, start, method="BFGS", options={"gtol": 1e-7})
    return -float(best.fun), np.asarray(best.x)


@pytest.mark.parametrize("trials", [noticing(0.02), noticing(0.3), with_columns()])
def test_gradient_and_curvature_are_those_of_the_posterior(trials: LatentTrials) -> None:
    field, rng = LatentField(trials), np.random.default_rng(2)
    shared = trials.shared_start + 0.1 * rng.normal(size=len(trials.shared_start))
    at = np.concatenate([shared, 0.3 * rng.normal(size=2 * trials.subjects)])
    gradient, whole = dense(field, at)
    steps = 1e-5 * np.eye(len(at))
    slopes = [(value(field, at + step) - value(field, at - step)) / 2e-5 for step in steps]
    assert gradient == pytest.approx(slopes, rel=1e-6, abs=1e-6)
    for step, row in zip(steps, whole, strict=True):
        ahead, behind = (dense(field, at + sign * step)[0] for sign in (1, -1))
        assert -(ahead - behind) / 2e-5 == pytest.approx(row, rel=1e-6, abs=1e-6)


def test_the_probability_of_an_answer_is_that_with_lapses() -> None:
    lower, upper = np.array([[-0.4], [-np.inf], [50.0]]), np.array([[0.9], [-1.0], [np.inf]])
    found = edge_slopes(lower, upper).with_lapses(0.1, np.log([1 / 3, 1 / 3, 1 / 2]))
    between = ndtr(upper) - ndtr(lower)
    wanted = 0.9 * between[:, 0] + 0.1 * np.array([1 / 3, 1 / 3, 1 / 2])
    assert np.exp(found.log_p[:, 0]) == pytest.approx(wanted, rel=1e-12)
    assert found.up[1, 0] == pytest.approx(0.9 * np.exp(-0.5) / np.sqrt(2 * np.pi) / wanted[1])


@pytest.mark.parametrize("number", range(5))
@pytest.mark.parametrize("lapse", [0.02, 0.1])
def test_the_mode_with_lapses_is_that_of_a_general_optimiser(lapse: float, number: int) -> None:
    trials = noticing(lapse, subjects=4, repeats=3)
    field, without = LatentField(trials), LatentField(replace(trials, lapse=0.0))
    components = WIDER.at(np.array([number]))
    modes = field.modes(components, field.start(1))
    assert np.isfinite(modes.log_evidence[0])
    start = without.modes(components, without.start(1)).parameters[0]
    highest, at = optimised(field, start, components)
    assert modes.value[0] == pytest.approx(highest, abs=1e-4)
    assert modes.parameters[0] == pytest.approx(at, abs=0.02)


def test_each_of_many_modes_with_lapses_is_known() -> None:
    rng, count = np.random.default_rng(5), 200
    field = LatentField(noticing(0.02, subjects=8, repeats=2))
    log_sd = rng.uniform(-4, 4, (2, count))
    root = np.zeros((count, 2, 2))
    root[:, 0, 0], root[:, 1, 0], root[:, 1, 1] = np.exp(log_sd[0]), 0, np.exp(log_sd[1])
    sds = np.exp(rng.uniform(-3, 2, count))
    components = Components(residual_sd=np.ones(count), root=root, discrepancy_sd=sds)
    found = field.modes(components, field.start(count))
    assert np.isfinite(found.log_evidence).mean() > 0.98
    assert (found.value >= field.evaluated(found.shared, found.z, components).value - 1e-3).all()


def test_a_search_does_not_end_where_the_curvature_is_not_positive() -> None:
    """At two of these points it did, with so small a rise that a mode seemed to be near."""
    rng, count = np.random.default_rng(19), 300
    x = np.tile([0.4, 0.7, 1.3, 2.1, 3.0], 9)
    felt = 1.2 * x + rng.normal(size=45)
    answer = np.select([felt > 0.7, felt < -1.1], [1, -1], 0)
    answer[rng.random(45) < 0.06] = -1
    two_sided = np.tile([True, True, True, True, False], 9)
    trials = NoticingTrials(
        subjects=9,
        conditions=0,
        subject=np.repeat(np.arange(9), 5),
        condition=np.zeros(45, dtype=np.int64),
        x=x,
        answer=np.where(two_sided, answer, np.maximum(answer, 0)),
        two_sided=two_sided,
        towards=-np.ones(45),
        weight=np.ones(45),
        lapse=0.02,
    )
    root = np.zeros((count, 2, 2))
    root[:, 0, 0] = np.exp(np.linspace(-3, 2, count))
    of_points = Components(residual_sd=np.ones(count), root=root, discrepancy_sd=np.ones(count))
    field = LatentField(trials)
    assert np.isfinite(field.modes(of_points, field.start(count)).log_evidence).all()


def test_the_mode_with_columns_is_that_of_a_general_optimiser() -> None:
    field = LatentField(with_columns())
    modes = field.modes(COMPONENTS, field.start(1))
    start = np.concatenate([field.trials.shared_start, np.zeros(8)])
    highest, at = optimised(field, start, COMPONENTS)
    assert modes.value[0] == pytest.approx(highest, abs=1e-4)
    assert modes.parameters[0] == pytest.approx(at, abs=0.01)


def test_a_column_that_is_not_allowed_to_count_changes_nothing() -> None:
    plain, columns = a_field(), LatentField(with_columns(extra_sd=np.full(2, 1e-6)))
    one, other = (field.modes(COMPONENTS, field.start(1)) for field in (plain, columns))
    free = int(plain.trials.free.sum())  # type: ignore[attr-defined]
    others = np.delete(other.shared[0], [free, free + 1])
    assert others == pytest.approx(one.shared[0], abs=1e-6)
    # The determinant of the columns' prior, which is in both parts of (26), cancels.
    assert other.log_evidence == pytest.approx(one.log_evidence, abs=1e-6)


def test_some_of_the_trials_keep_their_columns() -> None:
    trials = with_columns()
    assert np.array_equal(trials.some(2).extra, trials.extra[trials.subject % 2 == 0])


def test_no_lapses_give_the_numbers_of_the_model_without_them() -> None:
    trials = noticing(0.0)
    field = LatentField(trials)
    lower, upper = trials.bounds(*field.start(2), np.ones(2))
    found, plain = trials.slopes(lower, upper), edge_slopes(lower, upper)
    assert np.array_equal(found.log_p, plain.log_p)
    assert np.array_equal(found.up, plain.up)
    few = LatentField(noticing(1e-12))
    one, other = (at.modes(COMPONENTS, at.start(1)) for at in (field, few))
    assert other.shared == pytest.approx(one.shared, abs=1e-3)
    assert other.log_evidence == pytest.approx(one.log_evidence, abs=1e-3)
