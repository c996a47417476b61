"""Sensitivities against known true parameters, and how certain the predicted contrasts are."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import SimpleNamespace

from analysis.estimates import Json, NotEstimable, plain
from analysis.report.blocks import Block, Column, Section, Table, estimated
from analysis.report.estimates_json import estimate_json
from analysis.report.findings import Findings, Scale
from analysis.report.wording import interval, number
from analysis.trials.contrasts import BEAM_MODELS, FACTORS, ContrastRange
from device.friction.changes import LAW, RUNG
from device.friction.laws import LAWS
from device.friction.rungs import present_name
from device.friction.surfaces import BeamSurface
from protocol.journal.records import VirtualTruth
from protocol.study.rules import PAPERS_SCALE

_REPORTED = (LAW, RUNG)


def recovery(found: Findings) -> Section:
    """Return the comparison; it has no content for participants who are not virtual."""
    virtual, rating = found.loaded.virtual, found.sensitivity.rating
    people = () if isinstance(rating, NotEstimable) else rating.subjects
    lines = {person.subject: person for person in people}
    pairs = [
        SimpleNamespace(line=line, truth=_on_scale(truth, found.scale))
        for name, truth in virtual.items()
        # A virtual person whose trials are all left out has no line.
        if (line := lines.get(name))
    ]
    for each in pairs:
        low, high = each.line.gain.interval
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
        "the predicted contrasts are too small, and the other way round; what is left counts for "
        "effects of the conditions."
    )


def _table(pairs: Sequence[SimpleNamespace]) -> Table:
    return Table.over(
        pairs,
        [
            Column("subject", "line.subject"),
            Column("true gain", "truth.sensitivity", 2),
            *estimated("gain", "line.gain"),
            Column("gain covered", "covered", {True: "yes", False: "no"}.__getitem__),
        ],
        name="recovered",
        caption="Gain that each virtual participant was given, with what the skin multiplies "
        "changes by, and its estimate with a 95% interval. The true gain is per unit of what is "
        "felt; where fingers press or move otherwise than planned, that is no straight line in the "
        "predicted contrast, and gains per unit of this differ.",
    )


def _subject_json(pair: SimpleNamespace) -> Json:
    line, true = pair.line, pair.truth.to_json()
    return {
        "subject": line.subject,
        "true": {name: value for name, value in true.items() if name not in {"law", "rung"}},
        "sensitivity": pair.truth.sensitivity,
        **estimate_json("bias", line.bias),
        **estimate_json("gain", line.gain),
        "gain_covered": pair.covered,
    }


# How certain the predicted contrasts are.

_SCALING = (
    "Gains scale with the contrasts: if all of them were k times as large, all gains would be 1/k "
    "as large, and their intervals too. If only some of them change, gains change in other ways."
)
_KINDS = (
    "The contrasts are of different kinds: ln(μ′ before / μ′ after) at a place; the rms of the "
    "same ratio over a path, which is never negative; and the growth of a swing, that is, of the "
    "rms of ln(μ′/μ) along the path. One gain for all kinds is an assumption."
)

_STATED = (
    "The contrasts are those that the author of the scores states, and taken as known: how certain "
    "they are cannot be told here."
)


_LEVEL = (
    "The contrast of a touch is ln(μ′/μ), μ being the friction of {}, at its "
    "place or as the mean along its path. It is negative where friction is lower."
)


def section(found: Findings) -> Section:
    ranges = found.trials.ranges
    return Section(
        title="How certain the contrasts are",
        blocks=[
            _STATED
            if found.study.imported
            else _LEVEL.format(found.rest)
            if found.at_once
            else _KINDS,
            _range_table(ranges) if ranges else None,
            _SCALING,
        ],
        data={"contrast_ranges": [plain(entry) for entry in ranges]},
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
