"""The findings of a sliding experiment: curves, the fitted rig, and what passes cannot tell."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import Any

import numpy as np

from analysis.estimates import NotEstimable, plain
from analysis.report.drawing import Panel
from analysis.sliding.comparison import Mismatch, figure_panels, mismatches
from analysis.sliding.extremes import Extreme, extremes
from analysis.sliding.fit import Estimate, RigFit, fitted_rig
from analysis.sliding.passes import Course, Curve, Group, Pass, course, grouped, mean_curve
from analysis.sliding.rig_model import HALF_THICKNESS_M, RigProperties
from device.friction.scenes import Structure

UNITS: Mapping[str, tuple[str, float, str]] = {
    "friction_coefficient": ("friction coefficient at rest", 1.0, ""),
    "resonance_hz": ("resonance", 1.0, " Hz"),
    "damping_ratio": ("damping ratio", 1.0, ""),
    "gain": ("gain of the drive", 1.0, ""),
    "body_height_m": ("height of the bodies", 1e3, " mm"),
    "patch_centre_m": ("middle of the patches", 1e3, " mm"),
    "speed_ratio": ("speed over the measured one", 1.0, ""),
}
"""What each property is called, and its unit in print."""

_IN_WORDS = {
    "sliding_speed_m_s": "sliding speed",
    "body_mass_kg": "mass of the bodies",
    "sensor_gain": "gain of the force sensor",
}
ALWAYS_UNKNOWN: Mapping[str, str] = {
    "sliding_speed_m_s": (
        "friction depends on speed through (h/2 + h_c)/v alone. The speed that the position "
        "sensor shows is taken, and the height of the bodies follows; the speed over the "
        "measured one is the reverse"
    ),
    "body_mass_kg": "only its product with the gain counts; 0.01 kg per metre is taken",
    "sensor_gain": (
        "an error in the gain of the tangential force is an error in the friction coefficient, "
        "which no pass shows; its interval does not contain it"
    ),
}
"""What no sliding experiment of this kind tells, and why."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SlidingFindings:
    """What passes say about friction along the beam and about the rig.

    Attributes:
        session: which session the passes come from.
        data_sha256: digest of the passes.
        courses: passes by place.
        nominal: the paper's rig, with μ at rest and resonance as measured.
        fit: the rig that fits best.
    """

    session: str
    data_sha256: str
    courses: tuple[Course, ...]
    nominal: RigProperties
    fit: RigFit

    @cached_property
    def groups(self) -> list[Group]:
        """Repeated passes together."""
        return grouped(self.courses)

    @cached_property
    def curves(self) -> tuple[Curve, ...]:
        """Mean friction by place under each setting."""
        means = {id(one): mean for one, mean in zip(self.courses, self.fit.means, strict=True)}
        noise = self.fit.noise
        return tuple(
            mean_curve(group, [np.diag(noise.covariance(one, means[id(one)])) for one in group[1]])
            for group in self.groups
        )

    @cached_property
    def extremes(self) -> tuple[Extreme, ...]:
        """Troughs and peaks of each driven setting."""
        driven = [group for group in self.groups if group[0].voltage_v > 0]
        return tuple(
            found for group in driven for found in extremes(group, self.fit.rig, self.fit.noise)
        )

    @cached_property
    def mismatches(self) -> tuple[Mismatch, ...]:
        """Every law and rung against the curves."""
        return mismatches(self.curves, self.extremes, self.nominal, self.fit.rig)

    @property
    def panels(self) -> tuple[Panel, ...]:
        """Fig 16 redrawn."""
        return figure_panels(self.curves, self.nominal, self.fit.rig)

    @property
    def estimates(self) -> dict[str, Estimate | NotEstimable]:
        """Each property with its interval or the reason why it is not determined.

        `speed_ratio` is the speed over the measured one, were the bodies as high as the paper's
        model has them: friction tells only one of the two.
        """
        height = self.fit.estimates["body_height_m"]
        if isinstance(height, NotEstimable):
            return {**self.fit.estimates, "speed_ratio": height}
        value, high, low = map(_speed_ratio, (height.value, *height.interval))
        return {**self.fit.estimates, "speed_ratio": Estimate(value=value, interval=(low, high))}

    def record(self) -> dict[str, Any]:
        """Return all numbers as JSON values."""
        return {
            "session": self.session,
            "data_sha256": self.data_sha256,
            "passes": len(self.courses),
            "estimates": plain(self.estimates),
            "cannot_tell": dict(ALWAYS_UNKNOWN),
            "noise": plain(self.fit.noise),
            "deviance_per_point": self.fit.deviance / self.fit.points,
            "extremes": plain(self.extremes),
            "mismatches": plain(self.mismatches),
            "curves": plain(self.curves),
        }

    def calibration_record(self) -> dict[str, Any]:
        """Return what is kept as the rig's calibration: value, low and high of each property."""
        found: dict[str, Any] = {"session": self.session, "data_sha256": self.data_sha256}
        for name, estimate in self.fit.estimates.items():
            if isinstance(estimate, Estimate):
                low, high = estimate.interval
                found[name] = {"value": estimate.value, "low": low, "high": high}
        return found

    def lines(self) -> list[list[str]]:
        """Return a header and a row per property, for a table in the terminal."""
        return [["property", "value", "95% interval"], *_rows(self.estimates)]

    def extreme_lines(self) -> list[list[str]]:
        """Return a header and a row per trough and peak."""
        header = ["drive, Hz", "direction", "kind", "place, mm", "95% interval", "fitted, mm"]
        return [header, *map(_extreme_row, self.extremes)]

    def mismatch_lines(self) -> list[list[str]]:
        """Return a header and a row per law, rung and rig."""
        header = ["law", "rung", "rig", "rms", "mean |difference|", "places, mm"]
        rows = [
            [
                one.law,
                one.rung,
                "fitted" if one.fitted else "paper's",
                f"{one.rms:.4f}",
                f"{one.mean_absolute:.4f}",
                f"{1e3 * one.places_m:.2f}",
            ]
            for one in self.mismatches
        ]
        return [header, *rows]


