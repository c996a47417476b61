"""Sensitivity of each subject under M1, M2 and M3: to predicted friction, and to measured."""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from types import SimpleNamespace

from analysis.estimates import Json, NotEstimable, or_null, plain, why
from analysis.felt.measured_statistics import MeasuredStatistics
from analysis.report import figure_data, wording
from analysis.report.blocks import Column, Figure, Items, Section, Table, at, estimate, law_columns
from analysis.report.estimates_json import fit_json, law_json, subjects_json
from analysis.report.findings import Findings
from analysis.report.wording import MISSING, group_gain, number, p_equals
from analysis.sensitivity.integration import LEAST_EFFECTIVE
from analysis.sensitivity.linear_model import LinearSensitivity
from analysis.sensitivity.lines import SMALL_SPREAD, UNEQUAL, Lines, SubjectLine
from analysis.sensitivity.ordinal_model import OrdinalSensitivity
from analysis.sensitivity.two_stage_model import TwoStageSensitivity
from analysis.trials.contrasts import ContrastRange
from analysis.trials.law_likelihood import LawOrder, critical_correlation, critical_rank_correlation
from analysis.trials.trial_checks import FTest
from analysis.trials.trial_statistics import TrialStatistics

_CEILING = 0.05
"""Share of scores at the top of the scale above which the report warns."""


def section(found: Findings) -> Section:
    """Return bias and gain of each subject, and the detection of changes."""
    trials = found.trials
    return Section(
        title="Sensitivity",
        blocks=[
            _headline(trials.m2, trials.ranges),
            *(
                f"{model} has no estimates: {fit.reason}."
                for model, fit in (("M2", trials.m2), ("M1", trials.m1))
                if isinstance(fit, NotEstimable)
            ),
            wording.SKIN if _fits(trials) else None,
            Items(heading="Limitations of these data.", lines=_limits(found)),
            relative_figure(found),
            _gains_figure(trials),
            _fits_table(_fits(trials)),
            None
            if isinstance(trials.m1, NotEstimable)
            else Table.over(
                _with_group(trials.m1.lines),
                [*_LINE, _OWN_SHARE],
                name="simple",
                caption="Simple comparison: bias and gain by M1, with 95% intervals. "
                f"{wording.SIMPLE_ONLY} {wording.SKIN_IN_SHORT}",
            ),
            None if isinstance(trials.m3, NotEstimable) else _detection_table(trials.m3),
        ],
        data=_sensitivity_json(trials),
    )


def _headline(fit: OrdinalSensitivity | NotEstimable, ranges: Sequence[ContrastRange]) -> str:
    """Return the group's gain in a sentence, or an empty text without a fit."""
    if isinstance(fit, NotEstimable) or not fit.lines.group_known:
        return ""
    return f"{wording.group_gain(fit.lines, 'predicted')}{_known(ranges)}"


def _known(ranges: Sequence[ContrastRange]) -> str:
    """Return what the interval of a gain takes for known, by the least certain contrast."""
    if not ranges:
        return ""
    low, high, name = max(
        ((*entry.ends, entry.condition) for entry in ranges), key=lambda ends: ends[1] - ends[0]
    )
    return (
        f" The interval takes the contrasts as known, but that of {name} is {wording.number(low)} "
        f"to {wording.number(high)} under other assumptions of the friction model (see How certain "
        "the contrasts are)."
    )


def _limits(found: Findings) -> list[str]:
    limits, trials = [], found.trials
    if not trials.has_repeats and _fits(trials):
        limits.append(
            "With one rating per subject and condition, differences between subjects in "
            "sensitivity cannot be established: a subject's gain is known only by pooling with the "
            "others, and its own share shows how much of its departure from the group comes from "
            "the subject's own trials. The intervals of M1 and M2 then depend largely on the "
            "priors."
        )
    if isinstance(trials.m1, LinearSensitivity):
        limits.append(
            "M1 assumes that conditions differ only in the predicted contrast. It treats all other "
            "differences between conditions as noise of single trials, so its intervals are too "
            "narrow, above all those of the group; M2, the headline, includes a discrepancy for "
            "each condition."
        )
    # All laws rank the same conditions, so that the first one tells.
    rated = [order.rated for order in trials.orders.values() if isinstance(order, LawOrder)]
    if rated:
        limits.append(_too_few_means(rated[0]))
    scores = found.loaded.scored["score"].dropna()
    ceiling = (scores >= found.scale.highest).mean() if len(scores) else 0.0
    if ceiling > _CEILING:
        limits.append(
            f"{ceiling:.0%} of the scores are the highest possible. M1 ignores this ceiling and "
            "underestimates the gains; M2 accounts for it."
        )
    if isinstance(trials.m3, NotEstimable):
        why = trials.m3.reason
        limits.append(f"M3 (noticing a change, then rating it) has no estimates: {why}.")
    return limits


