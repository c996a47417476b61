"""Random studies with tracks and random answers: no level that is asked is beyond a limit.

100,000 by default; a million with STUDIES=1000000.
"""

import os
from random import Random
from typing import Any

import pytest

from device.tracks.next_level import Answer, next_level
from protocol.plan.track_trials import touches_of
from protocol.study.study import Study
from protocol.study.touch import slew_v_per_us
from protocol.study.track import GUESS_RATE, Track
from protocol.study_file.limits import level_problems
from protocol.study_file.loading import parsed_study, template
from protocol.study_file.tracks import track_problems
from protocol.tracks.procedure import constant_order

STUDIES = int(os.environ.get("STUDIES", "100000"))
BASE = parsed_study(template("threshold"))


def drawn(random: Random) -> dict[str, Any]:
    """Return the keys of a track, many of which ask for more than the rig allows."""
    axis = random.choice(["voltage", "frequency"])
    method = random.choices(["quest+", "staircase", "limits", "constant"], [1, 6, 3, 2])[0]
    count = random.randint(2, 12)
    low, high = (
        ((1, 260) if axis == "voltage" else (0.8, 0.999))
        if random.random() < 0.9
        else ((0, 190) if axis == "voltage" else (1.001, 1.9))
    )
    ends = sorted(random.uniform(low, high) for _ in range(2))
    steps = [random.randint(1, min(4, count - 1)) for _ in range(random.randint(1, 3))]
    of_staircase = {"rule": f"{random.randint(2, 4)} down 1 up", "step_levels": steps}
    drive = {"voltage_v": random.uniform(20, 260)} if axis == "frequency" else {}
    zero = {"voltage_v": 0} if axis == "voltage" else {"frequency": 1.0, **drive}
    return {
        "name": "random",
        "task": "yes or no" if method == "limits" else random.choice(list(GUESS_RATE)),
        "method": method,
        "axis": axis,
        "levels": {"from": ends[0], "to": ends[1], "count": count, "spaced": "equal steps"},
        "standard": {"place": "smooth", **zero},
        "comparison": {"place": "smooth", **drive},
        "trials": count * random.randint(1, 3),
        **(of_staircase if method == "staircase" else {}),
    }


def beyond(study: Study, track: Track, random: Random) -> str:
    """Return which touch of a track that is answered at random breaks a limit of the rig."""
    told: list[Answer] = []
    order = constant_order(track, 1, "random") if track.method == "constant" else ()
    rig, hz = study.rig, study.rig.nominal_resonance_hz
    for _ in range(4 if track.method == "quest+" else 12):
        if (level := next_level(track, told, order)) is None:
            break
        told.append(Answer(level, random.random() < 0.7))
        for touch in touches_of(track, "level", 1, track.at(level)):
            slew = slew_v_per_us(touch.peak_voltage_v, touch.peak_frequency * hz)
            if (
                touch.peak_voltage_v > rig.max_voltage_v
                or touch.peak_frequency * hz > rig.max_frequency_hz
                or slew > rig.max_slew_v_per_us * (1 + 1e-12)
            ):
                return f"level {level}: {touch}"
    return ""


@pytest.mark.soak
def test_no_level_is_beyond_a_limit() -> None:
    random, run = Random("levels within limits"), 0
    for _ in range(STUDIES):
        track = Track.model_validate(drawn(random))
        most_v, most_slew = random.uniform(60, 200), random.uniform(8, 40)
        rig = BASE.rig.model_copy(
            update={"max_voltage_v": most_v, "max_slew_v_per_us": most_slew, "max_drive_s": 20.0}
        )
        study = BASE.model_copy(update={"rig": rig, "track": (track,)})
        if any(track_problems(study)):
            continue
        levels = map(track.at, range(len(track.values)))
        if any(level_problems(study, 0, levels)):
            continue
        run += 1
        assert beyond(study, track, random) == "", track
    assert run > STUDIES / 20, "most of them would be refused for another reason"
    print(f"{run} of {STUDIES} random studies are allowed, and none goes beyond a limit")
