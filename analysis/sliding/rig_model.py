"""Friction along the passes as the rig's unknown properties determine it.

The friction law is `consistent` on the rung `beam`, to 1e-5 in μ'. Frequencies enter relative to
the resonance, as in every prediction for a trial: what makes a real resonance differ from the
model's is not known.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import minimize

from analysis.estimates import FloatArray
from device.beam.beam import Beam
from device.friction import rungs
from device.friction.changes import LAW, RUNG
from device.friction.contact import Contact
from device.friction.fineness import fineness_for
from device.friction.laws import ContactTerms, law_by_name
from device.friction.prediction import Batch, drive_terms
from device.friction.scenes import Direction
from device.friction.surfaces import PAPERS, BeamSurface

# Passes of a block along the beam, and their friction by place.
#
# Half millimetres are narrow beside the block and wide beside the noise of the position sensor.

BIN_M = 0.5e-3
_LEAST_SHARE = 0.5
"""Bins at the ends of the path with fewer samples than this share of the median are left out."""
_SAME_SPEED = 1.2
"""Passes of which none is faster than this multiple of the slowest share a curve: no hand is
steadier."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawn:
    """How a block is drawn along the beam: amplitude and frequency of the drive, and the block.

    `voltage_v` is 0 with the output off, `load_n` the block's weight, and `contact_m` the length of
    beam under it.
    """

    voltage_v: float
    frequency_hz: float
    direction: Direction
    load_n: float
    contact_m: float


_DRAWN = tuple(entry.name for entry in fields(Drawn))


@dataclass(frozen=True, kw_only=True, eq=False)
class Pass(Drawn):
    """One drawing of the block along the beam, while it moved; arrays of shape (samples,).

    `t_s` rises, `x_m` is the right edge of the block, and `mu` the tangential over the normal
    force, after the tare.
    """

    t_s: FloatArray
    x_m: FloatArray
    mu: FloatArray


@dataclass(frozen=True, kw_only=True)
class Setting(Drawn):
    """What passes have in common; `speed_m_s` is measured: the slope of place against time."""

    speed_m_s: float


@dataclass(frozen=True, kw_only=True, eq=False)
class BinnedPass:
    """A pass by place: means over bins of half a millimetre, each of shape (bins,).

    `bin` is the number of each bin, counted from the clamp; `x_m`, `t_s` (from the beginning of the
    pass) and `mu` are means of its `count` samples. `spread_m` is the standard deviation of the
    block's true places in one bin: the bin's width, and the noise of the position sensor.
    """

    setting: Setting
    bin: FloatArray
    x_m: FloatArray
    t_s: FloatArray
    mu: FloatArray
    count: FloatArray
    spacing_s: float
    spread_m: float


def binned_pass(made: Pass) -> BinnedPass:
    """Return a pass by place.

    Raises:
        ValueError: it has fewer than two samples, or the block did not move.
    """
    if made.x_m.size < 2 or np.ptp(made.x_m) < 2 * BIN_M:
        raise ValueError(f"a pass must move by more than 1 mm, got {made.x_m.size} samples")
    number = np.floor(made.x_m / BIN_M).astype(np.intp)
    count = np.bincount(number).astype(np.float64)
    kept = np.flatnonzero(count >= max(1.0, _LEAST_SHARE * float(np.median(count[count > 0]))))
    t_s = made.t_s - made.t_s[0]
    x_m, time_s, mu = (
        np.bincount(number, weights=values)[kept] / count[kept]
        for values in (made.x_m, t_s, made.mu)
    )
    speed_m_s = abs(float(np.polyfit(t_s, made.x_m, 1)[0]))
    setting = Setting(**{name: getattr(made, name) for name in _DRAWN}, speed_m_s=speed_m_s)
    return BinnedPass(
        setting=setting,
        bin=kept.astype(np.float64),
        x_m=x_m,
        t_s=time_s,
        mu=mu,
        count=count[kept],
        spacing_s=float(t_s[-1]) / (made.t_s.size - 1),
        # No block shakes by a tenth of a millimetre in a millisecond: that is the sensor's noise.
        spread_m=float(np.sqrt(BIN_M**2 / 12 + np.var(np.diff(made.x_m, 2)) / 6)),
    )


