"""Checks of a plan's trials against the limits of the rig."""

from collections.abc import Iterator
from itertools import pairwise
from math import pi

from protocol.plan.trials import Plan
from protocol.study.rig_settings import TARE_S
from protocol.study.study import Study
from protocol.study.touch import Touch

Violations = Iterator[tuple[str, str]]

_ROUNDING = 1 + 1e-12


def limit_violations(study: Study, plan: Plan) -> Violations:
    """Yield (rule, value) for every limit that the plan exceeds."""
    for trial in plan.trials:
        for touch in trial.touches:
            for rule, value, limit in _measures(study, touch):
                if value > limit * _ROUNDING:
                    yield (
                        f"{rule} must not exceed {limit:.12g}",
                        f"{value:.12g} in trial {trial.index}",
                    )
    yield from _beams(study, plan)
    duration_s = plan_s(study, plan)
    if duration_s > study.timing.max_session_s * _ROUNDING:
        yield (
            f"a session must not take more than {study.timing.max_session_s:g} s",
            f"{duration_s:.0f} s",
        )


def _measures(study: Study, touch: Touch) -> Iterator[tuple[str, float, float]]:
    """Yield (quantity, value, limit) for each limited quantity of a touch."""
    rig = study.rig
    volts = max(touch.voltage_v, touch.end_voltage_v)
    hertz = max(touch.frequency, touch.end_frequency) * rig.nominal_resonance_hz
    seconds = _touch_s(study, touch)
    before_s = max(study.touch.lead_in_s, touch.voltage_v / rig.ramp_v_per_s)
    yield "amplitude, V,", volts, rig.max_voltage_v
    yield "frequency, Hz,", hertz, rig.max_frequency_hz
    yield "slew, V/us,", 2e-6 * pi * hertz * volts, rig.max_slew_v_per_us
    yield "ramp, V/s,", abs(touch.end_voltage_v - touch.voltage_v) / seconds, rig.ramp_v_per_s
    yield "drive, s,", before_s + seconds if volts else 0.0, rig.max_drive_s
    if rig.amplifier_gain is not None:
        yield "generator, V peak-to-peak,", 2 * volts / rig.amplifier_gain, rig.generator_max_vpp
    if rig.capacitance_nf is not None and rig.max_current_ma is not None:
        milliamperes = 2e-6 * pi * hertz * volts * rig.capacitance_nf
        yield "current, mA,", milliamperes, rig.max_current_ma


def _touch_s(study: Study, touch: Touch) -> float:
    left_m, right_m = study.touch.path_m
    slide_s = (right_m - left_m) / study.touch.sliding_speed_m_s
    return touch.duration_s or (slide_s if touch.place == "path" else study.touch.hold_s)


def _mounted(study: Study, plan: Plan) -> list[str | None]:
    needed = [touch.beam or study.touch.beam for trial in plan.trials for touch in trial.touches]
    return [study.touch.beam, *needed]


def _beams(study: Study, plan: Plan) -> Violations:
    mounted = _mounted(study, plan)
    for beam in sorted({beam for beam in mounted if beam is not None} - set(study.beams)):
        yield "a beam must be one of the study's", repr(beam)
    swaps = sum(before != after for before, after in pairwise(mounted))
    if study.design.max_beam_swaps is not None and swaps > study.design.max_beam_swaps:
        yield f"at most {study.design.max_beam_swaps} beam swaps are allowed", str(swaps)


def plan_s(study: Study, plan: Plan) -> float:
    """Return the duration of the plan, s, computed here independently of `protocol.plan`."""
    timing, rig = study.timing, study.rig
    mounted = _mounted(study, plan)
    total_s = timing.beam_swap_s * sum(a != b for a, b in pairwise(mounted))
    blocks = len({trial.block for trial in plan.trials} - {0})
    times = {"before": 1, "after": 1, "block": blocks}
    total_s += timing.reading_s if study.design.practice_trials else 0.0
    for page in study.page:
        every_block = blocks if page.block is None else page.block <= blocks
        total_s += timing.reading_s * (every_block if page.before == "block" else 1)
    for question in study.question:
        if question.sessions == "every" or plan.session == 1:
            total_s += timing.answer_s * times.get(question.when, 0)
    for trial in plan.trials:
        after = [question for question in study.question if question.when == "trial"]
        asked = [q for q in after if not q.conditions or trial.condition in q.conditions]
        total_s += timing.answer_s * len(asked) * (trial.condition is not None)
        total_s += trial.break_s + timing.inter_trial_s
        total_s += timing.answer_s * (trial.question is not None) + timing.score_s * trial.scored
        total_s += timing.between_touches_s * (len(trial.touches) - 1)
        total_s += TARE_S * len(trial.touches) * (study.force_channel.rate_hz is not None)
        for touch in trial.touches:
            before_s = max(study.touch.lead_in_s, touch.voltage_v / rig.ramp_v_per_s)
            total_s += timing.reading_s + before_s + _touch_s(study, touch)
    return total_s
