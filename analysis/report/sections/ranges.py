"""How certain the predicted contrasts are, and gains from contrasts of one kind."""

from collections.abc import Mapping, Sequence

from analysis.estimates import Json, NotEstimable, plain
from analysis.report.blocks import Column, Section, Table, columns
from analysis.report.findings import Findings
from analysis.report.wording import interval, number
from analysis.sensitivity.ordinal_model import OrdinalSensitivity
from analysis.trials.contrast_ranges import FACTORS, RUNGS, ContrastRange
from device.friction.contrasts import LAW, RUNG
from device.friction.laws import LAWS

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
        name="contrasts",
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
    return Table(
        name="contrast-ranges",
        caption=f"Contrast of each condition as planned (law {LAW}, rung {RUNG}), and the range "
        "of its values if one assumption changes: the rung of the model "
        f"({', '.join(RUNGS)}), the friction law ({', '.join(LAWS)}), the damping ratio and the "
        f"finger's speed (each {low:g} to {high:g} times the assumed one).",
        columns=[
            Column(name="condition"),
            Column(name="kind", kind="word"),
            *columns("contrast", "over rungs", "over laws", "over damping", "over finger speed"),
        ],
        rows=[
            [
                entry.condition,
                entry.kind,
                number(entry.value, 4),
                *map(_span, (entry.by_rung, entry.by_law, entry.by_damping, entry.by_speed)),
            ]
            for entry in ranges
        ],
    )


def _span(values: Mapping[str, float]) -> str:
    known = [value for value in values.values() if value == value]  # noqa: PLR0124 - not NaN
    return interval((min(known), max(known)), 3) if known else number(None)


def _place_gains(
    every: OrdinalSensitivity | NotEstimable, places: OrdinalSensitivity | NotEstimable
) -> Table | str:
    """Return gains from all conditions beside those from the conditions at a place."""
    if isinstance(places, NotEstimable):
        return f"Gains from the conditions at a place alone are not available: {places.reason}."
    if isinstance(every, NotEstimable):
        return ""
    both = (every.lines, places.lines)
    subjects = zip(*(lines.subjects for lines in both), strict=True)
    named = [("group", both), *((pair[0].subject, pair) for pair in subjects)]
    return Table(
        name="place-gains",
        caption="Gain by M2 from all conditions, and from the conditions at a place alone, whose "
        "contrasts are of one kind; with 95% intervals.",
        columns=columns("subject", "all conditions", "95%", "at a place", "95%"),
        rows=[
            [
                name,
                *(
                    cell
                    for line in lines
                    for cell in (number(line.gain, 2), interval(line.gain_interval))
                ),
            ]
            for name, lines in named
        ],
    )


def _place_json(fit: OrdinalSensitivity | NotEstimable) -> Json:
    if isinstance(fit, NotEstimable):
        return {"subjects": [], "population": None, "reason": fit.reason}
    lines = fit.lines
    return {
        "model": "M2",
        "subjects": [
            {"subject": line.subject, "gain": line.gain, "gain_ci": plain(line.gain_interval)}
            for line in lines.subjects
        ],
        "population": {"gain": lines.gain, "gain_ci": plain(lines.gain_interval)},
    }