Repeats: TypeAlias = tuple[Setting, tuple[BinnedPass, ...]]
"""Passes that share a curve, and the setting of the slowest."""


def grouped(binned: Iterable[BinnedPass]) -> list[Repeats]:
    """Return repeated passes together."""

    def key(one: BinnedPass) -> tuple[Any, ...]:
        return tuple(getattr(one.setting, name) for name in _DRAWN)

    groups: list[list[BinnedPass]] = []
    for one in sorted(binned, key=lambda one: (*key(one), one.setting.speed_m_s)):
        first = groups[-1][0] if groups else None
        most_m_s = _SAME_SPEED * first.setting.speed_m_s if first else 0.0
        if first and key(first) == key(one) and one.setting.speed_m_s <= most_m_s:
            groups[-1].append(one)
        else:
            groups.append([one])
    return [(group[0].setting, tuple(group)) for group in groups]


@dataclass(frozen=True, kw_only=True, eq=False)
class MeanCurve:
    """Friction by place over repeated passes, shape (places,), with its standard error."""

    setting: Setting
    passes: int
    x_m: FloatArray
    mu: FloatArray
    error: FloatArray


def mean_curve(repeats: Repeats, variances: Sequence[FloatArray]) -> MeanCurve:
    """Return the mean of repeated passes, each bin weighted by the inverse of its variance.

    `variances` are those of the bins of each pass.
    """
    setting, binned = repeats
    number, *by_bin = (
        np.concatenate([getattr(one, name) for one in binned]) for name in ("bin", "x_m", "mu")
    )
    weight = 1 / np.concatenate(list(variances))
    place = np.unique(number, return_inverse=True)[1]
    total = np.bincount(place, weights=weight)
    x_m, mu = (np.bincount(place, weights=weight * values) / total for values in by_bin)
    return MeanCurve(
        setting=setting, passes=len(binned), x_m=x_m, mu=mu, error=np.asarray(total**-0.5)
    )


_STRUCTURE = PAPERS.structure


@dataclass(frozen=True, kw_only=True)
class RigProperties:
    """What a fit determines of a rig with that `surface`; by default the paper's values.

    `friction_coefficient` is μ with the output off, `damping_ratio` ζ, `resonance_hz` of the mode
    that is driven, `gain` in volts at the beam per volt of the drive, `patch_centre_m` the middle
    of the first patch, with which the others move.
    """

    friction_coefficient: float
    resonance_hz: float
    damping_ratio: float = _STRUCTURE.beam.damping_ratio
    gain: float = 1.0
    body_height_m: float = _STRUCTURE.body_height_m
    patch_centre_m: float = _STRUCTURE.beam.patches[0].centre_m
    surface: BeamSurface = PAPERS

    @classmethod
    def nominal(
        cls, surface: BeamSurface, *, friction_coefficient: float, resonance_hz: float
    ) -> "RigProperties":
        """Return the rig as its surface is described, with friction and resonance as measured."""
        return cls(
            friction_coefficient=friction_coefficient,
            resonance_hz=resonance_hz,
            damping_ratio=surface.structure.beam.damping_ratio,
            body_height_m=surface.structure.body_height_m,
            patch_centre_m=surface.structure.beam.patches[0].centre_m,
            surface=surface,
        )

    def beam(self) -> Beam:
        """Return the beam with this damping and these patches."""
        described = self.surface.structure.beam
        first_m = described.patches[0].centre_m
        patches = tuple(
            replace(patch, centre_m=self.patch_centre_m + (patch.centre_m - first_m))
            for patch in described.patches
        )
        return replace(described, damping_ratio=self.damping_ratio, patches=patches)

    @property
    def is_papers(self) -> bool:
        """Whether its beam is described as the paper's."""
        return self.surface.structure.beam == _STRUCTURE.beam

    @property
    def half_thickness_m(self) -> float:
        return self.surface.structure.beam.thickness_m / 2


