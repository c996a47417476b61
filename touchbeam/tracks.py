"""What a track would ask after given answers, and its estimate of the threshold."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from protocol.errors import BadInput

if TYPE_CHECKING:
    import os

    from device.friction.calibration import Calibration
    from device.tracks.next_level import Answer
    from protocol.study.study import Study
    from protocol.study.track import Track


def track(
    folder: "str | os.PathLike[str]", name: str, answers: Sequence[bool | int]
) -> dict[str, Any]:
    """Return what a track of the study in `folder` asks after `answers`, as `touchbeam track` does.

    Nothing needs to be recorded. `levels` and `values` are those that the answers were given at,
    `next` is the level to ask next or None, `estimate` what the answers say of the threshold.

    Args:
        folder: the study's.
        name: the track's.
        answers: in their order; 1 or True is a correct answer, or in yes or no "yes".

    Raises:
        ValueError: there is no such track, or it ends before the last answer.
    """
    from pathlib import Path

    from runner.study.calibration import fitted_calibration
    from runner.study.folder import StudyFolder

    place = StudyFolder(path=Path(folder))
    study = place.study()
    return track_of(study, fitted_calibration(place.path, study), name, answers)


def track_of(
    study: "Study", rig: "Calibration", name: str, answers: Sequence[bool | int]
) -> dict[str, Any]:
    """Return what `track` does, of a study and a rig that were read already."""
    from device.tracks.next_level import levels_of, next_level
    from protocol.tracks.procedure import constant_order
    from runner.study.tracks import volts_of

    names = [each.name for each in study.track]
    if name not in names:
        known = ", ".join(map(repr, names)) or "none; [[track]] declares one"
        raise BadInput(f"no track is called {name!r}; known: {known}")
    if wrong := [answer for answer in answers if answer not in {0, 1}]:
        raise BadInput(f"an answer must be 1 (correct, or yes) or 0, got {wrong[0]!r}")
    number = names.index(name)
    chosen = study.track[number]
    volts, problems = volts_of(study, number, rig)
    if problems:
        raise BadInput(str(problems[0]))
    first = (chosen, study.study.seed, 1, 0)  # of the first participant
    order: Sequence[int] = constant_order(*first) if chosen.method == "constant" else ()
    told = levels_of(chosen, [bool(answer) for answer in answers], order)
    if len(told) < len(answers):
        raise BadInput(
            f"{name!r} ends after {len(told)} of these {len(answers)} answers: leave the rest out"
        )
    level, levels = next_level(chosen, told, order), [answer.level for answer in told]
    following = None
    if level is not None:
        following = {"index": level, "value": chosen.values[level], "volts": volts[level]}
    return {
        "name": name,
        "task": chosen.task,
        "method": chosen.method,
        "levels": levels,
        "values": [chosen.values[each] for each in levels],
        "next": following,
        "estimate": _estimate(chosen, told),
    }


def _estimate(track: "Track", told: "Sequence[Answer]") -> dict[str, Any]:
    """Return the threshold as a session tells it, and the mean of a staircase's reversals."""
    from device.tracks.posterior import estimate
    from protocol.tracks.procedure import (
        converges_at,
        in_mean,
        place_after,
        reversal_mean,
        staircase,
    )

    made = estimate(track, told) if told else None
    found: dict[str, Any] = {
        "threshold": made.threshold if made else None,
        "threshold_ci": list(made.threshold_ci) if made else [None, None],
        "threshold_at": round(track.share, 4),
        **({"interval_db": made.interval_db} if made else {}),
    }
    if track.turns:
        turned_at = place_after(track, told).turned_at
        found["reversals"] = len(turned_at)
        found["reversals_in_mean"] = len(in_mean(track, turned_at))
        found["reversal_mean"] = reversal_mean(track, turned_at)
        if track.method == "staircase":
            found["reversal_mean_at"] = round(converges_at(staircase(track)), 4)
    return found
