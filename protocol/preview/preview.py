"""The preview of a cohort's plans: durations, beam swaps, extremes and balance."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from protocol.plan.plan import plan
from protocol.plan.slide_plan import slide_plan, slide_study
from protocol.plan.trials import Plan, Trial, plan_swaps, session_s, touches_s
from protocol.preview.precision import Cohort, Precision, cohort, precisions
from protocol.preview.session_length import session_lengths
from protocol.proof.cohort import CarryOver, carry_over
from protocol.study.rig_settings import ForceChannel
from protocol.study.study import Study
from protocol.study.touch import Touch, slew_v_per_us
from protocol.study_file.limits import max_resonance_hz

LINE_BAUD = 115_200
"""Of a serial line between board or gauge and host; USB and networks carry more."""
_BITS_PER_BYTE = 10  # 8 and two that frame them
_BLOCKS_PER_S = 20
_BLOCK_BYTES = {"board": 26, "gauge": 26}
"""Of a block without its samples: its length, number, time, checksum and end."""
_SAMPLE_BYTES = {"board": 6, "gauge": 22}
"""Three counts of 16 bits; three numbers in text, such as `0.1234,0.5601,0.04512;`."""


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """A model's predictions: its friction law, its rung, and the contrast of a trial.

    `contrast` is `None` for a trial without a question. `rig` describes the rig as calibrated; it
    is empty without a calibration.
    """

    law: str
    rung: str
    contrast: Callable[[Trial], float | None]
    rig: str = ""


@dataclass(frozen=True, kw_only=True)
class Preview:
    """A cohort's plans, slot by slot, with their durations, beam swaps and extremes.

    `slide` is the plan of the sliding experiment, None if the study says nothing of one.
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
    slide: Plan | None
    slide_s: float


def preview(study: Study, participants: int) -> Preview:
    """Return the preview of the first sessions of slots 0 to `participants` - 1."""
    plans = tuple(plan(study, slot) for slot in range(participants))
    touches = [touch for each in plans for trial in each.trials for touch in trial.touches]
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
            slew_v_per_us(touch.peak_voltage_v, touch.peak_frequency * nominal_hz)
            for touch in touches
        ),
        max_resonance_hz=max_resonance_hz(study, touches),
        slide=slide,
        slide_s=0.0 if slide is None else session_s(sliding, slide),
    )


def line_share(channel: ForceChannel) -> float:
    """Return how much of a serial line of `LINE_BAUD` the samples take; above 1 it is too slow.

    >>> round(line_share(ForceChannel(rate_hz=1000)), 2)
    0.57
    """
    speaks = "board" if channel.gauge is None else "gauge"
    sent = _SAMPLE_BYTES[speaks] * (channel.rate_hz or 0) + _BLOCK_BYTES[speaks] * _BLOCKS_PER_S
    return _BITS_PER_BYTE * sent / LINE_BAUD


def precision_by_length(shown: Preview, model: Prediction) -> list[Precision]:
    """Return how precisely sessions of this and other lengths determine each sensitivity."""
    study = shown.study
    return precisions(
        scored_contrasts(shown, model),
        study.design.repeats,
        session_lengths(study),
        study.rating,
        assumed_cohort(shown),
    )


def assumed_cohort(shown: Preview) -> Cohort:
    """Return the cohort of a forecast: of the paper's size if the preview is of one participant."""
    return cohort(len(shown.plans), shown.study.forecast, shown.study.rating)


def scored_contrasts(shown: Preview, model: Prediction) -> dict[str, list[float]]:
    """Return the predicted contrasts of a participant's scored trials by condition.

    Only the first slot's plan is used: every slot has the same trials in another order.
    """
    found: dict[str, list[float]] = {}
    for trial in shown.plans[0].trials:
        contrast = model.contrast(trial) if trial.kind == "trial" else None
        if contrast is not None and trial.condition is not None:
            found.setdefault(trial.condition, []).append(contrast)
    return found


def preview_record(shown: Preview, model: Prediction) -> dict[str, Any]:
    """Return the preview as plain JSON values; infinite widths become `None`."""
    channel = shown.study.force_channel
    recorded = {
        "rate_hz": channel.rate_hz,
        "gauge": channel.gauge,
        "line_share": round(line_share(channel), 2),
    }
    return {
        "participants": [
            {
                "id": f"P{each.slot + 1:02d}",
                "sequence": list(each.sequence),
                "trials": [_trial_record(shown.study, trial, model) for trial in each.trials],
                "duration_s": round(duration_s, 1),
                "beam_swaps": swaps,
            }
            for each, duration_s, swaps in zip(
                shown.plans, shown.durations_s, shown.swaps, strict=True
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
        **({} if shown.slide is None else {"slide": _slide_record(shown.slide, shown.slide_s)}),
        "max_voltage_v": shown.max_voltage_v,
        "max_frequency_hz": shown.max_frequency_hz,
        "max_slew_v_per_us": shown.max_slew_v_per_us,
        "max_resonance_hz": round(shown.max_resonance_hz, 1),
        "carryover": {
            "conditions": list(shown.study.conditions),
            "counts": [list(row) for row in shown.carryover.counts],
            "balanced": shown.carryover.balanced,
            "imbalance": shown.carryover.imbalance,
            "promised": shown.carryover.guaranteed,
            "across_blocks": [list(row) for row in shown.carryover.across_blocks],
        },
        "minutes_buy": [_precision_record(each) for each in precision_by_length(shown, model)],
    }


def _slide_record(sliding: Plan, duration_s: float) -> dict[str, Any]:
    passes = [{"index": trial.index, "drive": trial.condition} for trial in sliding.trials]
    return {"passes": passes, "duration_s": round(duration_s, 1)}


def _trial_record(study: Study, trial: Trial, model: Prediction) -> dict[str, Any]:
    return {
        "index": trial.index,
        "block": trial.block,
        "kind": trial.kind,
        "condition": trial.condition,
        "opposite": trial.opposite,
        "level": trial.level,
        "levels": levels(trial.touches),
        "expected": trial.expected,
        "touches": len(trial.touches),
        "touching_s": round(touches_s(study, trial.touches), 2),
        "predicted_contrast": model.contrast(trial),
    }


def levels(touches: Sequence[Touch]) -> dict[str, list[Any]]:
    """Return the settings of the touches in order; a pair is [start, end] of a touch."""
    return {
        "voltage_v": [_course(touch.voltage_v, touch.end_voltage_v) for touch in touches],
        "frequency": [_course(touch.frequency, touch.end_frequency) for touch in touches],
        "press": [touch.press for touch in touches],
        "direction": [touch.direction for touch in touches],
        "beam": [touch.beam for touch in touches],
    }


def _course(start: float, end: float) -> float | list[float]:
    return start if start == end else [start, end]


def _precision_record(precision: Precision) -> dict[str, Any]:
    return {
        "repeats": precision.repeats,
        "trials": precision.trials,
        "duration_s": round(precision.duration_s, 1),
        "whole": precision.whole,
        "half_width": _finite(precision.half_width),
        "gain_half_width": _finite(precision.gain_half_width),
        "relative_half_width": _finite(precision.relative),
    }


def _finite(width: float) -> float | None:
    return round(width, 4) if width < float("inf") else None
