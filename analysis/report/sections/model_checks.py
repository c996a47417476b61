"""Checks of the models: against studies that they simulate, and against known true parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

from analysis.estimates import LEVEL, Json, NotEstimable, plain
from analysis.report.blocks import Block, Column, Figure, Section, Table, estimate, p_cell
from analysis.report.estimates_json import unknown
from analysis.report.figure_data import predictive_figure
from analysis.report.findings import Findings, Scale
from analysis.report.wording import interval, number
from analysis.sensitivity.ordinal_model import OrdinalSensitivity
from analysis.sensitivity.predictive_checks import PredictiveCheck
from analysis.trials.contrasts import BEAM_MODELS, FACTORS, ContrastRange
from device.friction.changes import LAW, RUNG
from device.friction.laws import LAWS
from device.friction.rungs import present_name
from device.friction.surfaces import BeamSurface
from protocol.journal.records import VirtualTruth
from protocol.study.rules import PAPERS_SCALE

_REPORTED = (LAW, RUNG)


def predictive(found: Findings) -> Section:
    """Return how well each model predicts answers and scores like those of the study."""
    checks = found.trials.predictive
    return Section(
        title="Posterior predictive checks",
        blocks=[
            "Each model simulates the study with parameters drawn from its posterior. A model "
            "whose simulated studies differ from the real one is not shown. The rule, set in "
            f"advance, is p < {LEVEL:g} for any of its statistics after Holm's correction.",
            *(_check_figure(model, check) for model, check in checks.items()),
        ],
        data={
            "predictive_checks": {
                model: plain(check)
                if isinstance(check, NotEstimable)
                else {**plain(check), "level": LEVEL, "rejected": check.refusal is not None}
                for model, check in checks.items()
            }
        },
    )


def _check_figure(model: str, check: PredictiveCheck | NotEstimable) -> Figure:
    if isinstance(check, NotEstimable):
        instead = f"{model} has no check: {check.reason}."
        return Figure(name=f"predictive-{model.lower()}", instead=instead)
    return Figure(
        name=f"predictive-{model.lower()}",
        title=f"Posterior predictive check of {model}",
        caption=f"Distance of the study from what {model} expects (diamonds), and of studies that "
        "the model itself simulates (median and 95% interval), relative to their median.",
        draw=partial(predictive_figure, check.statistics),
        table=_check_table(model, check),
    )


def _check_table(model: str, check: PredictiveCheck) -> Table:
    verdict = "is not shown" if check.refusal else "is not rejected"
    return Table.over(
        check.statistics,
        [
            Column("statistic", "name"),
            Column("study", "observed", 3),
            *estimate("simulated", "predicted", 3),
            Column("p", "p", p_cell),
            Column("p (Holm)", "p_holm", p_cell),
        ],
        name=f"predictive-{model.lower()}",
        caption=f"{model} {verdict}. Distance between observed and expected counts or shares, in "
        f"the study (median over {check.draws} draws of the parameters) and in a study simulated "
        "at each draw (median and 95% interval); p is the share of draws at which the simulated "
        "study is at least as far from what the model expects.",
    )


def recovery(found: Findings) -> Section:
    """Return the comparison; it has no content for participants who are not virtual."""
    virtual, m2 = found.loaded.virtual, found.trials.m2
    lines = {} if isinstance(m2, NotEstimable) else {it.subject: it for it in m2.lines.subjects}
    pairs = [
        SimpleNamespace(line=line, truth=_on_scale(truth, found.scale))
        for name, truth in virtual.items()
        # A virtual person whose trials are all left out has no line.
        if (line := lines.get(name))
    ]
    for each in pairs:
        low, high = each.line.gain_interval
        each.covered = low <= each.truth.sensitivity <= high
    models = ((truth.law, present_name(truth.rung)) for truth in virtual.values())
    simulated = list(dict.fromkeys(models))
    blocks: list[Block] = [_explanation(simulated, found), _table(pairs)] if pairs else []
    data = {
        "simulated": [{"law": law, "rung": rung} for law, rung in simulated],
        "reported": {"law": LAW, "rung": RUNG},
        "subjects": list(map(_subject_json, pairs)),
    }
    return Section(
        title="Recovered against true parameters",
        blocks=blocks,
        data={"recovery": data} if virtual else {},
    )


def _on_scale(truth: VirtualTruth, scale: Scale) -> VirtualTruth:
    """Return the parameters in points of the study's scale; a person has them on the paper's."""
    points = scale.span / PAPERS_SCALE.span
    return replace(
        truth,
        bias=scale.lowest + points * truth.bias,
        gain=points * truth.gain,
        rating_noise=points * truth.rating_noise,
    )


def _explanation(simulated: list[tuple[str, str]], found: Findings) -> str:
    """Return on which law and rung beam and report rest, and what follows where they differ."""
    if not isinstance(found.origin.rig.surface, BeamSurface):
        return f"Virtual people and predicted contrasts follow {found.friction_source}."
    reported = "the law {} on the rung {}".format(*_REPORTED)
    others = [model for model in simulated if model != _REPORTED]
    if not others:
        return f"The simulated beam and the predicted contrasts follow the same model: {reported}."
    beams = " and ".join("the law {} on the rung {}".format(*model) for model in others)
    return (
        f"The simulated beam followed {beams}, but contrasts are predicted with {reported}. "
        "Recovered and true parameters therefore differ systematically: a gain is too large where "
        "the predicted contrasts are too small, and the other way round, and M2 takes what is left "
        "for discrepancies of conditions."
    )


def _table(pairs: Sequence[SimpleNamespace]) -> Table:
    return Table.over(
        pairs,
        [
            Column("subject", "line.subject"),
            Column("true bias", "truth.bias", 2),
            *estimate("bias", "line.bias"),
            Column("true gain", "truth.sensitivity", 2),
            *estimate("gain", "line.gain"),
            Column("gain covered", "covered", {True: "yes", False: "no"}.__getitem__),
        ],
        name="recovered",
        caption="Bias and gain that each virtual participant was given, and M2's estimates with "
        "95% intervals. The true gain is that against predicted contrasts: what the skin "
        "multiplies changes by is part of it.",
    )


def _subject_json(pair: SimpleNamespace) -> Json:
    line, true = pair.line, pair.truth.to_json()
    return {
        "subject": line.subject,
        "true": {name: value for name, value in true.items() if name not in {"law", "rung"}},
        "sensitivity": pair.truth.sensitivity,
        "bias": line.bias,
        "bias_ci": plain(line.bias_interval),
        "gain": line.gain,
        "gain_ci": plain(line.gain_interval),
        "gain_covered": pair.covered,
    }


# How certain the predicted contrasts are, and gains from contrasts of one kind.

_SCALING = (
    "Gains scale with the contrasts: if all of them were k times as large, all gains would be 1/k "
    "as large, and their intervals too. If only some of them change, gains change in other ways."
)
_KINDS = (
    "The contrasts are of different kinds: ln(μ′ before / μ′ after) at a place; the rms of the "
    "same ratio over a path, which is never negative; and the growth of a swing, that is, of the "
    "rms of ln(μ′/μ) along the path. One gain for all kinds is an assumption."
)


def section(found: Findings) -> Section:
    """Return ranges of the contrasts, and gains from those at a place alone."""
    trials = found.trials
    return Section(
        title="How certain the contrasts are",
        blocks=[
            _KINDS,
            _range_table(trials.ranges) if trials.ranges else None,
            _SCALING,
            _place_gains(trials.m2, trials.place_m2),
        ],
        data={
            "contrast_ranges": [plain(entry) for entry in trials.ranges],
            "sensitivity_at_places": _place_json(trials.place_m2),
        },
    )


def _range_table(ranges: Sequence[ContrastRange]) -> Table:
    low, high = FACTORS[0], FACTORS[-1]
    return Table.over(
        ranges,
        [
            Column("condition", "condition"),
            Column("kind", "kind", kind="word"),
            Column("contrast", "value", 4),
            Column("over rungs", "by_rung", _span),
            Column("over laws", "by_law", _span),
            Column("over damping", "by_damping", _span),
            Column("over finger speed", "by_speed", _span),
        ],
        name="contrast-ranges",
        caption=f"Contrast of each condition as planned (law {LAW}, rung {RUNG}), and the range "
        "of its values if one assumption changes: the rung of the model "
        f"({', '.join(BEAM_MODELS)}), the friction law ({', '.join(LAWS)}), the damping ratio and "
        f"the finger's speed (each {low:g} to {high:g} times the assumed one).",
    )


def _span(values: Mapping[str, float]) -> str:
    # A law that gives no friction above 0 has no contrast to show.
    known = [value for value in values.values() if value == value]  # noqa: PLR0124 - not NaN
    return interval((min(known), max(known)), 3) if known else number(None)


def _place_gains(
    every: OrdinalSensitivity | NotEstimable, places: OrdinalSensitivity | NotEstimable
) -> Table | str:
    if isinstance(places, NotEstimable):
        return f"Gains from the conditions at a place alone are not available: {places.reason}."
    # A comparison needs both; that M2 has no fit is said elsewhere on the page.
    if isinstance(every, NotEstimable):
        return ""
    subjects = zip(every.lines.subjects, places.lines.subjects, strict=True)
    return Table.over(
        [SimpleNamespace(every=a, places=b) for a, b in ((every.lines, places.lines), *subjects)],
        [
            Column("subject", "every.subject", absent="group"),
            *estimate("all conditions", "every.gain"),
            *estimate("at a place", "places.gain"),
        ],
        name="place-gains",
        caption="Gain by M2 from all conditions, and from the conditions at a place alone, whose "
        "contrasts are of one kind; with 95% intervals.",
    )


def _place_json(fit: OrdinalSensitivity | NotEstimable) -> Json:
    if isinstance(fit, NotEstimable):
        return {"subjects": [], **unknown(fit, "population")}
    lines = fit.lines
    return {
        "model": "M2",
        "subjects": [
            {"subject": line.subject, "gain": line.gain, "gain_ci": plain(line.gain_interval)}
            for line in lines.subjects
        ],
        "population": {"gain": lines.gain, "gain_ci": plain(lines.gain_interval)},
    }
