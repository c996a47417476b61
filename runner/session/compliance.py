"""What was done, judged against the instruction: the finger's place, its way and its force."""

from collections.abc import Sequence
from statistics import median

from protocol.journal.records import LIFTED_N, NOT_JUDGED, Compliance, ReadBack, TraceSample
from runner.screens import Pacing

PLACE_TOLERANCE_M = 0.005
"""Half the contact of a finger."""
FORCE_TOLERANCE = 0.5
"""Relative to the force asked for; people do not press evenly."""


def samples_of(read_back: ReadBack) -> list[TraceSample]:
    """Return what `read_back` says of the finger: one sample, none without sensors."""
    t_s, force_n, position_m = (
        read_back.device_time_s,
        read_back.force_n,
        read_back.position_m,
    )
    if t_s is None or force_n is None or position_m is None:
        return []
    return [TraceSample(t_s=t_s, force_n=force_n, position_m=position_m)]


def judged(pacing: Pacing, samples: Sequence[TraceSample]) -> Compliance:
    """Return what was done and whether it was what `pacing` asked for.

    `force_ok`: the median force lies within `FORCE_TOLERANCE` of the one asked for. `place_ok`:
    the finger stayed at its place, or moved the right way over at least half of its path. Both are
    None where the rig felt no finger at all: it may have no sensors.
    """
    touching = [entry for entry in samples if entry.force_n > LIFTED_N]
    if not touching:
        return NOT_JUDGED
    force_n = median(entry.force_n for entry in touching)
    return Compliance(
        force_n=round(force_n, 4),
        force_ok=abs(force_n - pacing.force_n) <= FORCE_TOLERANCE * pacing.force_n,
        place_ok=_moved_as_asked(pacing, touching),
    )


def _moved_as_asked(pacing: Pacing, touching: Sequence[TraceSample]) -> bool:
    way_m = pacing.end_m - pacing.start_m
    if way_m == 0:
        off_m = median(abs(entry.position_m - pacing.start_m) for entry in touching)
        return off_m <= PLACE_TOLERANCE_M
    moved_m = touching[-1].position_m - touching[0].position_m
    return 0.5 <= moved_m / way_m <= 1.5
