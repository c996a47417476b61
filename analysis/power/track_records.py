"""The record of a study's tracks: how the thresholds of simulated people err.

The people are those who rehearse the study: they feel the friction of the calibrated rig where and
as hard as they usually touch it, through their skin, and answer as `device.people.answering` says.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtr, ndtri

from analysis.estimates import FloatArray, NotEstimable
from analysis.power.people_cohorts import PeopleCohorts
from analysis.power.study_records import Asked, Record, Sums, of_thresholds, threshold_in_db
from analysis.simulation import names_of
from analysis.statistics.signed_rank import signed_rank
from device.friction.calibration import Calibration
from device.friction.scenes import REFERENCE_SPEED_M_S
from device.friction.surfaces import length_of
from device.people import person
from device.people.answering import Course, fractions
from device.people.person import People, World, person_name, uniforms_of
from device.tracks.expected import counted_answers
from device.tracks.posterior import report_lattice
from protocol.study.study import Study
from protocol.study.touch import Touch, mark_of
from protocol.study.track import GUESS_RATE, Track

_DRAWS = 4_001
_MEDIAN = 0.5


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
    world = World(damping_ratio=rig.damping_ratio, gain=rig.gain, surface=rig.surface)
    before = _log_friction(study, standard, people, world)
    levels = [track.at(level, volts) for level, volts in enumerate(solved)]
    smoother = before - np.stack([_log_friction(study, level, people, world) for level in levels])
    felt = -smoother if track.found == "rougher" else smoother
    # Who tires feels less surely: counted half-way through the track.
    noise = people.felt_noise * (1 + people.fatigue * track.trials / 2)
    if track.intervals == 1:
        less = ndtr((-felt - people.criterion_less) / noise)
        more = ndtr((felt - people.criterion) / noise)
        rougher = ndtr((felt - people.criterion_less) / noise)
        said = {"different": more + less, "rougher": rougher}
        return np.asarray(said.get(track.found, more))
    if track.intervals == 2:
        return np.asarray(ndtr(felt / (np.sqrt(2) * noise)))
    return _of_three(felt / noise, odd=track.found == "different")


def _log_friction(study: Study, touch: Touch, people: People, world: World) -> FloatArray:
    """Return the log friction that people feel in a touch, each where and as hard as usual."""
    mark = mark_of(touch, study.touch)
    parts = fractions(mark)
    way = Course(
        mark=mark,
        force_n=mark.force_n * people.force_factor,
        speed_factor=people.speed_factor,
        offset_m=people.place_offset_m,
        length_m=length_of(study.surface),
    )
    places_m = way.places_m(parts)

    def at_places(values: FloatArray) -> FloatArray:
        return np.repeat(values, len(parts))

    beam = touch.beam or study.touch.beam
    has_bodies = beam is None or study.beams[beam] > 0
    fingers = person.Fingers(
        place_m=places_m.ravel(),
        force_n=at_places(way.force_n),
        # A finger that rests is felt as one that moves a little.
        speed_m_s=at_places(way.speed_m_s) if mark.slides else REFERENCE_SPEED_M_S,
        voltage_v=np.full(places_m.size, touch.voltage_v * has_bodies),
        body_height_m=world.structure.body_height_m,
        skin=at_places(people.skin),
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
    return np.asarray(np.interp(felt, steps, [share.mean() for share in named]))


def by_chance(track: Track, people: People) -> FloatArray:
    """Return each person's share of right answers, or of yes, where nothing is felt, (people,)."""
    if track.intervals > 1:
        return np.full(people.size, GUESS_RATE[track.task])
    more, less = (
        ndtr(-criterion / people.felt_noise)
        for criterion in (people.criterion, people.criterion_less)
    )
    return np.asarray({"different": more + less, "rougher": less}.get(track.found, more))


def truths(track: Track, right: FloatArray, chance: FloatArray) -> FloatArray:
    """Return each person's threshold as a distance from the standard; NaN beyond the levels.

    It is where the curve has the share that defines it, once the answers by `chance` are taken
    out of `right`, which is from `shares`; in between quantiles are interpolated over logarithms.
    """
    guess = GUESS_RATE[track.task]
    logs, wanted = np.log(track.distances), ndtri((track.share - guess) / (1 - guess))
    quantiles = ndtri(((right - chance) / (1 - chance)).clip(1e-12, 1 - 1e-12))
    thresholds = np.full(right.shape[1], np.nan)
    for who, column in enumerate(quantiles.T):
        rising = np.maximum.accumulate(column)
        if rising[0] <= wanted <= rising[-1]:
            at = int(np.searchsorted(rising, wanted).clip(1))
            step = (wanted - rising[at - 1]) / max(rising[at] - rising[at - 1], 1e-300)
            thresholds[who] = np.exp(logs[at - 1] + step * (logs[at] - logs[at - 1]))
    return thresholds


def track_records(
    asked: Asked, cohorts: PeopleCohorts, keys: Sequence[str], first: int
) -> list[Record]:
    """Return the record of the study of each key, of which `first` is the number of the first.

    Errors and widths of thresholds are in dB. Two tracks on one axis are compared as in a report,
    which does not know whose threshold lies beyond the levels: everybody counts.
    """
    study, participants = cohorts.study, cohorts.participants
    of_groups: list[str | None] = [group.name for group in study.group for _ in range(group.size)]
    groups = (of_groups or [None] * participants) * len(keys)
    names = [person_name(key, who) for key in keys for who in names_of(participants)]
    people = People.of(
        [
            person.drawn_person(cohorts.population.of_group(group), name)
            for name, group in zip(names, groups, strict=True)
        ]
    )
    records = [Record({}, {}) for _ in keys]
    logs = {}
    for track in study.track:
        right = shares(study, track, people, cohorts.rig)
        truth = truths(track, right, by_chance(track, people))
        right = right + people.lapse * ((GUESS_RATE[track.task] or 1 / 2) - right)
        u = uniforms_of([f"{name}/{track.name}" for name in names], track.trials, 1)[..., 0].T
        counted = counted_answers(track, right, u, first * participants)
        grid = report_lattice(track)
        estimated = grid.interval(grid.posterior(counted))
        # Beyond the levels the last one counts, as in a report.
        levels = [distance for distance in track.distances if distance > 0]
        estimated[0] = estimated[0].clip(levels[0], levels[-1])
        sums = _sums(estimated, truth).reshape(5, len(keys), participants).sum(axis=2)
        for record, of_study in zip(records, sums.T.tolist(), strict=True):
            record.estimates[threshold_in_db(track.name)] = Sums(*of_study)
        logs[track.name] = np.log(estimated[0]).reshape(len(keys), participants)
    for a, b in asked.track_pairs:
        for record, differences in zip(records, logs[a] - logs[b], strict=True):
            test = signed_rank(differences)
            if not isinstance(test, NotEstimable):
                record.tests[of_thresholds(a, b)] = test.p
    return records


def _sums(estimated: FloatArray, truth: FloatArray) -> FloatArray:
    """Return what `Sums` has of each person, (5, people); 0 of who is beyond the levels."""
    middle, low, high = estimated
    error_db = 20 * np.log10(middle / truth)
    covered = (low <= truth) & (truth <= high)
    parts = (np.ones(truth.size), error_db, error_db**2, covered, 20 * np.log10(high / low))
    return np.where(np.isfinite(truth), np.stack(parts), 0.0)
