"""The preview of a cohort's plans: durations, beam swaps, extremes and balance."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from math import atan, cos, hypot, inf, isfinite, pi, sin, sqrt
from typing import Any, Literal

from protocol.address import BAUD
from protocol.journal.records import BYTES_PER_COUNT, CHANNELS
from protocol.plan.feasibility import design_problems, most_catches
from protocol.plan.plan import cohort_plans, plan, slide_plan, slide_study
from protocol.plan.trials import Plan, Trial, plan_swaps, session_s, touches_s
from protocol.proof.trial_checks import CarryOver, by_group, carry_over
from protocol.study.rig_settings import ForceChannel
from protocol.study.rules import MOST_REPEATS, PAPERS_SCALE, Forecast, Rating
from protocol.study.study import Study
from protocol.study.touch import Touch, slew_v_per_us
from protocol.study_file.limits import max_resonance_hz


@dataclass(frozen=True, kw_only=True)
class SessionLength:
    """A session of `repeats` repeats; unless `whole`, other constraints were relaxed to plan it."""

    repeats: int
    duration_s: float
    whole: bool


def session_lengths(study: Study) -> Iterator[SessionLength]:
    """Yield sessions of fewer, as many and more repeats, as far as a study file may set them."""
    repeats = study.design.repeats
    others = {1, 2, max(1, repeats // 2), repeats, repeats + 1, 2 * repeats, 4 * repeats}
    for other in sorted(other for other in others if other <= MOST_REPEATS):
        asked = _with(study, repeats=other)
        # The schema refuses such a design, and a copy is not checked against it.
        whole = study.design.opposite_repeats < other and not design_problems(asked)
        planned = asked if whole else _relaxed(asked)
        yield SessionLength(
            repeats=other, duration_s=session_s(planned, plan(planned, 0)), whole=whole
        )


def _with(study: Study, **design: object) -> Study:
    return study.model_copy(update={"design": study.design.model_copy(update=design)})


def _relaxed(study: Study) -> Study:
    """Return the study with its other constraints relaxed as far as its repeats require."""
    design = study.design
    conditions = tuple(
        condition.model_copy(update={"levels": (max(condition.levels),)})
        if design.repeats % len(condition.levels)
        else condition
        for condition in study.condition
    )
    return _with(
        study.model_copy(update={"condition": conditions}),
        opposite_repeats=min(design.opposite_repeats, design.repeats - 1),
        catch_trials=min(design.catch_trials, most_catches(study)),
        max_alike_in_row=max(design.max_alike_in_row, design.repeats),
    )


# Precision by session length: how precisely a session determines each person's sensitivity.
#
# The forecast is of the intervals that M2 reports (see docs/report.md), for N people of n scored
# trials each. With v = s² / Σ(x - mean x)², the variance of the slope of one person's scores
# about their own line, and τ the SD of gains between people, the variance of a gain relative to
# the group's mean is
#
#     (1 - 1/N) v [1 - ((N - 3)/(N - 1))² v / (v + τ²)],
#
# as in a hierarchical model whose prior is flat in τ² (Morris and Tang, Statistical Science 26,
# 2011, 271-287). Everybody shares what a condition adds beside its predicted contrast, so that it
# does not affect relative gains.
#
# It does affect the gains themselves, through their mean. The C condition means scatter about the
# group's line with the variance d² + s²/(N r), where r repeats do not reduce d, the spread of the
# conditions off the line; t has C - 2 degrees of freedom. Only differences of contrast within a
# condition, from graded levels, are free of d.

PAPERS_PARTICIPANTS = 9
_NEGLIGIBLE = 1e-12

Contrasts = Mapping[str, Sequence[float]]
"""The predicted contrasts of a participant's scored trials, by condition."""


@dataclass(frozen=True, kw_only=True)
class Precision(SessionLength):
    """A session and the precision it gives, from the scores of `trials` trials a person.

    `half_width` is that of the 95% interval of a gain relative to the group's mean, and
    `gain_half_width` that of the gain itself, in score points per unit of predicted contrast;
    `relative` is the share of `half_width` in the gain that would use the whole scale, from no
    contrast to the largest. They are infinite if the trials do not determine them.
    """

    trials: int
    half_width: float
    gain_half_width: float
    relative: float


@dataclass(frozen=True, kw_only=True)
class Cohort:
    """The number of participants, and the SDs of their scores and gains, in points of the scale."""

    participants: int
    residual_sd: float
    off_the_line_sd: float
    gain_sd: float


def cohort(participants: int, forecast: Forecast, rating: Rating) -> Cohort:
    """Return the cohort that a study file assumes, whose SDs are on the paper's scale."""
    points = rating.span / PAPERS_SCALE.span
    return Cohort(
        # Nothing can be said of the spread between people from one of them.
        participants=participants if participants > 1 else PAPERS_PARTICIPANTS,
        **{name: points * sd for name, sd in forecast},
    )


