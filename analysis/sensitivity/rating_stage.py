"""How changes are rated: an ordinal mixed model of each subject's line, with columns beside it.

Numbers of equations are those of docs/mathematics/answers.md.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.special import expit

from analysis.estimates import LEVEL, Estimate, FloatArray, IntArray, NotEstimable
from analysis.sensitivity import lines
from analysis.sensitivity.curvature import OrdinalTrials, counted
from analysis.sensitivity.integration import Marginals, settled
from analysis.sensitivity.laplace import Components, LatentField
from analysis.sensitivity.latent_posterior import LatentPosterior, integrated, log_evidence
from analysis.sensitivity.marginals import Combinations

SELECTION_SD = 0.5
"""Prior SD of what selection adds to ratings, in SDs of these."""
COLUMN_SD = 1.0
"""Prior SD of what groups and sessions add to ratings, in SDs of these."""
MOST_FREE = 21
"""Different ratings whose thresholds are estimated; those of more lie midway between them."""
FEWEST_CONDITIONS = 3
# log σ, log τ_b, log τ_g, artanh ρ and log τ_δ, in SDs of the ratings.
START = np.array([-0.5, -0.7, -0.7, 0.0, -1.5])


@dataclass(frozen=True, kw_only=True, eq=False)
class Beside:
    """What stands beside the lines of the subjects.

    Parameters:
        selection: shape (trials,), the column of who noticed; None where nobody was selected.
        group: shape (subjects,), the group of each, -1 for none; None without groups.
        session: shape (trials,), the session of each, from 0; None of a single one.
    """

    selection: FloatArray | None = None
    group: IntArray | None = None
    session: IntArray | None = None

    @cached_property
    def group_codes(self) -> FloatArray:
        """The codes of each group, (groups, groups - 1): see `codes`."""
        return codes(0 if self.group is None else int(self.group.max()) + 1)

    @cached_property
    def of_subjects(self) -> FloatArray:
        """The codes of each subject's group, 0 of none: (subjects, groups - 1)."""
        if self.group is None:
            return np.zeros((0, 0))
        known = np.vstack([self.group_codes, np.zeros(self.group_codes.shape[1])])
        return np.asarray(known[self.group])


def codes(levels: int) -> FloatArray:
    """Return codes of levels, (levels, levels - 1): orthonormal columns, each of which sums to 0.

    With them all levels have the same prior, and their mean is the line beside them.

    >>> codes(2)
    array([[ 0.70710678],
           [-0.70710678]])
    """
    level, step = np.arange(levels)[:, None], np.arange(1.0, levels)
    signs = np.where(level < step, 1.0, np.where(level == step, -step, 0.0))
    return np.asarray(signs / np.sqrt(step**2 + step))


@dataclass(frozen=True, kw_only=True, eq=False)
class PreparedRatings:
    """Rated trials in standard units, with the names and units of the result.

    `of_lines` (subjects, 2, columns) is how intercept and slope of each subject's line depend on
    the coefficients of the columns; `of_groups` likewise, (groups, 2, columns).
    """

    ratings: lines.Ratings
    axes: lines.Axes
    trials: OrdinalTrials
    selects: bool
    of_lines: FloatArray
    of_groups: FloatArray

    @property
    def rated_conditions(self) -> FloatArray:
        """Equal weights of the conditions with ratings, which sum to 1."""
        rated = np.bincount(self.ratings.condition, minlength=len(self.ratings.conditions)) > 0
        return np.asarray(rated / rated.sum())

    @property
    def counts(self) -> IntArray:
        """The number of rated trials of each subject."""
        return np.bincount(self.ratings.subject, minlength=len(self.ratings.subjects))