def _speed_ratio(body_height_m: float) -> float:
    nominal_m = HALF_THICKNESS_M + Structure().body_height_m
    return nominal_m / (HALF_THICKNESS_M + body_height_m)


def _rows(estimates: Mapping[str, Estimate | NotEstimable]) -> list[list[str]]:
    rows = []
    for name, found in estimates.items():
        label, factor, unit = UNITS[name]
        if isinstance(found, NotEstimable):
            rows.append([label, "not determined", found.reason])
            continue
        value, low, high = (f"{factor * number:.5g}" for number in (found.value, *found.interval))
        rows.append([label, value + unit, f"{low} to {high}{unit}"])
    return [
        *rows,
        *([_IN_WORDS[name], "not determined", why] for name, why in ALWAYS_UNKNOWN.items()),
    ]


def _extreme_row(one: Extreme) -> list[str]:
    own = one.setting
    row = [f"{own.frequency_hz:.0f}", own.direction, one.kind]
    if isinstance(one.place_m, NotEstimable) or one.interval_m is None:
        return [*row, "-", str(getattr(one.place_m, "reason", "")), f"{1e3 * one.expected_m:.2f}"]
    low, high = (f"{1e3 * end:.2f}" for end in one.interval_m)
    return [*row, f"{1e3 * one.place_m:.2f}", f"{low} to {high}", f"{1e3 * one.expected_m:.2f}"]


def data_digest(passes: Sequence[Pass]) -> str:
    """Return the SHA-256 of passes: their settings and every sample."""
    digest = sha256()
    for one in passes:
        numbers = one.voltage_v, one.frequency_hz, one.load_n, one.contact_m
        digest.update(f"{numbers} {one.direction} {one.t_s.size}".encode())
        for values in (one.t_s, one.x_m, one.mu):
            digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return digest.hexdigest()


def sliding_findings(
    passes: Sequence[Pass], resonance_hz: float, session: str
) -> SlidingFindings | NotEstimable:
    """Return the findings of passes on a rig whose resonance was measured.

    Without a pass with the output off, friction at rest is fitted from driven passes alone.
    """
    courses = tuple(course(one) for one in passes)
    mu = _mean_mu(courses, lambda one: one.setting.voltage_v == 0)
    if not any(one.setting.voltage_v > 0 for one in courses):
        return NotEstimable("no pass was driven")
    nominal = RigProperties(
        friction_coefficient=_mean_mu(courses, lambda _: True) if np.isnan(mu) else mu,
        resonance_hz=resonance_hz,
    )
    return SlidingFindings(
        session=session,
        data_sha256=data_digest(passes),
        courses=courses,
        nominal=nominal,
        fit=fitted_rig(courses, nominal),
    )


def _mean_mu(courses: Sequence[Course], counts: Callable[[Course], bool]) -> float:
    """Return the mean friction of the passes that count; nan without one."""
    chosen = [one.mu.mean() for one in courses if counts(one)]
    return float(np.mean(chosen)) if chosen else float("nan")
