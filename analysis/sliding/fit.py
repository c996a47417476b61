"""The rig's properties by generalised least squares on all passes, with profile intervals.

A property that the passes do not determine keeps its nominal value, and the fit says why. The
test is Fisher's information under the noise of these passes; of properties that trade off against
each other, the one known worst is given up first.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import f as f_distribution

from analysis.estimates import LEVEL, Estimate, FloatArray, NotEstimable
from analysis.sliding import rig_model
from analysis.sliding.rig_model import PATCHES, half_wave_ratio, slopes

_BOUNDS: Mapping[str, tuple[float, float]] = {
    "friction_coefficient": (0.1, 1.5),
    "resonance_hz": (0.0008, 0.03),
    "damping_ratio": (0.25, 2.5),
    "gain": (0.25, 1.5),
    "body_height_m": (0.25, 0.3),
    PATCHES: (0.0015, 0.008),
}
"""Largest standard error of a property that counts as determined: relative (of the body height:
relative to the tip's lever), for the patches' place in m on the paper's beam, on another one in
proportion to half a wave. And how far it is searched on either side of its nominal value; no
interval goes further."""
_NOISES = 2
_EVALUATIONS = 30
_MOVES, _SETTLED = 10, 2 / 15  # of the patches: a part of the limit to which their place is known
_RIDGE = 1e-13  # of scaled information, so that what the passes do not see has a large error
_AT_THE_END = 0.999  # of the reach: the search stays within it
_NEAR = 0.02  # of the root of the rise, at an end of an interval
_TRADED = 0.9
"""Correlation of two estimates from which on one is said to trade off against the other."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RigFit:
    """A rig fitted to passes.

    Properties of `rig` that are not determined have their nominal values; `estimates` has each with
    its interval, from the profile of the likelihood, or the reason why the passes do not tell it.
    `noise` is that of the passes about the fitted friction, `means` the latter in the bins of each
    pass, `deviance` the sum of squares of the residuals in units in which they are independent, and
    `points` the number of bins.
    """

    rig: rig_model.RigProperties
    estimates: Mapping[str, Estimate | NotEstimable]
    noise: rig_model.Noise
    means: tuple[FloatArray, ...]
    deviance: float
    points: int


def fitted_rig(binned: Sequence[rig_model.BinnedPass], nominal: rig_model.RigProperties) -> RigFit:
    """Return the rig that fits the passes best.

    `binned` are driven passes, and with the output off. The search begins at `nominal`, whose
    resonance is the measured one.
    """
    problem, given_up = _Problem(tuple(binned), nominal), dict[str, NotEstimable]()
    seen, found = tuple(one.mu for one in binned), rig_model.coordinates(nominal)
    fit = _Fit(problem, rig_model.Noise(), seen, found, rig_model.PROPERTIES)
    if problem.reach[PATCHES] < problem.limits[PATCHES]:
        given_up[PATCHES] = NotEstimable(
            "the patches lie so near to an end of the beam that their place is taken as described"
        )
        fit = fit.without([PATCHES])
    for _ in range(_NOISES):
        fit = fit.kept(given_up).best()
        means = problem.split(fit.friction(fit.found))
        fit = replace(fit, noise=rig_model.fitted_noise(problem.binned, means), means=means)
    fit = fit.kept(given_up).best()
    # Until the patches' slope is that at the best place.
    for _ in range(_MOVES):
        fit, before = fit.best(), fit
        if abs(fit.found[_PATCH] - before.found[_PATCH]) < _SETTLED * problem.limits[PATCHES]:
            break
    while beyond := fit.beyond():
        given_up |= beyond
        fit = fit.without(beyond).best()
    return RigFit(
        rig=problem.rig(fit.found),
        estimates={name: given_up.get(name) or fit.estimate(name) for name in rig_model.PROPERTIES},
        noise=fit.noise,
        means=problem.split(fit.friction(fit.found)),
        deviance=fit.least,
        points=problem.places.x_m.size,
    )


def unfitted_rig(
    binned: Sequence[rig_model.BinnedPass], nominal: rig_model.RigProperties, reason: str
) -> RigFit:
    """Return the nominal rig, and for that reason no estimate: no model predicts the passes.

    Their noise is that about each pass, smoothed over a few bins.
    """
    means = tuple(_smoothed(one.mu) for one in binned)
    noise = rig_model.fitted_noise(binned, means)
    white = [
        rig_model.whitened(noise.factor(one, mean), one.mu - mean)
        for one, mean in zip(binned, means, strict=True)
    ]
    return RigFit(
        rig=nominal,
        estimates=dict.fromkeys(rig_model.PROPERTIES, NotEstimable(reason)),
        noise=noise,
        means=means,
        deviance=sum(float(part @ part) for part in white),
        points=sum(part.size for part in white),
    )


_SMOOTH_BINS = 7


def _smoothed(mu: FloatArray) -> FloatArray:
    weights = np.ones(min(_SMOOTH_BINS, mu.size))
    total = np.convolve(mu, weights, "same")
    return np.asarray(total / np.convolve(np.ones(mu.size), weights, "same"))


@dataclass(frozen=True, eq=False)
class _Problem:
    binned: tuple[rig_model.BinnedPass, ...]
    nominal: rig_model.RigProperties

    def rig(self, found: FloatArray) -> rig_model.RigProperties:
        return rig_model.rig_at(found, self.nominal.surface)

    @cached_property
    def limits(self) -> Mapping[str, float]:
        """The largest standard error of each property that counts as determined."""
        limits = {name: limit for name, (limit, _) in _BOUNDS.items()}
        return limits | {PATCHES: limits[PATCHES] * half_wave_ratio(self.nominal.surface)}

    @cached_property
    def reach(self) -> Mapping[str, float]:
        """How far each property is searched; of the patches, as far as they stay on the beam."""
        surface = self.nominal.surface
        reach = {name: reach for name, (_, reach) in _BOUNDS.items()}
        patches = surface.structure.beam.patches
        left_m = min(patch.start_m for patch in patches)
        right_m = surface.length_m - max(patch.end_m for patch in patches)
        room_m = min(left_m, right_m) - rig_model.PATCH_STEP_M
        return reach | {PATCHES: min(reach[PATCHES] * half_wave_ratio(surface), room_m)}

    @cached_property
    def places(self) -> rig_model.Places:
        settings, x_m = zip(*((one.setting, one.x_m) for one in self.binned), strict=True)
        return rig_model.Places.along(settings, x_m, [one.spread_m for one in self.binned])

    def split(self, values: FloatArray) -> tuple[FloatArray, ...]:
        ends = np.cumsum([one.x_m.size for one in self.binned])[:-1]
        return tuple(np.split(values, ends))


_PATCH = rig_model.PROPERTIES.index(PATCHES)


@dataclass(frozen=True, eq=False)
class _Fit:
    """A least-squares problem under one noise, and its best coordinates so far.

    Friction is linear in the patches' place about `found`: each step of it would need new modes.
    `means` is the friction to which jitter is taken in proportion, by pass; `found` has the
    coordinates of all properties, and `free` the names of those that are fitted.
    """

    problem: _Problem
    noise: rig_model.Noise
    means: tuple[FloatArray, ...]
    found: FloatArray
    free: tuple[str, ...]

    @cached_property
    def which(self) -> list[int]:
        return [rig_model.PROPERTIES.index(name) for name in self.free]

    @cached_property
    def factors(self) -> tuple[FloatArray, ...]:
        pairs = zip(self.problem.binned, self.means, strict=True)
        return tuple(self.noise.factor(one, mean) for one, mean in pairs)

    def white(self, values: FloatArray) -> FloatArray:
        """Return values in units in which their noise is independent."""
        parts = zip(self.factors, self.problem.split(values), strict=True)
        return np.concatenate([rig_model.whitened(factor, part) for factor, part in parts])

    @cached_property
    def seen(self) -> FloatArray:
        return self.white(np.concatenate([one.mu for one in self.problem.binned]))

    @cached_property
    def patch_slope(self) -> FloatArray:
        surface = self.problem.nominal.surface
        return np.asarray(slopes(self.problem.places, self.found, [PATCHES], surface)[:, 0])

    def here(self, at: FloatArray) -> FloatArray:
        """Return coordinates with the patches where those of `found` are."""
        here = at.copy()
        here[_PATCH] = self.found[_PATCH]
        return here

    def friction(self, at: FloatArray) -> FloatArray:
        rig = self.problem.rig(self.here(at))
        friction = rig_model.friction_along(self.problem.places, [rig])[0]
        step = at[_PATCH] - self.found[_PATCH]
        return np.asarray(friction + step * self.patch_slope if step else friction)

    def residual(self, at: FloatArray) -> FloatArray:
        return self.white(self.friction(at)) - self.seen

    def slopes(self, at: FloatArray) -> FloatArray:
        """Return the derivatives of the residuals by the free coordinates."""
        tuned = [name for name in self.free if name != PATCHES]
        found = slopes(self.problem.places, self.here(at), tuned, self.problem.nominal.surface)
        # The patches' place is the last of the properties.
        own = [self.patch_slope] if PATCHES in self.free else []
        return self.white(np.column_stack([found, *own]))

    def whole(self, part: FloatArray) -> FloatArray:
        """Return all coordinates from the free ones."""
        found = self.found.copy()
        found[self.which] = part
        return found

    def best(self) -> "_Fit":
        """Return the fit at the least-squares coordinates."""
        if not self.free:
            return self
        middle = rig_model.coordinates(self.problem.nominal)[self.which]
        reach = np.array([self.problem.reach[name] for name in self.free])

        def residual(part: FloatArray) -> FloatArray:
            return self.residual(self.whole(part))

        def slope(part: FloatArray) -> FloatArray:
            return self.slopes(self.whole(part))

        solved = least_squares(
            residual,
            np.clip(self.found[self.which], middle - 0.99 * reach, middle + 0.99 * reach),
            jac=slope,
            bounds=(middle - reach, middle + reach),
            x_scale=np.array([0.1 * self.problem.limits[name] for name in self.free]),
            xtol=1e-6,
            ftol=1e-6,
            max_nfev=_EVALUATIONS,
        )
        return replace(self, found=self.whole(np.asarray(solved.x)))

    def kept(self, given_up: dict[str, NotEstimable]) -> "_Fit":
        """Return the fit of what the passes determine; put the other reasons into `given_up`."""
        if not self.free:
            return self
        fit, slope = self, self.slopes(self.found)
        while fit.free:
            # (7), mathematics/sliding
            size = np.linalg.norm(slope, axis=0)
            scaled = slope / np.where(size > 0, size, 1.0)
            inverse = np.linalg.inv(scaled.T @ scaled + _RIDGE * np.eye(len(fit.free)))
            error = np.sqrt(np.diag(inverse)) / np.where(size > 0, size, 1e-12)
            excess = error / [fit.problem.limits[name] for name in fit.free]
            worst = int(np.argmax(excess))
            if excess[worst] <= 1:
                break
            name = fit.free[worst]
            given_up[name] = fit.reason(name, float(error[worst]), inverse)
            fit, slope = fit.without([name]), np.delete(slope, worst, axis=1)
        return fit

    def without(self, names: Collection[str]) -> "_Fit":
        """Return the fit in which these properties have their nominal values."""
        given_up = [rig_model.PROPERTIES.index(name) for name in names]
        found = self.found.copy()
        found[given_up] = rig_model.coordinates(self.problem.nominal)[given_up]
        free = tuple(name for name in self.free if name not in names)
        return replace(self, found=found, free=free)

    def beyond(self) -> dict[str, NotEstimable]:
        """Return why the properties are not determined whose best value ends the search."""
        away = self.found - rig_model.coordinates(self.problem.nominal)
        best, beyond = self.problem.rig(self.found), dict[str, NotEstimable]()
        for name, number in zip(self.free, self.which, strict=True):
            if abs(away[number]) > _AT_THE_END * self.problem.reach[name]:
                end = f"the passes fit best where its search ends, at {getattr(best, name):.3g}"
                beyond[name] = NotEstimable(f"{end}: no such rig explains them")
        return beyond

    def reason(self, name: str, error: float, inverse: FloatArray) -> NotEstimable:
        """Return why a property with that standard error is not determined."""
        unit, factor = ("mm", 1e3) if name == PATCHES else ("%", 100.0)
        known = f"over 1000 {unit}" if factor * error > 1000 else f"{factor * error:.2g} {unit}"
        due = factor * self.problem.limits[name]
        text = f"its standard error would be {known}; {due:.3g} {unit} is due"
        if name == "damping_ratio":
            own_hz = self.problem.nominal.resonance_hz
            drives = [one.setting for one in self.problem.binned if one.setting.voltage_v > 0]
            off = (abs(one.frequency_hz / own_hz - 1) for one in drives)
            nearest = 100 * min(off, default=np.inf)
            text += f". The nearest drive is {nearest:.2g}% from the resonance"
            text += ", where friction hardly depends on the damping" if nearest > 1 else ""
        size = np.sqrt(np.diag(inverse))
        place = self.free.index(name)
        shared = np.abs(inverse[place]) / (size * size[place])
        shared[place] = 0.0
        if shared.size and shared.max() > _TRADED:
            text += f". It trades off against {self.free[int(np.argmax(shared))]}"
        return NotEstimable(text)

    @cached_property
    def tangent(self) -> FloatArray:
        """The residuals' derivatives at the best fit."""
        return self.slopes(self.found)

    @cached_property
    def covariance(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self.tangent.T @ self.tangent))

    @cached_property
    def least(self) -> float:
        residual = self.residual(self.found)
        return float(residual @ residual)

    @cached_property
    def rise(self) -> float:
        """The rise of the deviance at the ends of a 95% interval, (8) of mathematics/sliding."""
        spare = self.problem.places.x_m.size - len(self.free)
        return float(f_distribution.ppf(1 - LEVEL, 1, spare)) * max(1.0, self.least / spare)

    def estimate(self, name: str) -> Estimate:
        """Return a property with its profile interval: the others are at their best throughout."""
        place, number = self.free.index(name), rig_model.PROPERTIES.index(name)
        middle = float(self.found[number])
        width = float(np.sqrt(self.rise * self.covariance[place, place]))
        ends = [middle + self._end(name, sign * width) for sign in (-1, 1)]
        surface = self.problem.nominal.surface
        value, low, high = (rig_model.property_at(name, at, surface) for at in (middle, *ends))
        return Estimate(value=value, interval=(low, high))

    def _end(self, name: str, width: float) -> float:
        """Return how far from the best the deviance has risen, about `width`, within the search."""
        number, target = rig_model.PROPERTIES.index(name), float(np.sqrt(self.rise))
        off = rig_model.coordinates(self.problem.nominal)[number] - self.found[number]
        most = max(float(off + np.copysign(self.problem.reach[name], width)) / width, 1e-3)
        first = min(1.0, most) * width
        inner, outer = (0.0, 0.0), (first, self._rise(name, first))
        for _ in range(4):
            slope = (outer[1] - inner[1]) / (outer[0] - inner[0])
            if slope * width <= 0 or abs(outer[1] - target) < _NEAR * target:
                break
            step = (outer[0] + (target - outer[1]) / slope) / width
            inner, offset = outer, float(np.clip(step, min(0.2, most), min(4.0, most))) * width
            if offset == inner[0]:
                break
            outer = offset, self._rise(name, offset)
        return outer[0]

    def _rise(self, name: str, offset: float) -> float:
        """Return the root of the rise of the deviance with one property `offset` from the best."""
        place = self.free.index(name)
        # (9), mathematics/sliding
        part = offset * self.covariance[:, place] / self.covariance[place, place]
        at = self.whole(self.found[self.which] + part)
        fit = replace(self, found=at) if name == PATCHES else self
        pseudo = np.linalg.pinv(np.delete(self.tangent, place, axis=1))
        others, least = np.delete(self.which, place), np.inf
        for _ in range(3):
            residual = fit.residual(at)
            deviance = float(residual @ residual)
            if deviance >= least:
                break
            least, at = deviance, at.copy()
            at[others] -= pseudo @ residual
        return float(np.sqrt(max(least - self.least, 0.0)))
