"""What a study's tracks tell of virtual people: errors, coverage, trials spent, and differences.

The people are those who rehearse the study: they feel the friction of the calibrated rig where and
as hard as they usually touch it, through their skin, and answer as `device.people.answering` says.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from analysis.estimates import LEVEL, FloatArray, Json
from analysis.power.diagnosands import Measured, finite, ratio, share
from analysis.statistics.signed_rank import doubled_midranks, p_of_ranks
from device.friction.scenes import REFERENCE_SPEED_M_S, Calibration
from device.people.answering import Course, fractions
from device.people.person import (
    BODY_HEIGHT_M,
    Fingers,
    People,
    Population,
    World,
    felt_friction,
    people_of,
    person_name,
)
from device.tracks.expected import counted_answers
from device.tracks.posterior import lattice
from protocol.study.study import Study
from protocol.study.touch import Touch, mark_of
from protocol.study.track import GUESS_RATE, Track

_AT_ONCE = 2_000
"""Observers whose posteriors are kept at a time: 15 MB for 800 sets of parameters."""
_DRAWS = 4_001
_MEDIAN = 0.5


@dataclass(frozen=True, kw_only=True)
class TrackPower:
    """How the thresholds of a track err, in dB, over studies of this many participants.

    `coverage` is of the 95% intervals; `trials` the mean number of them; `beyond` the share of
    people whose threshold no level of the track reaches, who count for none of the others.
    """

    name: str
    bias_db: Measured
    rmse_db: Measured
    coverage: Measured
    trials: Measured
    beyond: Measured


@dataclass(frozen=True, kw_only=True)
class TracksDiffer:
    """How often the signed rank test of the log thresholds of two tracks finds a difference.

    `above` names the track whose true thresholds are larger on average; `ratio_db` by how much.
    """

    above: str
    below: str
    ratio_db: float
    power: Measured


def shares(study: Study, track: Track, people: People, rig: Calibration) -> FloatArray:
    """Return the chance that each person is right (or says yes) at a level, (levels, people).

    Lapses are left out. Of two touches whose log friction differs by c under the finger, a share
    Phi(c / (sqrt(2) s)) is named rightly, with the SD s of what is felt; yes is said where
    c + s z is beyond the criterion. For three touches the share is an integral over their noise.
    """
    from device.tracks.contrast import voltages

    solved: Sequence[float | None] = [None] * len(track.values)
    if track.axis == "contrast":
        solved = voltages(study, study.track.index(track), rig)[0]
    still = track.comparison.model_copy(update={"voltage_v": 0.0})
    # Yes is said of a touch beside the beam at rest, which is remembered.
    standard = still if track.intervals == 1 else track.standard or still
    world = World(damping_ratio=rig.damping_ratio, gain=rig.gain)
    before = _log_friction(study, standard, people, world)
    levels = [track.at(level, volts) for level, volts in enumerate(solved)]
    smoother = before - np.stack([_log_friction(study, it, people, world) for it in levels])
    found = track.found
    felt = -smoother if found == "rougher" else smoother
    # Who tires feels less surely: counted half-way through the track.
    noise = people.felt_noise * (1 + people.fatigue * track.trials / 2)
    if track.intervals == 1:
        less = ndtr((-felt - people.criterion_less) / noise)
        more = ndtr((felt - people.criterion) / noise)
        of = {"different": more + less, "rougher": ndtr((felt - people.criterion_less) / noise)}
        return np.asarray(of.get(found, more))
    if track.intervals == 2:
        return np.asarray(ndtr(felt / (np.sqrt(2) * noise)))
    return _of_three(felt / noise, odd=found == "different")


def _log_friction(study: Study, touch: Touch, people: People, world: World) -> FloatArray:
    """Return the log friction that people feel in a touch, each where and as hard as usual."""
    mark = mark_of(touch, study.touch)
    parts = fractions(mark)
    way = Course(
        mark=mark,
        force_n=mark.force_n * people.force_factor,
        speed_factor=people.speed_factor,
        offset_m=people.place_offset_m,
    )
    places_m = way.places_m(parts)

    def each(values: FloatArray) -> FloatArray:
        return np.repeat(values, len(parts))

    beam = touch.beam or study.touch.beam
    has_bodies = beam is None or study.beams[beam] > 0
    fingers = Fingers(
        place_m=places_m.ravel(),
        force_n=each(way.force_n),
        # A finger that rests is felt as one that moves a little.
        speed_m_s=each(way.speed_m_s) if mark.slides else REFERENCE_SPEED_M_S,
        voltage_v=np.full(places_m.size, touch.voltage_v * has_bodies),
        body_height_m=BODY_HEIGHT_M,
        skin=each(people.skin),
        mu0=1.0,
    )
    model_hz = touch.frequency * world.resonance_hz
    felt = np.log(felt_friction(world, fingers, model_hz, touch.direction))
    by_person = felt.reshape(places_m.shape)
    return np.asarray(by_person.mean(axis=1) if mark.slides else by_person[:, -1])


def _of_three(felt: FloatArray, *, odd: bool) -> FloatArray:
    """Return the share of people who find the one of three touches that differs by `felt` SD."""
    z = ndtri((np.arange(_DRAWS) + _MEDIAN) / _DRAWS)
    steps = np.linspace(-12, 12, 241)
    if not odd:  # the largest of three: the others are both smaller
        table = np.array([(ndtr(z + step) ** 2).mean() for step in steps])
    else:
        # Farthest from the mean of the others: with d = x1 - (x2 + x3) / 2 and u = (x2 - x3),
        # which do not depend on each other, the first touch is named where |u| < 2 |d| / 3.
        spread = np.sqrt(1.5)
        table = np.array(
            [
                (2 * ndtr(2 / 3 * np.abs(step + spread * z) / np.sqrt(2)) - 1).mean()
                for step in steps
            ]
        )
    return np.asarray(np.interp(felt, steps, table))


def by_chance(track: Track, people: People) -> FloatArray:
    """Return each person's share of right answers, or of yes, where nothing is felt, (people,)."""
    if track.intervals > 1:
        return np.full(people.size, GUESS_RATE[track.task])
    more, less = (ndtr(-it / people.felt_noise) for it in (people.criterion, people.criterion_less))
    return np.asarray({"different": more + less, "rougher": less}.get(track.found, more))


