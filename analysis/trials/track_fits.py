"""Thresholds of people: the answers of each person in each track, fitted, and their cohort."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import bdtrc

from analysis.estimates import LEVEL, FloatArray, Interval, NotEstimable
from analysis.loading.study_data import StudyData
from analysis.statistics.detection import Detection, detection
from analysis.thresholds.answer_curve import Curve
from analysis.thresholds.psychometric import Mixed, Threshold, fitted, mixed
from analysis.trials import track_readings
from device.friction.calibration import Calibration
from device.friction.changes import friction_difference
from protocol.study.study import Study
from protocol.study.track import AXIS_KEY, AXIS_UNITS, GUESS_RATE, Track, decibels
from protocol.tracks.procedure import reversal_mean

NOT_AS_INSTRUCTED = 0.1
"""A larger share of touches that were not as instructed gets a note."""
CURVE_POINTS = 61
_THRESHOLDS = 162
"""Places between which the likelihood of thresholds is, for the cohort."""
STUCK = 0.5
"""So does a larger share of the second half of the answers at an end of the levels."""


@dataclass(frozen=True, kw_only=True)
class Course:
    """The answers of a person at levels that the method chose, in their order.

    `values` are levels on the axis; `sessions` their numbers.
    """

    values: tuple[float, ...]
    correct: tuple[bool, ...]
    reversal: tuple[bool, ...]
    sessions: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class PersonThreshold:
    """The threshold of a person in a track.

    Attributes:
        threshold: of the fit, on the axis, in its unit, with its 95% interval; NaN if it is not
            told, as all that would follow from it is None.
        reason: why it is not, such as "above 160 V", the last level.
        limit: that level.
        db: of a voltage, relative to 1 V or to that of the standard.
        contrast: of friction against the standard, predicted of the threshold: ln(mu / mu').
        weber: the Weber fraction, 1 - mu' / mu.
        felt: the measured friction of the person beside the predicted one; None if not recorded.
        measured: the threshold as a contrast of measured friction, ln(mu / mu'), with its interval.
        measured_weber: the Weber fraction of measured friction.
        reversal_mean: mean of the reversals made with the last step, another estimate.
        fit: of the curve; its threshold is a distance from the standard.
        points: distance from the standard, answers, and how many of them were right (yes).
        detection: of yes or no with catch trials: d' and criterion over all levels together.
        readings: the threshold by other choices of estimate, curve and lapse rate.
        flags: what to look at before this is believed.
    """

    participant: str
    track: str
    unit: str
    threshold: float
    threshold_interval: Interval
    reason: str | None
    limit: float | None
    db: float | None = None
    db_interval: Interval | None = None
    contrast: float | None = None
    contrast_interval: Interval | None = None
    weber: float | None = None
    weber_interval: Interval | None = None
    felt: track_readings.Felt | None
    measured: float | None = None
    measured_interval: Interval | None = None
    measured_weber: float | None = None
    measured_weber_interval: Interval | None = None
    reversals: int
    reversal_mean: float | None
    fit: Threshold
    points: tuple[tuple[float, int, int], ...]
    course: Course
    detection: Detection | NotEstimable | None
    readings: Mapping[track_readings.Choice, float]
    flags: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class CohortThreshold:
    """The geometric mean of people's thresholds in a track; `flagged` of them have flags.

    `said` is in words what a share `threshold_at` of the answers do at the threshold; `mixed` the
    same by a model with person effects; `measured` that of contrasts of measured friction.
    """

    track: str
    unit: str
    threshold_at: float
    said: str
    people: int
    flagged: int
    threshold: float | NotEstimable
    threshold_interval: Interval | NotEstimable
    mixed: Mixed | NotEstimable
    weber: float | NotEstimable
    weber_interval: Interval | NotEstimable
    weber_of: str


@dataclass(frozen=True, kw_only=True)
class Thresholds:
    """The thresholds of a study with tracks, track by track; `readings` by other choices."""

    people: tuple[PersonThreshold, ...]
    cohort: tuple[CohortThreshold, ...]
    readings: tuple[track_readings.CohortReading, ...]


def thresholds(
    study: Study,
    data: StudyData,
    rig: Calibration,
    friction: Mapping[int, float] | None = None,
) -> Thresholds | None:
    """Return the thresholds of all people; None where no trial that counts is of a track.

    `friction` has that of recorded touches, by their index.
    """
    trials = data.trials[data.trials["track"].notna()]
    # A track that the study file no longer has is in the tables alone.
    tracks = [track for track in study.track if trials["track"].eq(track.name).any()]
    if not tracks:
        return None
    people: list[PersonThreshold] = []
    read: list[track_readings.CohortReading] = []
    for track in tracks:
        own = trials[trials["track"].eq(track.name)]
        felt = partial(contrast_of_level, study, track, rig)
        for who in data.table.subjects:
            if len(mine := own[own["participant"].eq(who)]):
                touches = data.touches[data.touches["attempt_id"].isin(mine.index)]
                people.append(_person(track, who, mine, touches, felt, friction or {}))
        told = ((it.readings, felt, it.felt) for it in people if it.track == track.name)
        read += track_readings.cohort_readings(track, told)
    cohort = tuple(_cohort(track, people) for track in tracks)
    return Thresholds(people=tuple(people), cohort=cohort, readings=tuple(read))


def _person(
    track: Track,
    who: str,
    trials: pd.DataFrame,
    touches: pd.DataFrame,
    felt: Callable[..., Any],
    friction: Mapping[int, float],
) -> PersonThreshold:
    points = tuple(_points(track, trials))
    asked, number, right = zip(*points, strict=True) if points else ((), (), ())
    positive = [distance for distance in track.distances if distance > 0]
    options: dict[str, Any] = {
        "task": track.task,
        "threshold_at": track.share,
        "span": (positive[0], positive[-1]),
    }
    fit = fitted(
        asked,
        number,
        right,
        **options,
        shape=track.shape,
        band_at=curve_places(track),
        likelihood_at=_threshold_edges(track),
    )
    threshold, *ends = (track.on_axis(each) for each in (fit.threshold, *fit.threshold_ci))
    first, last = sorted(ends)
    reason, limit = fit.reason, None
    if reason is not None and reason.startswith(("above", "below")):
        reason, limit = _beyond(track, far=reason.startswith("above"))
    chosen = trials[trials["track_role"].eq("level")]
    turned = chosen["reversal"].eq(True).fillna(False).to_numpy(bool)
    turns = tuple(chosen["level"][turned].astype(int))
    mean = reversal_mean(track, turns) if track.turns else None
    contrasts = [felt(level) for level in (threshold, *ends)]
    known = fit.reason is None and all(each is not None for each in contrasts)
    follows = track_readings.felt_in(
        track, trials, touches, friction, lambda level: felt(track.values[level], signed=True)
    )
    values: dict[str, Any] = {}
    if track.axis == "voltage" and fit.reason is None:
        ratios = [each / (track.reference or 1.0) for each in (threshold, first, last)]
        db, low, high = (decibels(each) if each > 0 else float("nan") for each in ratios)
        values["db"] = db, (low, high)
    if known:
        values["contrast"] = contrasts[0], (contrasts[1], contrasts[2])
        values["weber"] = _weber_fractions(*values["contrast"])
    if known and follows is not None and contrasts[0]:
        values["measured"] = follows.contrast(contrasts[0], (contrasts[1], contrasts[2]))
        values["measured_weber"] = _weber_fractions(*values["measured"])
    return PersonThreshold(
        participant=who,
        track=track.name,
        unit=AXIS_UNITS[track.axis],
        threshold=threshold,
        threshold_interval=(first, last),
        reason=reason,
        limit=limit,
        **{name: value for name, (value, _) in values.items()},
        **{f"{name}_interval": interval for name, (_, interval) in values.items()},
        felt=follows,
        reversals=int(turned.sum()),
        reversal_mean=mean,
        fit=fit,
        points=points,
        course=Course(
            values=tuple(chosen["level_value"]),
            correct=tuple(chosen["correct"].astype(bool)),
            reversal=tuple(turned.tolist()),
            sessions=tuple(chosen["session"]),
        ),
        detection=_detection(trials) if track.intervals == 1 and track.catch else None,
        readings=dict(track_readings.readings(track, points, fit, options, mean)),
        flags=(*fit.flags, *_flags(track, trials, touches)),
    )


def _weber_fractions(contrast: float, ends: Sequence[float]) -> tuple[float, Interval]:
    low, high = (float(1 - np.exp(-each)) for each in ends)
    return float(1 - np.exp(-contrast)), (low, high)


def _detection(trials: pd.DataFrame) -> Detection | NotEstimable:
    """Return how well touches with a stimulus are told from catch trials, at all levels."""
    catch, yes = trials["track_role"].eq("catch"), trials["change"].eq("yes")
    hits, alarms = ([[int(yes[of].sum()), int(of.sum())]] for of in (~catch, catch))
    return detection(np.array(hits), np.array(alarms))


def _beyond(track: Track, *, far: bool) -> tuple[str, float]:
    """Return the level beyond which a threshold lies, in words, too: the easiest or the hardest."""
    distances = [distance for distance in track.distances if distance > 0]
    limit = track.on_axis(distances[-1] if far else distances[0])
    side = "above" if far == (track.values[-1] > track.reference) else "below"
    return f"{side} {limit:.4g} {AXIS_UNITS[track.axis]}".rstrip(), limit


def _points(track: Track, trials: pd.DataFrame) -> Iterator[tuple[float, int, int]]:
    """Yield each level as a distance from the standard, with its answers and the right ones.

    In yes or no a catch trial is at no distance; in intervals none of its answers is right.
    """
    right = trials["correct"]
    distance = trials["level"].map(dict(enumerate(track.distances)))
    if track.intervals == 1:
        right = trials["change"].eq("yes")
        distance = distance.fillna(0.0)
    known = distance.notna() & right.notna()
    counted = right[known].astype(bool).groupby(distance[known]).agg(["count", "sum"])
    for level, number, correct in counted.itertuples():
        yield float(level), int(number), int(correct)


def contrast_of_level(
    study: Study, track: Track, rig: Calibration, level: float, *, signed: bool = False
) -> float | None:
    """Return the predicted contrast of a level against the standard; None where none is known."""
    if track.axis == "contrast" and not signed:
        return level
    if track.standard is None or track.axis == "place" or not np.isfinite(level):
        return None
    # On the axis of contrast the largest voltage tells which of both touches is smoother.
    value = study.rig.max_voltage_v if track.axis == "contrast" else max(level, 0.0)
    comparison = track.comparison.model_copy(update={AXIS_KEY[track.axis]: value})
    found = friction_difference(study, track.standard, comparison, rig)
    if track.axis == "contrast":
        found = float(np.copysign(level, found))
    return found if signed else abs(found)


def _flags(track: Track, trials: pd.DataFrame, touches: pd.DataFrame) -> Iterator[str]:
    """Yield in a few words what in the course of a track speaks against its threshold."""
    levels = trials["level"][trials["track_role"].eq("level")].to_numpy()
    late = levels[len(levels) // 2 :]
    if track.method in {"staircase", "quest+"} and len(late):
        for end, name in ((0, "hardest"), (len(track.values) - 1, "easiest")):
            if (late == end).mean() > STUCK:
                yield f"stuck at the {name} level"
    if track.intervals > 1:
        chosen = trials["change"].value_counts()
        # Of all intervals the one that was named most often, by Bonferroni's correction.
        chance = bdtrc(chosen.max() - 1, chosen.sum(), 1 / track.intervals)
        if track.intervals * chance < LEVEL:
            yield f"the {chosen.idxmax()} touch was named in {chosen.max()} of {chosen.sum()}"
    judged = touches[["force_ok", "place_ok", "speed_ok"]].eq(False).fillna(False).any(axis=1)
    if len(judged) and judged.mean() > NOT_AS_INSTRUCTED:
        yield f"{judged.mean():.0%} of the touches were not as instructed"


def _cohort(track: Track, people: Sequence[PersonThreshold]) -> CohortThreshold:
    own = [each for each in people if each.track == track.name]
    measured = bool(own) and all(each.measured_weber is not None for each in own)
    name = "measured_weber" if measured else "weber"
    threshold, ends = _mean(own, "threshold")
    weber, weber_ends = _mean(own, name)
    return CohortThreshold(
        track=track.name,
        unit=AXIS_UNITS[track.axis],
        threshold_at=track.share,
        said="says yes" if track.intervals == 1 else "is right",
        people=sum(each.threshold > 0 for each in own),
        flagged=sum(bool(each.flags) for each in own),
        threshold=threshold,
        threshold_interval=ends,
        mixed=_mixed(track, own),
        weber=weber,
        weber_interval=weber_ends,
        weber_of="measured" if measured else "predicted",
    )


def _mean(
    people: Sequence[PersonThreshold], name: str
) -> tuple[float | NotEstimable, Interval | NotEstimable]:
    """Return the geometric mean of everybody; without those beyond the levels it would be wrong."""
    beyond = [each.reason for each in people if each.limit is not None]
    if not beyond:
        return mean_over_people([getattr(each, name) for each in people])
    where = " or ".join(sorted({str(reason) for reason in beyond}))
    lie = "lies" if len(beyond) == 1 else "lie"
    none = NotEstimable(f"{len(beyond)} of {len(people)} thresholds {lie} {where}")
    return none, none


def mean_over_people(
    values: Sequence[float | None],
) -> tuple[float | NotEstimable, Interval | NotEstimable]:
    """Return the geometric mean of what is known of people, with its t interval."""
    if len(logs := track_readings.logarithms(values)):
        return track_readings.geometric_mean(logs)
    none = NotEstimable("nobody's threshold could be estimated")
    return none, none


def _mixed(track: Track, own: Sequence[PersonThreshold]) -> Mixed | NotEstimable:
    """Return the cohort's threshold by a model with person effects, in the unit of the axis."""
    if track.reference:
        return NotEstimable("the model is of levels from 0")
    likelihoods = [each.fit.likelihood for each in own if each.fit.likelihood]
    if len(likelihoods) < 2:
        return NotEstimable("of one person")
    edges = _threshold_edges(track)
    made = mixed(np.array(likelihoods), np.sqrt(edges[1:] * edges[:-1]))
    low, *_, high = (each for each in track.distances if each > 0)
    if low <= made.threshold <= high:
        return made
    return NotEstimable(_beyond(track, far=made.threshold > high)[0])


def _threshold_edges(track: Track) -> FloatArray:
    """Return places in equal ratios over all thresholds that are possible."""
    low, *_, high = (each for each in track.distances if each > 0)
    beyond = np.sqrt(high / low)
    return np.geomspace(low / beyond, high * beyond, _THRESHOLDS)


def curve_places(track: Track) -> FloatArray:
    """Return distances from the standard at which curves are drawn."""
    ends = [each for each in track.distances if each > 0]
    space = np.geomspace if track.levels.step_db is not None else np.linspace
    return space(ends[0], ends[-1], CURVE_POINTS)


def curve_of(track: Track, found: PersonThreshold, distance: FloatArray) -> FloatArray:
    """Return the share right (or of yes) that the fit expects at these distances."""
    fit, chance = found.fit, GUESS_RATE[track.task]
    share = (track.share - chance) / (1 - chance)
    curve = Curve(track.shape, share)
    at, threshold = distance, fit.threshold
    if track.shape == "weibull":
        at, threshold = np.log(distance), np.log(threshold)
    parts = (threshold, np.log(curve.width / fit.slope), fit.lapse, fit.guess)
    return curve.share_correct(at, [np.array(part) for part in parts])
