"""Ratings against the friction model: predicted contrasts, and the laws compared."""

from collections.abc import Mapping
from functools import partial

import numpy as np

from analysis.estimates import NotEstimable, plain
from analysis.report import figure_data
from analysis.report.blocks import Figure, Section, Table, columns, law_columns
from analysis.report.estimates_json import law_json
from analysis.report.findings import Findings
from analysis.report.wording import SKIN_IN_SHORT, number, of_all, share
from analysis.sensitivity.answers_model import Rated
from analysis.trials.law_comparison import (
    MOST_COUNTED,
    LawOrder,
    critical_rank_correlation,
)
from analysis.trials.trial_checks import Proportion, proportion
from analysis.trials.trial_statistics import PAPERS_RANKING, TrialStatistics
from device.friction.changes import CONDITIONS, LAW, RUNG, predicted_contrast
from device.friction.laws import LAWS

PREDICTIONS = "predictions"
"""Id of the table of predicted contrasts."""


def section(found: Findings) -> Section:
    """Return the model's predictions, and how well they fit the ratings."""
    felt, predicted = _first_signal(found.trials)
    of_paper = found.published and not found.study.imported
    has_signal = of_paper or any(item.kind == "signal" for item in found.study.opening)
    return Section(
        title="Ratings against the model",
        blocks=[
            _signal_line(felt, predicted, found) if has_signal else None,
            ratings_figure(found, _prediction_table(found)),
            _levels_figure(found),
            *(_laws_compared(found) if len(found.shown_laws) > 1 else ()),
        ],
        data={
            "laws": [law_json(score) for score in found.trials.laws],
            "signal": {"felt": plain(felt), "predicted": plain(predicted)},
            "contrast_law": LAW,
            "contrast_rung": RUNG,
        },
    )


def _first_signal(trials: TrialStatistics) -> tuple[Proportion | NotEstimable, dict[str, float]]:
    """Return how many felt the first signal as expected, and what each law predicts of it."""
    answers = trials.data.trials
    answered = answers["trial_kind"].eq("signal") & answers["agrees"].notna()
    if answered.any():
        by_law = trials.contrasts.by_law.items()
        predicted = {law: float(np.mean(values[answered])) for law, values in by_law}
    else:
        signal = CONDITIONS["signal"]
        predicted = {law: predicted_contrast(signal, law, rig=trials.rig) for law in LAWS}
    return proportion(int(answers["agrees"][answered].sum()), int(answered.sum())), predicted


def _signal_line(
    felt: Proportion | NotEstimable, predicted: Mapping[str, float], found: Findings
) -> str:
    several = len(found.shown_laws) > 1
    laws = ", ".join(
        f"{law} {number(predicted[law], 4)}" if several else number(predicted[law], 4)
        for law in found.shown_laws
    )
    told = (
        "response not recorded"
        if isinstance(felt, NotEstimable)
        else f"felt as expected by {share(felt)}"
    )
    return (
        f"First signal (0 → 100 V): {told}; predicted contrast ({found.friction_source}): {laws}."
    )


_LINE = (
    "The line is the group's in the model of the ratings, without effects of conditions beyond "
    "their contrasts{selected}; it ends with the scale. "
)
_SELECTED = " and as if nobody had been selected by noticing"
_THRESHOLDS = (
    "A dotted line is the geometric mean of a track's thresholds, as the contrast that is "
    "predicted of them, the bar at its foot the 95% interval. "
)


def ratings_figure(found: Findings, table: Table | None = None) -> Figure:
    """Return the ratings against the model, which stand among the results."""
    given = found.trials.scored.ratings.given
    count = len(given.rating)
    if not count:
        instead = "No rated trial has a prediction, so there is no figure."
        return Figure(name="model", instead=instead, table=table)
    # `where` takes a mask rather than positions.
    chosen = np.isin(np.arange(count), figure_data.thinned(count, figure_data.MOST_POINTS))
    ratings, curve = given.where(chosen), figure_data.model_curve(found)
    thresholds = figure_data.thresholds_of(found)
    rating = found.sensitivity.rating
    selects = isinstance(rating, Rated) and rating.selection is not None
    line = _LINE.format(selected=_SELECTED * selects)
    return Figure(
        name="model",
        title="Ratings against the model",
        caption="Ratings against the contrast that is predicted for each trial, from "
        f"{found.friction_source}. "
        "Shape and colour mark the condition; equal ratings are offset slightly. "
        f"{line * (curve is not None)}{_THRESHOLDS * bool(thresholds)}"
        f"{'' if found.predictor[1] else SKIN_IN_SHORT}"
        f"{of_all(len(ratings.rating), count, 'ratings')}",
        draw=partial(figure_data.scatter_figure, ratings, found.scale, curve, thresholds),
        table=table,
        front=True,
    )


