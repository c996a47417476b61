"""Ratings against the friction model: predicted contrasts and the fit of each law."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from analysis.estimates import NotEstimable, plain
from analysis.report import figure_data
from analysis.report.blocks import Figure, Section, Table, columns, law_columns
from analysis.report.estimates_json import law_json
from analysis.report.findings import Findings
from analysis.report.wording import SKIN_IN_SHORT, number, of_all, share
from analysis.trials.law_likelihood import LawLikelihood, shared_contrasts
from analysis.trials.trial_checks import Proportion, proportion
from analysis.trials.trial_statistics import PAPERS_RANKING, LawScore, TrialStatistics
from device.friction.changes import CONDITIONS, LAW, RUNG, predicted_contrast
from device.friction.laws import LAWS

PREDICTIONS = "predictions"
"""Id of the table of predicted contrasts."""


def section(found: Findings) -> Section:
    """Return the model's predictions, and how well they fit the ratings."""
    felt, predicted = _first_signal(found.trials)
    has_signal = found.published or any(item.kind == "signal" for item in found.study.opening)
    return Section(
        title="Ratings against the model",
        blocks=[
            _signal_line(felt, predicted, found) if has_signal else None,
            ratings_figure(found, _prediction_table(found)),
            _levels_figure(found),
            _laws_line(found.trials),
            _law_table(found.trials.laws) if len(found.shown_laws) > 1 else None,
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


_LINES = {
    figure_data.HEADLINE: "The solid line is the mean rating that M2 expects of the group's "
    "average subject, without effects of conditions beyond their contrasts. ",
    figure_data.SIMPLE: "The dashed line is the group's by M1, the simple comparison. ",
}
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
    ratings, (at, curves) = given.where(chosen), figure_data.model_curves(found)
    thresholds = figure_data.thresholds_of(found)
    return Figure(
        name="model",
        title="Ratings against the model",
        caption="Ratings against the contrast that is predicted for each trial, from "
        f"{found.friction_source}. "
        "Shape and colour mark the condition; equal ratings are offset slightly. "
        f"{''.join(_LINES[model] for model in curves)}{_THRESHOLDS * bool(thresholds)}"
        f"{SKIN_IN_SHORT}{of_all(len(ratings.rating), count, 'ratings')}",
        draw=partial(figure_data.scatter_figure, ratings, found.scale, at, curves, thresholds),
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
        "large ones means with standard errors. The line is the mean rating that M2 expects of "
        "the group's average subject at the predicted contrasts.",
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
    physical = [score for score in laws if not isinstance(score.likelihood, NotEstimable)] or laws
    return Table(
        name=PREDICTIONS,
        caption="Mean predicted contrast of each condition under each friction law, from "
        f"{found.friction_source} (change of log friction; positive in the expected direction), "
        f"with the mean {found.measure}.",
        columns=columns("condition", f"mean {found.measure}", *(score.law for score in physical)),
        rows=[
            [name, number(mean, 2), *(number(score.predicted.get(name), 4) for score in physical)]
            for name, mean in zip(found.loaded.table.conditions, means, strict=True)
        ],
    )


def _laws_line(trials: TrialStatistics) -> str:
    """Return cautions on the laws' log-likelihoods, or an empty text if there are none."""
    if not any(isinstance(score.likelihood, LawLikelihood) for score in trials.laws):
        return ""
    cautions = (
        "Conditions, not trials, are the units that tell laws apart. If p is large, arbitrary "
        "contrasts would fit as well; a law that predicts no better than none adds nothing."
    )
    scored = trials.scored
    # Only then is a law's fit a matter of condition means alone.
    if all(shared_contrasts(scored.ratings, x) for x in scored.contrasts.values()):
        cautions += (
            " Here all subjects have the same contrasts, so a law cannot explain who felt what: "
            "its fit reflects the condition means and how strongly each subject follows them."
        )
    return cautions


def _law_table(laws: Sequence[LawScore]) -> Table:
    return Table.over(
        laws,
        law_columns("law", "without a law"),
        name="laws",
        caption="Each friction law compared with the ratings. Order of the conditions: Spearman's "
        "correlation of predicted contrasts with mean responses, p over all orders, and the "
        "smallest correlation of these ranks, including ties, that has p < .05. Prediction "
        "error: root mean square error, in points, of the mean rating of each condition predicted "
        "from the other conditions, and the same without a law, from the subjects' levels alone; a "
        "prediction outside the scale counts as its end, and conditions whose mean prediction is "
        "outside are named. p of the fit: share of all assignments of the contrasts to the "
        "conditions that fit the ratings at least as well."
        + _CIRCULAR
        * any(score.law == PAPERS_RANKING for score in laws),
    )


_CIRCULAR = (
    " The paper's own ranking (voltage first, pressure last, the others unranked) was derived "
    "from the paper's Table 4: tested on the same data, it is circular and not evidence."
)