def truths(track: Track, right: FloatArray, chance: FloatArray) -> FloatArray:
    """Return each person's threshold as a distance from the standard; NaN beyond the levels.

    It is where the curve has the share that defines it, once the answers by `chance` are taken
    out of `right`, which is from `shares`; in between quantiles are interpolated over logarithms.
    """
    guess = GUESS_RATE[track.task]
    logs, wanted = np.log(track.distances), ndtri((track.share - guess) / (1 - guess))
    quantiles = ndtri(((right - chance) / (1 - chance)).clip(1e-12, 1 - 1e-12))
    found = np.full(right.shape[1], np.nan)
    for person, column in enumerate(quantiles.T):
        rising = np.maximum.accumulate(column)
        if rising[0] <= wanted <= rising[-1]:
            at = int(np.searchsorted(rising, wanted).clip(1))
            step = (wanted - rising[at - 1]) / max(rising[at] - rising[at - 1], 1e-300)
            found[person] = np.exp(logs[at - 1] + step * (logs[at] - logs[at - 1]))
    return found


@dataclass(frozen=True, kw_only=True)
class TrackFindings:
    """What the tracks of a study tell, over this many studies of these participants."""

    participants: int
    studies: int
    tracks: tuple[TrackPower, ...]
    differences: tuple[TracksDiffer, ...]

    def record(self) -> Json:
        """Return it as plain JSON values, each with its Monte Carlo error."""

        def pairs(of: TrackPower | TracksDiffer) -> Json:
            named: Json = {}
            for key, value in vars(of).items():
                if isinstance(value, Measured):
                    named |= value.as_json(key, f"{key}_mc_error")
                else:
                    named[key] = finite(value) if isinstance(value, float) else value
            return named

        return {
            "participants": self.participants,
            "studies": self.studies,
            "tracks": list(map(pairs, self.tracks)),
            "differences": list(map(pairs, self.differences)),
        }


