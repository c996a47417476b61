"""Compliance with the touch instruction: the finger's position, movement, speed and force."""

from collections.abc import Sequence
from itertools import pairwise
from statistics import median

from protocol.journal.records import LIFTED_N, NOT_JUDGED, Compliance, ReadBack, TraceSample
from protocol.study.rules import TouchRules
from runner.screens import Pacing


def samples_of(read_back: ReadBack) -> list[TraceSample]:
    """Return the finger sample in `read_back`, or an empty list if the rig has no sensors."""
    t_s, force_n, position_m = read_back.device_time_s, read_back.force_n, read_back.position_m
    if t_s is None or force_n is None or position_m is None:
        return []
    return [TraceSample(t_s=t_s, force_n=force_n, position_m=position_m)]


def judged(pacing: Pacing, samples: Sequence[TraceSample], rules: TouchRules) -> Compliance:
    """Return the measured force and whether the touch complied with `pacing`.

    `force_ok`: the median force is near the instructed force. `place_ok`: the finger stayed in
    place, or moved in the right direction over about its path. `speed_ok`: the median speed of a
    slide is near the instructed one, if the rules limit it. All are None if no sample shows
    contact: the rig may have no sensors.
    """
    touching = [entry for entry in samples if entry.force_n > LIFTED_N]
    if not touching:
        return NOT_JUDGED
    force_n = median(entry.force_n for entry in touching)
    return Compliance(
        force_n=round(force_n, 4),
        force_ok=abs(force_n - pacing.force_n) <= rules.force_within * pacing.force_n,
        place_ok=_place_ok(pacing, touching, rules),
        speed_ok=_speed_ok(pacing, touching, rules),
    )


def _place_ok(pacing: Pacing, touching: Sequence[TraceSample], rules: TouchRules) -> bool:
    path_m = pacing.end_m - pacing.start_m
    if path_m == 0:
        deviation_m = median(abs(entry.position_m - pacing.start_m) for entry in touching)
        return deviation_m <= rules.place_within_m
    moved_m = touching[-1].position_m - touching[0].position_m
    return abs(moved_m / path_m - 1) <= rules.path_within


def _speed_ok(pacing: Pacing, touching: Sequence[TraceSample], rules: TouchRules) -> bool | None:
    asked_m_s = (pacing.end_m - pacing.start_m) / pacing.duration_s
    speeds_m_s = [
        (after.position_m - before.position_m) / (after.t_s - before.t_s)
        for before, after in pairwise(touching)
        if after.t_s > before.t_s
    ]
    if rules.speed_within is None or asked_m_s == 0 or not speeds_m_s:
        return None
    return abs(median(speeds_m_s) / asked_m_s - 1) <= rules.speed_within
