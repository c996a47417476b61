"""The findings of a sliding experiment: curves, the fitted rig, and what passes cannot tell."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from typing import Any, NamedTuple

import numpy as np

from analysis.estimates import Estimate, FloatArray, NotEstimable
from analysis.friction.recorded import decoded
from analysis.sliding import rig_model
from analysis.sliding.comparison import Extreme, Mismatch, extremes, mismatches
from analysis.sliding.fit import RigFit, fitted_rig, unfitted_rig
from device.friction.surfaces import PAPERS, BeamSurface, beam_surface
from protocol.errors import BadInput
from protocol.journal import events as journal
from protocol.journal.records import LIFTED_N, CommandedDrive, DamagedSamplesError, Recording
from protocol.journal.state import folded
from protocol.study.surface import Surface, SurfaceKind
from protocol.study.touch import Slide
from protocol.study_file.loading import parsed_study

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

ALWAYS_UNKNOWN: Mapping[str, tuple[str, str]] = {
    "sliding_speed_m_s": (
        "sliding speed",
        "friction depends on speed through (h/2 + h_c)/v alone. The speed that the position "
        "sensor shows is taken, and the height of the bodies follows; the speed over the "
        "measured one is the reverse",
    ),
    "body_mass_kg": (
        "mass of the bodies",
        "only its product with the gain counts; 0.01 kg per metre is taken",
    ),
    "sensor_gain": (
        "gain of the force sensor",
        "an error in the gain of the tangential force is an error in the friction coefficient, "
        "which no pass shows; its interval does not contain it",
    ),
}
"""What no sliding experiment of this kind tells: what it is called, and why."""

WITHOUT_MODEL: Mapping[SurfaceKind, str] = {
    "measured": "friction on this surface comes from a table: only the resonance is calibrated",
    "given": "no model predicts friction on this surface: nothing is fitted or calibrated",
}
"""Why no rig is fitted to passes on a surface of that kind."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SlidingFindings:
    """What passes say about friction along the beam and about the rig.

    `session` is the one that the passes come from, `data_sha256` their digest; `binned` are passes
    by place, and `nominal` is the rig as described, with μ at rest and resonance as measured.
    `reason` is why no rig was fitted, empty if one was.
    """

    session: str
    data_sha256: str
    binned: tuple[rig_model.BinnedPass, ...]
    nominal: rig_model.RigProperties
    fit: RigFit
    reason: str = ""

    @cached_property
    def repeats(self) -> list[rig_model.Repeats]:
        """Repeated passes together."""
        return rig_model.grouped(self.binned)

    @cached_property
    def curves(self) -> tuple[rig_model.MeanCurve, ...]:
        """Mean friction by place under each setting."""
        return tuple(self.curve_of(each) for each in self.repeats)

    def curve_of(self, repeats: rig_model.Repeats) -> rig_model.MeanCurve:
        """Return the mean friction by place of some of these passes."""
        means = {id(one): mean for one, mean in zip(self.binned, self.fit.means, strict=True)}
        covariance = self.fit.noise.covariance
        return rig_model.mean_curve(
            repeats, [np.diag(covariance(one, means[id(one)])) for one in repeats[1]]
        )

    @cached_property
    def extremes(self) -> tuple[Extreme, ...]:
        """Troughs and peaks of each driven setting."""
        if self.reason:
            return ()
        driven = [each for each in self.repeats if each[0].voltage_v > 0]
        return tuple(
            found for each in driven for found in extremes(each, self.fit.rig, self.fit.noise)
        )

    @cached_property
    def mismatches(self) -> tuple[Mismatch, ...]:
        """Every law and rung against the curves."""
        return (
            ()
            if self.reason
            else mismatches(self.curves, self.extremes, self.nominal, self.fit.rig)
        )

    @property
    def described(self) -> str:
        """Whose rig the nominal one is, in a table."""
        return "paper's" if self.nominal.is_papers else "study's"

    @property
    def estimates(self) -> dict[str, Estimate | NotEstimable]:
        """Each property with its interval or the reason why it is not determined.

        `speed_ratio` is the speed over the measured one, were the bodies as high as they are
        described: friction tells only one of the two.
        """
        height = self.fit.estimates["body_height_m"]
        if isinstance(height, NotEstimable):
            return {**self.fit.estimates, "speed_ratio": height}
        half_m = self.nominal.half_thickness_m
        nominal_m = half_m + self.nominal.body_height_m
        value, high, low = (
            nominal_m / (half_m + each) for each in (height.value, *height.interval)
        )
        return {**self.fit.estimates, "speed_ratio": Estimate(value=value, interval=(low, high))}

    def calibration_record(self) -> dict[str, Any]:
        """Return what is kept as the rig's calibration: value, low and high of each property.

        Without a fit it is the measured resonance alone.
        """
        found: dict[str, Any] = {"session": self.session, "data_sha256": self.data_sha256}
        if self.reason:
            return found | {"resonance_hz": {"value": self.nominal.resonance_hz}}
        for name, estimate in self.fit.estimates.items():
            if isinstance(estimate, Estimate):
                value, (low, high) = estimate.value, estimate.interval
                if name == "body_height_m":  # a lever shorter than half the beam is no height
                    value, low, high = (max(height_m, 0.0) for height_m in (value, low, high))
                found[name] = {"value": value, "low": low, "high": high}
        return found

    def lines(self) -> list[list[str]]:
        """Return a header and a row per property, for a table in the terminal."""
        rows = [["property", "value", "95% interval"]]
        for name, found in self.estimates.items():
            label, factor, unit = UNITS[name]
            if isinstance(found, NotEstimable):
                rows.append([label, "not determined", found.reason])
                continue
            numbers = (found.value, *found.interval)
            value, low, high = (f"{factor * number:.5g}" for number in numbers)
            rows.append([label, value + unit, f"{low} to {high}{unit}"])
        return [*rows, *([label, "not determined", why] for label, why in ALWAYS_UNKNOWN.values())]

    def extreme_lines(self) -> list[list[str]]:
        """Return a header and a row per trough and peak."""
        rows = [["drive, Hz", "direction", "kind", "place, mm", "95% interval", "fitted, mm"]]
        for one in self.extremes:
            place, interval = "-", str(getattr(one.place_m, "reason", ""))
            if isinstance(one.place_m, float) and one.interval_m:
                low, high = (f"{1e3 * end:.2f}" for end in one.interval_m)
                place, interval = f"{1e3 * one.place_m:.2f}", f"{low} to {high}"
            drive, direction = f"{one.setting.frequency_hz:.0f}", one.setting.direction
            rows.append(
                [drive, direction, one.kind, place, interval, f"{1e3 * one.expected_m:.2f}"]
            )
        return rows

    def mismatch_lines(self) -> list[list[str]]:
        """Return a header and a row per law, rung and rig."""
        rows = [["law", "rung", "rig", "rms", "mean |difference|", "places, mm"]]
        for one in self.mismatches:
            rig = "fitted" if one.fitted else self.described
            errors = f"{one.rmse:.4f}", f"{one.mean_absolute:.4f}", f"{1e3 * one.places_m:.2f}"
            rows.append([one.law, one.rung, rig, *errors])
        return rows


