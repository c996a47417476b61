"""Compliance with the touch instruction: the finger's position, movement and force."""

from collections.abc import Sequence
from statistics import median

from protocol.journal.records import LIFTED_N, NOT_JUDGED, Compliance, ReadBack, TraceSample
from runner.screens import Pacing

PLACE_TOLERANCE_M = 0.005
"""Half the length of a finger's contact."""
FORCE_TOLERANCE = 0.5
"""Relative to the instructed force; people do not press evenly."""


def samples_of(read_back: ReadBack) -> list[TraceSample]:
    """Return the finger sample in `read_back`, or an empty list if the rig has no sensors."""
    t_s, force_n, position_m = read_back.device_time_s, read_back.force_n, read_back.position_m
    if t_s is None or force_n is None or position_m is None:
        return []
    return [TraceSample(t_s=t_s, force_n=force_n, position_m=position_m)]


def judged(pacing: Pacing, samples: Sequence[TraceSample]) -> Compliance:
    """Return the measured force and whether the touch complied with `pacing`.

    `force_ok`: the median force lies within `FORCE_TOLERANCE` of the instructed force. `place_ok`:
    the finger stayed in place, or moved in the right direction over 50 to 150 % of its path. Both
    are None if no sample shows contact: the rig may have no sensors.
    """
    touching = [entry for entry in samples if entry.force_n > LIFTED_N]
    if not touching:
        return NOT_JUDGED
    force_n = median(entry.force_n for entry in touching)
    return Compliance(
        force_n=round(force_n, 4),
        force_ok=abs(force_n - pacing.force_n) <= FORCE_TOLERANCE * pacing.force_n,
        place_ok=_place_ok(pacing, touching),
    )


def _place_ok(pacing: Pacing, touching: Sequence[TraceSample]) -> bool:
    path_m = pacing.end_m - pacing.start_m
    if path_m == 0:
        deviation_m = median(abs(entry.position_m - pacing.start_m) for entry in touching)
        return deviation_m <= PLACE_TOLERANCE_M
    moved_m = touching[-1].position_m - touching[0].position_m
    return 0.5 <= moved_m / path_m <= 1.5