def _too_few_means(count: int) -> str:
    """Return a sentence on the correlations that `count` condition means need for p < .05."""
    ranks, moments = critical_rank_correlation(count), critical_correlation(count)
    if isinstance(ranks, NotEstimable):
        reached = "cannot have p < .05, even for a perfect order"
    # With few conditions only the perfect order is rare enough.
    elif ranks >= 1:
        reached = "has p < .05 only if it is 1 or −1"
    else:
        reached = f"must reach {ranks:.3f} for p < .05"
    products = (
        ""
        if isinstance(moments, NotEstimable)
        else f" (Pearson's correlation of the contrasts and means must exceed {moments:.3f})"
    )
    return (
        f"With {count} condition means and no ties, Spearman's rank correlation (the one shown) "
        f"{reached}{products}. Most orders of the conditions are not evidence for or against a law."
    )


def _gains_figure(trials: TrialStatistics) -> Figure:
    models = figure_data.gains(trials)
    if not models:
        return Figure(name="sensitivity")
    model, lines = next(iter(models.items()))
    return Figure(
        name="sensitivity",
        title="Sensitivity of each subject",
        caption="Sensitivity of each subject with its 95% interval; dashed lines show the group, "
        f"if there are several subjects. {wording.SKIN_IN_SHORT}{_drawn(lines)}",
        draw=partial(figure_data.gains_figure, models),
        table=_gains_table(model, lines),
    )


def _drawn(lines: Lines) -> str:
    return wording.of_all(len(figure_data.drawn_subjects(lines)), len(lines.subjects), "subjects")


def relative_figure(found: Findings) -> Figure:
    """Return the relative gains, which stand among the results."""
    trials = found.trials
    model, lines = next(iter(figure_data.gains(trials).items()), ("", None))
    if lines is None or not lines.subjects[0].relative_gain_known:
        return Figure(name="relative-gains")
    return Figure(
        name="relative-gains",
        title="Who is more sensitive than whom",
        caption=f"Relative gain of each subject by {model}, a model of the ratings: the gain less "
        "the mean gain of the subjects (dashed), with its 95% interval. "
        f"{wording.SKIN_IN_SHORT}{_drawn(lines)}",
        draw=partial(figure_data.relative_gains_figure, lines),
        front=True,
    )


_LINE = (
    Column("subject", "subject", absent="group"),
    *estimate("bias", "bias"),
    *estimate("gain", "gain"),
)
_OWN_SHARE = Column("own share", "own_share", 2, absent="")


def _with_group(lines: Lines) -> list[Lines | SubjectLine]:
    """Return the records of a table of lines; a subject without trials has only the group's."""
    return [lines, *(line for line in lines.subjects if line.trials)]


def _gains_table(model: str, lines: Lines) -> Table:
    return Table.over(
        _with_group(lines),
        [
            *_LINE,
            *estimate("relative gain", "relative_gain", absent=""),
            Column(
                "JND",
                "jnd",
                lambda jnd: wording.UNBOUNDED if math.isinf(jnd) else wording.number(jnd),
            ),
            Column("95%", "jnd_interval", partial(wording.interval, digits=3)),
            _OWN_SHARE,
        ],
        name="gains",
        caption=f"Sensitivity by {model}, with 95% intervals. Bias: rating at no contrast. Gain: "
        "rating points per unit of contrast. Relative gain: the subject's gain less the mean gain "
        "of the subjects, which tells who is more sensitive than whom and is known better than the "
        "gain itself. JND (just noticeable difference): the contrast that changes a rating by the "
        "standard deviation of its noise (no threshold of a psychometric function), without an "
        "upper limit where the gain may be 0. Own share: the share of a "
        "subject's departure from the group's gain that comes from the "
        f"subject's own trials; the rest comes from the group. {wording.SKIN_IN_SHORT}",
    )


def _fits(trials: TrialStatistics) -> dict[str, LinearSensitivity | OrdinalSensitivity]:
    """Return the fits by model, the headline first."""
    # The second stage of M3 is M2 of the changes that were noticed.
    m3 = trials.m3.ratings if isinstance(trials.m3, TwoStageSensitivity) else trials.m3
    fits = {figure_data.HEADLINE: trials.m2, figure_data.SIMPLE: trials.m1, "M3": m3}
    return {name: fit for name, fit in fits.items() if not isinstance(fit, NotEstimable)}


