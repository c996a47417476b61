"""The preview of a cohort's plans: durations, beam swaps, extremes and balance."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import count
from math import isfinite
from typing import Any, Literal

from protocol.address import BAUD
from protocol.journal.records import BYTES_PER_COUNT, CHANNELS
from protocol.plan.plan import cohort_plans, slide_plan, slide_study
from protocol.plan.trials import Plan, Trial, plan_swaps, session_s, touches_s
from protocol.proof.trial_checks import CarryOver, by_group, carry_over
from protocol.study.rig_settings import ForceChannel
from protocol.study.study import Study
from protocol.study.touch import Touch, slew_v_per_us
from protocol.study_file.limits import max_resonance_hz

_BITS_PER_BYTE = 10  # 8 and two that frame them
_BLOCKS_PER_S = 20
_BLOCK_BYTES = {"board": 26, "gauge": 26}
"""Of a block without its samples: its length, number, time, checksum and end."""
_SAMPLE_BYTES = {"board": BYTES_PER_COUNT * len(CHANNELS), "gauge": 22}
"""A count of each channel; three numbers in text, such as `0.1234,0.5601,0.04512;`."""


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """Predictions: `contrast` is None of no question, `rig` '' if not calibrated.

    `source` says where friction comes from, if not from the model under this law on this rung;
    `rest` to what that of a touch is compared that is rated at once.
    """

    law: str
    rung: str
    contrast: Callable[[Trial], float | None]
    rig: str = ""
    source: str = ""
    rest: str = "that at 0 V"


Resonance = Literal["measured", "kept", "missing"]
"""Where a session has the rig's resonance from: measured before the first touch, or kept as the
calibration of a device that measures none; else nothing can be driven."""


@dataclass(frozen=True, kw_only=True)
class Preview:
    """A cohort's plans, by slot, their durations, swaps and extremes, and the `slide`, if any.

    A kept `resonance` is the nominal one of the `study`.
    """

    study: Study
    plans: tuple[Plan, ...]
    carryover: CarryOver
    durations_s: tuple[float, ...]
    swaps: tuple[int, ...]
    max_voltage_v: float
    max_frequency_hz: float
    max_slew_v_per_us: float
    max_resonance_hz: float
    resonance: Resonance
    slide: Plan | None
    slide_s: float


def preview(
    study: Study,
    participants: int,
    at_levels: Iterable[Touch] = (),
    resonance: Resonance = "measured",
) -> Preview:
    """Return the preview of the first sessions of that many participants.

    `at_levels` are the touches that tracks may make, which the plans do not have.
    """
    plans = cohort_plans(study, participants)
    touches = [touch for each in plans for trial in each.trials for touch in trial.touches]
    touches += at_levels
    nominal_hz = study.rig.nominal_resonance_hz
    sliding = slide_study(study)
    slide = slide_plan(sliding) if "slide" in study.model_fields_set else None
    return Preview(
        study=study,
        plans=plans,
        carryover=carry_over(study, plans),
        durations_s=tuple(session_s(study, each) for each in plans),
        swaps=tuple(plan_swaps(study, each) for each in plans),
        max_voltage_v=max(touch.peak_voltage_v for touch in touches),
        max_frequency_hz=max(touch.peak_frequency for touch in touches) * nominal_hz,
        max_slew_v_per_us=max(
            slew_v_per_us(it.peak_voltage_v, it.peak_frequency * nominal_hz) for it in touches
        ),
        max_resonance_hz=max_resonance_hz(study, touches),
        resonance=resonance,
        slide=slide,
        slide_s=0.0 if slide is None else session_s(sliding, slide),
    )


def line_share(channel: ForceChannel) -> float:
    """Return how much of a serial line of `BAUD` the samples take; above 1 it is too slow.

    >>> round(line_share(ForceChannel(rate_hz=1000)), 2)
    0.57
    """
    speaks = "board" if channel.gauge is None else "gauge"
    sent = _SAMPLE_BYTES[speaks] * (channel.rate_hz or 0) + _BLOCK_BYTES[speaks] * _BLOCKS_PER_S
    return _BITS_PER_BYTE * sent / BAUD


def preview_record(shown: Preview, model: Prediction) -> dict[str, Any]:
    """Return the preview as plain JSON values."""
    channel = shown.study.force_channel
    share = round(line_share(channel), 2)
    recorded = {"rate_hz": channel.rate_hz, "gauge": channel.gauge, "line_share": share}
    groups = [
        {"name": name, "participants": len(own), **_balance_record(carry_over(shown.study, own))}
        for name, own in by_group(shown.plans).items()
        if name
    ]
    sliding = shown.slide.trials if shown.slide else ()
    passes = [{"index": trial.index, "drive": trial.condition} for trial in sliding]
    slide_s, highest_hz = round(shown.slide_s, 1), shown.max_resonance_hz
    return {
        "participants": [
            {
                "id": f"P{number:02d}",
                **({"group": each.group, "slot": each.slot} if each.group else {}),
                "sequence": list(each.sequence),
                "trials": [_trial_record(shown.study, trial, model) for trial in each.trials],
                "duration_s": round(duration_s, 1),
                "beam_swaps": swaps,
            }
            for number, each, duration_s, swaps in zip(
                count(1), shown.plans, shown.durations_s, shown.swaps, strict=False
            )
        ],
        "questions": [{"name": each.name, "when": each.when} for each in shown.study.question],
        "pages": [
            {"before": page.before, "block": page.block, "picture": page.picture}
            for page in shown.study.page
        ],
        "contrast_law": model.law,
        "contrast_rung": model.rung,
        **({"contrast_rig": model.rig} if model.rig else {}),
        **({} if channel.rate_hz is None else {"recorded": recorded}),
        **({"slide": {"passes": passes, "duration_s": slide_s}} if shown.slide else {}),
        "max_voltage_v": shown.max_voltage_v,
        "max_frequency_hz": shown.max_frequency_hz,
        "max_slew_v_per_us": shown.max_slew_v_per_us,
        "resonance": {"from": shown.resonance, "hz": shown.study.rig.nominal_resonance_hz},
        # No number in JSON is infinite: without a drive that follows it none is too high.
        "max_resonance_hz": round(highest_hz, 1) if isfinite(highest_hz) else None,
        "carryover": {
            "conditions": list(shown.study.conditions),
            "counts": [list(row) for row in shown.carryover.counts],
            **_balance_record(shown.carryover),
            "across_blocks": [list(row) for row in shown.carryover.across_blocks],
        },
        **({"groups": groups} if groups else {}),
    }


def _balance_record(found: CarryOver) -> dict[str, Any]:
    known = {"balanced": found.balanced, "imbalance": found.imbalance}
    return {**known, "promised": found.guaranteed}


def _trial_record(study: Study, trial: Trial, model: Prediction) -> dict[str, Any]:
    planned = ("index", "block", "kind", "condition", "opposite", "level")
    return {
        **{key: getattr(trial, key) for key in planned},
        "levels": levels(trial.touches),
        "expected": trial.expected,
        "touches": len(trial.touches),
        "touching_s": round(touches_s(study, trial.touches), 2),
        "predicted_contrast": model.contrast(trial),
    }


def levels(touches: Sequence[Touch]) -> dict[str, list[Any]]:
    """Return the settings of the touches in order; a pair is [start, end] of a touch."""
    constant = ("frequency_hz", "press", "sliding_speed_m_s", "direction", "beam")
    return {
        "voltage_v": [_course(touch.voltage_v, touch.end_voltage_v) for touch in touches],
        "frequency": [_course(touch.frequency, touch.end_frequency) for touch in touches],
        **{key: [getattr(touch, key) for touch in touches] for key in constant},
    }


def _course(start: float, end: float) -> float | list[float]:
    return start if start == end else [start, end]