def data_digest(passes: Sequence[rig_model.Pass]) -> str:
    """Return the SHA-256 of passes: their settings and every sample."""
    digest = sha256()
    for one in passes:
        numbers = one.voltage_v, one.frequency_hz, one.load_n, one.contact_m
        digest.update(f"{numbers} {one.direction} {one.t_s.size}".encode())
        for values in (one.t_s, one.x_m, one.mu):
            digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return digest.hexdigest()


def sliding_findings(
    passes: Sequence[rig_model.Pass],
    resonance_hz: float,
    session: str,
    surface: BeamSurface = PAPERS,
    reason: str = "",
) -> SlidingFindings | NotEstimable:
    """Return the findings of passes on a beam whose resonance was measured.

    With a `reason` why no model predicts their friction no rig is fitted.

    Without a pass with the output off, friction at rest is fitted from driven passes alone.
    """
    binned = tuple(rig_model.binned_pass(one) for one in passes)
    if not any(one.setting.voltage_v > 0 for one in binned):
        return NotEstimable("no pass was driven")
    at_rest = [one for one in binned if one.setting.voltage_v == 0] or binned
    mu = float(np.mean([one.mu.mean() for one in at_rest]))
    nominal = rig_model.RigProperties.nominal(
        surface, friction_coefficient=mu, resonance_hz=resonance_hz
    )
    return SlidingFindings(
        session=session,
        data_sha256=data_digest(passes),
        binned=binned,
        nominal=nominal,
        fit=unfitted_rig(binned, nominal, reason) if reason else fitted_rig(binned, nominal),
        reason=reason,
    )