@lru_cache(maxsize=16)
def half_wave_ratio(surface: BeamSurface) -> float:
    """Return half a wave over the paper's: friction turns at distances in proportion."""
    return surface.half_wave_m / PAPERS.half_wave_m


PROPERTIES = tuple(entry.name for entry in fields(RigProperties) if entry.name != "surface")
PATCHES = "patch_centre_m"
"""The one property that changes the modes, which cost most."""


def coordinates(rig: RigProperties) -> FloatArray:
    """Return the properties as a fit varies them: as logarithms, but the patches' place, m.

    The body height counts from the beam's middle, where the tip's lever begins.
    """
    found = vars(rig) | {"body_height_m": rig.body_height_m + rig.half_thickness_m}
    return np.array([found[it] if it == PATCHES else np.log(found[it]) for it in PROPERTIES])


def property_at(name: str, coordinate: float, surface: BeamSurface) -> float:
    if name == PATCHES:
        return float(coordinate)
    half_m = surface.structure.beam.thickness_m / 2
    return float(np.exp(coordinate)) - half_m * (name == "body_height_m")


def rig_at(found: FloatArray, surface: BeamSurface = PAPERS) -> RigProperties:
    values = zip(PROPERTIES, found.tolist(), strict=True)
    at = {name: property_at(name, value, surface) for name, value in values}
    return RigProperties(**at, surface=surface)


@lru_cache(maxsize=64)
def _resonance_hz(beam: Beam, mode: int) -> float:
    return rungs.rung_resonance_hz(RUNG, beam, mode)


NODES = np.sqrt(3.0) * np.array([-1.0, 0.0, 1.0])
_WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6
"""Gauss and Hermite's rule of three points for a mean over a normal spread."""
_LEAST_M = 1e-5
_FINENESS = fineness_for(1e-5)


@dataclass(frozen=True, kw_only=True, eq=False)
class Places:
    """Places under given settings, one after the other; `of` is the setting of each place.

    Friction at a place is its mean over places about it that have the standard deviation
    `spread_m`: a bin's mean rounds the corners of the curve.
    """

    settings: tuple[Setting, ...]
    of: NDArray[np.intp]
    x_m: FloatArray
    spread_m: FloatArray

    @classmethod
    def along(
        cls, settings: Sequence[Setting], x_m: Sequence[FloatArray], spread_m: Sequence[float] = ()
    ) -> "Places":
        """Return places of each setting, with the spread of each setting if there is any."""
        of = np.repeat(np.arange(len(settings)), [each.size for each in x_m])
        spread = np.array(spread_m)[of] if spread_m else np.zeros(of.size)
        return cls(settings=tuple(settings), of=of, x_m=np.concatenate(list(x_m)), spread_m=spread)


def friction_along(places: Places, rigs: Sequence[RigProperties]) -> FloatArray:
    """Return μ' at the places for rigs that share surface and patches, shape (rigs, places).

    The motion is summed once for all rigs that differ in resonance or damping.
    """
    if places.spread_m.any():
        x_m = (places.x_m[:, None] + places.spread_m[:, None] * NODES).ravel()
        about = Places(
            settings=places.settings,
            of=np.repeat(places.of, NODES.size),
            x_m=np.clip(x_m, _LEAST_M, rigs[0].surface.length_m),
            spread_m=np.zeros(x_m.size),
        )
        return friction_along(about, rigs).reshape(len(rigs), -1, NODES.size) @ _WEIGHTS
    terms = _terms(places, rigs)
    half_m = rigs[0].half_thickness_m
    numbers = [(it.body_height_m + half_m, it.gain, it.friction_coefficient) for it in rigs]
    lever_m, gain, mu = np.array(numbers).T[..., None]
    # (2), mathematics/sliding
    tip = gain * (lever_m / (half_m + rigs[0].surface.structure.body_height_m))
    scaled = replace(
        terms,
        friction_coefficient=mu,
        relative_tip_speed=terms.relative_tip_speed * tip,
        inertial_ratio=terms.inertial_ratio * gain,
        printed_inertial_ratio=terms.printed_inertial_ratio * gain,
    )
    return np.broadcast_to(law_by_name(LAW)(scaled), (len(rigs), places.x_m.size))


