"""What is wrong with the tracks of a study: levels, standard, rule, stop and definition."""

from collections.abc import Iterator, Sequence, Set
from itertools import pairwise
from math import gcd
from typing import Any

from protocol.errors import Problem
from protocol.study.study import Study
from protocol.study.track import AXIS_KEY, GUESS_RATE, Track, decibels
from protocol.tracks.procedure import WHOLE, converges_at, most_reversals, nearest, staircase

_ROUNDED = 1e-4
"""How far a level may be from what it stands for, relative to it: nobody types all its digits."""
_APART, _LEAST = 1e-6, 1e-9
"""What neighbouring levels must differ by, relative to their distance from the standard and in
units of the axis: what no rig tells apart would end as a division by 0."""
_OF_STAIRCASES = ("rule", "step_db", "step_levels", "up_step_db", "up_step_levels")


_Found = Iterator[tuple[str, str, object, str]]
"""Key, rule, value and hint of each problem."""


def track_problems(study: Study) -> Iterator[Problem]:
    """Yield what is wrong with the tracks themselves; their touches are checked as all others."""
    # A beam that there is not is told once, where beams are.
    known = {None, *study.beams}
    mounted = {track.comparison.beam or study.touch.beam for track in study.track} & known
    for number, track in enumerate(study.track):
        # What follows needs levels, and those need a standard.
        found = [*_standard(track), *_touches(track, known)] or [*_levels(track)]
        found = found or [*_apart(track)]
        found = found or [*_method(track), *_staircase(track), *_stop(track), *_curve(track)]
        if len(mounted) > 1 and study.design.tracks == "interleaved":
            hint = 'write design.tracks = "one after another", so that beams are swapped in between'
            beam = str(track.comparison.beam)
            found.insert(0, ("comparison.beam", "must be that of all tracks", beam, hint))
        for key, rule, value, hint in found:
            keys = key.split(".") if key else []
            where = ", ".join([f"track {track.name}", *keys])
            yield Problem(where, rule, str(value), hint, ("track", number, *keys))


def _standard(track: Track) -> _Found:
    key, standard, comparison = AXIS_KEY[track.axis], track.standard, track.comparison
    if standard is None:
        needs = {
            f'task = "{track.task}"': track.task != "yes or no",
            f'axis = "{track.axis}"': track.axis != "voltage",
            f"catch = {track.catch}": track.catch > 0,
        }
        if why := next((said for said, so in needs.items() if so), None):
            value = "0" if key == "voltage_v" else "..."
            hint = f'such as standard = {{ place = "{comparison.place}", {key} = {value} }}'
            yield "standard", f"must be given where {why}", "nothing", hint
    elif key not in standard.model_fields_set:
        rule = f'must give {key}, because axis = "{track.axis}"'
        yield "standard", rule, "none", "the levels are on one side of the standard's"
    if key in comparison.model_fields_set:
        value = getattr(comparison, key)
        rule = f'must not give {key}, which axis = "{track.axis}" fills in'
        yield f"comparison.{key}", rule, value, "leave it out; levels has the values"
    if track.axis in {"frequency", "place"} and not comparison.voltage_v:
        hint = "an amplitude, which is the same at all levels"
        rule = f'must be above 0 where axis = "{track.axis}"'
        yield "comparison.voltage_v", rule, comparison.voltage_v, hint


def _touches(track: Track, known: Set[str | None]) -> _Found:
    beam, other = track.standard and track.standard.beam, track.comparison.beam
    if track.standard is not None and beam != other and {beam, other} <= known:
        hint = "nobody can wait for a beam within a trial"
        yield "standard.beam", "must be that of the comparison", beam or "none", hint
    for name, touch in (("standard", track.standard), ("comparison", track.comparison)):
        if touch is None:
            continue
        in_hz = {"frequency_hz", "sweep_to_hz"} & touch.model_fields_set
        if touch.programme != "hold" or in_hz:
            rule = "must hold one drive relative to the resonance"
            hint = "leave ramp_to_v, sweep_to, sweep_to_hz and frequency_hz out"
            yield name, rule, " and ".join(sorted(in_hz)) or touch.programme, hint
        if track.axis == "place" and touch.place != "smooth":
            yield f"{name}.place", 'must be "smooth" where axis = "place"', touch.place, ""
        if track.axis != "place" and touch.place_m is not None:
            hint = "give touch.smooth_place_m, which all touches have"
            yield f"{name}.place_m", 'is for axis = "place"', touch.place_m, hint


