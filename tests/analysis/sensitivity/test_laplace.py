"""Laplace's approximation of answers between edges: derivatives, modes and evidence."""

import mpmath
import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.sensitivity.curvature import OrdinalTrials, counted, edge_slopes
from analysis.sensitivity.laplace import Components, LatentField


def a_field() -> LatentField:
    rng = np.random.default_rng(9)
    return LatentField(
        OrdinalTrials(
            subjects=4,
            conditions=3,
            subject=np.array([0, 0, 0, 1, 1, 1, 3, 3, 3, 3]),
            condition=np.array([0, 1, 2, 0, 1, 2, 0, 1, 2, 0]),
            x=rng.normal(size=10),
            category=np.array([0, 2, 4, 1, 3, 3, 2, 4, 0, 1]),
            weight=np.array([1.0, 2, 1, 1, 3, 1, 1, 1, 2, 1]),
            thresholds=np.array([-1.0, -0.4, 0.3, 1.0]),
            free=np.array([False, True, True, False]),
            extra=np.empty((10, 0)),
            extra_sd=np.empty(0),
        )
    )


COMPONENTS = Components(
    residual_sd=np.array([0.7]),
    root=np.linalg.cholesky(np.array([[[0.8, 0.1], [0.1, 0.5]]])),
    discrepancy_sd=np.array([0.6]),
)


def value_of(field: LatentField, shared: FloatArray, own: FloatArray) -> float:
    return float(field.evaluated(shared[None], own[None], COMPONENTS).value[0])


def test_gradient_and_curvature_are_those_of_the_posterior() -> None:
    field = a_field()
    rng = np.random.default_rng(2)
    shared = field.trials.shared_start + 0.1 * rng.normal(size=7)
    own = 0.3 * rng.normal(size=(4, 2))
    found = field.evaluated(shared[None], own[None], COMPONENTS).curvature
    size = len(shared)
    whole = np.zeros((size + 8, size + 8))
    whole[:size, :size] = found.whole[..., 0]
    for number in range(4):
        block = slice(size + 2 * number, size + 2 * number + 2)
        first, mixed, second = found.own_precision[:, number, 0]
        whole[block, block] = [[first, mixed], [mixed, second]]
        whole[block, :size] = found.cross[:, number, :, 0]
        whole[:size, block] = found.cross[:, number, :, 0].T
    gradient = np.concatenate([found.shared_gradient[:, 0], found.own_gradient.T.ravel()])

    def value(step: FloatArray) -> float:
        moved = shared + step[:size], own + step[size:].reshape(4, 2)
        return value_of(field, *moved)

    steps = np.eye(size + 8) * 1e-4
    slopes = [(value(step) - value(-step)) / 2e-4 for step in steps]
    assert slopes == pytest.approx(gradient, rel=1e-6, abs=1e-6)
    for one, first in enumerate(steps):
        for other, second in enumerate(steps):
            curve = value(first + second) - value(first - second)
            curve = (curve - value(second - first) + value(-first - second)) / 4e-8
            assert -curve == pytest.approx(whole[one, other], abs=2e-5)


def test_newton_ends_at_the_mode() -> None:
    field = a_field()
    mode = field.modes(COMPONENTS, field.start(1))
    there = field.evaluated(mode.shared, mode.z, COMPONENTS).curvature
    gradient = [there.shared_gradient.ravel(), there.own_gradient.ravel()]
    assert np.abs(np.concatenate(gradient)).max() < 1e-4
    rng = np.random.default_rng(1)
    for _ in range(20):
        shared = mode.shared[0] + 0.05 * rng.normal(size=7)
        own = mode.z[0] + 0.05 * rng.normal(size=(4, 2))
        assert value_of(field, shared, own) < mode.value[0]


def test_equal_trials_are_counted_once() -> None:
    rows, weight = counted(np.array([[1.0, 2.0], [0.0, 3.0], [1.0, 2.0]]))
    assert rows.tolist() == [[0.0, 3.0], [1.0, 2.0]]
    assert weight.tolist() == [1.0, 2.0]


def test_slopes_far_out_are_those_of_fifty_digits() -> None:
    mpmath.mp.dps = 50
    for near, far in ((1e4, 1e4 + 0.5), (50.0, np.inf), (-40.0, 3.0), (-2.0, -1.9), (-9e4, -8e4)):
        found = edge_slopes(np.array([[near]]), np.array([[far]]))
        ends = mpmath.mpf(near), mpmath.mpf(far)
        # Both ends on the side where Φ is small.
        below = (-ends[1], -ends[0]) if near + far > 0 else ends
        p = mpmath.ncdf(below[1]) - mpmath.ncdf(below[0])
        assert float(found.log_p[0, 0]) == pytest.approx(float(mpmath.log(p)), rel=1e-12)
        for slope, end, sign in ((found.up, ends[1], 1), (found.down, ends[0], -1)):
            exact = sign * mpmath.npdf(end) / p if mpmath.isfinite(end) else mpmath.mpf(0)
            assert float(slope[0, 0]) == pytest.approx(float(exact), rel=1e-12, abs=1e-290)


def test_the_evidence_is_that_of_a_dense_matrix_at_any_components() -> None:
    """Far out, where σ is small and gains differ much, terms of 1e10 leave a determinant of 1."""
    field = a_field()
    corners = ((-0.4, 0.0, 1e-12), (-3.0, 1.0, 1e-9), (-6.0, 6.0, 1e-4), (6.0, -6.0, 1e-12))
    for log_sd, log_tau, error in corners:
        components = Components(
            residual_sd=np.exp([log_sd]),
            root=np.exp(log_tau) * COMPONENTS.root,
            discrepancy_sd=np.array([0.6]),
        )
        mode = field.modes(components, field.start(1))
        known, size = mode.curvature, mode.shared.shape[1]
        whole = np.zeros((size + 8, size + 8))
        whole[:size, :size] = known.whole[..., 0]
        whole[size:, :size] = np.swapaxes(known.cross[..., 0], 0, 1).reshape(8, size)
        whole[:size, size:] = whole[size:, :size].T
        for number in range(4):
            block = slice(size + 2 * number, size + 2 * number + 2)
            first, mixed, second = known.own_precision[:, number, 0]
            whole[block, block] = [[first, mixed], [mixed, second]]
        exact = mpmath.log(mpmath.det(mpmath.matrix(whole.tolist())))
        assert float(known.log_determinant[0]) == pytest.approx(float(exact), abs=error)
        assert np.isfinite(mode.log_evidence[0])


def test_a_mode_that_is_not_found_is_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the last step was expected to bring was added to where it had come: +39,101, not -70."""
    field = a_field()
    assert np.isfinite(field.modes(COMPONENTS, field.start(1)).log_evidence[0])
    monkeypatch.setattr("analysis.sensitivity.laplace.STEPS", 1)
    assert np.isnan(field.modes(COMPONENTS, field.start(1)).log_evidence[0])