def track_findings(
    study: Study, population: Population, rig: Calibration, sizes: tuple[int, int], seed: int
) -> TrackFindings:
    """Return what the tracks of a study tell; `sizes` are numbers of studies and participants."""
    studies, participants = sizes
    groups: list[str | None] = [each.name for each in study.group for _ in range(each.size)]
    groups = groups or [None]
    names = [
        (groups[who % len(groups)], person_name(f"{seed}/{number}", f"P{who + 1}"))
        for number in range(studies)
        for who in range(participants)
    ]
    drawn = [people_of(population.of_group(group), [name])[0] for group, name in names]
    people = People.of(drawn)
    found: list[TrackPower] = []
    logs: dict[str, _Logs] = {}
    for track in study.track:
        right = shares(study, track, people, rig)
        truth = truths(track, right, by_chance(track, people))
        right = right + people.lapse * ((GUESS_RATE[track.task] or 1 / 2) - right)
        told = _estimated(track, right, seed)
        logs[track.name] = (np.log(told.middle), np.log(truth), track.axis)
        found.append(_quality(track, told, truth, sizes))
    differ = [
        _difference(a, b, logs, sizes)
        for a, b in combinations(logs, 2)
        if logs[a][2] == logs[b][2]  # on one axis
    ]
    return TrackFindings(
        participants=participants,
        studies=studies,
        tracks=tuple(found),
        differences=tuple(differ),
    )


_Logs = tuple[FloatArray, FloatArray, str]
"""Logarithms of estimates and of truths, and the axis."""


@dataclass(frozen=True, kw_only=True)
class _Told:
    middle: FloatArray
    low: FloatArray
    high: FloatArray
    trials: FloatArray


def _estimated(track: Track, right: FloatArray, seed: int) -> _Told:
    """Return the estimates of all observers, a stretch of them at a time."""
    random = np.random.default_rng(seed)
    grid, parts, trials = lattice(track, fine=True), [], []
    for first in range(0, right.shape[1], _AT_ONCE):
        counted = counted_answers(track, right[:, first : first + _AT_ONCE], random)
        parts.append(grid.interval(grid.posterior(counted)))
        trials.append(counted.sum(axis=(1, 2)))
    middle, low, high = np.concatenate(parts, axis=1)
    return _Told(middle=middle, low=low, high=high, trials=np.concatenate(trials))


def _quality(track: Track, told: _Told, truth: FloatArray, shape: tuple[int, int]) -> TrackPower:
    known = np.isfinite(truth)

    def mean(values: NDArray[np.generic]) -> Measured:
        of = np.where(known, values, 0).reshape(shape).sum(axis=1)
        return ratio(of.astype(np.float64), known.reshape(shape).sum(axis=1).astype(np.float64))

    error_db = 20 * np.log10(told.middle / truth)
    squares = mean(error_db**2)
    root = float(np.sqrt(squares.value))
    return TrackPower(
        name=track.name,
        bias_db=mean(error_db),
        rmse_db=Measured(root, squares.error / (2 * root) if root else float("nan")),
        coverage=mean((told.low <= truth) & (truth <= told.high)),
        trials=mean(told.trials),
        beyond=share((~known).reshape(shape).mean(axis=1)),
    )


def _difference(a: str, b: str, logs: dict[str, _Logs], shape: tuple[int, int]) -> TracksDiffer:
    true_db = 20 / np.log(10) * np.nanmean(logs[a][1] - logs[b][1])
    above, below = (a, b) if true_db >= 0 else (b, a)
    # The estimate of everybody counts, as in a report, which does not know who is beyond a level.
    differences = (logs[above][0] - logs[below][0]).reshape(shape)
    ranks = doubled_midranks(np.where(differences == 0, np.nan, np.abs(differences)))
    positive = (ranks * (differences > 0)).sum(axis=1)
    p = [p_of_ranks(row[row > 0], int(v)) for row, v in zip(ranks, positive, strict=True)]
    higher = 2 * positive > ranks.sum(axis=1)
    return TracksDiffer(
        above=above,
        below=below,
        ratio_db=abs(float(true_db)),
        power=share((np.array(p) < LEVEL) & higher),
    )