def precisions(
    contrasts: Contrasts,
    repeats: int,
    sessions: Iterable[SessionLength],
    rating: Rating,
    people: Cohort,
) -> list[Precision]:
    """Return the precision of `sessions`, whose contrasts spread as in one of `repeats` repeats."""
    every = [contrast for own in contrasts.values() for contrast in own]
    largest = max(map(abs, every), default=0.0)

    def precision(session: SessionLength) -> Precision:
        share = session.repeats / repeats
        half = relative_gain_half_width(contrasts, share, people)
        return Precision(
            **vars(session),
            trials=round(share * len(every)),
            half_width=half,
            gain_half_width=hypot(half, _mean_gain_half_width(contrasts, share, people)),
            relative=half * largest / rating.span if half < inf else inf,
        )

    return [precision(session) for session in sessions]


def relative_gain_half_width(contrasts: Contrasts, share: float, people: Cohort) -> float:
    """Return half a relative gain's 95% interval for `share` times the trials of `contrasts`."""
    every = [contrast for own in contrasts.values() for contrast in own]
    spread, trials = share * squared_spread(every), round(share * len(every))
    # A line takes two of the trials: less than three leave no degree of freedom.
    if trials < 3 or spread <= _NEGLIGIBLE:
        return inf
    count, variance = people.participants, people.residual_sd**2 / spread
    pooled = (max(count - 3, 0) / (count - 1)) ** 2 * variance / (variance + people.gain_sd**2)
    sd = sqrt((1 - 1 / count) * variance * (1 - pooled))
    return t_quantile(0.975, (count - 1) * (trials - 2)) * sd


def _mean_gain_half_width(contrasts: Contrasts, share: float, people: Cohort) -> float:
    groups = [own for own in contrasts.values() if own]
    means = [sum(own) / len(own) for own in groups]
    between, within = squared_spread(means), sum(squared_spread(own) for own in groups)
    information = 0.0
    if len(means) > 2 and between > _NEGLIGIBLE:
        ratings = people.participants * share * len(groups[0])
        off_sd = hypot(people.off_the_line_sd, people.residual_sd / sqrt(ratings))
        information += between / (t_quantile(0.975, len(means) - 2) * off_sd) ** 2
    if within > _NEGLIGIBLE:
        scatter = t_quantile(0.975, 1000) * people.residual_sd
        information += people.participants * share * within / scatter**2
    return 1 / sqrt(information) if information else inf


def confounded(contrasts: Contrasts) -> bool:
    """Return whether each condition has one contrast, so that the two are confounded."""
    return all(squared_spread(own) <= _NEGLIGIBLE for own in contrasts.values())


def squared_spread(contrasts: Sequence[float]) -> float:
    """Return the sum of squared deviations from the mean."""
    mean = sum(contrasts) / max(len(contrasts), 1)
    return sum(((contrast - mean) ** 2 for contrast in contrasts), 0.0)


def t_quantile(probability: float, df: int) -> float:
    """Return the quantile of Student's t with `df` degrees of freedom, by bisection.

    >>> round(t_quantile(0.975, 18), 4)
    2.1009
    """
    low, high = 0.0, 1e6
    while low < (middle := (low + high) / 2) < high:  # until they are two neighbouring floats
        if 0.5 + _central(middle, df) / 2 < probability:
            low = middle
        else:
            high = middle
    return middle


def _central(t: float, df: int) -> float:
    """Return the probability within [-t, t] (Abramowitz and Stegun, 26.7.3 and 26.7.4).

    Written here because loading scipy for it would slow `touchbeam check` down by 0.2 s.
    """
    angle, odd = atan(t / sqrt(df)), df % 2
    squared = cos(angle) ** 2
    term = total = cos(angle) if odd else 1.0
    for k in range(2 + odd, df - 1, 2):
        term *= squared * (k - 1) / k
        total += term
    if not odd:
        return sin(angle) * total
    return 2 / pi * (angle + (sin(angle) * total if df > 1 else 0.0))


_BITS_PER_BYTE = 10  # 8 and two that frame them
_BLOCKS_PER_S = 20
_BLOCK_BYTES = {"board": 26, "gauge": 26}
"""Of a block without its samples: its length, number, time, checksum and end."""
_SAMPLE_BYTES = {"board": BYTES_PER_COUNT * len(CHANNELS), "gauge": 22}
"""A count of each channel; three numbers in text, such as `0.1234,0.5601,0.04512;`."""


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """A model's predictions: `contrast` is None of no question, `rig` '' if not calibrated."""

    law: str
    rung: str
    contrast: Callable[[Trial], float | None]
    rig: str = ""


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
    """Return the contrasts of scored trials by condition: every slot's are those of the first."""
    contrasts: dict[str, list[float]] = {}
    for trial in shown.plans[0].trials:
        contrast = model.contrast(trial) if trial.kind == "trial" else None
        if contrast is not None and trial.condition is not None:
            contrasts.setdefault(trial.condition, []).append(contrast)
    return contrasts


def preview_record(shown: Preview, model: Prediction) -> dict[str, Any]:
    """Return the preview as plain JSON values; infinite widths become `None`."""
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
        "minutes_buy": [_precision_record(each) for each in precision_by_length(shown, model)],
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


def _precision_record(precision: Precision) -> dict[str, Any]:
    widths = {
        "half_width": precision.half_width,
        "gain_half_width": precision.gain_half_width,
        "relative_half_width": precision.relative,
    }
    return {
        "repeats": precision.repeats,
        "trials": precision.trials,
        "duration_s": round(precision.duration_s, 1),
        "whole": precision.whole,
        **{name: round(width, 4) if width < inf else None for name, width in widths.items()},
    }