# The passes of a sliding experiment as the journal has them, less what the analysis leaves out.

_LEAST_M = 6 * rig_model.BIN_M
_SMOOTH_S = 0.05


class Cell(NamedTuple):
    """What was planned of a pass; `frequency` is relative to the resonance, 0 without a drive."""

    voltage_v: float
    frequency: float
    direction: str
    speed_m_s: float

    @classmethod
    def of(cls, touch: Mapping[str, Any], resonance_hz: float) -> "Cell":
        """Return that of a planned touch, on a rig of that resonance."""
        fixed_hz = touch.get("frequency_hz")
        frequency = touch.get("frequency", 1.0) if fixed_hz is None else fixed_hz / resonance_hz
        left_m, right_m = touch["path_m"]
        return cls(
            voltage_v=float(touch["voltage_v"]),
            frequency=round(float(frequency), 6) if touch["voltage_v"] else 0.0,
            direction=str(touch["direction"]),
            speed_m_s=round((right_m - left_m) / touch["duration_s"], 9),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedPass:
    """A pass with what tells it from the others; `drive` is its name in the plan."""

    index: int
    drive: str
    cell: Cell
    made: rig_model.Pass


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnSession:
    """A sliding experiment: its passes, and the rig on which they were made.

    `session` is what people call it, `planned` what the plan has of each pass. `passes` are those
    that count, in the order in which they were made; `left_out` has number and reason of the others
    that were made. `resonance` is the last that was measured, `idn` the device's answer to `*IDN?`,
    `surface` what the block was drawn over.
    """

    session: str
    rehearsal: bool
    planned: tuple[Cell, ...]
    passes: tuple[PlannedPass, ...]
    left_out: tuple[tuple[int, str], ...]
    resonance: journal.ResonanceMeasured
    idn: str
    surface: Surface = field(default_factory=Surface)

    def findings(self) -> SlidingFindings | NotEstimable:
        """Return the findings of the passes that count."""
        reason = WITHOUT_MODEL.get(self.surface.kind, "")
        surface = PAPERS if reason else beam_surface(self.surface)
        passes = [each.made for each in self.passes]
        return sliding_findings(passes, self.resonance.frequency_hz, self.session, surface, reason)


def drawn_session(events: Sequence[journal.StoredEvent]) -> DrawnSession:
    """Return the sliding experiment whose events these are.

    A pass without a zero of its own has the last one before it.

    Raises:
        BadInput: no pass has been made.
    """
    excluded = folded(events).excluded
    records = [event.record for event in events]
    opened = records[0]
    assert isinstance(opened, journal.SessionOpened), "the first event of every session"
    planned = {trial.index: trial for trial in opened.trials}
    texts = [each.study_text for each in records if isinstance(each, journal.SessionTerms)]
    # The study as it was when the session began or was last resumed.
    assert texts[-1] is not None, "every build that slides records the study"
    study = parsed_study(texts[-1])
    resonances = [record for record in records if isinstance(record, journal.ResonanceMeasured)]
    found, left_out = [], []
    for attempt in _attempts(records):
        index = attempt.number
        made = _pass(attempt, study.slide, str(planned[index].touches[0]["direction"]))
        if why := excluded.get(index, made if isinstance(made, str) else None):
            left_out.append((index, why))
        elif isinstance(made, rig_model.Pass):
            found.append((index, str(planned[index].condition), made))
    armed = [record for record in records if isinstance(record, journal.DeviceArmed)]
    if not found or not resonances:
        raise BadInput(f"slide/{opened.session}: no pass has been made that counts")
    resonance_hz = resonances[-1].frequency_hz
    cells = {at: Cell.of(trial.touches[0], resonance_hz) for at, trial in planned.items()}
    return DrawnSession(
        session=f"{opened.participant}/{opened.session}",
        rehearsal=opened.kind == "rehearsal",
        planned=tuple(cells.values()),
        passes=tuple(
            PlannedPass(index=index, drive=drive, cell=cells[index], made=made)
            for index, drive, made in found
        ),
        left_out=tuple(left_out),
        resonance=resonances[-1],
        idn=armed[-1].idn if armed else "",
        surface=study.surface,
    )


class _Attempt(NamedTuple):
    number: int
    commanded: CommandedDrive | None
    recorded: Recording | None
    zero: tuple[float, float]


def _attempts(records: Sequence[object]) -> Iterator[_Attempt]:
    """Yield every pass that was made to its end, with its zero or the last one before it."""
    index, commanded, recorded, zero = -1, None, None, (0.0, 0.0)
    for record in records:
        match record:
            case journal.TrialStarted():
                index, commanded, recorded = record.index, None, None
            case journal.TouchStarted():
                commanded = record.commanded
            case journal.TouchRecorded():
                recorded = record
                if record.tare_n is not None:
                    zero = record.tare_n[0], record.tare_n[1]
            case journal.Answered():
                yield _Attempt(index, commanded, recorded, zero)


def _pass(attempt: _Attempt, slide: Slide, direction: str) -> rig_model.Pass | str:
    """Return the pass while the mark moved and the block was on the beam, or why there is none."""
    _, commanded, recorded, zero = attempt
    if recorded is None or commanded is None:
        return "nothing was recorded"
    try:
        t_s, _, (tangential_n, normal_n, x_m) = decoded(recorded, zero)
    except DamagedSamplesError as error:
        return str(error)
    began_s, over_s = recorded.moved_s
    chosen = (t_s >= began_s) & (t_s <= over_s) & (normal_n > LIFTED_N)
    if chosen.sum() < recorded.rate_hz * (over_s - began_s) / 2:
        return "the block was not on the beam"
    if np.ptp(x_m[chosen]) < _LEAST_M:
        return "the block did not move"
    way_m = _smooth(x_m[chosen] if direction == "right" else -x_m[chosen], recorded.rate_hz)
    if (np.maximum.accumulate(way_m) - way_m).max() > _LEAST_M:
        return "the block went back"
    chosen = np.flatnonzero(chosen)[_moving(way_m)]
    return rig_model.Pass(
        voltage_v=commanded.voltage_v,
        frequency_hz=commanded.frequency_hz,
        direction="left" if direction == "left" else "right",
        load_n=slide.load_n,
        contact_m=slide.contact_m,
        t_s=t_s[chosen],
        x_m=x_m[chosen],
        mu=tangential_n[chosen] / normal_n[chosen],
    )


def _smooth(way_m: FloatArray, rate_hz: float) -> FloatArray:
    """Return means over `_SMOOTH_S`, so that the sensor's noise is no movement."""
    length = max(round(_SMOOTH_S * rate_hz), 1)
    padded_m = np.pad(way_m, length, mode="edge")
    smooth_m = np.convolve(padded_m, np.ones(length) / length, "same")
    return np.asarray(smooth_m[length:-length])


def _moving(way_m: FloatArray) -> slice:
    """Return the part of a pass in which the block moves: a hand begins late and ends early.

    A block at rest has another friction, and hundreds of samples at one place.
    """
    begun = np.flatnonzero(way_m < way_m.min() + rig_model.BIN_M)[-1]
    over = np.flatnonzero(way_m > way_m.max() - rig_model.BIN_M)[0]
    return slice(int(begun), int(over))
