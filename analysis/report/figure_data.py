"""Data of the report's figures, thinned where a figure would be too dense to read."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.estimates import (
    Estimate,
    FloatArray,
    IntArray,
    Interval,
    NotEstimable,
    ScoreTable,
)
from analysis.report import drawing as plot
from analysis.report.findings import Findings, Scale
from analysis.sensitivity.answers_model import Person
from analysis.sensitivity.lines import Ratings
from analysis.trials.contrasts import ScoredTrials
from analysis.trials.track_fits import mean_over_people
from device.friction.changes import LAW

# docs/report.md names these numbers: beyond them a figure is too dense to read.
MOST_LINES = 100
MOST_POINTS = 2_000
MOST_INTERVALS = 40
MOST_PEOPLE = 60
CURVE_POINTS = 101


@dataclass(frozen=True, kw_only=True, eq=False)
class ByLevel:
    """Scores of a condition by level, if it has several, thinned if there are very many.

    `mean`, `error` and the model's `expected` go with levels `at`.
    """

    condition: str
    level: FloatArray
    score: FloatArray
    at: FloatArray
    mean: FloatArray
    error: FloatArray
    counts: IntArray
    expected: FloatArray | None


def thinned(count: int, most: int) -> IntArray:
    """Return at most `most` of `count` positions, evenly spaced.

    >>> thinned(9, 4)
    array([0, 2, 4, 6])
    """
    # Even spacing keeps the whole course of a session, which the first ones alone would not.
    return np.arange(count) if count <= most else np.arange(most) * count // most


def model_curve(found: Findings) -> tuple[FloatArray, FloatArray] | None:
    """Return contrasts of rated trials, and the group's ratings there; None where they are none.

    The line ends at the ends of the scale.
    """
    rating, (_, is_measured) = found.sensitivity.rating, found.predictor
    # A line over measured contrasts has no place among predicted ones.
    if isinstance(rating, NotEstimable) or is_measured:
        return None
    contrast = found.trials.scored.ratings.given.contrast
    # Only where there are data: the model promises nothing beyond.
    at = np.linspace(contrast.min(), contrast.max(), CURVE_POINTS)
    return at, np.clip(rating.of(at), found.scale.lowest, found.scale.highest)


def drawn_subjects(subjects: Sequence[Person]) -> list[Person]:
    """Return the subjects whose intervals are drawn."""
    return [subjects[place] for place in thinned(len(subjects), MOST_INTERVALS)]


def course(scored: ScoredTrials) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
    """Return places in the session that are known, and mean, standard error and count of scores."""
    ratings = scored.every
    known = (scored.place > 0) & ~np.isnan(ratings.rating)
    places, which = np.unique(scored.place[known], return_inverse=True)
    counts = np.bincount(which)
    means = np.bincount(which, weights=ratings.rating[known]) / counts
    squares = np.bincount(which, weights=(ratings.rating[known] - means[which]) ** 2)
    # A place with a single score has no standard error.
    errors = np.sqrt(squares / np.where(counts > 1, counts - 1, np.nan) / counts)
    return places, means, errors, counts


def levels(found: Findings) -> tuple[ByLevel, ...]:
    """Return the scores by level of the conditions that were scored at several levels."""
    # The contrasts of the scored trials, among those of all.
    chosen = found.loaded.trials.index.isin(found.loaded.scored.index)
    contrast = found.trials.contrasts.by_law[LAW][chosen]
    scored = found.loaded.scored.assign(contrast=contrast).dropna(subset=["score"])
    # A condition at a single level has no course over levels.
    several = scored.groupby("condition")["level"].nunique().gt(1)
    names = [name for name in found.loaded.table.conditions if several.get(name, False)]
    rating, (_, is_measured) = found.sensitivity.rating, found.predictor
    model = None if isinstance(rating, NotEstimable) or is_measured else rating
    made = []
    for name in names:
        own = scored[scored["condition"] == name]
        by_level = own.groupby("level")
        at = by_level["contrast"].mean().to_numpy()
        drawn = own.iloc[thinned(len(own), MOST_POINTS // len(names))]
        # Without all predicted contrasts the line would have gaps that look like data.
        known = model if np.isfinite(at).all() else None
        scores = by_level["score"]
        made.append(
            ByLevel(
                condition=name,
                level=drawn["level"].to_numpy(float),
                score=drawn["score"].to_numpy(float),
                at=np.array(scores.mean().index, float),
                mean=scores.mean().to_numpy(),
                error=np.asarray(scores.sem(), np.float64),
                counts=np.asarray(scores.count(), np.int64),
                expected=None if known is None else np.clip(known.of(at), *found.scale),
            )
        )
    return tuple(made)


def people(found: Findings) -> dict[str, tuple[FloatArray, ...]]:
    """Return scores by condition of all subjects, or of too many those of the most extreme ones.

    Beyond `MOST_PEOPLE` these are the two with the lowest and with the highest means, and those
    with the smallest and with the largest spread of their scores.
    """
    table = found.loaded.table
    scored = found.loaded.scored.dropna(subset=["score"])
    cells = {
        key: own.to_numpy(float)
        for key, own in scored.groupby(["participant", "condition"])["score"]
    }
    empty = np.array([])
    return {
        table.subjects[row]: tuple(
            cells.get((table.subjects[row], name), empty) for name in table.conditions
        )
        for row in _shown_people(table)
    }


def _shown_people(table: ScoreTable) -> list[int]:
    if len(table.subjects) <= MOST_PEOPLE:
        return list(range(len(table.subjects)))
    rated = np.flatnonzero(table.given.any(axis=1))
    # Stable, so that subjects who are equal come in one order on every computer.
    by_mean = rated[np.argsort(np.nanmean(table.scores[rated], axis=1), kind="stable")]
    by_spread = rated[np.argsort(np.nanstd(table.scores[rated], axis=1), kind="stable")]
    # Extremes show what an average hides: who never changes a score, and who jumps.
    ends = [*by_mean[:2], *by_mean[-2:], *by_spread[:2], *by_spread[-2:]]
    return list(dict.fromkeys(int(row) for row in ends))


# Figures of the models: ratings against contrasts, and sensitivities.


def scatter_figure(
    ratings: Ratings,
    scale: Scale,
    curve: tuple[FloatArray, FloatArray] | None,
    thresholds: Mapping[str, tuple[float, Interval | NotEstimable]],
    sheet: plot.Sheet,
) -> None:
    """Draw ratings against predicted contrasts, and the model's line.

    `thresholds` of tracks, with their intervals, stand on the same axis.
    """
    shown = np.unique(ratings.condition)
    legend_rows = (len(shown) + len(thresholds) + 2) / 2
    axes = sheet.axes(plot.HEIGHT_IN + plot.LEGEND_ROW_IN * legend_rows)
    labels = plot.labels_of(ratings.conditions, "condition")
    for place in shown:
        own = ratings.condition == place
        axes.plot(
            ratings.contrast[own],
            ratings.rating[own] + plot.jitter(int(own.sum()), scale),
            linestyle="none",
            **plot.marked(int(place)),
            alpha=0.7,
            label=labels[place],
        )
    if curve is not None:
        axes.plot(*curve, color="black", label="group, model")
    for number, (track, (value, ends)) in enumerate(thresholds.items()):
        colour = plot.COLOURS[1 + number % (len(plot.COLOURS) - 2)]
        axes.axvline(value, color=colour, linestyle=":", label=f"threshold, {track}")
        if not isinstance(ends, NotEstimable):
            foot = [0.02 + 0.03 * number] * 2
            axes.plot(ends, foot, color=colour, transform=axes.get_xaxis_transform())
    axes.set(ylim=plot.limits(scale), ylabel=f"rating, {scale}")
    axes.set_xlabel("predicted contrast, change of log friction")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncol=2, frameon=False)


def thresholds_of(found: Findings) -> dict[str, tuple[float, Interval | NotEstimable]]:
    """Return the mean predicted contrast of each track's thresholds, where it is known of all."""
    by_track: dict[str, list[float | None]] = {}
    for each in found.thresholds.people if found.thresholds else ():
        by_track.setdefault(each.track, []).append(each.contrast)
    means = {track: mean_over_people(of) for track, of in by_track.items() if None not in of}
    return {
        track: (value, ends)
        for track, (value, ends) in means.items()
        if not isinstance(value, NotEstimable)
    }


