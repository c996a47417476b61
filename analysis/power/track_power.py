"""What a study's tracks tell of simulated studies, one row of numbers each.

The people are those who rehearse the study: they feel the friction of the calibrated rig where and
as hard as they usually touch it, through their skin, and answer as `device.people.answering` says.
Rows are added up later, by `analysis.power.track_diagnosands`.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.special import ndtr, ndtri

from analysis.estimates import FloatArray, NotEstimable
from analysis.statistics.intervals import mean_interval
from analysis.statistics.signed_rank import doubled_midranks, p_of_ranks
from analysis.trials.track_fits import contrast_of_level
from device.friction.scenes import REFERENCE_SPEED_M_S, Calibration
from device.people import person
from device.people.answering import Course, fractions
from device.people.person import People, Population, World, person_name, uniforms_of
from device.tracks.expected import counted_answers
from device.tracks.posterior import lattice
from protocol.study.study import Study
from protocol.study.touch import Touch, mark_of
from protocol.study.track import GUESS_RATE, Track

_AT_ONCE = 2_000
"""Observers whose posteriors are kept at a time: 15 MB for 800 sets of parameters."""
_DRAWS = 4_001
_MEDIAN = 0.5
OF_TRACK = ("known", "error", "squared error", "covered", "trials", "Weber limit")
"""Sums over the people whose threshold some level reaches, and the upper end of the 95% interval
of the cohort's Weber fraction."""
OF_PAIR = ("p", "shift", "true", "known")
"""Of two tracks: p of the signed rank test, mean estimated difference of log thresholds, sum of
the true ones and of how many people they are."""


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
    fingers = person.Fingers(
        place_m=places_m.ravel(),
        force_n=each(way.force_n),
        # A finger that rests is felt as one that moves a little.
        speed_m_s=each(way.speed_m_s) if mark.slides else REFERENCE_SPEED_M_S,
        voltage_v=np.full(places_m.size, touch.voltage_v * has_bodies),
        body_height_m=person.BODY_HEIGHT_M,
        skin=each(people.skin),
        mu0=1.0,
    )
    model_hz = touch.frequency * world.resonance_hz
    felt = np.log(person.felt_friction(world, fingers, model_hz, touch.direction))
    by_person = felt.reshape(places_m.shape)
    return np.asarray(by_person.mean(axis=1) if mark.slides else by_person[:, -1])


def _of_three(felt: FloatArray, *, odd: bool) -> FloatArray:
    """Return the share of people who find the one of three touches that differs by `felt` SD."""
    z = ndtri((np.arange(_DRAWS) + _MEDIAN) / _DRAWS)
    steps = np.linspace(-12, 12, 241)
    # The largest of three: the others are both smaller.
    named = (ndtr(z + step) ** 2 for step in steps)
    if odd:
        # Farthest from the mean of the others: with d = x1 - (x2 + x3) / 2 and u = (x2 - x3),
        # which do not depend on each other, the first touch is named where |u| < 2 |d| / 3.
        distance = (np.abs(step + np.sqrt(1.5) * z) for step in steps)
        named = (2 * ndtr(2 / 3 * d / np.sqrt(2)) - 1 for d in distance)
    return np.asarray(np.interp(felt, steps, [each.mean() for each in named]))


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
    for who, column in enumerate(quantiles.T):
        rising = np.maximum.accumulate(column)
        if rising[0] <= wanted <= rising[-1]:
            at = int(np.searchsorted(rising, wanted).clip(1))
            step = (wanted - rising[at - 1]) / max(rising[at] - rising[at - 1], 1e-300)
            found[who] = np.exp(logs[at - 1] + step * (logs[at] - logs[at - 1]))
    return found


def pairs_of_tracks(study: Study) -> list[tuple[Track, Track]]:
    """Return the pairs that are compared: those on one axis."""
    return [(a, b) for a, b in combinations(study.track, 2) if a.axis == b.axis]


def track_columns(study: Study) -> list[tuple[str, ...]]:
    """Return the names of a row's numbers: of a track or two, and what of them."""
    own = [(track.name, what) for track in study.track for what in OF_TRACK]
    pairs = [(a.name, b.name, what) for a, b in pairs_of_tracks(study) for what in OF_PAIR]
    return [*own, *pairs]


