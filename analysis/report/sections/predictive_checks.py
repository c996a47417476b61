"""Posterior predictive checks of the models M2 and M3."""

from analysis.estimates import Json, NotEstimable, plain
from analysis.report.blocks import Section, Table, columns
from analysis.report.findings import Findings
from analysis.report.wording import interval, number, p_value
from analysis.sensitivity.predictive_checks import LEVEL, PredictiveCheck


def section(found: Findings) -> Section:
    """Return how well each model predicts answers and scores like those of the study."""
    checks = found.trials.predictive
    return Section(
        name="predictive",
        title="Posterior predictive checks",
        blocks=[
            "Each model simulates the study with parameters drawn from its posterior. A model "
            "whose simulated studies differ from the real one is not shown. The rule, set in "
            f"advance, is p < {LEVEL:g} for any of its statistics after Holm's correction.",
            *(_lines(model, check) for model, check in checks.items()),
        ],
        data={"predictive_checks": {model: _json(check) for model, check in checks.items()}},
    )


def _lines(model: str, check: PredictiveCheck | NotEstimable) -> Table | str:
    if isinstance(check, NotEstimable):
        return f"{model} has no check: {check.reason}."
    verdict = "is not shown" if check.refusal else "is not rejected"
    return Table(
        name=f"predictive-{model.lower()}",
        caption=f"{model} {verdict}. Distance between observed and expected counts or shares, in "
        f"the study and in {check.draws} simulated studies (mean and 95 % interval); p is the "
        "share of simulated studies that are at least as far from what the model expects.",
        columns=columns("statistic", "study", "simulated", "95 %", "p", "p (Holm)"),
        rows=[
            [
                each.name,
                number(each.observed, 3),
                number(each.predicted, 3),
                interval(each.predicted_interval, 3),
                p_value(each.p),
                p_value(each.p_holm),
            ]
            for each in check.statistics
        ],
    )


def _json(check: PredictiveCheck | NotEstimable) -> Json:
    found: Json = plain(check)
    if isinstance(check, PredictiveCheck):
        found |= {"level": LEVEL, "rejected": check.refusal is not None}
    return found
