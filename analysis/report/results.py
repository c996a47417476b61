"""The results in words to paste: a paragraph for each question that a study asks.

Numbers are written as the American Psychological Association asks (7th edition, section 6.36): two
decimals, three of a p-value, no zero before the point of a number that cannot exceed 1.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from analysis.estimates import LEVEL, Interval, NotEstimable
from analysis.report.findings import CHANGES_NOTICED, Design, Findings
from analysis.report.wording import (
    bounded,
    chance,
    count_of,
    interval,
    number,
    p_equals,
    sentence,
    unbroken,
)
from analysis.sensitivity.lines import UNEQUAL, Lines
from analysis.sensitivity.ordinal_model import OrdinalSensitivity
from analysis.statistics.factorial import Effect, Factorial, TestedEffect
from analysis.statistics.groups import (
    GAIN,
    INTERACTION,
    SCORE,
    Compared,
    GroupInteraction,
    GroupStatistics,
    TwoGroups,
)
from analysis.statistics.omnibus import SkillingsMack
from analysis.statistics.signed_rank import PairwiseTest, SignedRank
from analysis.statistics.summary import Reading
from analysis.trials.track_fits import CohortThreshold
from device.friction.changes import LAW
from protocol.errors import listed
from protocol.registration.registration import GAINS, OMNIBUS

_SKIN = "Without measured friction, skin and perception cannot be told apart."
THRESHOLDS = "What are the thresholds?"
NOTICE = "Are the changes noticed?"
DIFFER = "Do the conditions differ?"
WHICH = "Which ones?"
GROUPS = "Do the groups differ?"
FACTORS = "Which factors matter?"
TOGETHER = "What holds for all of these questions together?"
FOLLOW = "Do ratings follow the predicted change of friction?"
ORDERED = "Does the model predict the order of the conditions?"
MOST_PAIRS = 3
"""Pairs of conditions that are told with all their numbers; the table has the others."""


def paragraphs(found: Findings) -> Iterator[tuple[str, str]]:
    """Yield the questions that these data can answer, each with its answer."""
    if found.thresholds is not None:
        yield THRESHOLDS, " ".join(threshold_lines(found, "In"))
    if found.loaded.table.conditions:
        yield from _of_conditions(found)


def _of_conditions(found: Findings) -> Iterator[tuple[str, str]]:
    main = found.table.main
    if found.design is not None:
        yield TOGETHER, _together(found.design)
    if found.trials.noticed:
        yield NOTICE, _noticed(found)
    yield DIFFER, f"{_who(found)} {_omnibus(found, main)}"
    if any(isinstance(pair.test, SignedRank) for pair in main.pairwise):
        yield WHICH, _pairs(found, main.pairwise)
    if found.groups is not None:
        yield GROUPS, of_groups(found.groups, adjusted=not found.loaded.table.given.all())
    if found.factors is not None:
        yield FACTORS, _factors(found.factors)
    yield from _of_models(found)


def _of_models(found: Findings) -> Iterator[tuple[str, str]]:
    """Yield what the models of sensitivity and friction answer."""
    if isinstance(found.trials.m2, OrdinalSensitivity):
        law = f"; law {LAW}" * (len(found.shown_laws) > 1)
        predicted = f"predicted contrast (change of log friction{law})"
        yield FOLLOW, _gain(found, found.trials.m2.lines, predicted)
    # Where friction was measured, skin is not in the gains: people are compared by these.
    felt = None if found.measured is None else found.measured.m2
    if isinstance(felt, OrdinalSensitivity):
        contrast = "measured contrast (change of log friction at the finger)"
        yield "Do they follow the change that was measured?", _gain(found, felt.lines, contrast)
        measured = "Friction was measured, so this is not a matter of skin."
        yield from _spread(found, felt.lines, measured)
    elif isinstance(found.trials.m2, OrdinalSensitivity):
        yield from _spread(found, found.trials.m2.lines, _SKIN)
    yield from _ranking(found)


def threshold_lines(found: Findings, of: str = "Threshold in") -> list[str]:
    """Return the mean threshold of each track, with the share that defines it."""
    cohort = found.thresholds.cohort if found.thresholds else ()
    return [f"{of} the track {each.track}: {_mean_threshold(each)}" for each in cohort]


def _mean_threshold(each: CohortThreshold) -> str:
    if isinstance(each.threshold, NotEstimable):
        return f"not known, because {each.threshold.reason}."
    unit, ends = f" {each.unit}" * bool(each.unit), each.threshold_interval
    said = "" if isinstance(ends, NotEstimable) else f", 95% CI [{ends[0]:.3g}, {ends[1]:.3g}]"
    of = f"geometric mean of {each.people} {'person' if each.people == 1 else 'people'}"
    note = f", {each.flagged} of them with notes in the section Thresholds" * bool(each.flagged)
    share = f"a share of {each.threshold_at:.3g} {each.said}"
    weber = ""
    if not isinstance(each.weber, NotEstimable):
        weber = f", a Weber fraction of {each.weber:.3g} of {each.weber_of} friction"
    return f"{each.threshold:.3g}{unit}{said}{weber}, where {share} ({of}{note})."


def counts(found: Findings, question: str) -> bool:
    """Return whether what rests on a question is told: with a design, only where that holds."""
    return found.design is None or found.design.holds(question)


def _p(found: Findings, question: str, p: float) -> str:
    """Return p and, with a design, that by one correction over all questions."""
    corrected = found.design.p_holm.get(question) if found.design else None
    return p_equals(p) + ("" if corrected is None else f" ({p_equals(corrected)} corrected)")


def _noticed(found: Findings) -> str:
    """Tell how often changes were reported, and of which conditions more than on catch trials."""
    *conditions, whole = found.trials.noticed
    all_together = whole.found
    if isinstance(all_together, NotEstimable):
        return f"Not known: {all_together.reason}."
    rates = (all_together.hits, all_together.false_alarms)
    hits, alarms = (f"{rate.share:.0%} of {rate.trials:,}" for rate in rates)
    at_all = counts(found, CHANGES_NOTICED)
    more = [each.of["condition"] for each in conditions if each.noticed and at_all]
    others = [each.of["condition"] for each in conditions if not each.noticed]
    told = (
        f"Noticed more often than catch trials: {listed(more)} (exact tests within people, "
        "Holm's correction)"
        if more
        else "No condition was noticed significantly more often than catch trials (exact tests "
        "within people, Holm's correction), which does not show that none is"
    )
    rest = f"; this is not shown of {listed(others)}" if more and others else ""
    return (
        f"A change was reported on {hits} trials with a change and on {alarms} catch trials, "
        f"{_p(found, CHANGES_NOTICED, all_together.p)}; d′ = {number(all_together.d_prime, 2)}"
        f"{_ci(all_together.d_prime_interval)}. {told}{rest}."
    )


def _who(found: Findings) -> str:
    given = found.loaded.table.given
    subjects, conditions = (int(given.any(axis=axis).sum()) for axis in (1, 0))
    if not subjects:
        return "Nobody gave a score."
    of = count_of(conditions, "condition")
    return sentence(f"{count_of(subjects, 'participant')} rated {of} from {found.scale}.")


def _omnibus(found: Findings, main: Reading) -> str:
    test = main.omnibus
    if isinstance(test, NotEstimable):
        return f"No test of all conditions could be computed: {test.reason}."
    p = test.best_p
    differed = (
        "Ratings differed between conditions"
        if p < LEVEL and counts(found, OMNIBUS)
        else "No difference between conditions was found, which does not show that they are equal"
    )
    told = _p(found, OMNIBUS, p)
    if isinstance(test, SkillingsMack):
        t = f"Skillings–Mack T({test.df}) = {number(test.statistic, 2)}, {told}"
        return f"{differed}, {t} (some scores are missing)."
    w = f"Kendall's W = {bounded(test.kendall_w)}{_ci(test.kendall_w_interval, bounded=True)}"
    return f"{differed}, Friedman's χ²({test.df}) = {number(test.chi2, 2)}, {told}, {w}."


NO_FINDING = "because the conditions were not found to differ"


def _pairs(found: Findings, pairs: Sequence[PairwiseTest]) -> str:
    """Tell the largest significant differences, or the largest one if none is."""
    if not counts(found, OMNIBUS):
        return f"No pair is told, {NO_FINDING}."
    # The largest first, because only some are told.
    differ = sorted((pair for pair in pairs if pair.differs), key=_size, reverse=True)
    told = "; ".join(_pair(found, pair) for pair in differ[:MOST_PAIRS])
    if not differ:
        largest = max((pair for pair in pairs if isinstance(pair.test, SignedRank)), key=_size)
        told = f"The largest difference: {_pair(found, largest)}"
        return (
            "No two conditions differed significantly (Wilcoxon's signed-rank tests, Holm's "
            f"correction). {told if _size(largest) else 'No pair of means differs'}."
        )
    more = len(differ) - MOST_PAIRS
    others = f" {sentence(count_of(more, 'other pair'))} differed, too." if more > 0 else ""
    return f"By Wilcoxon's signed-rank tests with Holm's correction, {told}.{others}"


def _size(pair: PairwiseTest) -> float:
    return abs(pair.test.mean_difference) if isinstance(pair.test, SignedRank) else -1.0


def _pair(found: Findings, pair: PairwiseTest) -> str:
    test = pair.test
    assert isinstance(test, SignedRank)
    names, means = found.loaded.table.conditions, found.table.main.table4.column_means
    mean = dict(zip(names, means, strict=True))
    higher, lower, by = _higher_first(pair, test.mean_difference, test.mean_difference_interval)
    r = test.rank_biserial if higher == pair.a else -test.rank_biserial
    return (
        f"{higher} (M = {number(mean[higher], 2)}) was rated above {lower} "
        f"(M = {number(mean[lower], 2)}) by {by}, {p_equals(pair.p_holm)}, r = {bounded(r)}"
    )


def _higher_first(
    pair: PairwiseTest | TwoGroups, difference: float, ends: Interval | NotEstimable
) -> tuple[str, str, str]:
    """Return the names of a pair, the higher one first, so that the difference is never below 0."""
    a, b = pair.a, pair.b
    if difference < 0:
        a, b, difference = b, a, -difference
        # Turning a difference round swaps the ends of its interval as well.
        ends = ends if isinstance(ends, NotEstimable) else (-ends[1], -ends[0])
    return a, b, f"{number(difference, 2)}{_ci(ends)}"


def of_groups(made: GroupStatistics, *, adjusted: bool) -> str:
    """Tell in which of the questions about groups they differ, and by how much.

    Means are `adjusted` where somebody has no score of a condition: see `groups.mean_scores`.
    """
    means = f"Mean scores{', adjusted for conditions without a score,' * adjusted}"
    apart = sorted(made.in_conditions, key=lambda entry: -abs(entry[1].shift))
    most = "; ".join(f"{name}, {_higher(pair)}" for name, pair in apart[:MOST_PAIRS])
    return " ".join(
        (
            _compared(made, SCORE, means, made.score),
            _profiles(made, made.interaction),
            _compared(made, GAIN, "Gains", made.gain),
            *([f"Conditions in which groups differed most: {most}."] if most else []),
        )
    )


def _compared(made: GroupStatistics, name: str, what: str, found: Compared | NotEstimable) -> str:
    if isinstance(found, NotEstimable):
        return f"{what} could not be compared between groups: {found.reason}."
    first, *others = sorted(found.pairs, key=lambda pair: pair.p_holm)
    h = f"Kruskal–Wallis H = {number(found.statistic, 2)}, " if others else ""
    differed = "differed" if made.holds(name) else "were not found to differ"
    return (
        f"{what} {differed} between groups ({h}{p_equals(made.p_holm[name])} by Holm's correction "
        f"over all questions); {'most clearly ' * bool(others)}{_higher(first)}, Mann–Whitney "
        f"U = {number(first.u, 1)}, {p_equals(first.p_holm)}."
    )


def _profiles(made: GroupStatistics, found: GroupInteraction | NotEstimable) -> str:
    if isinstance(found, NotEstimable):
        return f"Group × condition could not be tested: {found.reason}."
    differed = "differed" if made.holds(INTERACTION) else "were not found to differ"
    return (
        f"Effects of conditions {differed} between groups (group × condition, "
        f"{p_equals(made.p_holm[INTERACTION])}; groups explain {bounded(found.share)} of the "
        "variation of profiles)."
    )


def _higher(pair: TwoGroups) -> str:
    """Tell how far apart two groups are, with the higher one first."""
    return "{} above {} by {}".format(*_higher_first(pair, pair.shift, pair.shift_interval))


def _factors(tests: Factorial) -> str:
    """Tell the effects that were found with their sizes, and which levels are the extreme ones."""
    known = [it for it in tests.effects if isinstance(it.effect, Effect)]
    if not known:
        why = (it.effect.reason for it in tests.effects if isinstance(it.effect, NotEstimable))
        return f"No effect of a factor could be tested: {'; '.join(dict.fromkeys(why))}."
    told = [_effect(tests, it) for it in known if it.found]
    rest = [it.name for it in known if not it.found]
    none = f"No effect was found of {listed(rest)}, which does not show that there is none."
    how = "Permutation and F tests within people, the larger p corrected over all questions."
    return " ".join([*(f"{sentence(each)}." for each in told), *[none] * bool(rest), how])


def _effect(tests: Factorial, it: TestedEffect) -> str:
    effect = it.effect
    assert isinstance(effect, Effect)
    said = (
        f"F({effect.df[0]}, {effect.df[1]}) = {number(effect.f, 2)}, {p_equals(it.p_holm)}, "
        f"partial η² = {bounded(effect.partial_eta2)}"
        f"{_ci(effect.partial_eta2_interval, bounded=True)}"
    )
    if len(it.factors) > 1:
        return f"the effect of {it.factors[0]} depended on {it.factors[1]}, {said}"
    levels = [each for each in tests.levels if each.factor == it.name]
    high, low = (pick(levels, key=lambda each: each.mean) for pick in (max, min))
    return (
        f"{it.name} mattered, from M = {number(low.mean, 2)} ({low.level}) to M = "
        f"{number(high.mean, 2)} ({high.level}), {said}"
    )


def _together(design: Design) -> str:
    """Tell the questions that hold by one correction over all, because many err more often."""
    left = [f"{name} ({p_equals(p)})" for name, p in design.p_holm.items() if p < LEVEL]
    return (
        f"This page asks {count_of(len(design.p_holm), 'question')} of groups, factors, conditions "
        "and people. By Holm's correction over all of them, so that without any effect something "
        f"is claimed in at most 5% of studies, hold: {'; '.join(left) or 'none'}. What rests on a "
        "question counts only where that holds. A registered primary hypothesis is tested alone."
    )


def _gain(found: Findings, lines: Lines, contrast: str) -> str:
    if not lines.group_known:
        return "A single participant tells nothing about a group."
    low, high = lines.gain_interval
    shown = (
        "which includes 0, so these data do not show that ratings follow it."
        if low <= 0 <= high
        else f"which is no finding, {NO_FINDING}."
        if not counts(found, OMNIBUS)
        else "so ratings follow it."
        if low > 0
        else "so ratings fall where a larger change is predicted."
    )
    what, by, ends = ("rise", lines.gain, lines.gain_interval)
    if lines.gain < 0:
        what, by, ends = ("fall", -lines.gain, (-high, -low))
    return (
        f"Per unit of {contrast}, the estimate is a {what} of {number(by, 2)} points in the group"
        f"{_ci(ends)}, {shown}"
    )


def _spread(found: Findings, lines: Lines, skin: str) -> Iterator[tuple[str, str]]:
    """Yield how much gains differ between subjects, if there are several."""
    if not lines.group_known:
        return
    apart = [
        line
        for line in lines.subjects
        if line.relative_gain_interval[0] > 0 or line.relative_gain_interval[1] < 0
    ] * counts(found, GAINS)
    who = (
        f"{count_of(len(apart), 'participant')} differed from the mean gain of the group "
        f"({listed(line.subject for line in apart[:MOST_PAIRS])}"
        f"{', …' if len(apart) > MOST_PAIRS else ''})."
        if apart
        else "no participant's gain can be told from the group's mean gain."
    )
    spread = f"SD {number(lines.gain_sd, 2)}{_ci(lines.gain_sd_interval)}"
    differ = (
        f"Gains differed between participants, {spread}"
        if lines.equal_gains < UNEQUAL and counts(found, GAINS)
        else "These data do not show that gains differ between participants: equal gains have "
        f"{chance(lines.equal_gains)} (.50 before the study), and if gains differ, their SD is "
        f"below {number(lines.gain_sd_upper, 2)} with {chance(0.95)}"
    )
    yield "Are some people more sensitive?", f"{differ}; {who} {skin}"


def _ranking(found: Findings) -> Iterator[tuple[str, str]]:
    """Yield what the order of the conditions says of the law, if there is anything to say."""
    order = found.trials.orders[LAW]
    if isinstance(order, NotEstimable):
        return
    rho, p = order.spearman, order.p
    if isinstance(rho, NotEstimable) or isinstance(p, NotEstimable):
        return
    has_laws = len(found.shown_laws) > 1
    predicted, law = ("law", f" (law {LAW})") if has_laws else ("prediction", "")
    evidence = (
        f"no evidence for or against the {predicted}"
        if p >= LEVEL
        else f"no finding, {NO_FINDING}"
        if not counts(found, OMNIBUS)
        else f"evidence {'for' if rho > 0 else 'against'} the {predicted}'s order"
    )
    yield (
        ORDERED,
        f"Predicted contrasts and mean ratings of {count_of(order.rated, 'condition')} "
        f"correlated by Spearman's {unbroken(f'ρ = {bounded(rho)}')}, "
        f"{p_equals(p)}{law}: {evidence}.",
    )


def _ci(ends: Interval | NotEstimable, *, bounded: bool = False) -> str:
    """Return an interval as APA writes it, or nothing without one."""
    if isinstance(ends, NotEstimable) or np.isnan(ends).any():
        return ""
    return f", 95% CI {interval(ends, bounded=bounded)}"