def track_rows(
    study: Study, population: Population, rig: Calibration, participants: int, keys: Sequence[str]
) -> FloatArray:
    """Return a row for the study of each key, drawn apart from all others."""
    groups: list[str | None] = [each.name for each in study.group for _ in range(each.size)]
    names = [person_name(key, f"P{who:02d}") for key in keys for who in range(1, participants + 1)]
    drawn = [
        person.people_of(population.of_group(group), [name])[0]
        for name, group in zip(names, (groups or [None] * participants) * len(keys), strict=True)
    ]
    people, shape = People.of(drawn), (len(keys), participants)
    # Studies are numbered within their task, as every number is kept by task.
    parts: list[FloatArray] = []
    logs: dict[str, tuple[FloatArray, FloatArray]] = {}
    for track in study.track:
        right = shares(study, track, people, rig)
        truth = truths(track, right, by_chance(track, people))
        right = right + people.lapse * ((GUESS_RATE[track.task] or 1 / 2) - right)
        streams = [f"{name}/{track.name}" for name in names]
        told = _estimated(track, right, uniforms_of(streams, track.trials, 1)[..., 0].T)
        middle = told[0]
        logs[track.name] = np.log(middle).reshape(shape), np.log(truth).reshape(shape)
        limits = _weber_limits(study, track, rig, middle.reshape(shape))
        parts.append(np.column_stack([_sums(told, truth, shape), limits]))
    for a, b in pairs_of_tracks(study):
        shift, true = (one - other for one, other in zip(logs[a.name], logs[b.name], strict=True))
        parts.append(_differences(shift, true))
    return np.column_stack(parts)


def _estimated(track: Track, right: FloatArray, u: FloatArray) -> FloatArray:
    """Return threshold, ends of its interval and trials of all observers, (4, observers)."""
    grid, parts = lattice(track, fine=True), []
    for first in range(0, right.shape[1], _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        counted = counted_answers(track, right[:, some], u[:, some], first)
        parts.append([*grid.interval(grid.posterior(counted)), counted.sum(axis=(1, 2))])
    return np.concatenate(parts, axis=1)


def _sums(told: FloatArray, truth: FloatArray, shape: tuple[int, int]) -> FloatArray:
    """Return the sums of `OF_TRACK` but its last, (studies, 5); errors are in dB."""
    middle, low, high, trials = told
    known, error_db = np.isfinite(truth), 20 * np.log10(middle / truth)
    covered = (low <= truth) & (truth <= high)
    values = (known, error_db, error_db**2, covered, trials)
    return np.stack([np.where(known, it, 0).reshape(shape).sum(axis=1) for it in values], axis=1)


def _weber_limits(study: Study, track: Track, rig: Calibration, middle: FloatArray) -> FloatArray:
    """Return the upper ends of the cohorts' Weber fractions, as a report has them; else NaN.

    Predicted contrasts between thresholds of the grid are interpolated over logarithms.
    """
    grid = np.unique(lattice(track, fine=True).threshold)
    side = 1 if track.values[-1] > track.reference else -1
    contrasts = [contrast_of_level(study, track, rig, track.reference + side * it) for it in grid]
    if any(each is None or each <= 0 for each in contrasts):
        return np.full(len(middle), np.nan)
    at = np.interp(np.log(middle), np.log(grid), np.log(np.array(contrasts, float)))
    ends = [mean_interval(row) for row in np.log(-np.expm1(-np.exp(at)))]
    return np.array([np.nan if isinstance(it, NotEstimable) else np.exp(it[1]) for it in ends])


def _differences(shift: FloatArray, true: FloatArray) -> FloatArray:
    """Return the numbers of `OF_PAIR` from log ratios of people, (studies, 4)."""
    # The estimate of everybody counts, as in a report, which does not know who is beyond a level.
    ranks = doubled_midranks(np.where(shift == 0, np.nan, np.abs(shift)))
    positive = (ranks * (shift > 0)).sum(axis=1)
    p = [p_of_ranks(row[row > 0], int(v)) for row, v in zip(ranks, positive, strict=True)]
    known = np.isfinite(true)
    return np.column_stack([p, shift.mean(axis=1), np.nansum(true, axis=1), known.sum(axis=1)])
