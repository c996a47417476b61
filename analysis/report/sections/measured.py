"""Sensitivity to friction as it was measured at the finger, beside that to predicted friction."""

from collections.abc import Mapping

from analysis.estimates import Json, NotEstimable, plain, why
from analysis.felt.measured_statistics import MeasuredStatistics
from analysis.report.as_json import fit_json, law_json
from analysis.report.blocks import Column, Items, Section, Table, columns
from analysis.report.findings import Findings
from analysis.report.wording import MISSING, interval, law_cells, number, p_equals
from analysis.sensitivity.linear_model import LinearSensitivity
from analysis.sensitivity.lines import SMALL_SPREAD, Lines, SubjectLine
from analysis.sensitivity.ordinal_model import OrdinalSensitivity
from analysis.sensitivity.two_stage_model import TwoStageSensitivity
from analysis.trials.trial_checks import FTest
from analysis.trials.trial_statistics import TrialStatistics

COVERAGE = (
    "In 500 simulated sessions (25 studies of 20 people with the paper's five trials) of rigs, "
    "sensors and skins that the analysis did not know, best estimates of contrasts had an RMS "
    "error of .009; 95% intervals of gains by M1 held the true gain in 98 to 99% of cases on "
    "measured contrasts, and in 29 to 35% on predicted ones."
)
"""How often intervals on measured contrasts held the truth; `tests/soak` draws it again."""

Fit = LinearSensitivity | OrdinalSensitivity | TwoStageSensitivity | NotEstimable


def section(found: Findings) -> Section:
    """Return contrasts and sensitivities by the recorded touches; nothing if there are none."""
    measured = found.measured
    if measured is None:
        return Section(name="measured", title="", blocks=[], data={})
    fits = _fits(found.trials, measured)
    return Section(
        name="measured",
        title="Sensitivity to measured friction",
        blocks=[
            _headline(measured),
            "Friction was measured at the finger in every recorded touch, so that these gains are "
            "of what was felt: skin is not in them. The sensor's gain cancels in a contrast. "
            f"{COVERAGE}",
            _differences(measured.differences),
            Items(heading="Without a measured contrast.", lines=_left_out(measured)),
            _contrasts_table(measured),
            _gains_table(found.trials, measured),
            _spread_table(fits),
            _predictor_table(measured),
        ],
        data={"measured": _json(measured)},
    )


def _fits(trials: TrialStatistics, measured: MeasuredStatistics) -> dict[str, tuple[Fit, Fit]]:
    """Return each model's fit to predicted and to measured contrasts, the headline first."""
    return {
        "M2": (trials.m2, measured.m2),
        "M1": (trials.m1, measured.m1),
        "M3": (trials.m3, measured.m3),
    }


def _lines(fit: Fit) -> Lines | None:
    if isinstance(fit, NotEstimable):
        return None
    return fit.ratings.lines if isinstance(fit, TwoStageSensitivity) else fit.lines


def _headline(measured: MeasuredStatistics) -> str:
    lines = _lines(measured.m2)
    if lines is None:
        assert isinstance(measured.m2, NotEstimable)
        return f"M2 has no estimates on measured contrasts: {measured.m2.reason}."
    shown = "includes" if lines.gain_interval[0] <= 0 <= lines.gain_interval[1] else "excludes"
    return (
        f"By M2, ratings change by {number(lines.gain, 2)} points per unit of measured contrast in "
        f"the group, 95% interval {interval(lines.gain_interval)}, which {shown} 0."
    )


def _differences(found: FTest | NotEstimable) -> str:
    """Return whether subjects differ in gain, in a sentence."""
    if isinstance(found, NotEstimable):
        return f"Whether subjects differ in gain cannot be tested: {found.reason}."
    return (
        f"Slopes of the subjects' own, beyond a common one: F({found.df[0]}, {found.df[1]}) = "
        f"{number(found.f, 2)}, {p_equals(found.p)}."
    )


def _left_out(measured: MeasuredStatistics) -> list[str]:
    """Return how many scored trials the measured fits leave out, by reason."""
    return [
        f"{count} scored trial{'s' if count > 1 else ''}, because {reason}; left out of the fits "
        "to measured contrasts."
        for reason, count in measured.left_out.items()
    ]


def _contrasts_table(measured: MeasuredStatistics) -> Table:
    return Table(
        name="measured-contrasts",
        caption="Measured contrast of each condition (change of log friction, as the predicted "
        "one) and its standard error over trials; SD between trials of the best estimates; "
        "standard error of one trial alone, and of its best estimate, which borrows from the "
        "person's and the condition's other trials and is what the models take.",
        columns=columns(
            *("condition", "trials", "predicted", "measured", "standard error"),
            *("SD between trials", "error of one trial", "error of its best estimate"),
        ),
        rows=[
            [
                entry.condition,
                str(entry.trials),
                *(
                    number(value, 4)
                    for value in (
                        *(entry.predicted, entry.mean, entry.mean_error),
                        *(entry.spread, entry.trial_error, entry.best_error),
                    )
                ),
            ]
            for entry in measured.conditions
        ],
    )


