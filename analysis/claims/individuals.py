"""Claims about single participants: their scores and the sensitivity of their skin."""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, fdtrc, fdtri, stdtrit

from analysis.claims.claim import Claims, Finding, human_finding
from analysis.claims.published_scores import ALPHA, PUBLISHED, SCORES, about_subjects, short
from analysis.estimates import FloatArray, Interval
from analysis.sensitivity.lines import SMALL_SPREAD
from analysis.sensitivity.ordinal_model import OrdinalSensitivity, ordinal_sensitivity
from analysis.sensitivity.ratings import Ratings
from device.friction.changes import CONDITIONS
from device.friction.contrasts import predicted_contrast

_POWER = 0.8
CLAIMS = Claims()


@dataclass(frozen=True, kw_only=True)
class GainSpread:
    """Subjects' gains on one value per condition, and how much they can be said to differ.

    Attributes:
        f: the F test of equal gains, with `df` and `p`.
        mean: the mean gain.
        sd_interval: 95% interval of the standard deviation of the gains between subjects.
        detectable_sd: the standard deviation that the test finds with a power of .8.
    """

    f: float
    df: tuple[int, int]
    p: float
    mean: float
    sd_interval: Interval
    detectable_sd: float

    @property
    def differ(self) -> bool | None:
        """Whether gains differ, None where the scores leave it open.

        They do if the interval of their standard deviation excludes 0, and do not if it excludes
        all but a small part of the mean gain.
        """
        low, high = self.sd_interval
        if low > 0:
            return True
        return False if high < SMALL_SPREAD * abs(self.mean) else None


def gain_spread(scores: FloatArray, x: FloatArray) -> GainSpread:
    """Return the spread of subjects' gains, given effects of subjects and of conditions.

    Let S be the sum of squares of the slopes on x of the residuals of rows and columns, and
    Q = Σ(x - x̄)². With gains of standard deviation τ between subjects and residuals of variance σ²,
    F is (1 + τ²Q/σ²) times a variable of the F distribution, which gives the power. The limits of
    τ² are S(1 - q/F)/(Qc), with q and c the same quantile of F and of chi-square, and 0 below that
    (Williams, Biometrika 49, 1962). Gains and residuals are taken as normal, and everybody's
    residuals to scatter alike.

    Parameters:
        scores: shape (subjects, conditions), none missing.
        x: shape (conditions,), a predicted contrast or an effect; not all equal.
    """
    centred = x - x.mean()
    information = float(centred @ centred)
    residuals = scores - scores.mean(axis=0) - scores.mean(axis=1)[:, None] + scores.mean()
    squares = float(((residuals @ centred) ** 2).sum() / information)
    subjects, conditions = scores.shape
    df = (subjects - 1, (subjects - 1) * (conditions - 2))
    variance = (float((residuals**2).sum()) - squares) / df[1]
    f = squares / df[0] / variance

    def limit(probability: float) -> float:
        part = 1 - float(fdtri(*df, probability)) / f
        return float(
            np.sqrt(max(0.0, squares * part / information / chdtri(df[0], 1 - probability)))
        )

    detectable = float(fdtri(*df, 1 - ALPHA) / fdtri(*df, 1 - _POWER)) - 1
    return GainSpread(
        f=f,
        df=df,
        p=float(fdtrc(*df, f)),
        mean=float(scores.mean(axis=0) @ centred / information),
        sd_interval=(limit(1 - ALPHA / 2), limit(ALPHA / 2)),
        detectable_sd=float(np.sqrt(detectable * variance / information)),
    )


def _levels_differ() -> tuple[float, float]:
    """Return F and p of the differences between the subjects' mean scores."""
    subjects, conditions = SCORES.shape
    df = (subjects - 1, (subjects - 1) * (conditions - 1))
    between = conditions * PUBLISHED.subject_means.var(ddof=1)
    f = float(between / PUBLISHED.effects.residual_sd**2)
    return f, float(fdtrc(*df, f))


