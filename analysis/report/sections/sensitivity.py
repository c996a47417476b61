"""How people notice and rate changes: levels, sensitivities as far as they are told, noticing."""

from collections.abc import Sequence
from functools import partial
from types import SimpleNamespace

import numpy as np

from analysis.estimates import Estimate, NotEstimable, plain, why
from analysis.felt.measured_statistics import MeasuredStatistics
from analysis.report import figure_data, wording
from analysis.report.blocks import Block, Column, Figure, Items, Section, Table, estimated
from analysis.report.estimates_json import noticing_json, people_json, rating_json
from analysis.report.findings import Findings
from analysis.report.results import BEYOND, untold
from analysis.report.wording import bounded, chance, count_of, interval, number
from analysis.sensitivity.answers_model import UNEQUAL, GroupLine, Noticed, Person, Rated
from analysis.sensitivity.coverage import SimulatedStudies, most_alike, simulated_studies
from analysis.statistics.slope import Slope
from analysis.trials.contrasts import ContrastRange
from protocol.errors import listed

APART = "groups apart"
_CEILING = 0.05
"""Share of scores at the top of the scale above which the report names it."""
FIGURES = ("people-levels", "relative-gains", "sensitivity")


def section(found: Findings) -> Section:
    """Return what the model of the answers tells."""
    rating, noticing = found.sensitivity.rating, found.sensitivity.noticing
    blocks: list[Block] = [
        f"Ratings have no model: {rating.reason}." if isinstance(rating, NotEstimable) else "",
        *([] if isinstance(rating, NotEstimable) else _rated(found, rating)),
        f"Noticing has no model: {noticing.reason}." * (not found.at_once)
        if isinstance(noticing, NotEstimable)
        else _noticing_table(found, noticing),
        *([] if found.measured is None else _measured(found.measured)),
    ]
    data = {
        "sensitivity_model": "rating" if found.measure == "score" else "noticing, then rating",
        "sensitivity_note": "" if found.predictor[1] else wording.SKIN,
        "sensitivity": people_json(rating),
        **why("sensitivity", rating),
        "noticing": noticing_json(noticing),
        "rating": {"predictor": found.contrast, **rating_json(rating)},
        "sensitivity_coverage": None
        if isinstance(rating, NotEstimable)
        else plain(simulated(found, rating)),
        **why("sensitivity_coverage", rating),
    }
    if found.measured is not None:
        of_conditions = plain(found.measured.conditions)
        data["measured"] = {"conditions": of_conditions, "left_out": found.measured.left_out}
    return Section(title="Sensitivity", blocks=blocks, data=data)


def _rated(found: Findings, rating: Rated) -> list[Block]:
    is_measured = found.predictor[1]
    return [
        f"{group_gain(found, rating)}{'' if is_measured else _known(found.trials.ranges)}",
        None if rating.untold is None else untold(found, rating),
        _spread(rating),
        selection(rating),
        _coverage(found, rating),
        wording.MEASURED if is_measured else wording.SKIN,
        Items(heading="Limitations of these data.", lines=_limits(rating)),
        front_figure(found),
        _gains_figure(found, rating),
        _effects_table(rating) if rating.effects else None,
        _lines_table("groups", rating.groups, "Level and gain of each group, with 95% intervals.")
        if rating.groups
        else None,
        _lines_table(
            "groups-apart",
            rating.differences,
            "By how much levels and gains of two groups differ, the first less the second, with "
            "95% intervals. No correction over pairs.",
        )
        if rating.differences
        else None,
    ]


def group_gain(found: Findings, rating: Rated) -> str:
    """Return the group's gain in a sentence."""
    if isinstance(gain := rating.gain, NotEstimable):
        return "A single participant tells nothing about a group."
    low, high = gain.interval
    noticed = isinstance(found.trials.slope, Slope) and found.measure == "response"
    beside = (
        " It is of the scores of changes that were answered as expected; the slopes of responses "
        "(Do the conditions differ?) also count what was not."
    ) * noticed
    return (
        f"Ratings change by {number(gain.value, 2)} points per unit of {found.contrast} in the "
        f"group, 95% CI {interval(gain.interval)}, which "
        f"{'includes' if low <= 0 <= high else 'excludes'} 0.{beside}"
    )


def _known(ranges: Sequence[ContrastRange]) -> str:
    """Return what the interval of a gain takes for known, by the least certain contrast."""
    if not ranges:
        return ""
    low, high, name = max(
        ((*entry.ends, entry.condition) for entry in ranges), key=lambda ends: ends[1] - ends[0]
    )
    return (
        f" The interval takes the contrasts as known, but that of {name} is {number(low)} "
        f"to {number(high)} under other assumptions of the same law (see How certain the "
        "contrasts are)."
    )


