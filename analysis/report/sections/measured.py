"""Sensitivity to friction as it was measured at the finger, beside that to predicted friction."""

from types import SimpleNamespace

from analysis.estimates import Json, NotEstimable, or_null, plain, why
from analysis.felt.measured_statistics import MeasuredStatistics
from analysis.report.blocks import Column, Items, Section, Table, at, estimate, law_columns
from analysis.report.estimates_json import fit_json, law_json
from analysis.report.findings import Findings
from analysis.report.wording import MISSING, group_gain, number, p_equals
from analysis.sensitivity.lines import SMALL_SPREAD
from analysis.trials.trial_checks import FTest
from analysis.trials.trial_statistics import TrialStatistics

COVERAGE = (
    "In 500 simulated sessions (25 studies of 20 people with the paper's five trials) of rigs, "
    "sensors and skins that the analysis did not know, best estimates of contrasts had an RMS "
    "error of .009; 95% intervals of gains by M1 held the true gain in 98 to 99% of cases on "
    "measured contrasts, and in 29 to 35% on predicted ones."
)
"""How often intervals on measured contrasts held the truth; `tests/soak` draws it again."""


def section(found: Findings) -> Section:
    """Return contrasts and sensitivities by the recorded touches; nothing if there are none."""
    measured = found.measured
    if measured is None:
        return Section()
    left_out = [
        f"{count} scored trial{'s' * (count > 1)}, because {reason}; left out of the fits to "
        "measured contrasts."
        for reason, count in measured.left_out.items()
    ]
    return Section(
        title="Sensitivity to measured friction",
        blocks=[
            _headline(measured),
            "Friction was measured at the finger in every recorded touch, so that these gains are "
            "of what was felt: skin is not in them. The sensor's gain cancels in a contrast. "
            f"{COVERAGE}",
            _differences(measured.differences),
            Items(heading="Without a measured contrast.", lines=left_out),
            _contrasts_table(measured),
            _gains_table(found.trials, measured),
            _spread_table(found.trials, measured),
            _predictor_table(measured),
        ],
        data={"measured": _json(measured)},
    )


def _headline(measured: MeasuredStatistics) -> str:
    if isinstance(measured.m2, NotEstimable):
        return f"M2 has no estimates on measured contrasts: {measured.m2.reason}."
    return group_gain(measured.m2.lines, "measured")


def _differences(found: FTest | NotEstimable) -> str:
    """Return whether subjects differ in gain, in a sentence."""
    if isinstance(found, NotEstimable):
        return f"Whether subjects differ in gain cannot be tested: {found.reason}."
    return (
        f"Slopes of the subjects' own, beyond a common one: F({found.df[0]}, {found.df[1]}) = "
        f"{number(found.f, 2)}, {p_equals(found.p)}."
    )


def _contrasts_table(measured: MeasuredStatistics) -> Table:
    numbers = {
        "predicted": "predicted",
        "measured": "mean",
        "standard error": "mean_error",
        "SD between trials": "spread",
        "error of one trial": "trial_error",
        "error of its best estimate": "best_error",
    }
    return Table.over(
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
        "person's and the condition's other trials and is what the models take.",
    )


def _gains_table(trials: TrialStatistics, measured: MeasuredStatistics) -> Table | None:
    if isinstance(measured.m2, NotEstimable):
        return None
    nominal, felt = at(trials.m2, "lines"), measured.m2.lines
    known = () if isinstance(nominal, NotEstimable) else nominal.subjects
    by_name = {line.subject: line for line in known}
    subjects = ((by_name.get(line.subject), line) for line in felt.subjects)
    return Table.over(
        [SimpleNamespace(predicted=a, measured=b) for a, b in ((nominal, felt), *subjects)],
        [
            Column("subject", "measured.subject", absent="group"),
            # The group has no relative gain: it is what subjects' gains are relative to.
            *estimate("predicted: gain", "predicted.gain"),
            *estimate("relative gain", "predicted.relative_gain", absent=MISSING),
            *estimate("measured: gain", "measured.gain"),
            *estimate("relative gain", "measured.relative_gain", absent=MISSING),
        ],
        name="measured-gains",
        caption="Gain of each subject by M2, in rating points per unit of contrast, on predicted "
        "and on measured contrasts, with 95% intervals. The former mixes skin with perception, "
        "the latter does not.",
    )


def _spread_table(trials: TrialStatistics, measured: MeasuredStatistics) -> Table:
    return Table.over(
        [
            SimpleNamespace(model=model, kind=kind, fit=getattr(of, model.lower()))
            for model in ("M2", "M1", "M3")  # the headline first
            for kind, of in (("predicted", trials), ("measured", measured))
        ],
        [
            Column("model", "model"),
            Column("contrasts", "kind"),
            *estimate("gain", "fit.lines.gain"),
            Column("spread", "fit.lines.gain_sd", 2),
            Column("95% below", "fit.lines.gain_sd_upper", 2),
            Column("P(equal)", "fit.lines.equal_gains", 3),
            Column("P(small)", "fit.lines.small_gain_sd", 3),
        ],
        name="measured-spread",
        caption="The group's gain and the spread of gains between subjects (posterior median) on "
        "predicted and on measured contrasts, with 95% intervals, and the value that the spread "
        "is below with 95% probability. P(equal): the probability that there is no spread. "
        f"P(small): the probability that the spread is less than {SMALL_SPREAD:.0%} of the gain.",
    )


def _predictor_table(measured: MeasuredStatistics) -> Table:
    return Table.over(
        measured.predictors,
        law_columns("predictor", "without a predictor"),
        name="predictors",
        caption="What people may feel, each measured in the same trials and compared with the "
        "ratings as the friction laws are: the order of the conditions, the error of the mean "
        "rating of each condition predicted from the others, and the share of all assignments to "
        "the conditions that fit the ratings at least as well.",
    )


def _json(measured: MeasuredStatistics) -> Json:
    return {
        "conditions": plain(measured.conditions),
        "left_out": plain(measured.left_out),
        "coverage": COVERAGE,
        "models": {of: fit_json(getattr(measured, of.lower())) for of in ("M1", "M2", "M3")},
        "noise_share": or_null(measured.noise_share),
        **why("noise_share", measured.noise_share),
        "differences": plain(measured.differences),
        "predictors": [
            # Scored as laws are, but a measured change is no law.
            {"predictor": entry.pop("law"), **entry}
            for entry in map(law_json, measured.predictors)
        ],
    }