def _sensitivity_model(contrasts: FloatArray) -> OrdinalSensitivity:
    """Return M2, the report's own model of individual sensitivity, of the published scores."""
    subject, condition = np.indices(SCORES.shape)
    fit = ordinal_sensitivity(
        Ratings(
            subjects=PUBLISHED.table.subjects,
            conditions=PUBLISHED.table.conditions,
            subject=subject.ravel(),
            condition=condition.ravel(),
            contrast=np.broadcast_to(contrasts, SCORES.shape).ravel(),
            rating=SCORES.ravel(),
        )
    )
    assert isinstance(fit, OrdinalSensitivity)
    return fit


@CLAIMS.add(
    place="Section 5.2, after Table 4",
    claim="people differ in the sensitivity of their skin receptors",
    check="gains of subjects (score per contrast): true if the 95% interval of their SD excludes "
    "0, false if it excludes all above a quarter of the mean gain",
    expected="a difference",
    remark="Table 4 can tell that people differ in the level of their scores, which may be their "
    "use of the scale; with one score per person and condition it cannot tell whether gains differ "
    "or are alike, nor one person's gain from the others'",
)
def _receptor_sensitivity_differs(law: str) -> Finding:
    contrasts = np.array([predicted_contrast(CONDITIONS[name], law) for name in PUBLISHED.means])
    found = gain_spread(SCORES, contrasts)
    lines = _sensitivity_model(contrasts).lines
    apart = [
        line.subject
        for line in lines.subjects
        if line.relative_gain_interval[0] > 0 or line.relative_gain_interval[1] < 0
    ]
    levels_f, levels_p = _levels_differ()
    # On the conditions' own effects the mean gain is 1, whatever the law.
    free = gain_spread(SCORES, SCORES.mean(axis=0))
    low, high = free.sd_interval
    return human_finding(
        f"equal gains: F({free.df[0]}, {free.df[1]}) = {free.f:.2f}, p = {short(free.p)}; "
        f"their SD is {100 * low:.0f} to {100 * high:.0f}% of the mean gain (95% CI), and "
        f"{100 * free.detectable_sd:.0f}% is found with a power of {_POWER}",
        found.differ,
        gains=found,
        gains_on_condition_effects=free,
        m2_gain_sd=lines.gain_sd,
        m2_gain_sd_interval=lines.gain_sd_interval,
        m2_equal_gains=lines.equal_gains,
        m2_subjects_with_another_gain=apart,
        levels_f=levels_f,
        levels_p=levels_p,
    )


@CLAIMS.add(
    place="Section 5.2, after Table 4",
    claim="the third subject scores lowest: 4 for pressure, 7 or 8 elsewhere",
    check="the row of subject 3",
    expected="lowest mean; 4; 7 or 8",
)
def _table4_third_subject() -> Finding:
    third = SCORES[2]
    elsewhere = np.isin(third[:4], (7, 8)).all()
    lowest = PUBLISHED.subject_means.argmin() == 2
    return about_subjects([2], lowest, third[4] == 4, elsewhere, scores=third)


def prediction_interval(others: FloatArray) -> Interval:
    """Return the 95% interval of one more value, as far as the others are normal."""
    spread = others.std(ddof=1) * np.sqrt(1 + 1 / others.size)
    half = float(stdtrit(others.size - 1, 1 - ALPHA / 2) * spread)
    return float(others.mean()) - half, float(others.mean()) + half


@CLAIMS.add(
    place="Section 5.2, after Table 4",
    claim="elsewhere the third subject's 7 or 8 points are about the scores given by others",
    check="each of the four scores lies in the 95% prediction interval of the other eight",
    expected="within",
    remark="the four scores are 0.5 to 1.9 below the others' means; 'about' is taken to be within "
    "the scatter between people",
)
def _third_subject_like_others() -> Finding:
    others = np.delete(SCORES, 2, axis=0)
    intervals = {
        name: prediction_interval(others[:, place])
        for place, name in enumerate(PUBLISHED.table.conditions[:4])
    }
    scores = dict(zip(intervals, SCORES[2], strict=False))
    inside = {name: low <= scores[name] <= high for name, (low, high) in intervals.items()}
    outside = [
        f"{name} {scores[name]:.0f}, others {low:.1f} to {high:.1f}"
        for name, (low, high) in intervals.items()
        if not inside[name]
    ]
    return human_finding(
        "outside the 95% prediction interval: " + ("; ".join(outside) or "none"),
        inside.values(),
        below_others=others.mean(axis=0)[:4] - SCORES[2][:4],
        prediction_intervals=intervals,
    )