def simulated(found: Findings, rating: Rated) -> SimulatedStudies:
    """Return the simulated studies that are most like this one."""
    noticing = found.sensitivity.noticing
    return most_alike(
        people=len(rating.subjects),
        trials=float(np.mean([person.trials for person in rating.subjects])),
        noticed=1.0 if isinstance(noticing, NotEstimable) else noticing.share,
        highest=rating.highest,
        absolute=found.at_once,
    )


def _coverage(found: Findings, rating: Rated) -> str:
    """Return how often intervals held the truth in such studies, in a sentence."""
    alike, names = simulated(found, rating), ["gains", "levels", "group's gain"]
    if not isinstance(found.sensitivity.noticing, NotEstimable):
        names += ["group's d", "d"]
    held = ", ".join(
        f"{name} {bounded(alike.held[name], 3)}" for name in names if name in alike.held
    )
    if rating.differences:
        apart = [of.held[APART] for of in simulated_studies() if APART in of.held]
        held += f"; differences of groups {bounded(min(apart), 3)} to {bounded(max(apart), 3)}"
        held += f" (of {count_of(len(apart), 'kind')} of studies)"
    too_few = f" Those of {listed(alike.too_few)} are too narrow." * bool(alike.too_few)
    return (
        f"In the {alike.studies} simulated studies most like this one "
        f"({alike.name}, scored {alike.scale}: "
        f"{alike.people:.0f} people with {alike.trials:.0f} rated trials each, "
        f"{alike.highest:.0%} of the scores the highest), 95% intervals held the truth: {held}."
        f"{too_few} An interval that held it in nearly all is wider than it need be."
    )


def _spread(rating: Rated) -> str:
    if isinstance(rating.gain, NotEstimable):
        return ""
    equal = f"all gains are equal with {chance(rating.equal_gains)}"
    before = f".50 before the study; below {bounded(UNEQUAL)} would show it"
    below = f"is below {number(rating.gain_sd_upper, 2)} with {chance(0.95)}"
    if rating.gains_differ:
        return f"Gains differ between people: {equal} (.50 before the study); their SD {below}."
    return (
        f"These data do not show that gains differ between people: {equal} ({before}). If gains "
        f"differ, their SD {below}. That gains differ is seldom shown, also where they do."
    )


def selection(rating: Rated) -> str:
    """Return how much the scores follow what was felt beyond the change, in a sentence."""
    if (of := rating.selection) is None:
        return ""
    low, high = of.interval
    tells = (
        "so these data do not tell"
        if low <= 0 <= high
        else "so they scored what they felt"
        if low > 0
        else "so scores fall with what is felt beyond the change"
    )
    return (
        "Those who notice a weak change have, by chance, felt more of it than others. Do people "
        f"score what they felt, or the change itself? {number(of.value, 2)} points per SD of what "
        f"is felt beyond the change, 95% CI {interval(of.interval)} (0 if they score the change "
        f"itself), {tells}. Levels and gains allow for both."
    )


def _limits(rating: Rated) -> list[str]:
    if rating.highest <= _CEILING:
        return []
    return [
        f"{rating.highest:.0%} of the scores in the model are the highest possible; it takes each "
        "for this or more."
    ]


# Figures and tables of people.


def front_figure(found: Findings) -> Figure:
    """Return what these data tell of each person, which stands among the results.

    It is by how much the gains differ from their mean, or else the levels.
    """
    rating = found.sensitivity.rating
    if isinstance(rating, NotEstimable) or isinstance(rating.gain, NotEstimable):
        return Figure(name="relative-gains")
    drawn = figure_data.drawn_subjects(rating.subjects)
    shown = wording.of_all(len(drawn), len(rating.subjects), "subjects")
    if rating.untold is None:
        return Figure(
            name="relative-gains",
            title="Who is more sensitive than whom",
            caption="Relative gain of each subject: the gain (points per unit of "
            f"{found.contrast}) less the mean gain of the subjects (dashed), with its 95% "
            f"interval. {_skin(found)}{shown}",
            draw=partial(figure_data.relative_gains_figure, drawn),
            front=True,
        )
    level = rating.level
    return Figure(
        name="people-levels",
        title="How high each person rates",
        caption=f"Level of each subject, the rating of a {found.contrast} of "
        f"{number(rating.contrast, 2)}, the mean of the rated ones, with its 95% interval and the "
        "number of rated trials; the dashed line is the group. Levels differ between people who "
        "feel alike, because they use the scale in their own way: they are no sensitivities. "
        f"{BEYOND}{shown}",
        draw=partial(
            figure_data.levels_of_people_figure,
            drawn,
            level.value if isinstance(level, Estimate) else None,
            found.scale,
        ),
        front=True,
    )