def gains_figure(subjects: Sequence[Person], group: float | None, sheet: plot.Sheet) -> None:
    """Draw each subject's gain with its 95% interval, and the group's gain."""
    axes = _subject_intervals(sheet, subjects, [person.gain for person in subjects])
    if group is not None:
        axes.axhline(group, color=plot.COLOURS[0], linewidth=0.8, linestyle="--")
    axes.set_ylabel("gain, points per unit of contrast")


def relative_gains_figure(subjects: Sequence[Person], sheet: plot.Sheet) -> None:
    """Draw each subject's gain less the mean gain, with its 95% interval."""
    relative = [of for it in subjects if isinstance(of := it.relative_gain, Estimate)]
    axes = _subject_intervals(sheet, subjects, relative)
    axes.axhline(0.0, color=plot.GREY, linewidth=0.8, linestyle="--")
    axes.set_ylabel("relative gain, points per unit")


def levels_of_people_figure(
    subjects: Sequence[Person], group: float | None, scale: Scale, sheet: plot.Sheet
) -> None:
    """Draw each subject's level with its 95% interval and number of trials, and the group's."""
    axes = _subject_intervals(sheet, subjects, [person.level for person in subjects])
    if group is not None:
        axes.axhline(group, color=plot.COLOURS[0], linewidth=0.8, linestyle="--")
    low, high = plot.limits(scale)
    ends = np.array([person.level.interval for person in subjects])
    bottom, top = min(low, float(ends[:, 0].min())), max(high, float(ends[:, 1].max()))
    # Levels may lie beyond the scale, whose end many scores have reached.
    axes.axhspan(scale.lowest, scale.highest, color=plot.GREY, alpha=0.12, linewidth=0)
    axes.set(ylim=(bottom, top + 0.08 * (top - bottom)), ylabel=f"level, on {scale}")
    for place, person in enumerate(subjects):
        where = (place, top + 0.04 * (top - bottom))
        axes.annotate(f"{person.trials}", where, ha="center", va="center", fontsize="small")