def prepared(ratings: lines.Ratings, beside: Beside) -> PreparedRatings | NotEstimable:
    """Return the trials with a rating, equal ones counted, or why they set no scale.

    Each different rating is a category; the outermost thresholds between them are fixed.

    Parameters:
        ratings: of trials with a rating and without.
        beside: of the same trials.
    """
    given = ~np.isnan(ratings.rating)
    trials = ratings.where(given)
    axes = lines.axes_of(trials)
    if isinstance(axes, NotEstimable):
        return axes
    values, category = np.unique(trials.rating, return_inverse=True)
    if len(values) < 3:
        return NotEstimable(
            "two different ratings do not set the unit of the latent scale, at least 3 are needed"
        )
    edges = (values[1:] + values[:-1]) / 2
    free = np.full(len(edges), len(values) <= MOST_FREE)
    free[[0, -1]] = False
    x = (trials.contrast - axes.x_mean) / axes.x_sd
    columns, sd, of_lines, of_groups = _columns(beside, given, trials.subject, x)
    rows, weight = counted(
        np.column_stack([trials.subject, trials.condition, x, category, columns])
    )
    used = len(np.unique(trials.condition))
    return PreparedRatings(
        ratings=trials,
        axes=axes,
        selects=beside.selection is not None,
        of_lines=np.zeros((len(trials.subjects), 2, len(sd))) if of_lines is None else of_lines,
        of_groups=of_groups,
        trials=OrdinalTrials(
            subjects=len(trials.subjects),
            conditions=len(trials.conditions) if used >= FEWEST_CONDITIONS else 0,
            subject=rows[:, 0].astype(np.int64),
            condition=rows[:, 1].astype(np.int64),
            x=rows[:, 2],
            category=rows[:, 3].astype(np.int64),
            weight=weight,
            thresholds=(edges - axes.y_mean) / axes.y_sd,
            free=free,
            extra=rows[:, 4:],
            extra_sd=sd,
        ),
    )


def _columns(
    beside: Beside, given: np.ndarray, subject: IntArray, x: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray | None, FloatArray]:
    """Return (10): selection, level and gain of groups, and level of sessions.

    They are the columns, (trials, columns), with the prior SDs of their coefficients, and how the
    lines of subjects and of groups depend on these.
    """
    selection = np.empty((len(x), 0))
    if beside.selection is not None:
        selection = beside.selection[given, None]
    of_group, sessions = beside.of_subjects, np.empty((len(x), 0))
    if beside.session is not None:
        sessions = codes(int(beside.session.max()) + 1)[beside.session[given]]
    own = of_group[subject] if of_group.size else np.empty((len(x), 0))
    columns = np.hstack([selection, own, own * x[:, None], sessions])
    sd = np.full(columns.shape[1], COLUMN_SD)
    first, width = selection.shape[1], own.shape[1]
    sd[:first] = SELECTION_SD

    def placed(of: FloatArray) -> FloatArray:
        lines_of = np.zeros((len(of), 2, columns.shape[1]))
        for line in range(2):
            lines_of[:, line, first + line * width : first + (line + 1) * width] = of
        return lines_of

    groups = placed(beside.group_codes) if width else np.zeros((0, 2, columns.shape[1]))
    return columns, sd, placed(of_group) if width else None, groups