def _levels_figure(found: Findings) -> Figure:
    data = figure_data.levels(found)
    if not data:
        return Figure(name="levels")
    return Figure(
        name="levels",
        title="Scores by level",
        caption="Scores against the level of each condition: small points are single scores, "
        "large ones means with standard errors."
        + " The line is the group's in the model of the ratings, at the predicted contrasts."
        * any(it.expected is not None for it in data),
        draw=partial(figure_data.levels_figure, data, found.scale),
        table=Table(
            name="levels",
            caption="Numbers shown in the figure: mean score by level.",
            columns=columns("condition", "level", "scores", "mean score", "standard error"),
            rows=[
                [it.condition, f"{at:g}", str(count), number(mean, 2), number(error, 2)]
                for it in data
                for at, count, mean, error in zip(it.at, it.counts, it.mean, it.error, strict=True)
            ],
        ),
    )


def _prediction_table(found: Findings) -> Table:
    laws, means = found.trials.laws, found.trials.response_tests.means
    # The paper's own ranking has ranks, which would look like contrasts here.
    physical = [score for score in laws if score.law in found.shown_laws]
    several = len(physical) > 1
    headings = [score.law if several else "predicted contrast" for score in physical]
    sign = "change of log friction; positive in the expected direction"
    if found.at_once:
        sign = f"log friction of the last touch, relative to {found.rest}"
    return Table(
        name=PREDICTIONS,
        caption="Mean predicted contrast of each condition"
        + " under each friction law" * several
        + f", from {found.friction_source} ({sign}), "
        f"with the mean {found.measure}.",
        columns=columns("condition", f"mean {found.measure}", *headings),
        rows=[
            [name, number(mean, 2), *(number(score.predicted.get(name), 4) for score in physical)]
            for name, mean in zip(found.loaded.table.conditions, means, strict=True)
        ],
    )


def _laws_compared(found: Findings) -> tuple[str, Table]:
    # All laws rank the same conditions, so that the first one tells.
    orders = [order for order in found.trials.orders.values() if isinstance(order, LawOrder)]
    rated = orders[0].rated if orders else 0
    return _too_few_means(rated) if orders else "", _law_table(found, rated)


def _too_few_means(count: int) -> str:
    """Return a sentence on the correlation that `count` condition means need for p < .05."""
    needed = critical_rank_correlation(count)
    if isinstance(needed, NotEstimable):
        reached = "cannot have p < .05, even for a perfect order"
    # With few conditions only the perfect order is rare enough.
    elif needed >= 1:
        reached = "has p < .05 only if it is 1 or −1"
    else:
        reached = f"must reach about {needed:.2f} for p < .05"
    return (
        f"With {count} condition means and no ties, Spearman's rank correlation {reached}. Most "
        "orders of the conditions are not evidence for or against a law."
    )


def _law_table(found: Findings, conditions: int) -> Table:
    laws = found.trials.laws
    given = "ratings" if found.measure == "score" else "answers and ratings"
    of = "over all orders" if conditions <= MOST_COUNTED else "by the t distribution"
    return Table.over(
        laws,
        law_columns("law"),
        name="laws",
        caption=f"Each friction law compared with {given}. ln Bayes factor: log "
        f"evidence of the {given} under the law's contrasts, less that under the best "
        "law's; at −3 they are 20 times as probable under the best one. A gain may have either "
        "sign; that of Spearman's correlation (of predicted contrasts with the conditions' means, "
        f"p {of}) tells whether ratings follow the law or its reverse."
        + _CIRCULAR
        * any(score.law == PAPERS_RANKING for score in laws),
    )


_CIRCULAR = (
    " The paper's own ranking (voltage first, pressure last, the others unranked) was derived "
    "from the paper's Table 4: tested on the same data, it is circular and not evidence."
)