def _subject_intervals(
    sheet: plot.Sheet, subjects: Sequence[Person], estimates: Sequence[Estimate]
) -> plot.Axes:
    axes = sheet.axes()
    middle = np.array([estimate.value for estimate in estimates])
    ends = np.array([estimate.interval for estimate in estimates])
    plot.intervals(axes, np.arange(len(subjects), dtype=np.float64), middle, ends)
    plot.name_places(axes, plot.labels_of(tuple(it.subject for it in subjects), "subject"))
    axes.set_xlabel("subject")
    return axes


# Figures of scores: by condition, over the session, by level, and by participant.

FEWEST_FOR_A_CLOUD = 8
"""Fewer scores have no density that a cloud could show."""
FEW_NAMES, NAMES_IN_A_ROW = 6, 45
"""How many names of conditions have room upright in a sixth of a figure, and small in all of it."""
_CLOUD_SD = 0.04
"""Standard deviation of the clouds' density kernel, as a share of the scale."""


def raincloud_figure(
    table: ScoreTable,
    lines: FloatArray,
    means: FloatArray,
    measure: str,
    scale: Scale,
    sheet: plot.Sheet,
) -> None:
    """Draw densities of the measure by condition, `lines` of subjects, and means as diamonds."""
    labels = plot.labels_of(table.conditions, "condition")
    # Names that are not cut need room below.
    axes = sheet.axes(plot.HEIGHT_IN + 0.08 * max(0, max(map(len, labels)) - 16))
    places = np.arange(len(table.conditions))
    for place, column in zip(places, table.scores.T, strict=True):
        _cloud(axes, float(place), column[~np.isnan(column)], scale)
    axes.plot(
        places,
        lines.T + plot.jitter(len(lines), scale),
        color=plot.GREY,
        marker="o",
        markersize=plot.marker(0.6),
        linewidth=0.6,
        alpha=0.6,
    )
    axes.plot(
        places,
        means,
        "D",
        color=plot.COLOURS[1],
        markersize=plot.marker(1.7),
        markerfacecolor="none",  # hides no score
        markeredgewidth=1.5,
        label="mean",
    )
    plot.name_places(axes, labels)
    axes.set(ylim=plot.limits(scale), ylabel=f"{measure}, {scale}", xlabel="condition")
    axes.legend(loc="best", frameon=False)