def _fits_table(fits: Mapping[str, LinearSensitivity | OrdinalSensitivity]) -> Table | None:
    """Return the spread of gains between subjects under each model, or None without a fit."""
    if not fits:
        return None
    return Table.over(
        [SimpleNamespace(model=model, fit=fit) for model, fit in fits.items()],
        [
            Column("model", "model"),
            *estimate("SD", "fit.lines.gain_sd"),
            Column("95% below", "fit.lines.gain_sd_upper", 2),
            Column("P(equal)", "fit.lines.equal_gains", 3),
            Column("P(small)", "fit.lines.small_gain_sd", 3),
            Column("SD of noise", "fit.residual_sd", 2),
            Column("effective points", "fit.effective_points", "{:.0f}".format),
        ],
        name="spread",
        caption="Spread of gains between subjects, in points per unit of contrast: the median, "
        "the 95% interval and the value that it is below with 95% probability, if gains differ. "
        "P(equal): the probability that all gains are equal, .50 before the study; unless it is "
        f"below {wording.bounded(UNEQUAL, 3)}, the data show no difference, and the interval "
        f"begins at 0. P(small): the probability that the spread is less than {SMALL_SPREAD:.0%} "
        "of the group's gain, about as much as differences of skin alone produce. Effective "
        f"points: how well the fit is integrated, at least {LEAST_EFFECTIVE:.0f}. "
        f"{wording.SKIN_IN_SHORT}",
    )


def _detection_table(fit: TwoStageSensitivity) -> Table:
    subjects = zip(fit.detection, fit.ratings.lines.subjects, strict=True)
    return Table.over(
        [SimpleNamespace(noticing=noticing, line=line) for noticing, line in subjects],
        [
            Column("subject", "noticing.subject"),
            *estimate("d′", "noticing.d_prime"),
            *estimate("criterion", "noticing.criterion"),
            *estimate("false alarms", "noticing.false_alarm_rate"),
            *estimate("gain", "line.gain"),
        ],
        name="detection",
        caption="Change detection and rating of the changes that were noticed (M3): d′ at a "
        f"contrast of {fit.reference_contrast:.3f}; the criterion for the expected change, in SDs "
        "of the noise; the false-alarm rate, the probability that a change in either direction is "
        "reported without one; gain in rating points; with 95% intervals. "
        f"{_scored(fit)} {wording.SKIN_IN_SHORT}",
    )


def _scored(fit: TwoStageSensitivity) -> str:
    """Return what the scores are taken to follow, and what else they would mean."""
    felt = fit.scored == "what was felt"
    return (
        f"Scores are taken to follow {'what was felt' if felt else 'the change itself'} "
        f"({wording.chance(fit.scored_p)}, .50 before the study); if they follow "
        f"{'the change itself' if felt else 'what was felt of the changes that were noticed'}, "
        f"the group's gain is {wording.number(fit.other_gain, 2)} rather than "
        f"{wording.number(fit.ratings.lines.gain, 2)}."
    )


def _sensitivity_json(trials: TrialStatistics) -> Json:
    subjects = {
        model: [] if isinstance(fit, NotEstimable) else subjects_json(fit.lines.subjects)
        for model, fit in (("M1", trials.m1), ("M2", trials.m2))
    }
    return {
        "sensitivity_model": "M2",
        "sensitivity_note": wording.SKIN,
        "sensitivity": subjects["M2"],
        **why("sensitivity", trials.m2),
        "sensitivity_simple": {
            "model": "M1",
            "note": wording.SIMPLE_ONLY,
            "subjects": subjects["M1"],
            **({"reason": trials.m1.reason} if isinstance(trials.m1, NotEstimable) else {}),
        },
        "sensitivity_models": {
            model: fit_json(getattr(trials, model.lower())) for model in ("M1", "M2", "M3")
        },
    }


# Sensitivity to friction as it was measured at the finger.

COVERAGE = (
    "In 500 simulated sessions (25 studies of 20 people with the paper's five trials) of rigs, "
    "sensors and skins that the analysis did not know, best estimates of contrasts had an RMS "
    "error of .009; 95% intervals of gains by M1 held the true gain in 98 to 99% of cases on "
    "measured contrasts, and in 29 to 35% on predicted ones."
)
"""How often intervals on measured contrasts held the truth; `tests/soak` draws it again."""


def measured_section(found: Findings) -> Section:
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
            _measured_headline(measured),
            "Friction was measured at the finger in every recorded touch, so that these gains are "
            "of what was felt: skin is not in them. The sensor's gain cancels in a contrast. "
            f"{COVERAGE}",
            _differences(measured.differences),
            Items(heading="Without a measured contrast.", lines=left_out),
            _contrasts_table(measured),
            _measured_gains(found.trials, measured),
            _spread_table(found.trials, measured),
            _predictor_table(measured),
        ],
        data={"measured": _measured_json(measured)},
    )


def _measured_headline(measured: MeasuredStatistics) -> str:
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


def _measured_gains(trials: TrialStatistics, measured: MeasuredStatistics) -> Table | None:
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


def _measured_json(measured: MeasuredStatistics) -> Json:
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