def _terms(places: Places, rigs: Sequence[RigProperties]) -> ContactTerms:
    """Return the terms for a gain of 1 and the nominal body height, shape (rigs, places) each."""
    tuned, settings = [(rig.resonance_hz, rig.damping_ratio) for rig in rigs], places.settings
    known = sorted(set(tuned))
    row, size = [known.index(each) for each in tuned], len(known)

    def tiled(name: str) -> FloatArray:
        own = np.array([getattr(one, name) for one in settings], dtype=np.float64)
        return np.tile(own[places.of], size)

    surface = rigs[0].surface
    structure = surface.structure
    # Without the rigs' damping, so that all of them share its modes.
    beam = replace(rigs[0].beam(), damping_ratio=structure.beam.damping_ratio)
    scale = _resonance_hz(beam, surface.mode)
    frequency_hz = [one.frequency_hz * scale / own_hz for own_hz, _ in known for one in settings]
    damping = np.repeat([ratio for _, ratio in known], len(settings))
    drive = (len(settings) * np.arange(size)[:, None] + places.of).ravel()
    contact = Contact(
        beam=beam,
        coverage="local",
        direction="right",
        x_m=np.tile(places.x_m, size),
        contact_m=tiled("contact_m"),
        body_count=structure.body_count,
        body_mass_kg=structure.body_mass_kg,
        body_height_m=structure.body_height_m,
        body_load_n=1.0,
        finger_load_n=tiled("load_n"),
        sliding_speed_m_s=tiled("speed_m_s"),
        friction_coefficient=1.0,
        same_direction_fraction=None,
    )
    drives = np.array(frequency_hz), damping
    batch = Batch(
        contact=contact,
        mode=surface.mode,
        voltage_v=tiled("voltage_v"),
        frequency_hz=drives[0][drive],
        damping_ratio=drives[1][drive],
    )
    terms = drive_terms(batch, drives, drive, _FINENESS)
    shaped = {name: value.reshape(size, -1)[row] for name, value in vars(terms).items()}
    leftward = np.array([one.direction == "left" for one in settings])[places.of]
    right, left = shaped["same_direction"], shaped["opposing"]
    shaped["same_direction"] = np.where(leftward, left, right)
    shaped["opposing"] = np.where(leftward, right, left)
    return ContactTerms(**shaped)


PATCH_STEP_M = 0.25e-3
_STEPS = {"damping_ratio": 0.01, "resonance_hz": 1e-5, PATCHES: PATCH_STEP_M}
_PLAIN_STEP = 1e-4


def slopes(
    places: Places, found: FloatArray, names: Sequence[str], surface: BeamSurface = PAPERS
) -> FloatArray:
    """Return the derivatives of μ' by some coordinates, shape (places, names)."""
    step = {name: _STEPS.get(name, _PLAIN_STEP) for name in names}
    unit = dict(zip(PROPERTIES, np.eye(len(PROPERTIES)), strict=True))
    rigs = {
        name: [rig_at(found + sign * step[name] * unit[name], surface) for sign in (1, -1)]
        for name in names
    }
    # Rigs whose patches lie elsewhere share no modes with others.
    along = {PATCHES: [friction_along(places, [rig])[0] for rig in rigs.pop(PATCHES, [])]}
    if rigs:
        together = friction_along(places, [rig for both in rigs.values() for rig in both])
        along |= zip(rigs, together.reshape(len(rigs), 2, -1), strict=True)
    found = np.empty((places.x_m.size, len(names)))
    for place, name in enumerate(names):
        above, below = along[name]
        found[:, place] = (above - below) / (2 * step[name])
    return found


