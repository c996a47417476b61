"""Checks of the trials of tracks in a plan, independent of the code that drew them.

A level is an index into the grid of its track, and every level of it keeps the limits of the rig:
so no order of answers leads to one that does not.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise

from protocol.plan.trials import Plan, Trial
from protocol.study.study import Study
from protocol.study.study_question import INTERVALS
from protocol.study.touch import Touch
from protocol.study.track import Track

Violations = Iterator[tuple[str, str]]


def level_touches(study: Study) -> Iterator[tuple[str, Touch]]:
    """Yield every touch that a track may make, with its name.

    The voltages of contrasts are a rig's own, and judged once they are known.
    """
    for track in study.track:
        for level, value in enumerate(track.values if track.axis != "contrast" else ()):
            yield f"level {level} ({value:.6g}) of track {track.name}", track.at(level)


def track_violations(study: Study, plan: Plan) -> Violations:
    """Yield (rule, value) for each trial of a track that does not match the study."""
    tracks = {track.name: track for track in study.track}
    made: dict[str, list[Trial]] = {name: [] for name in tracks}
    for trial in plan.trials:
        if (trial.kind == "track") != (trial.track is not None):
            yield "a trial of a track, and no other, must name one", f"trial {trial.index}"
        if trial.track is not None and trial.track.name not in made:
            yield "a track must be one of the study's", repr(trial.track.name)
        elif trial.track is not None:
            made[trial.track.name].append(trial)
    for name, trials in made.items():
        yield from _of_track(tracks[name], trials)
        for trial in trials:
            for rule in _content(tracks[name], trial):
                yield rule, f"trial {trial.index} ({name})"
    yield from _order(study, [trial for trial in plan.trials if trial.track is not None])


def _of_track(track: Track, trials: Sequence[Trial]) -> Violations:
    roles = [trial.track.role for trial in trials if trial.track]
    wanted = {"level": track.trials, "catch": track.catch, "easy": track.easy}
    if Counter(roles) != Counter(wanted):
        yield f"{track.name} must have {wanted}", str(dict(Counter(roles)))
    if roles[:1] != ["level"]:
        yield f"{track.name} must begin at a level that its method chooses", str(roles[:1])
    intervals = [each.track.interval for each in trials if each.track and each.track.interval]
    if track.task == "yes or no":
        return
    # In each stretch all intervals come twice, so that none comes more than four times in a row.
    size = 2 * track.intervals
    for start in range(0, len(intervals), size):
        stretch = intervals[start : start + size]
        most, least = 2, 2 if len(stretch) == size else 0
        counts = [stretch.count(number) for number in range(1, track.intervals + 1)]
        if min(counts) < least or max(counts) > most:
            yield f"{track.name} must have each interval twice in {size} trials", str(stretch)


def _content(track: Track, trial: Trial) -> Iterator[str]:
    planned = trial.track
    assert planned is not None
    several = track.task != "yes or no"
    compared = 0 if planned.role == "catch" else planned.interval or 1
    numbers = range(1, {"two intervals": 2, "three intervals": 3}.get(track.task, 1) + 1)
    # A catch trial has the standard alone, and so has what is not the comparison.
    wanted = [track.comparison if number == compared else track.standard for number in numbers]
    if len(trial.touches) != len(wanted):
        yield f"a trial must have the touches of {track.task}"
    elif list(trial.touches) != wanted:
        yield "the touches must be the standard, and the comparison in its interval"
    if not several:
        right: str | None = "no" if planned.role == "catch" else "yes"
    else:
        right = None if planned.interval is None else INTERVALS[planned.interval - 1]
    if trial.expected != right or (planned.interval is None) != (
        not several or planned.role == "catch"
    ):
        yield f"the right answer must be {right}"
    if trial.scored or trial.question or trial.condition or trial.opposite:
        yield "a trial of a track must have no condition and no score"


def _order(study: Study, trials: Sequence[Trial]) -> Violations:
    names = [trial.track.name for trial in trials if trial.track]
    if study.design.tracks == "one after another":
        starts = [name for place, name in enumerate(names) if names[place - 1 : place] != [name]]
        if len(starts) != len(set(starts)):
            yield "tracks must follow one another", str(starts)
    else:
        many = {each.name: each.trials + each.catch + each.easy for each in study.track}
        at = 0
        for number in range(max(many.values(), default=0)):
            due = {name for name, trials_of in many.items() if trials_of > number}
            if set(names[at : at + len(due)]) != due:
                yield "each track must come once before one comes again", f"round {number + 1}"
            at += len(due)
    blocks = [trial.block for trial in trials]
    most = study.design.track_block
    if any(later - block not in {0, 1} for block, later in pairwise(blocks)) or any(
        many > most for many in Counter(blocks).values()
    ):
        yield f"tracks must come in blocks of at most {most} trials", str(blocks)
