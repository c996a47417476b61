"""What is measured of a touch: the force channel's zero and record, and whether it complied."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from statistics import median

import numpy as np

from device.force_channel.recording import Samples
from protocol.journal import events, records
from protocol.study.rig_settings import TARE_S
from protocol.study.rules import TouchRules
from runner.screens import Pacing
from runner.session.session import SessionContext, Zero
from runner.session.waiting import wait

DRIFT_N = 0.02
"""A zero that moved further within a minute is told: twice the drift of a usual sensor."""
TOUCHED_N = 0.1
"""One that moved further is no zero: a finger rests on the beam, or the sensor is broken."""


def tare(context: SessionContext) -> str:
    """Measure the force channel's zero on the untouched beam; return a warning, or nothing.

    The context's zero is the new one, unless something seems to touch the beam: then it stays the
    one before, and is not `trusted`. The first one on a beam is believed, and so is one that is
    found twice.
    """
    rate_hz = context.session.study.force_channel.rate_hz
    if rate_hz is None:
        return ""
    context.device.record(rate_hz, context.clock.monotonic_s)
    # Not a plain sleep: the watchdog is fed, and the operator can stop the session meanwhile.
    wait(context, TARE_S)
    measured_n = means(context.device.recorded())
    if measured_n is None:
        # Without samples nothing is known of the zero, so that the touch has no tare.
        context.zero = None
        return "the force channel gave no samples on the untouched surface"
    before, now_s = context.zero, context.clock.monotonic_s()
    context.zero = Zero(forces_n=measured_n, at_s=now_s)
    # The first zero on a beam cannot be compared with one before it: beams differ in weight.
    if before is None:
        return ""
    moved_n = _moved_n(measured_n, before.forces_n)
    # The limit holds for a minute and grows with the time, as a drift does.
    usual_n = DRIFT_N * max((now_s - before.at_s) / 60, 1.0)
    told = f"the zero of the force channel moved by {1e3 * moved_n:+.0f} mN"
    # A finger does not rest twice with the same force; a sensor that has moved stays where it is.
    again = before.doubted_n is not None and abs(_moved_n(measured_n, before.doubted_n)) <= usual_n
    if abs(moved_n) > TOUCHED_N + usual_n and not again:
        # The zero before stays to compare the next one with; this touch does without.
        context.zero = replace(before, doubted_n=measured_n)
        why = "something touches the surface, or the sensor drifts"
        return f"{told}: {why}; this touch has no tare"
    return told if abs(moved_n) > usual_n else ""


def _moved_n(now_n: tuple[float, float], before_n: tuple[float, float]) -> float:
    """The larger change of the two forces."""
    return max((now - before for now, before in zip(now_n, before_n, strict=True)), key=abs)


def begin(context: SessionContext) -> None:
    if (rate_hz := context.session.study.force_channel.rate_hz) is not None:
        context.device.record(rate_hz, context.clock.monotonic_s)


def end(context: SessionContext, touch: int, moved_s: tuple[float, float]) -> list[str]:
    """Stop recording and store what `touch` recorded; return what the operator must know.

    The output is off. `moved_s` is when the mark began to move, and when the touch was over.
    """
    if context.session.study.force_channel.rate_hz is None:
        return []
    samples = context.device.recorded()
    # A wrong tare would shift all forces; without one the analysis knows that it has none.
    tare_n = context.zero.forces_n if context.zero and context.zero.trusted else None
    context.log.append(
        events.TouchRecorded.packed(**vars(samples), touch=touch, moved_s=moved_s, tare_n=tare_n)
    )
    felt = means(samples, moved_s)
    warnings = []
    if samples.saturated:
        warnings.append(f"the force channel was at its limit in {samples.saturated} samples")
    if felt is None or (tare_n is not None and felt[1] - tare_n[1] < records.LIFTED_N):
        warnings.append("the force channel felt no finger")
    return warnings


def means(samples: Samples, within_s: Sequence[float] = ()) -> tuple[float, float] | None:
    """Return the mean tangential and normal force, N; None without samples.

    Begin and end are `within_s` on the session's clock; without them everything counts.
    """
    counts = np.frombuffer(samples.counts, "<i2").reshape(len(records.CHANNELS), -1)
    first_s = samples.first_s + samples.clock_offset_s
    places = [round((moment_s - first_s) * samples.rate_hz) for moment_s in within_s]
    count = counts.shape[1]
    # The touch may reach beyond what was recorded.
    low, high = (min(max(place, 0), count) for place in (places or (0, count)))
    if low >= high:
        return None
    tangential, normal = (counts[:2, low:high].mean(axis=1) * samples.scale[:2]).tolist()
    return tangential, normal


def samples_of(read_back: records.ReadBack) -> list[records.TraceSample]:
    """Return the finger sample in `read_back`, or an empty list if the rig has no sensors."""
    t_s, force_n, position_m = read_back.device_time_s, read_back.force_n, read_back.position_m
    if t_s is None or force_n is None or position_m is None:
        return []
    return [records.TraceSample(t_s=t_s, force_n=force_n, position_m=position_m)]


def judged(
    pacing: Pacing, samples: Sequence[records.TraceSample], rules: TouchRules
) -> records.Compliance:
    """Return the measured force and whether the touch complied with `pacing`.

    `force_ok`: the median force is near the instructed force. `place_ok`: the finger stayed in
    place, or moved in the right direction over about its path. `speed_ok`: the median speed of a
    slide is near the instructed one, if the rules limit it. All are None if no sample shows
    contact: the rig may have no sensors.
    """
    # Samples before the finger arrives, or after it has left, would pull the median force down.
    touching = [entry for entry in samples if entry.force_n > records.LIFTED_N]
    if not touching:
        return records.NOT_JUDGED
    force_n = median(entry.force_n for entry in touching)
    return records.Compliance(
        force_n=round(force_n, 4),
        force_ok=abs(force_n - pacing.force_n) <= rules.force_within * pacing.force_n,
        place_ok=_place_ok(pacing, touching, rules),
        speed_ok=_speed_ok(pacing, touching, rules),
    )


def _place_ok(pacing: Pacing, touching: Sequence[records.TraceSample], rules: TouchRules) -> bool:
    path_m = pacing.end_m - pacing.start_m
    # A touch without a path stays at one place. The share of the path below would divide by 0.
    if path_m == 0:
        deviation_m = median(abs(entry.position_m - pacing.start_m) for entry in touching)
        return deviation_m <= rules.place_within_m
    moved_m = touching[-1].position_m - touching[0].position_m
    return abs(moved_m / path_m - 1) <= rules.path_within


def _speed_ok(
    pacing: Pacing, touching: Sequence[records.TraceSample], rules: TouchRules
) -> bool | None:
    asked_m_s = (pacing.end_m - pacing.start_m) / pacing.duration_s
    speeds_m_s = [
        (after.position_m - before.position_m) / (after.t_s - before.t_s)
        for before, after in pairwise(touching)
        # Two samples with one time give no speed.
        if after.t_s > before.t_s
    ]
    if rules.speed_within is None or asked_m_s == 0 or not speeds_m_s:
        return None
    return abs(median(speeds_m_s) / asked_m_s - 1) <= rules.speed_within