def _cloud(axes: plot.Axes, place: float, scores: FloatArray, scale: Scale) -> None:
    """Draw half a violin (normal kernel) right of `place`, and median and quartiles left of it."""
    if scores.size < FEWEST_FOR_A_CLOUD:
        return
    values, counts = np.unique(scores, return_counts=True)
    # A cloud ends with the scale, because no score can lie beyond it.
    grid = np.linspace(scale.lowest, scale.highest, 201)
    density = np.exp(-(((grid[:, None] - values) / (_CLOUD_SD * scale.span)) ** 2) / 2) @ counts
    begin, width = place + 0.06, 0.38 * density / density.max()
    axes.fill_betweenx(grid, begin, begin + width, color=plot.COLOURS[5], alpha=0.5, linewidth=0)
    low, middle, high = np.quantile(scores, [0.25, 0.5, 0.75])
    bar: Any = {"color": plot.COLOURS[0], "linewidth": plot.marker(0.8), "alpha": 0.8}
    axes.plot([place - 0.06] * 2, [low, high], **bar)
    axes.plot([place - 0.06], [middle], "_", color="black", markersize=plot.marker(1.8))


def course_figure(
    places: IntArray, means: FloatArray, errors: FloatArray, scale: Scale, sheet: plot.Sheet
) -> None:
    """Draw mean scores by place in the session, with their standard errors."""
    axes, bars = sheet.axes(), np.nan_to_num(errors)  # a single score has none
    axes.errorbar(places, means, yerr=bars, fmt="o-", color=plot.COLOURS[0])
    axes.set_ylabel(f"mean score ± standard error, {scale}")
    axes.locator_params(axis="x", integer=True)
    axes.set_xlabel("place among the session's scored trials")


def factor_figure(
    factors: Mapping[str, tuple[str, ...]],
    means: FloatArray,
    halves: FloatArray,
    measure: str,
    scale: Scale,
    sheet: plot.Sheet,
) -> None:
    """Draw means by level of a factor, with a line for each level of another one.

    `factors` are one or two with their levels; `means`, and `halves` of their intervals, have
    shape (levels of the first factor, levels of the second or 1).
    """
    lines, (first, *_, last) = means.shape[1], [*factors, *factors]
    names = plot.labels_of(factors[last], last) if lines > 1 else [""]
    axes, places = sheet.axes(plot.HEIGHT_IN + plot.legend_in(names)), np.arange(len(means))
    of_lines = zip(names, means.T, halves.T, strict=True)
    for number, (name, middle, half) in enumerate(of_lines):
        # Beside one another, so that no interval covers another one.
        at = places + (0.4 / lines) * (number - (lines - 1) / 2)
        axes.errorbar(at, middle, yerr=half, linewidth=1, **plot.marked(number), label=name)
    plot.name_places(axes, plot.labels_of(factors[first], first))
    axes.set(xlabel=first, ylabel=f"mean {measure}, {scale}")
    axes.margins(y=0.08)
    if lines > 1:
        plot.name_series(axes, last)