@dataclass(frozen=True, kw_only=True, eq=False)
class RatingStage:
    """The posterior of the ratings, integrated over σ, the spread of lines and that of δ.

    y = b_s + g_s (x - mean x) + γ φ(a)/Φ(a) + δ_c + columns + σ e is rated with the category in
    which it lies.
    """

    ready: PreparedRatings
    posterior: LatentPosterior

    @cached_property
    def _parts(self) -> dict[str, Combinations]:
        """What is told, in points and in points per unit of contrast."""
        axes, groups = self.ready.axes, self.ready.of_groups
        level, gain = axes.y_sd * np.array([[1.0, 0.0], [0.0, 1 / axes.x_sd]])
        bias = level - axes.x_mean * gain
        levels, gains, biases = (self._of_lines(of) for of in (level, gain, bias))
        size, of = len(self.posterior.trials.shared_start), self.ready.trials
        effects = np.eye(size)[of.line_columns.stop :]
        # A level is a mean over the conditions, with what these have beyond their contrasts.
        mean_effect = self.ready.rated_conditions @ effects if len(effects) else np.zeros(size)

        def over_conditions(part: Combinations) -> Combinations:
            return replace(part, shared=part.shared + axes.y_sd * mean_effect)

        no_group = np.zeros((0, levels.shared.shape[1]))
        by_group = [
            levels.shared_only(self._shared(of, groups) if len(groups) else no_group)
            for of in (level, gain)
        ]
        a, b = np.array([*combinations(range(len(groups)), 2)], np.int64).reshape(-1, 2).T
        selection = np.eye(size)[of.extra_columns][: int(self.ready.selects)]
        return {
            "level": over_conditions(levels),
            "group level": over_conditions(levels.shared_only(self._shared(level))),
            "gain": gains,
            "group gain": levels.shared_only(self._shared(gain)),
            "bias": over_conditions(biases),
            "group bias": over_conditions(levels.shared_only(self._shared(bias))),
            "relative gain": self._relative(gains),
            "selection": levels.shared_only(axes.y_sd * selection),
            "effects": levels.shared_only(axes.y_sd * effects),
            "levels of groups": over_conditions(by_group[0]),
            "gains of groups": by_group[1],
            **{
                f"{name} apart": each.shared_only(each.shared[a] - each.shared[b])
                for name, each in zip(("levels", "gains"), by_group, strict=True)
            },
        }

    def _shared(self, of_line: FloatArray, columns: FloatArray | None = None) -> FloatArray:
        """Return of_line · the population's line, or each group's, by shared parameters."""
        if columns is None:
            columns = np.zeros((1, 2, self.ready.trials.extra.shape[1]))
        shared = np.zeros((len(columns), len(self.posterior.trials.shared_start)))
        shared[:, self.ready.trials.line_columns] = of_line
        shared[:, self.ready.trials.extra_columns] = np.einsum("i,gik->gk", of_line, columns)
        return shared

    def _of_lines(self, of_line: FloatArray) -> Combinations:
        own = self.posterior.of_lines(of_line)
        return replace(own, shared=self._shared(of_line, self.ready.of_lines))

    def _relative(self, gains: Combinations) -> Combinations:
        """Return the gain of each subject less the mean of those with ratings."""
        departures = gains.shared - gains.mean @ gains.shared
        return replace(gains, shared=departures, common=-gains.own)

    @cached_property
    def _marginals(self) -> dict[str, Marginals]:
        first, *others = self._parts.values()
        every = self.posterior.marginals(first.followed_by(*others))
        ends = np.cumsum([0, *(len(part.shared) for part in self._parts.values())])
        told = {
            name: every.part(slice(*ends[place : place + 2]))
            for place, name in enumerate(self._parts)
        }
        for name, marginals in told.items():
            if name in _PLACES:
                told[name] = marginals.plus(self.ready.axes.y_mean)
        return told

    @cached_property
    def _estimates(self) -> dict[str, list[Estimate]]:
        weights = self.posterior.points.weights
        return {
            name: estimates_of(marginals, weights) if marginals.means.size else []
            for name, marginals in self._marginals.items()
        }

    def of_subjects(self, name: str) -> list[Estimate]:
        """Return `level`, `gain`, `relative gain` or `bias` of each subject."""
        return self._estimates[name]

    def of_group(self, name: str) -> Estimate:
        """Return `level`, `gain` or `bias` of the population."""
        (estimate,) = self._estimates[f"group {name}"]
        return estimate

    def of_groups(self, name: str) -> list[Estimate]:
        """Return `levels` or `gains` of each group."""
        return self._estimates[f"{name} of groups"]

    def apart(self, name: str) -> list[Estimate]:
        """Return by how much `levels` or `gains` differ in each pair of groups."""
        return self._estimates[f"{name} apart"]

    @property
    def selection(self) -> Estimate | None:
        """γ, in points; None where nothing was selected."""
        return next(iter(self._estimates["selection"]), None)

    @property
    def effects(self) -> list[Estimate]:
        """δ of each condition, in points; none of fewer than three conditions."""
        return self._estimates["effects"]

    @property
    def alone(self) -> bool:
        """Whether at most one subject has ratings, who tells nothing about a population."""
        return bool((self.ready.counts > 0).sum() < 2)

    @cached_property
    def refusal(self) -> NotEstimable | None:
        """Why the lines are not known, or None."""
        rated = np.flatnonzero(self.ready.counts)
        points, weights = self.posterior.points, self.posterior.points.weights
        told = [self._marginals[name].part(rated) for name in ("level", "gain")]
        if not self.alone:
            told += [self._marginals[name] for name in ("group level", "group gain")]
        return points.refusal() or points.refusal(
            *((each, each.interval_95(weights)) for each in told)
        )

    @cached_property
    def gain_sd_upper(self) -> float:
        """What the SD of gains is below with 95% probability, if they differ."""
        unit = self.ready.axes.y_sd / self.ready.axes.x_sd
        (upper,) = self.posterior.points.quantiles(
            lambda points: unit * np.exp(points[:, 2]), 1 - LEVEL
        )
        return upper

    @cached_property
    def equal_gains(self) -> float:
        """Posterior probability that all gains are equal, which is 1/2 before the study."""
        middle = self.posterior.points.mean(self.posterior.points.points)

        def components(points: FloatArray) -> Components:
            return _components(np.insert(points, [2, 2], [-np.inf, 0.0], axis=1))

        field, start = LatentField(self.ready.trials), np.delete(middle, [2, 3])
        of_equal = log_evidence(field, start, components, _log_prior_of_equal)
        return float(expit(of_equal - self.posterior.points.log_evidence))