def _gains_table(trials: TrialStatistics, measured: MeasuredStatistics) -> Table | None:
    """Return each subject's gain by M2 on predicted and on measured contrasts."""
    nominal, felt = _lines(trials.m2), _lines(measured.m2)
    if felt is None:
        return None
    by_name: Mapping[str, SubjectLine] = (
        {} if nominal is None else {line.subject: line for line in nominal.subjects}
    )
    names = ("predicted: gain", "95%", "relative gain", "95%")
    others = ("measured: gain", "95%", "relative gain", "95%")
    return Table(
        name="measured-gains",
        caption="Gain of each subject by M2, in rating points per unit of contrast, on predicted "
        "and on measured contrasts, with 95% intervals. The former mixes skin with perception, "
        "the latter does not.",
        columns=columns("subject", *names, *others),
        rows=[
            # The group has no relative gain: it is what subjects' gains are relative to.
            ["group", *_gain_cells(nominal), *[MISSING] * 2, *_gain_cells(felt), *[MISSING] * 2],
            *(
                [
                    line.subject,
                    *_subject_cells(by_name.get(line.subject)),
                    *_subject_cells(line),
                ]
                for line in felt.subjects
            ),
        ],
    )


def _gain_cells(line: SubjectLine | Lines | None) -> list[str]:
    if line is None:
        return [MISSING] * 2
    return [number(line.gain, 2), interval(line.gain_interval)]


def _subject_cells(line: SubjectLine | None) -> list[str]:
    if line is None:
        return [MISSING] * 4
    known = line.relative_gain_known
    return [
        *_gain_cells(line),
        number(line.relative_gain, 2),
        interval(line.relative_gain_interval) if known else MISSING,
    ]


def _spread_table(fits: Mapping[str, tuple[Fit, Fit]]) -> Table:
    """Return gain and spread of the group under each model, on either kind of contrast."""
    return Table(
        name="measured-spread",
        caption="The group's gain and the spread of gains between subjects (posterior median) on "
        "predicted and on measured contrasts, with 95% intervals, and the value that the spread "
        "is below with 95% probability. P(equal): the probability that there is no spread. "
        f"P(small): the probability that the spread is less than {SMALL_SPREAD:.0%} of the gain.",
        columns=columns(
            *("model", "contrasts", "gain", "95%", "spread", "95% below", "P(equal)", "P(small)")
        ),
        rows=[
            [model, kind, *_spread_cells(_lines(fit))]
            for model, both in fits.items()
            for kind, fit in zip(("predicted", "measured"), both, strict=True)
        ],
    )


def _spread_cells(lines: Lines | None) -> list[str]:
    if lines is None:
        return [MISSING] * 6
    return [
        *_gain_cells(lines),
        number(lines.gain_sd, 2),
        number(lines.gain_sd_upper, 2),
        number(lines.equal_gains),
        number(lines.small_gain_sd),
    ]


def _predictor_table(measured: MeasuredStatistics) -> Table:
    return Table(
        name="predictors",
        caption="What people may feel, each measured in the same trials and compared with the "
        "ratings as the friction laws are: the order of the conditions, the error of the mean "
        "rating of each condition predicted from the others, and the share of all assignments to "
        "the conditions that fit the ratings at least as well.",
        columns=[
            *columns("predictor", "Spearman", "p", "smallest for p < .05"),
            Column(name="order, strongest first", kind="ranking"),
            *columns("prediction error", "without a predictor", "p of the fit"),
        ],
        rows=[[score.law, *law_cells(score)] for score in measured.predictors],
    )


def _json(measured: MeasuredStatistics) -> Json:
    models = {"M1": measured.m1, "M2": measured.m2, "M3": measured.m3}
    share = measured.noise_share
    return {
        "conditions": plain(measured.conditions),
        "left_out": plain(measured.left_out),
        "coverage": COVERAGE,
        "models": {name: fit_json(fit) for name, fit in models.items()},
        "noise_share": None if isinstance(share, NotEstimable) else share,
        **why("noise_share", share),
        "differences": plain(measured.differences),
        "predictors": [
            # Scored as laws are, but a measured change is no law.
            {"predictor": entry.pop("law"), **entry}
            for entry in map(law_json, measured.predictors)
        ],
    }
