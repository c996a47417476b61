"""The results in words to paste: a paragraph for each question that a study asks.

Numbers are written as the American Psychological Association asks (7th edition, section 6.36): two
decimals, three of a p-value, no zero before the point of a number that cannot exceed 1.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from analysis.estimates import LEVEL, Estimate, Interval, NotEstimable
from analysis.report.findings import CHANGES_NOTICED, Findings
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
from analysis.sensitivity.answers_model import Rated
from analysis.statistics.factorial import Effect, Factorial, LevelMean, TestedEffect
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
from analysis.statistics.signed_rank import PairwiseTest, SignedRank, least_holm_p
from analysis.statistics.slope import LevelSlope, Slope
from analysis.statistics.summary import ConditionTests
from analysis.trials.track_fits import CohortThreshold
from device.friction.changes import LAW
from protocol.errors import listed
from protocol.registration.registration import FOLLOWS, OMNIBUS

_SKIN = "Without measured friction, skin and perception cannot be told apart."
THRESHOLDS = "What are the thresholds?"
NOTICE = "Are the changes noticed?"
DIFFER = "Do the conditions differ?"
WHICH = "Which ones?"
GROUPS = "Do the groups differ?"
FACTORS = "Which factors matter?"
TOGETHER = "What was found?"
SENSITIVE = "Are some people more sensitive?"
WHICH_WAY = "Which way were the changes felt?"
FOLLOW = "Do responses follow the predicted change of friction?"
MOST_PAIRS = 3
"""Pairs of conditions that are told with all their numbers; the table has the others."""


def paragraphs(found: Findings) -> Iterator[tuple[str, str]]:
    """Yield the questions that these data can answer, each with its answer."""
    if found.thresholds is not None:
        yield THRESHOLDS, " ".join(threshold_lines(found, "In"))
    if found.loaded.table.conditions:
        yield from _of_conditions(found)


def _of_conditions(found: Findings) -> Iterator[tuple[str, str]]:
    main = found.trials.response_tests
    if contrary := contrary_lines(found):
        yield WHICH_WAY, " ".join(contrary)
    if len(found.questions.p_holm) > 1:
        yield TOGETHER, together(found)
    if found.trials.noticed:
        yield NOTICE, _noticed(found)
    yield DIFFER, " ".join([_who(found), _omnibus(found, main)])
    if any(isinstance(pair.test, SignedRank) for pair in main.pairwise):
        yield WHICH, _pairs(found, main.pairwise)
    if found.groups is not None:
        yield GROUPS, of_groups(found, found.groups)
    if found.factors is not None:
        yield FACTORS, _factors(found.factors)
    yield from _of_models(found)


def _of_models(found: Findings) -> Iterator[tuple[str, str]]:
    """Yield what predictions and the models of sensitivity answer."""
    if found.is_predicted:
        yield FOLLOW, _slope(found)
    rating = found.sensitivity.rating
    if isinstance(rating, NotEstimable) or isinstance(rating.gain, NotEstimable):
        return
    if found.predictor[1]:
        yield "Do they follow the change that was measured?", _gain(rating.gain)
    if rating.untold is None:
        yield SENSITIVE, _differ(found, rating)
    else:
        yield SENSITIVE, f"{untold(found, rating)} {_levels(found, rating)}"


def threshold_lines(found: Findings, of: str = "Threshold in") -> list[str]:
    """Return the mean threshold of each track, with the share that defines it."""
    cohort = found.thresholds.cohort if found.thresholds else ()
    return [f"{of} the track {each.track}: {_mean_threshold(each)}" for each in cohort]


def _mean_threshold(each: CohortThreshold) -> str:
    unit, ends = f" {each.unit}" * bool(each.unit), each.threshold_interval
    if isinstance(each.threshold, NotEstimable):
        of_all = ""
        if not isinstance(each.mixed, NotEstimable):
            low, high = each.mixed.threshold_interval
            of_all = f"; the mean by the mixed model is {each.mixed.threshold:.3g}{unit}"
            of_all += f", 95% CI [{low:.3g}, {high:.3g}]"
        return f"no geometric mean, because {each.threshold.reason}{of_all}."
    said = "" if isinstance(ends, NotEstimable) else f", 95% CI [{ends[0]:.3g}, {ends[1]:.3g}]"
    of = f"geometric mean of {each.people} {'person' if each.people == 1 else 'people'}"
    note = f", {each.flagged} of them with notes in the section Thresholds" * bool(each.flagged)
    share = f"a share of {each.threshold_at:.3g} {each.said}"
    if 2 * each.flagged > each.people and not isinstance(each.mixed, NotEstimable):
        note += f"; {each.mixed.threshold:.3g}{unit} by the mixed model of all answers"
    weber = ""
    if not isinstance(each.weber, NotEstimable):
        weber = f", a Weber fraction of {each.weber:.3g} of {each.weber_of} friction"
    return f"{each.threshold:.3g}{unit}{said}{weber}, where {share} ({of}{note})."


def contrary_lines(found: Findings) -> list[str]:
    """Return a sentence for each condition whose changes were felt the other way, and what to do.

    A condition of which so few changes were felt that chance explains their directions has none.
    """
    contrary = {name: ways for name, ways in found.trials.directions.items() if ways.is_contrary}
    if not contrary:
        return []
    names = found.loaded.table.conditions
    foreseen = [name for name in contrary if found.trials.predicted[names.index(name)] < 0]
    others = [name for name in contrary if name not in foreseen]
    return [
        *(
            f"{sentence(name)}: {_of(ways.expected)} of {ways.answers:,} answers as expected, "
            f"{ways.contrary:,} the other way."
            for name, ways in contrary.items()
        ),
        "These answers count as 0 in the tests.",
        *[
            f"The other way is also what {found.friction_source} predicts of {listed(foreseen)}: "
            "look at the expected answer in the study file."
        ]
        * bool(foreseen),
        *[
            f"Look at the expected answer of {listed(others)} in the study file, at the wiring and "
            "at the drive."
        ]
        * bool(others),
    ]


def _of(count: int) -> str:
    return f"{count:,}" if count else "none"


def _p(found: Findings, question: str, p: float) -> str:
    """Return p and, of several questions, that by one correction over all."""
    questions = found.questions
    corrected = questions.p_holm.get(question)
    if corrected is None or len(questions.p_holm) < 2:
        return p_equals(p)
    how = "registered, tested alone" if question == questions.primary else ""
    return f"{p_equals(p)} ({how or f'{p_equals(corrected)} corrected'})"


def _noticed(found: Findings) -> str:
    """Tell how often changes were reported, and of which conditions more than on catch trials."""
    *conditions, whole = found.trials.noticed
    all_together = whole.found
    if isinstance(all_together, NotEstimable):
        return f"Not known: {all_together.reason}."
    rates = (all_together.hits, all_together.false_alarms)
    hits, alarms = (f"{rate.share:.0%} of {rate.trials:,}" for rate in rates)
    at_all = found.questions.holds(CHANGES_NOTICED)
    more = [each.of["condition"] for each in conditions if each.noticed and at_all]
    others = [each.of["condition"] for each in conditions if not each.noticed]
    told = (
        f"Noticed more often than catch trials: {listed(more)} (one-sided exact tests within "
        "people, Holm's correction)"
        if more
        else "No condition was noticed significantly more often than catch trials (one-sided exact "
        "tests within people, Holm's correction), which does not show that none is"
        if at_all
        else "No single condition is told, because changes as a whole were not found to be noticed "
        "more often than catch trials; the section Detection has the test of each"
    )
    rest = f"; this is not shown of {listed(others)}" if more and others else ""
    alarmed = found.loaded.alarmed
    beside = f" (with {count_of(alarmed, 'participant')} left out elsewhere for false alarms)"
    return (
        f"A change was reported on {hits} trials with a change and on {alarms} catch trials"
        f"{beside * bool(alarmed)}, one-sided "
        f"{_p(found, CHANGES_NOTICED, all_together.p)}; d′ = {number(all_together.d_prime, 2)}"
        f"{_ci(all_together.d_prime_interval)}. {told}{rest}."
    )


def _who(found: Findings) -> str:
    given = found.trials.response_tests.table.given
    people, conditions = (int(given.any(axis=axis).sum()) for axis in (1, 0))
    if not people:
        return f"Nobody gave a {found.measure}."
    of = count_of(conditions, "condition")
    ways = found.trials.directions.values()
    if not ways:
        rated = f"{count_of(people, 'participant')} rated {of} from {found.scale}"
        if not found.rating.known:
            rated = f"{count_of(people, 'participant')} gave {of} scores, {found.scale}"
        rated += f"{_left_out(found)}."
        if (catch := found.table.table4).catch is not None:
            rated += f" Without a drive (catch trials) they gave {number(catch.catch_mean, 2)}."
        return sentence(rated)
    expected, answers = (sum(getattr(each, name) for each in ways) for name in _COUNTED)
    return sentence(
        f"{count_of(people, 'participant')} gave {answers:,} answers on {of}, {expected:,} of them "
        f"as expected{_left_out(found)}. Each answer counts as a response from "
        f"{found.response_scale}: 0 if the change was not answered as expected, else its score, "
        "counted from 1."
    )


_COUNTED = ("expected", "answers")


def _left_out(found: Findings) -> str:
    """Return who is not among them, and by whose decision."""
    people = {it.participant: it.by for it in found.loaded.left_out if it.trial is None}
    by_rule = [who for who, by in people.items() if by == "rule"]
    if not by_rule:
        return ""
    return f"; {count_of(len(by_rule), 'other')} left out by the study's rules ({_some(by_rule)})"


def _some(people: Sequence[str]) -> str:
    return f"{listed(people[:MOST_PAIRS])}{', …' * (len(people) > MOST_PAIRS)}"


def _omnibus(found: Findings, main: ConditionTests) -> str:
    test = main.omnibus
    if isinstance(test, NotEstimable):
        return f"No test of all conditions could be computed: {test.reason}."
    questions = found.questions
    differed = (
        f"{sentence(found.measure)}s differed between conditions"
        if questions.holds(OMNIBUS)
        else "No difference between conditions was found, which does not show that they are equal"
    )
    if questions.holds(OMNIBUS) and questions.p_holm[OMNIBUS] >= LEVEL:
        grounds = listed(_claim(found, name) for name in questions.grounds)
        differed += f", as follows from this: {grounds}. Of all conditions at once it is not shown"
    told = _p(found, OMNIBUS, test.best_p)
    if isinstance(test, SkillingsMack):
        t = f"Skillings–Mack T({test.df}) = {number(test.statistic, 2)}, {told}"
        return f"{differed}, {t} (some cells are empty)."
    w = f"Kendall's W = {bounded(test.kendall_w)}{_ci(test.kendall_w_interval, bounded=True)}"
    return f"{differed}, Friedman's χ²({test.df}) = {number(test.chi2, 2)}, {told}, {w}."


NO_FINDING = "because the conditions were not found to differ"


def _pairs(found: Findings, pairs: Sequence[PairwiseTest]) -> str:
    """Tell the largest significant differences, or the largest one if none is."""
    if isinstance(found.trials.response_tests.omnibus, NotEstimable):
        return "No pair is told, because all conditions could not be tested together."
    if not found.questions.holds(OMNIBUS):
        return f"No pair is told, {NO_FINDING}."
    # The largest first, because only some are told.
    differ = sorted((pair for pair in pairs if pair.differs), key=_size, reverse=True)
    told = "; ".join(_pair(found, pair) for pair in differ[:MOST_PAIRS])
    if not differ:
        largest = max((pair for pair in pairs if isinstance(pair.test, SignedRank)), key=_size)
        told = f"The largest difference: {_pair(found, largest)}"
        return (
            "No two conditions differed significantly (Wilcoxon's signed-rank tests, Holm's "
            f"correction{_least_p(pairs)}). "
            f"{told if _size(largest) else 'No pair of means differs'}."
        )
    more = len(differ) - MOST_PAIRS
    others = f" {sentence(count_of(more, 'other pair'))} differed, too." if more > 0 else ""
    return f"By Wilcoxon's signed-rank tests with Holm's correction, {told}.{others}"


def _least_p(pairs: Sequence[PairwiseTest]) -> str:
    """Return that so few people cannot show a difference, where that is so."""
    least = least_holm_p(pairs)
    return f", whose p is at least {least:.2g} of so few people" * (least >= LEVEL)


def _size(pair: PairwiseTest) -> float:
    return abs(pair.test.mean_difference) if isinstance(pair.test, SignedRank) else -1.0


def _pair(found: Findings, pair: PairwiseTest) -> str:
    test = pair.test
    assert isinstance(test, SignedRank)
    names, means = found.loaded.table.conditions, found.trials.response_tests.means
    mean = dict(zip(names, means, strict=True))
    higher, lower, by = _higher_first(pair, test.mean_difference, test.mean_difference_interval)
    r = test.rank_biserial if higher == pair.a else -test.rank_biserial
    return (
        f"{higher} (M = {number(mean[higher], 2)}) was above {lower} "
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


def of_groups(found: Findings, made: GroupStatistics) -> str:
    """Tell in which of the questions about groups they differ, and by how much.

    Means are adjusted where somebody has no answer to a condition: see `groups.mean_scores`.
    """
    adjusted = not found.trials.response_tests.table.is_complete
    means = found.in_measure("Mean responses")
    means += ", adjusted for conditions without an answer," * adjusted
    apart = sorted(made.in_conditions, key=lambda entry: -abs(entry[1].shift))
    most = "; ".join(f"{name}, {_higher(pair)}" for name, pair in apart[:MOST_PAIRS])
    return " ".join(
        (
            _compared(made, SCORE, means, made.score),
            _profiles(made, made.interaction),
            *([_compared(made, GAIN, _SLOPES, made.gain)] if found.is_predicted else []),
            *([f"Conditions in which groups differed most: {most}."] if most else []),
        )
    )


_SLOPES = "Slopes on predicted contrasts"


def _compared(made: GroupStatistics, name: str, what: str, found: Compared | NotEstimable) -> str:
    if isinstance(found, NotEstimable):
        return f"{what} could not be compared between groups: {found.reason}."
    first, *others = sorted(found.pairs, key=lambda pair: pair.p_holm)
    h = f"Kruskal–Wallis H = {number(found.statistic, 2)}, " if others else ""
    differed = "differed" if made.holds(name) else "were not found to differ"
    return (
        f"{what} {differed} between groups ({h}{p_equals(found.p)}, "
        f"{p_equals(made.p_holm[name])} corrected); {'most clearly ' * bool(others)}"
        f"{_higher(first)}, Mann–Whitney U = {number(first.u, 1)}, {p_equals(first.p_holm)}"
        f"{' over the pairs' * bool(others)}."
    )


def _profiles(made: GroupStatistics, found: GroupInteraction | NotEstimable) -> str:
    if isinstance(found, NotEstimable):
        return f"Group × condition could not be tested: {found.reason}."
    differed = "differed" if made.holds(INTERACTION) else "were not found to differ"
    return (
        f"Effects of conditions {differed} between groups (group × condition, "
        f"{p_equals(found.p)}, {p_equals(made.p_holm[INTERACTION])} corrected; groups explain "
        f"{bounded(found.share)} of the "
        "variation of profiles)."
    )


def _higher(pair: TwoGroups) -> str:
    """Tell how far apart two groups are, with the higher one first."""
    return "{} above {} by typically {}".format(
        *_higher_first(pair, pair.shift, pair.shift_interval)
    )


def _factors(tests: Factorial) -> str:
    """Tell the effects that were found with their sizes, and which levels are the extreme ones."""
    known = [it for it in tests.effects if isinstance(it.effect, Effect)]
    if not known:
        why = (it.effect.reason for it in tests.effects if isinstance(it.effect, NotEstimable))
        return f"No effect of a factor could be tested: {'; '.join(dict.fromkeys(why))}."
    told = [_effect(tests, it) for it in known if it.found]
    rest = [it.name for it in known if not it.found]
    tested = [it for it in known if not isinstance(it.p_holm, NotEstimable)]
    least = min(tested, key=lambda it: float(it.p_holm))  # type: ignore[arg-type]
    smallest = "" if told else f" (smallest p: {least.name}, {p_equals(least.p_holm)} corrected)"
    none = (
        f"No effect was found of {listed(rest)}{smallest}, which does not show that there is none."
    )
    people = count_of(min(it.effect.people for it in known), "participant")  # type: ignore[union-attr]
    how = (
        f"Permutation and F tests within {people}, main effects on ranks, the larger p corrected "
        "over all questions."
    )
    return " ".join([*(f"{sentence(each)}." for each in told), *[none] * bool(rest), how])


def _effect(tests: Factorial, it: TestedEffect) -> str:
    effect = it.effect
    assert isinstance(effect, Effect)
    f = (
        "everybody alike"
        if isinstance(effect.f, NotEstimable)
        else f"F({effect.df[0]}, {effect.df[1]}) = {number(effect.f, 2)}"
    )
    said = (
        f"{f}, {p_equals(it.p_holm)}, partial η² = {bounded(effect.partial_eta2)}"
        f"{_ci(effect.partial_eta2_interval, bounded=True)}"
    )
    if len(it.factors) > 1:
        return f"the effect of {it.factors[0]} depended on {it.factors[1]}, {said}"
    levels = [each for each in tests.levels if each.factor == it.name]
    high, low = (pick(levels, key=lambda each: each.mean) for pick in (max, min))
    return f"{it.name} mattered, from {_level(low)} to {_level(high)}, {said}"


def _level(each: LevelMean) -> str:
    """Tell the mean response at a level, with the two things that it is made of."""
    made_of = (
        ""
        if np.isnan(each.expected)
        else f"; {each.expected:.0%} as expected, these scored {number(each.score, 2)}"
    )
    return f"M = {number(each.mean, 2)} ({each.level}{made_of})"


def together(found: Findings) -> str:
    """Tell the questions that hold by one correction over all, because many err more often."""
    questions = found.questions
    lock = found.loaded.lock
    # One of version 1 may have no test any more; its section says what is tested.
    is_tested = lock is not None and not lock.registration.earlier
    alone = " The registered primary hypothesis is tested alone." * is_tested
    held = [
        f"{_claim(found, name)} ({p_equals(p)})"
        for name, p in questions.p_holm.items()
        if p < LEVEL
    ]
    count = count_of(len(questions.p_holm), "question")
    # The registered one has no part in what the correction promises.
    has_primary = questions.primary in questions.p_holm
    if not held:
        over = "the others" if has_primary else "all of them"
        return (
            f"None of {count} holds, which does not show that nothing has an effect "
            f"(Holm's correction over {over}).{alone}"
        )
    over, any_of = ("the others", "any of these") if has_primary else ("all", "anything")
    return (
        f"{sentence('; '.join(held))}. This is what holds of {count}, corrected together (Holm's "
        f"method, over {over}): where nothing has an effect, at most 5% of studies claim {any_of}. "
        "Pairs, single conditions and pairs of groups count only where their question "
        f"holds.{alone}"
    )


def _claim(found: Findings, question: str) -> str:
    """Return what is claimed where a question holds; the test of the prediction has two sides."""
    slope = found.trials.slope
    if question == FOLLOWS and isinstance(slope, Slope):
        if found.study.absolute:
            return f"scores are {_way(found, slope)}"
        if slope.value < 0:
            return "responses go against the prediction"
    return found.in_measure(question.replace("ratings", "responses"))


def _way(found: Findings, slope: Slope) -> str:
    """Return which way scores follow contrasts of which nothing is expected."""
    where = "friction is predicted to be higher" if found.at_once else "the contrast is larger"
    return f"{'higher' if slope.value > 0 else 'lower'} where {where}"


def _slope(found: Findings) -> str:
    """Tell whether responses follow the predicted contrasts, by one test."""
    slope = found.trials.slope
    if isinstance(slope, NotEstimable):
        return f"Not tested: {slope.reason}."
    shown = (
        "these data do not show that they follow it"
        if not found.questions.holds(FOLLOWS)
        else f"they are {_way(found, slope)}"
        if found.study.absolute
        else "they follow it"
        if slope.value > 0
        else "they fall where a larger change is predicted"
    )
    few = ""
    least, conditions = p_equals(slope.least_p), count_of(slope.conditions, "condition")
    if slope.least_p >= LEVEL:
        few = f" ({conditions} with such contrasts cannot show it, at best {least})"
    elif not found.questions.holds(FOLLOWS) and slope.least_p * len(found.questions.p_holm) > 0.01:
        few = f" ({conditions} have at best {least}, before any correction)"
    law = f"; law {LAW}" * (len(found.shown_laws) > 1)
    is_of = "change of log friction"
    if found.at_once:
        is_of = f"log friction of the last touch, relative to {found.rest}"
    # Its own p is below .05, so that the interval is without 0, and the corrected one is not.
    alone = slope.p < LEVEL and not found.questions.holds(FOLLOWS)
    return (
        f"Per unit of predicted contrast ({is_of}{law}), mean {found.measure}s "
        f"change by {number(slope.value, 2)} points ({number(slope.value / 10, 2)} per .10, which "
        f"is a change of about 10%){_ci(slope.interval)}, "
        f"{_p(found, FOLLOWS, slope.p)} against contrasts in any other order{few}: {shown}"
        f"{' once corrected with the others; the interval is of this question alone' * alone}."
        f"{_in_order(found)}{_within(found)}"
    )


def _within(found: Findings) -> str:
    """Return what the levels of the conditions say of it, where it is clear."""
    slope = found.trials.level_slope
    if not isinstance(slope, LevelSlope) or slope.p >= LEVEL:
        return ""
    return (
        f" Within conditions, over their levels alone, {found.measure}s change by "
        f"{number(slope.value, 2)} points per unit{_ci(slope.interval)}, {p_equals(slope.p)} (not "
        "among the corrected questions)."
    )


def _gain(gain: Estimate) -> str:
    low, high = gain.interval
    shown = (
        "which includes 0, so these data do not show that ratings follow it."
        if low <= 0 <= high
        else "so ratings follow it."
        if low > 0
        else "so ratings fall where a larger change was measured."
    )
    return (
        "Per unit of measured contrast (change of log friction at the finger), ratings change by "
        f"{number(gain.value, 2)} points in the group{_ci(gain.interval)}, {shown}"
    )


def _differ(found: Findings, rating: Rated) -> str:
    """Return whether gains differ between subjects, and who differs."""
    apart = [
        person.subject
        for person in rating.subjects
        if isinstance(of := person.relative_gain, Estimate)
        and (of.interval[0] > 0 or of.interval[1] < 0)
    ] * rating.gains_differ
    who = (
        f"{count_of(len(apart), 'participant')} differed from the mean gain of the group "
        f"({_some(apart)})."
        if apart
        else "no participant's gain can be told from the group's mean gain."
    )
    equal = f"equal gains have {chance(rating.equal_gains)} (.50 before the study)"
    below = f"below {number(rating.gain_sd_upper, 2)} with {chance(0.95)}"
    differ = (
        f"Gains differed between participants: {equal}, their SD is {below}"
        if rating.gains_differ
        else f"These data do not show that gains differ between participants: {equal}, and if "
        f"gains differ, their SD is {below}"
    )
    skin = "Friction was measured, so this is not a matter of skin."
    return f"{differ}; {who} {skin if found.predictor[1] else _SKIN}"


def untold(found: Findings, rating: Rated) -> str:
    """Return why the gains of people are not told, in a sentence."""
    assert rating.untold is not None
    told, people = sum(person.told for person in rating.subjects), len(rating.subjects)
    who = f"most people are ({people - told} of {people})" if told else "each person is"
    what = "touch of medium friction" if found.at_once else "change of medium size"
    return (
        f"How sensitive {who} cannot be told from these data: {rating.untold.reason}. "
        f"What they do tell of each is a level, the rating of a {what}."
    )


BEYOND = "A level beyond the scale stands for ratings at its end."


def _levels(found: Findings, rating: Rated) -> str:
    """Return how far apart the levels of people are."""
    levels = sorted(rating.subjects, key=lambda person: person.level.value)
    low, high = levels[0], levels[-1]
    wide = np.mean([np.ptp(person.level.interval) for person in levels])
    least, most = found.rating.minimum, found.rating.maximum
    inside = not found.rating.known or (least <= low.level.value and high.level.value <= most)
    beyond = "" if inside else f" {BEYOND}"
    return (
        f"Levels are from {number(low.level.value, 1)} ({low.subject}) to "
        f"{number(high.level.value, 1)} ({high.subject}), each known to within "
        f"±{number(float(wide) / 2, 1)} points on average.{beyond}"
    )


def _in_order(found: Findings) -> str:
    """Return how the order of the conditions agrees with the law's, of which nothing is claimed."""
    order = found.trials.orders[LAW]
    if isinstance(order, NotEstimable):
        return ""
    rho, p = order.spearman, order.p
    if isinstance(rho, NotEstimable) or isinstance(p, NotEstimable):
        return ""
    return (
        f" In order alone: Spearman's {unbroken(f'ρ = {bounded(rho)}')}, {p_equals(p)} (not "
        "corrected; nothing is claimed of it)."
    )


def _ci(ends: Interval | NotEstimable, *, bounded: bool = False) -> str:
    """Return an interval as APA writes it, or nothing without one."""
    if isinstance(ends, NotEstimable) or np.isnan(ends).any():
        return ""
    return f", 95% CI {interval(ends, bounded=bounded)}"