_PLACES = frozenset(
    {"level", "group level", "bias", "group bias", "levels of groups"}
)  # on the scale of ratings, not differences


def estimates_of(told: Marginals, weights: FloatArray) -> list[Estimate]:
    """Return medians and 95% intervals."""
    (medians,) = told.quantiles(weights, 0.5)
    return [
        Estimate(value=value, interval=interval)
        for value, interval in zip(medians.tolist(), told.interval_95(weights), strict=True)
    ]


def rating_stage(
    ratings: lines.Ratings, beside: Beside, *, few: bool = False
) -> RatingStage | NotEstimable:
    """Return the fit of the ratings, or why there is none.

    The outermost thresholds are fixed midway between the two lowest and the two highest ratings
    given, so that lines are in rating points; the others are estimated, up to 21 values. Lines of
    subjects are normal about the population's.
    With `few` points its evidence is known, and its limits are not.
    """
    ready = prepared(ratings, beside)
    if isinstance(ready, NotEstimable):
        return ready
    start = START if ready.trials.conditions else START[:-1]
    fits = integrated(LatentField(ready.trials), start, _components, _log_prior, few=few)
    if few:
        fit = RatingStage(ready=ready, posterior=next(fits))
        return fit.posterior.points.refusal() or fit
    fit = settled(fits, lambda posterior: RatingStage(ready=ready, posterior=posterior))
    return fit.refusal or fit


def _components(points: FloatArray) -> Components:
    return Components(
        residual_sd=np.exp(points[:, 0]),
        root=lines.roots_of_covariances(points[:, 1:4]),
        discrepancy_sd=np.exp(points[:, 4]) if points.shape[1] > 4 else np.ones(len(points)),
    )


def _log_prior(points: FloatArray) -> FloatArray:
    spread = lines.log_prior_of_spread(points[:, 2]) - 2 * np.log(2**0.5 * np.cosh(points[:, 3]))
    return np.asarray(spread + _log_prior_of_equal(np.delete(points, [2, 3], axis=1)))


def _log_prior_of_equal(points: FloatArray) -> FloatArray:
    others = np.delete(points, 1, axis=1)
    half_cauchy = (others - np.log1p(np.exp(2 * others))).sum(axis=1)
    return np.asarray(lines.log_prior_of_spread(points[:, 1]) + half_cauchy)