# The noise of friction along a pass: jitter that is correlated in time, sensor noise, and drift.
#
# The variance of a pass's bins about the true friction m is
#
#     m m' σ² e(|t - t'|) + diag(w²/n) + z² + d² t t'
#
# Stick-slip jitter is relative, with standard deviation σ and correlation e^{-|t|/τ}; e is its
# mean over the two bins. Sensor noise w is that of one sample of n. The force channel's zero is
# uncertain by z after the tare and drifts by d. A fit that ignored τ would claim intervals that
# are too narrow: neighbouring bins share their jitter.

ZERO_N = 1e-3
"""Standard error of the zero when the block begins to move: noise of the tare, and drift since."""
DRIFT_N_PER_S = 10e-3 / 60
"""Standard deviation of the zero's drift: 10 mN a minute."""
_LEAST_MU = 0.02
"""Least friction to which jitter is taken in proportion."""
_NOISE_STEPS = 200


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Jitter relative to friction, its correlation time, and sensor noise per sample, in μ."""

    jitter: float = 0.05
    correlation_s: float = 0.02
    sensor: float = 0.02

    def covariance(self, one: BinnedPass, mu: FloatArray) -> FloatArray:
        """Return the covariance of the bins of a pass about friction `mu`, shape (bins, bins)."""
        width = one.count * one.spacing_s / self.correlation_s
        # (5), mathematics/sliding: means of e^{-|t|} over a bin and over two bins that do not
        # overlap.
        within = 2 * (width + np.expm1(-width)) / width**2
        half = np.minimum(width, 40.0) / 2
        spread = np.sinh(half) / half
        apart = np.abs(one.t_s[:, None] - one.t_s) / self.correlation_s
        shared = np.exp(-apart) * spread[:, None] * spread
        np.fill_diagonal(shared, within)
        size = self.jitter * np.maximum(np.abs(mu), _LEAST_MU)
        load_n, t_s = one.setting.load_n, one.t_s
        found = np.minimum(shared, 1.0) * size[:, None] * size
        found += (ZERO_N / load_n) ** 2 + (DRIFT_N_PER_S / load_n) ** 2 * t_s[:, None] * t_s
        found[np.diag_indices_from(found)] += self.sensor**2 / one.count
        return np.asarray(found)

    def factor(self, one: BinnedPass, mu: FloatArray) -> FloatArray:
        """Return the lower Cholesky factor of `covariance`."""
        return np.asarray(cholesky(self.covariance(one, mu), lower=True, check_finite=False))


def whitened(factor: FloatArray, values: FloatArray) -> FloatArray:
    """Return values, shape (bins,) or (bins, k), in units in which their noise is independent."""
    return np.asarray(solve_triangular(factor, values, lower=True, check_finite=False))


def fitted_noise(binned: Sequence[BinnedPass], means: Sequence[FloatArray]) -> Noise:
    """Return the noise under which the passes are likeliest about their means.

    What a mean leaves unexplained counts as noise, correlated as it is.
    """

    def noise(logs: FloatArray) -> Noise:
        jitter, correlation_s, sensor = np.exp(np.clip(logs, -12.0, 2.0)).tolist()
        return Noise(jitter=jitter, correlation_s=correlation_s, sensor=sensor)

    def deviance(logs: FloatArray) -> float:
        total = 0.0
        for one, mean in zip(binned, means, strict=True):
            factor = noise(logs).factor(one, mean)
            residual = whitened(factor, one.mu - mean)
            total += float(residual @ residual) + 2 * float(np.log(np.diag(factor)).sum())
        return total

    nominal = Noise()
    start = np.log([nominal.jitter, nominal.correlation_s, nominal.sensor])
    found = minimize(
        deviance,
        start,
        method="Nelder-Mead",
        options={
            "maxfev": _NOISE_STEPS,
            "xatol": 0.02,
            "fatol": 0.05,
            "initial_simplex": np.vstack([start, start + 0.5 * np.eye(start.size)]),
        },
    )
    return noise(np.asarray(found.x))
