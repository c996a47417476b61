"""Ratings against the friction model: predicted contrasts, and each law's score."""

from collections.abc import Sequence
from functools import partial

from analysis.estimates import NotEstimable
from analysis.report.as_json import Json, or_null, plain, why
from analysis.report.drawing import scatter_figure
from analysis.report.figure_data import scatter
from analysis.report.findings import Findings
from analysis.report.section import Column, Figure, Section, Table, columns
from analysis.report.wording import number, of_all, p_value, share
from analysis.trials.law_comparison import LawLikelihood, LawOrder, shared_contrasts
from analysis.trials.trial_statistics import PAPERS_RANKING, LawScore, TrialStatistics

PREDICTIONS = "predictions"
"""The id of the table of predicted contrasts."""


def section(found: Findings) -> Section:
    """Return what the model predicts, and how it fits what was felt."""
    return Section(
        name="model",
        title="Ratings against the model",
        blocks=[
            _signal_line(found.trials),
            _ratings_figure(found),
            _laws_line(found.trials),
            _law_table(found.trials.laws),
        ],
        data={
            "laws": [_law_json(score) for score in found.trials.laws],
            "signal": plain(found.trials.signal),
        },
    )


def _signal_line(trials: TrialStatistics) -> str:
    signal = trials.signal
    laws = ", ".join(f"{law} {number(value, 4)}" for law, value in signal.predicted.items())
    felt = (
        "is not recorded here"
        if isinstance(signal.felt, NotEstimable)
        else f"was felt as expected by {share(signal.felt)}"
    )
    return f"The first signal (0 → 100 V) {felt}; contrast predicted for it: {laws}."


def _ratings_figure(found: Findings) -> Figure:
    data, table = scatter(found), _prediction_table(found)
    if data is None:
        return Figure(
            name="model",
            instead="No trial with a rating has a prediction, so that there is nothing to draw.",
            table=table,
        )
    return Figure(
        name="model",
        title="Ratings against the model",
        caption="Ratings against the contrast that the friction model predicts for the trial, a "
        "shape and colour per condition; equal ratings are shifted a little. The line is the "
        f"group's, by M1.{of_all(len(data.ratings.rating), data.of, 'ratings')}",
        draw=partial(scatter_figure, data),
        table=table,
    )


def _prediction_table(found: Findings) -> Table:
    """The contrast that each law predicts for each condition, beside the mean score."""
    laws, means = found.trials.laws, found.table.main.table4.column_means
    physical = [score for score in laws if not isinstance(score.likelihood, NotEstimable)] or laws
    return Table(
        name=PREDICTIONS,
        caption="Mean predicted contrast of each condition under each friction law (change of log "
        "friction; positive is the expected change), beside the mean score.",
        columns=columns("condition", "mean score", *(score.law for score in physical)),
        rows=[
            [
                name,
                number(mean, 2),
                *(number(score.predicted.get(name), 4) for score in physical),
            ]
            for name, mean in zip(found.loaded.table.conditions, means, strict=True)
        ],
    )


def _laws_line(trials: TrialStatistics) -> str:
    """How far the laws' log-likelihoods can be read, empty where there are none."""
    if not any(isinstance(score.likelihood, LawLikelihood) for score in trials.laws):
        return ""
    said = (
        "The gain in log-likelihood is not penalised for the law's three parameters more (slope, "
        "its spread, its correlation with level), so that chance alone makes it positive; beside a "
        "large p it says that any contrasts would do."
    )
    scored = trials.scored
    if all(shared_contrasts(scored.ratings, x) for x in scored.contrasts.values()):
        said += (
            " All subjects have the same contrasts here, so that a law cannot say who felt what: "
            "its gain is of the conditions' means, and of subjects who follow them more or less."
        )
    return said


def _law_table(laws: Sequence[LawScore]) -> Table:
    return Table(
        name="laws",
        caption="Each friction law against the ratings: does it order the conditions as people "
        "did (Spearman's correlation of predicted contrasts with mean scores, p over all orders, "
        "and the least correlation of these ranks, ties and all, that has p < .05), and does it "
        "explain who felt what (largest log-likelihood of M1 with its contrasts, the gain over "
        "subjects who differ in level alone, and p of the gain: the share of all assignments of "
        "its contrasts to the conditions that gain as much)." + _circular(laws),
        columns=[
            *columns("law", "Spearman", "p", "p < .05 takes"),
            Column(name="order, strongest first", kind="ranking"),
            *columns("log-likelihood", "gain", "p of the gain"),
        ],
        rows=[[score.law, *_order_cells(score.order), *_felt(score.likelihood)] for score in laws],
    )


def _circular(laws: Sequence[LawScore]) -> str:
    if all(score.law != PAPERS_RANKING for score in laws):
        return ""
    return (
        " The paper's own ranking (voltage first, pressure last, nothing said of the others) was "
        "read off the paper's Table 4: scored on those very data it is circular and no evidence."
    )


def _order_cells(order: LawOrder | NotEstimable) -> list[str]:
    if isinstance(order, NotEstimable):
        return [*[number(None)] * 3, f"none: {order.reason}"]
    needed = order.rank_needed
    return [
        number(order.spearman, 2),
        p_value(order.p),
        "none" if isinstance(needed, NotEstimable) else number(needed, 2),
        " > ".join(" = ".join(group) for group in order.tied),
    ]


def _felt(found: LawLikelihood | NotEstimable) -> list[str]:
    if isinstance(found, NotEstimable):
        return [number(None)] * 3
    gain_p = found.gain_p
    told = f"none: {gain_p.reason}" if isinstance(gain_p, NotEstimable) else p_value(gain_p)
    return [number(found.log_likelihood, 2), number(found.gain_over_none, 2), told]


def _law_json(score: LawScore) -> Json:
    return {
        "law": score.law,
        **_order_json(score.order),
        "predicted": plain(score.predicted),
        "who_felt_what": _likelihood_json(score.likelihood),
    }


def _order_json(order: LawOrder | NotEstimable) -> Json:
    if isinstance(order, NotEstimable):
        return {
            **dict.fromkeys(("spearman", "p", "rho_needed", "r_needed")),
            "order": [],
            "order_tied": [],
            "reason": order.reason,
        }
    known: Json = {
        "spearman": or_null(order.spearman),
        "order": list(order.order),
        "order_tied": plain(order.tied),
        "p": or_null(order.p),
        "rho_needed": or_null(order.rank_needed),
        "r_needed": or_null(order.needed),
    }
    if isinstance(order.spearman, NotEstimable):
        known["reason"] = order.spearman.reason
    return {**known, **why("rho_needed", order.rank_needed)}


def _likelihood_json(found: LawLikelihood | NotEstimable) -> Json:
    if isinstance(found, NotEstimable):
        return {"reason": found.reason}
    return {**plain(found), "gain_p": or_null(found.gain_p), **why("gain_p", found.gain_p)}