def _levels(track: Track) -> _Found:
    levels, values, reference = track.levels, track.levels.values, track.reference
    ends = (levels.first, levels.last, levels.count)
    given = sum(end is not None for end in ends)
    rule, got = "", f"{min(values, default=0):g} to {max(values, default=0):g}"
    if given != (0 if levels.listed else 3):
        rule = "must have from, to and count, or values"
        got = "both" if levels.listed else "neither"
        hint = 'such as { from = 5, to = 100, count = 27, spaced = "equal ratios" }'
    elif levels.spaced == "equal ratios" and 0 in ends:
        rule, got = "must not begin or end at 0 in equal ratios", "0"
        hint = 'begin above 0, or write spaced = "equal steps"'
    elif len(set(values)) < max(2, len(values)):
        rule, got = "must be at least 2, and differ", _several(values, levels.first)
        hint = "give more levels, each once"
    elif min(values) <= reference <= max(values):
        side = f"the standard at {reference:g}" if track.standard else "0"
        rule = f"must all be on one side of {side}, and none there"
        hint = "where nothing differs no answer is right; catch trials have the standard"
        if track.axis == "frequency":
            hint = "friction is not monotone across a standard: make a track of each side"
    elif track.axis == "frequency" and min(*values, reference) < 1 < max(*values, reference):
        rule = "must lie on one side of the resonance, together with the standard"
        hint = "friction is not monotone across 1.0: make a track of each side"
    if rule:
        yield "levels", rule, got, hint


def _apart(track: Track) -> _Found:
    if any(b - a < max(_LEAST, _APART * b) for a, b in pairwise((0.0, *track.distances))):
        rule = f"must differ from each other by 1 in {1 / _APART:,.0f}, and from the standard"
        got = f"{min(track.values):.15g} to {max(track.values):.15g}"
        yield "levels", rule, got, "give fewer levels, or a wider range"


def _several(values: Sequence[float], alone: float | None) -> str:
    if not values and alone is not None:
        return f"1 level: {alone:g}"
    return ", ".join(f"{value:g}" for value in values[:5]) + ", ..." * (len(values) > 5) or "none"


def _method(track: Track) -> _Found:
    if track.task == "two intervals" and track.find == "different":
        hint = "of two touches each differs from the other: smoother, rougher or stronger"
        yield "find", "must not be so in two intervals", "different", hint
    many = len(track.values)
    if track.method == "constant" and track.trials % many:
        rule = f"must be a multiple of the {many} levels of constant stimuli"
        near = max(many, round(track.trials / many) * many)
        yield "trials", rule, track.trials, f"such as {near}"
    if track.method == "limits" and track.task != "yes or no":
        rule = 'must be "yes or no" where method = "limits"'
        hint = "a series ends where the answer changes, and a guess would end it: take a staircase"
        yield "task", rule, repr(track.task), hint
    if track.mercy and track.method != "quest+":
        hint = "leave it out, or take the method quest+"
        yield "mercy", "is for QUEST+", track.mercy, hint
    if track.start is not None and not track.turns:
        hint = "leave it out: this method chooses its first level"
        yield "start", "is for staircases and limits", track.start, hint
    elif track.start is not None:
        level = track.values[nearest(track.values, track.start)]
        if abs(level - track.start) > _ROUNDED * level:
            yield "start", "must be one of the levels", track.start, f"nearest: {level:.6g}"


def _staircase(track: Track) -> _Found:
    if track.method != "staircase":
        hint = 'leave it out, or write method = "staircase"'
        for key in _OF_STAIRCASES:
            if value := getattr(track, key):
                yield key, "is for staircases", repr(value), hint
        return
    if track.rule is None:
        hint = 'such as rule = "3 down 1 up", which converges to 0.794 correct'
        yield "rule", "must be given for a staircase", "nothing", hint
    if bool(track.step_db) == bool(track.step_levels):
        hint = "such as step_db = [4, 4, 1], or step_levels = [4, 4, 1]"
        rule = "must have step_db or step_levels for a staircase"
        # Of the track, so that it is not said of one whose steps cannot be read.
        yield "", rule, "both" if track.step_db else "neither", hint
    if track.up_step_db and track.up_step_levels:
        hint = "leave one of them out"
        yield "up_step_db", "must not be given beside up_step_levels", "both", hint
    wrong = [*_steps(track)]
    yield from wrong
    if track.rule is not None and (track.step_db or track.step_levels) and not wrong:
        yield from _convergence(track)


def _convergence(track: Track) -> _Found:
    at = converges_at(staircase(track))
    if not _least(track) < round(at, 4) < 1 - track.lapse[0]:
        rule = f"must converge to a share above {_least(track):.3g} and below what lapses leave"
        hint = 'more correct answers down, fewer errors up: such as "3 down 1 up", 0.794'
        yield "rule", rule, f'"{track.rule}", {at:.4f}', hint


