"""Thresholds of people in tracks: their table, their cohort, levels and psychometric functions."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby
from operator import attrgetter
from typing import Any

import numpy as np

from analysis.estimates import Interval, Json, NotEstimable, plain
from analysis.report import drawing as plot
from analysis.report.blocks import Column, Figure, Section, Table
from analysis.report.figure_data import thinned
from analysis.report.findings import Findings
from analysis.report.wording import MISSING, of_all
from analysis.statistics.detection import Detection
from analysis.trials.track_fits import (
    CohortThreshold,
    PersonThreshold,
    Thresholds,
    curve_of,
    curve_places,
)
from protocol.study.track import Track, decibels

FIGURES = tuple(f"{what}-{number}" for what in ("track", "psychometric") for number in range(1, 21))
MOST_PANELS = 12
PANELS_A_ROW = 3
METHOD = (
    "Threshold, slope and lapse rate of each person in each track are medians of one posterior, "
    "as touchbeam fit computes it, with its 95% credible intervals. The answers at all levels and "
    "of easy trials count, in yes or no those of catch trials, too. Answers may scatter more than "
    "binomial ones. The share that defines a threshold is that of "
    "somebody who does not lapse. A threshold beyond the levels is not told: the answers do not "
    "say how far it lies beyond. The mean of "
    "reversals estimates the level to which a staircase converges, which can "
    "be that of another share. The Weber fraction (1 − μ′/μ) is that of the friction which the "
    "model predicts at the threshold. Where friction was recorded, a person's measured contrasts "
    "follow the predicted ones by a factor, that of the skin, and the threshold on the measured "
    "axis is the predicted contrast times this factor."
)


def section(found: Findings) -> Section:
    """Return the thresholds of people and of the cohort; nothing for a study without tracks."""
    made = found.thresholds
    if made is None:
        return Section()
    return Section(
        title="Thresholds",
        blocks=[
            METHOD,
            _cohort_table(made.cohort),
            _people_table(made.people),
            _readings_table(made),
            *_figures(found),
        ],
        data={
            "thresholds": {
                "people": list(map(_json, made.people)),
                "cohort": [plain(each) for each in made.cohort],
                "readings": [
                    {**plain(each), "choice": each.choice._asdict()} for each in made.readings
                ],
            }
        },
    )


def curves_figures(found: Findings) -> Iterator[Figure]:
    """Yield the psychometric functions of each track, which stand among the results."""
    return (figure for figure in _figures(found) if figure.front)


def _json(found: PersonThreshold) -> Json:
    """Return all numbers of a person in a track; those of the fit stand beside the others."""
    told: Json = plain(replace(found, readings={}))
    fit = told.pop("fit")
    del told["readings"]  # those of the cohort are told
    wanted = ("threshold_at", "slope", "slope_ci", "lapse", "lapse_ci", "guess", "scatter")
    points = ("level", "answers", "right")
    return {
        **told,
        **{name: fit[name] for name in (*wanted, "deviance_p", "trials")},
        "points": [dict(zip(points, each, strict=True)) for each in told["points"]],
    }


def _short(value: object) -> str:
    """Return a number with three digits that count."""
    if not isinstance(value, int | float) or np.isnan(value):
        return MISSING
    return f"{value:.3g}".replace("-", "−")


def _ends(ends: Interval | NotEstimable | None) -> str:
    if ends is None or isinstance(ends, NotEstimable) or np.isnan(ends).any():
        return MISSING
    return f"[{_short(ends[0])},\N{NO-BREAK SPACE}{_short(ends[1])}]"


def _cohort_table(cohort: Sequence[CohortThreshold]) -> Table:
    return Table.over(
        cohort,
        [
            Column("track", "track", kind="text"),
            Column("people", "people"),
            Column("threshold", "threshold", _short),
            Column("95%", "threshold_interval", _ends),
            Column("unit", "unit", kind="text"),
            Column("at a share of", "threshold_at", _short),
            Column("mixed model", "mixed.threshold", _short),
            Column("95%", "mixed.threshold_interval", _ends),
            Column("SD, dB", lambda each: _short(_sd_db(each))),
            Column("Weber fraction", "weber", _short),
            Column("95%", "weber_interval", _ends),
            Column("of friction", "weber_of", kind="text"),
            Column("with notes", "flagged"),
        ],
        name="thresholds-cohort",
        caption="Geometric mean of the thresholds of all people, with the t interval of their "
        "logarithms; none if the threshold of one lies beyond the levels, which the mixed model "
        "takes in. At a share of: the share right, in yes or no that of yes, which defines it. "
        "Mixed model: the same and the SD of people, from all answers at once, with an effect of "
        "each person. Weber fraction: of friction as predicted, or as measured where it was "
        "recorded of everybody. "
        "With notes: people whose threshold has a note below; they count all the same.",
    )


def _sd_db(each: CohortThreshold) -> float | None:
    return None if isinstance(each.mixed, NotEstimable) else decibels(np.exp(each.mixed.sd))


def _readings_table(made: Thresholds) -> Table:
    return Table.over(
        made.readings,
        [
            Column("track", "track", kind="text"),
            Column("axis", "axis", kind="text"),
            Column("estimate", "choice.estimate", kind="text"),
            Column("curve", "choice.shape", kind="text"),
            Column("lapse rate", "choice.lapses", kind="text"),
            Column("threshold", "threshold", _short),
            Column("95%", "threshold_interval", _ends),
            Column("SD, dB", "sd_db", _short),
        ],
        name="thresholds-readings",
        caption="The geometric mean by each choice of analysis that has a threshold of everybody: "
        "curve, lapse rate (as the study "
        "file gives it, or known to be .02), posterior or mean of reversals, on the track's own "
        "axis, on predicted and on measured friction. SD: between people.",
    )


def _people_table(people: Sequence[PersonThreshold]) -> Table:
    def any_of(name: str) -> bool:
        return any(getattr(each, name) is not None for each in people)

    return Table.over(
        people,
        [
            Column("track", "track", kind="text"),
            Column("subject", "participant", kind="text"),
            Column(
                "threshold",
                lambda each: (
                    each.reason or f"{_short(each.threshold)}\N{NO-BREAK SPACE}{each.unit}".rstrip()
                ),
            ),
            Column("95%", "threshold_interval", _ends),
            *[Column("dB", "db", _short)] * any_of("db"),
            *[Column("predicted Weber fraction", "weber", _short)] * any_of("weber"),
            *[
                Column("measured Weber fraction", "measured_weber", _short),
                Column("95%", "measured_weber_interval", _ends),
                Column("measured / predicted", "felt.ratio", _short),
            ]
            * any_of("felt"),
            Column("slope", "fit.slope", _short),
            Column("lapse rate", "fit.lapse", _short),
            *[Column("mean of reversals", "reversal_mean", _short)] * any_of("reversal_mean"),
            *[
                Column("false alarms", lambda each: _counted(each.detection)),
                Column("d′", "detection.d_prime", _short),
                Column("criterion", "detection.criterion", _short),
            ]
            * any_of("detection"),
            Column("answers", "fit.trials"),
            Column("p of the fit", "fit.deviance_p", 2),
            Column("notes", lambda each: "; ".join(each.flags), kind="sentence"),
        ],
        name="thresholds-people",
        caption="Threshold of each person in each track, at the share of the table above. dB: "
        "relative to the standard's voltage, or to 1 V where that is 0. Slope: Weibull's exponent, "
        "or 1/SD of a normal curve. d′ and criterion: of all touches with a stimulus against catch "
        "trials. p of the fit: how often answers of the "
        "fitted curve deviate from it as much as these. The "
        "predicted contrasts and all intervals stand in report.json.",
    )


def _counted(of: Detection | NotEstimable | None) -> str:
    if not isinstance(of, Detection):
        return MISSING
    return f"{of.false_alarms.reported} of {of.false_alarms.trials}"


def _figures(found: Findings) -> Iterator[Figure]:
    # People come track by track.
    by_track = groupby(found.thresholds.people if found.thresholds else (), attrgetter("track"))
    for number, (name, people) in enumerate(by_track, start=1):
        yield from _figures_of(found.study.track_of(name), list(people), number)


def _figures_of(track: Track, people: Sequence[PersonThreshold], number: int) -> Iterator[Figure]:
    """Yield the levels over the answers and the psychometric functions of a track."""
    known = [each for each in people if each.course.values]
    shown = [known[place] for place in thinned(len(known), MOST_PANELS)]
    more = of_all(len(shown), len(known), "people")
    if not shown:
        return
    rings = "; rings mark reversals" * any(any(each.course.reversal) for each in shown)
    share = f"{track.share:.4g} {'of yes' if track.intervals == 1 else 'right'}"
    yield Figure(
        name=f"track-{number}",
        title=f"Levels of {track.name}",
        caption=f"Levels of {track.name} over the answers, right (filled) or wrong{rings}. The "
        f"dashed line is the fitted threshold ({share}).{more}",
        draw=partial(_levels_figure, track, shown),
    )
    yield Figure(
        name=f"psychometric-{number}",
        title=f"Psychometric functions of {track.name}",
        caption=f"Share {'of yes' if track.intervals == 1 else 'right'} at each level of "
        f"{track.name}; the area of a point is the number of answers. The curve is the fit with "
        f"its 95% band, the bar the 95% interval of the threshold ({share}).{more}",
        draw=partial(_curves_figure, track, shown),
        front=True,
    )


def _axis(track: Track) -> str:
    unit = {"voltage": ", V", "place": ", m", "frequency": " / resonance", "contrast": ""}
    return f"{track.axis}{unit[track.axis]}"


def _logarithmic(track: Track) -> bool:
    return track.levels.step_db is not None


def _panels(
    people: Sequence[PersonThreshold], sheet: plot.Sheet, x_label: str, y_label: str
) -> Iterator[tuple[plot.Axes, PersonThreshold]]:
    """Yield labelled axes for each person."""
    columns = min(PANELS_A_ROW, len(people))
    rows = -(-len(people) // columns)
    grid = sheet.grid(rows, columns, 0.6 + 2.3 * rows)
    names = plot.labels_of(tuple(each.participant for each in people), "person")
    for axes in grid[len(people) :]:
        axes.set_visible(False)
    for place, (axes, person) in enumerate(zip(grid, people, strict=False)):
        axes.set_title(names[place], fontsize="medium")
        if place % columns == 0:
            axes.set_ylabel(y_label)
        if place >= len(people) - columns:
            axes.set_xlabel(x_label)
        yield axes, person


def _levels_figure(track: Track, people: Sequence[PersonThreshold], sheet: plot.Sheet) -> None:
    for axes, person in _panels(people, sheet, "answer", _axis(track)):
        course = person.course
        at, values = np.arange(1, len(course.values) + 1), np.array(course.values)
        right, turned = np.array(course.correct), np.array(course.reversal)
        wrong: Any = {"color": plot.COLOURS[1], "markersize": 3, "fillstyle": "none"}
        axes.plot(at, values, "-", color=plot.GREY, linewidth=0.8)
        axes.plot(at[right], values[right], "o", color=plot.COLOURS[0], markersize=3)
        axes.plot(at[~right], values[~right], "o", **wrong)
        axes.plot(at[turned], values[turned], "o", color="black", markersize=7, fillstyle="none")
        if np.isfinite(person.threshold):
            axes.axhline(person.threshold, color="black", linestyle="--", linewidth=0.8)
        if _logarithmic(track):
            axes.set_yscale("log")
            axes.yaxis.set_major_formatter("{x:g}")
            axes.yaxis.set_minor_formatter("{x:g}")


def _curves_figure(track: Track, people: Sequence[PersonThreshold], sheet: plot.Sheet) -> None:
    side = 1 if track.values[-1] > track.reference else -1
    distance = curve_places(track)
    named = "share of yes" if track.intervals == 1 else "share right"
    for axes, person in _panels(people, sheet, _axis(track), named):
        fit = person.fit
        # A catch trial has no place on a logarithmic axis.
        points = [each for each in person.points if each[0] > 0 or not _logarithmic(track)]
        levels, answers, right = np.array(points, float).reshape(-1, 3).T
        place = track.reference + side * levels
        axes.scatter(place, right / answers, s=6 * answers, color=plot.COLOURS[0], alpha=0.6)
        at = track.reference + side * distance
        axes.fill_between(at, *np.array(fit.band).T, color=plot.GREY, alpha=0.3, linewidth=0)
        if np.isfinite(fit.threshold):
            curve = curve_of(track, person, distance)
            axes.plot(at, curve, color="black")
            height = curve_of(track, person, np.array([fit.threshold]))
            axes.plot(person.threshold_interval, [*height, *height], color=plot.COLOURS[1])
        axes.set_ylim(-0.04, 1.04)
        if _logarithmic(track):
            axes.set_xscale("log")
            axes.xaxis.set_major_formatter("{x:g}")
            axes.xaxis.set_minor_formatter("")
            axes.set_xlim(0.85 * levels.min(initial=distance[0]), 1.2 * distance[-1])