def levels_figure(data: Sequence[ByLevel], scale: Scale, sheet: plot.Sheet) -> None:
    """Draw scores against the level of each condition: all of them, means, and the model's line."""
    columns = min(len(data), 3)
    rows = -(-len(data) // columns)
    grid = sheet.grid(rows, columns, 1.0 + 2.4 * rows)
    for axes, own in zip(grid, data, strict=False):
        scores = own.score + plot.jitter(len(own.score), scale)
        axes.plot(own.level, scores, ".", color=plot.GREY, alpha=0.5)
        # A level with a single score has no bar.
        errors = np.nan_to_num(own.error)
        axes.errorbar(own.at, own.mean, yerr=errors, fmt="o", color=plot.COLOURS[0])
        if own.expected is not None:
            axes.plot(own.at, own.expected, color="black", label="model")
        axes.set_title(own.condition, fontsize="medium")
        axes.set_ylim(plot.limits(scale))
    grid[0].set_ylabel(f"score, {scale}")
    for axes in grid:
        axes.set_xlabel("level")


def noticed_figure(
    names: tuple[str, ...], series: Mapping[str, FloatArray], sheet: plot.Sheet
) -> None:
    """Draw shares with their intervals, (names, 3) for each of `series`, side by side."""
    labels = plot.labels_of(tuple(series), "group")
    axes = sheet.axes(plot.HEIGHT_IN + (plot.legend_in(labels) if len(series) > 4 else 0.0))
    for number, (label, shares) in enumerate(zip(labels, series.values(), strict=True)):
        # A group without such trials has no share.
        known = ~np.isnan(shares[:, 0])
        offset = 0.6 * ((number + 0.5) / len(series) - 0.5)
        places = np.arange(len(names), dtype=np.float64)[known] + offset
        plot.intervals(axes, places, shares[known, 0], shares[known, 1:], number, label)
    # What is no signal stands apart from what is one.
    axes.axvline(0.5, color=plot.GREY, linewidth=0.8, linestyle="--")
    axes.set(ylim=(-0.03, 1.03), ylabel="share of trials with a reported change")
    plot.name_places(axes, plot.labels_of(names, "condition"))
    if len(series) > 1:
        plot.name_series(axes)


def people_figure(
    conditions: tuple[str, ...],
    scores: Mapping[str, Sequence[FloatArray]],
    means: FloatArray,
    scale: Scale,
    sheet: plot.Sheet,
) -> None:
    """Draw a small panel for each participant: scores by condition, and the group's means."""
    count, names = len(conditions), plot.labels_of(conditions, "condition")
    columns = min(len(scores), 6, max(1, NAMES_IN_A_ROW // count))
    rows, places = -(-len(scores) // columns), np.arange(count)
    grid = sheet.grid(rows, columns, 1.0 + 1.1 * rows)
    for axes, (subject, trials) in zip(grid, scores.items(), strict=False):
        axes.plot(places, means, color=plot.GREY, linewidth=0.8)
        for place, own in enumerate(trials):
            at = np.full(len(own), place)
            axes.plot(at, own, plot.MARKERS[0], color=plot.COLOURS[0], alpha=0.6)
        axes.set_title(plot.labels_of((subject,), "subject")[0], fontsize="small", pad=2)
        axes.set_ylim(plot.limits(scale))
    for axes in grid[len(scores) :]:
        axes.set_axis_off()
    size = "medium" if count <= FEW_NAMES else "x-small"
    for axes in grid:
        axes.set_xticks(places, names, rotation=90, fontsize=size)
    # Where the last row is not full, the names stand in its gap, which is not made wider for them.
    for axes in grid[max(0, len(scores) - columns) : columns * (rows - 1)]:
        axes.tick_params(labelbottom=True)
        for label in axes.get_xticklabels():
            label.set_in_layout(False)


# Figures of trials and touches as made: reaction times, and force and place against the plan.


def strips_figure(
    groups: Mapping[str, FloatArray],
    medians: Sequence[float],
    sheet: plot.Sheet,
    axis: str,
    *,
    across: str,
    logarithmic: bool = False,
    asked: float | None = None,
) -> None:
    """Draw values of each group as points beside its median; `asked` is a dashed line."""
    axes = sheet.axes()
    for place, (values, median) in enumerate(zip(groups.values(), medians, strict=True)):
        # Multiples of the golden ratio spread points evenly without random numbers.
        beside = place + 0.3 * ((np.arange(len(values)) * 0.6180339887) % 1.0 - 0.5)
        axes.plot(beside, values, ".", color=plot.COLOURS[0], alpha=0.5)
        axes.plot([place - 0.25, place + 0.25], [median] * 2, color="black")
    if asked is not None:
        axes.axhline(asked, color=plot.GREY, linestyle="--", linewidth=0.8)
    if logarithmic:
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("{x:g}")
    plot.name_places(axes, plot.labels_of(tuple(groups), across))
    axes.set(xlabel=across, ylabel=axis)