def _least(track: Track) -> float:
    """Return the share correct, or of yes, that needs nothing to be felt."""
    return GUESS_RATE[track.task] or track.false_alarms[0]


def _steps(track: Track) -> _Found:
    grid_db, most = track.levels.step_db, len(track.values) - 1
    for key in ("step_levels", "up_step_levels"):
        if (step := max(getattr(track, key), default=0)) > most:
            yield key, f"must be at most {most}, from the first level to the last", step, ""
    every = [(key, db) for key in ("step_db", "up_step_db") for db in getattr(track, key)]
    if every and grid_db is None:
        hint = "give step_levels and up_step_levels, numbers of levels"
        yield every[0][0], "needs levels in equal ratios", every[0][1], hint
        return
    for key, db in every:
        assert grid_db is not None
        if round(db / grid_db) < 1 or abs(db / grid_db - round(db / grid_db)) > WHOLE:
            rule = f"must be whole steps of the levels, which are {grid_db:.4g} dB apart"
            yield key, rule, f"{db:g} dB", _fitting(track, [each for _, each in every])
            return
        if round(db / grid_db) > most:
            rule = f"must be at most {grid_db * most:.4g} dB, from the first level to the last"
            yield key, rule, f"{db:g} dB", ""


def _fitting(track: Track, steps_db: Sequence[float]) -> str:
    """Return the range nearest to the track's whose levels are apart by what divides all steps."""
    step_db = gcd(*(max(1, round(1000 * db)) for db in steps_db)) / 1000
    first, last = min(track.levels.values), max(track.levels.values)
    count = max(1, round(decibels(last / first) / step_db))
    end = first * 10 ** (count * step_db / 20)
    if count > 1 and end > last * (1 + _ROUNDED):  # the end may be a limit of the rig
        count, end = count - 1, end / 10 ** (step_db / 20)
    end = last if abs(end / last - 1) <= _ROUNDED else end
    return f"nearest: levels = {{ from = {first:g}, to = {end:.6g}, count = {count + 1} }}"


def _stop(track: Track) -> _Found:
    stop = track.stop
    if stop is None:
        return
    most = most_reversals(track)
    if stop.reversals is not None and stop.reversals > most:
        rule = f"cannot be reached: trials = {track.trials} gives at most {most}"
        if not most:
            rule, hint = f'cannot be reached: method = "{track.method}" has none', "leave it out"
        else:
            hint = "ask for fewer reversals, or give more trials"
        yield "stop.reversals", rule, stop.reversals, hint
    distances = track.distances
    finest = min(decibels(b / a) for a, b in pairwise(distances))
    if stop.interval_db is not None and stop.interval_db < finest:
        rule = f"cannot be reached: neighbouring levels are {finest:.3g} dB apart"
        yield "stop.interval_db", rule, stop.interval_db, "give more levels, or a wider one"
    if stop.reversals is None and stop.interval_db is None:
        hint = "give reversals or interval_db, or leave stop out"
        yield "stop", "must say when the track ends", "nothing", hint


def _curve(track: Track) -> _Found:
    chance, least = GUESS_RATE[track.task], _least(track)
    pair: Any
    if track.task != "yes or no" and "false_alarms" in track.model_fields_set:
        hint = "leave it out: guesses are half or a third of all answers"
        yield "false_alarms", 'is for "yes or no"', list(track.false_alarms), hint
    ranges = {key: getattr(track, key) for key in ("slope", "lapse", "false_alarms")}
    for key, pair in ranges.items():
        if pair and pair[0] > pair[1]:
            yield key, "must go from least to most", list(pair), "change their order"
    for key in ("lapse", "false_alarms"):
        if ranges[key][1] >= 0.5:
            rule, hint = "must be below 0.5", "nobody measures a threshold with more"
            yield key, rule, f"{ranges[key][1]:g}", hint
            return
    if track.threshold_at is None and not track.share < 1 - track.lapse[1]:
        rule = f"must be below {1 - track.share:.3g}, so that the threshold's share can be reached"
        yield "lapse", rule, f"{track.lapse[1]:g}", "or write a lower threshold_at"
    elif not least < track.share < 1 - track.lapse[1]:
        what = f"chance, {chance:.3g} in {track.task}" if chance else f"false alarms, {least:.3g}"
        rule = f"must lie above {what}, and below what lapses leave, {1 - track.lapse[1]:.3g}"
        hint = f"half-way from chance to 1 is {(1 + chance) / 2:.3g}, the default"
        yield "threshold_at", rule, f"{track.share:g}", hint