def _skin(found: Findings) -> str:
    return "" if found.predictor[1] else wording.SKIN_IN_SHORT


def _gains_figure(found: Findings, rating: Rated) -> Figure:
    drawn = figure_data.drawn_subjects(rating.subjects)
    shown = wording.of_all(len(drawn), len(rating.subjects), "subjects")
    gain = rating.gain.value if isinstance(rating.gain, Estimate) else None
    return Figure(
        name="sensitivity",
        title="Gain of each subject",
        caption="Gain of each subject with its 95% interval; the dashed line is the group, if "
        f"there are several subjects. {_skin(found)}{shown}",
        draw=partial(figure_data.gains_figure, drawn, gain),
        table=_people_table(found, rating),
    )


def _people_table(found: Findings, rating: Rated) -> Table:
    records: list[Rated | Person] = [] if isinstance(rating.gain, NotEstimable) else [rating]
    return Table.over(
        [*records, *rating.subjects],
        [
            Column("subject", "subject", absent="group"),
            Column("trials", "trials", absent=""),
            *estimated("level", "level"),
            *estimated("gain", "gain"),
            *estimated("relative gain", "relative_gain", absent=""),
            Column("gain told", "told", {True: "yes", False: "no"}.__getitem__, absent=""),
        ],
        name="gains",
        caption=f"Level: the rating of a {found.contrast} of {number(rating.contrast, 3)}, the "
        f"mean of the rated ones. {BEYOND} Gain: rating points per unit of it. Relative gain: "
        "the gain less the mean gain of the subjects, which is known better than the gain itself. "
        "With 95% intervals, not corrected for the number of people. Trials: those that the model "
        "takes. A gain is told if its interval leaves less than half of the scale open over the "
        f"contrasts of this study. {_skin(found)}",
    )


def _lines_table(name: str, lines: Sequence[GroupLine], caption: str) -> Table:
    return Table.over(
        lines,
        [Column("group", "name"), *estimated("level", "level"), *estimated("gain", "gain")],
        name=f"sensitivity-{name}",
        caption=caption,
    )


def _effects_table(rating: Rated) -> Table:
    return Table.over(
        [SimpleNamespace(name=name, of=of) for name, of in rating.effects.items()],
        [Column("condition", "name"), *estimated("effect", "of")],
        name="effects",
        caption="By how many points each condition is rated higher than its contrast says, with "
        "95% intervals. Were one gain right for all conditions, these would be 0.",
    )


def _noticing_table(found: Findings, noticing: Noticed) -> Table:
    return Table.over(
        [noticing, *noticing.subjects],
        [
            Column("subject", "subject", absent="group"),
            *estimated("d", "d"),
            *estimated("criterion", "criterion"),
        ],
        name="noticing",
        caption=f"How changes are noticed. d: how strongly a change of {number(noticing.unit, 3)} "
        f"(one SD of the {found.contrast}s) is felt, in SDs of the noise. Criterion: how strongly "
        "a change must be felt to be answered as expected, in the same unit. With 95% intervals. "
        f"{noticing.share:.0%} of the changes were answered as expected.{_lean(noticing)}",
    )


def _lean(noticing: Noticed) -> str:
    """Return which answers are given more readily, as far as it is known."""
    low, high = noticing.lean.interval
    if low <= 0 <= high:
        return ""
    return (
        f" The first answer of a question is given {'more' if high < 0 else 'less'} readily than "
        f"its contrary, by {number(abs(noticing.lean.value), 2)}; d allows for it."
    )


# Friction as it was measured.


def _measured(measured: MeasuredStatistics) -> list[Block]:
    left_out = [
        f"{count} scored trial{'s' * (count > 1)}, because {reason}."
        for reason, count in measured.left_out.items()
    ]
    numbers = {
        "predicted": "predicted",
        "measured": "mean",
        "standard error": "mean_error",
        "SD between trials": "spread",
        "error of one trial": "trial_error",
        "error of its best estimate": "best_error",
    }
    return [
        Items(heading="Without a measured contrast.", lines=left_out),
        Table.over(
            measured.conditions,
            [
                Column("condition", "condition"),
                Column("trials", "trials"),
                *(Column(title, of, 4) for title, of in numbers.items()),
            ],
            name="measured-contrasts",
            caption="Measured contrast of each condition (change of log friction, as the predicted "
            "one) and its standard error over trials; SD between trials of the best estimates; "
            "standard error of one trial alone, and of its best estimate, which borrows from the "
            "person's and the condition's other trials and is what the model takes.",
        ),
    ]
