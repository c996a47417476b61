"""The hypotheses that a registration can name: each with its test in words and how results decide.

A further one is a `Hypothesis` here and nothing else: `touchbeam register` knows its name and its
test, and the report its verdict. What touchbeam 1 registered is judged by its tests, of scores, as
far as they are still there.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, permutations
from math import exp, log

import numpy as np

from analysis.estimates import LEVEL, NotEstimable
from analysis.report import results as page
from analysis.report.blocks import at
from analysis.report.findings import Findings
from analysis.report.wording import chance, interval, number, p_equals
from analysis.statistics.groups import Compared, compared, mean_scores
from analysis.statistics.signed_rank import signed_rank
from analysis.statistics.slope import FEWEST_CONDITIONS
from analysis.statistics.summary import ConditionTests
from analysis.trials.law_comparison import LawOrder
from device.friction.changes import LAW
from protocol.errors import BadInput
from protocol.registration import registration as hypothesis
from protocol.study.study import Study

Judged = tuple[str, float | None, bool | None] | NotEstimable
"""What was found, p, and whether it supports the hypothesis; None where nothing decides."""
_Orders = Mapping[str, LawOrder | NotEstimable]


@dataclass(frozen=True)
class Hypothesis:
    """A hypothesis that a registration can name.

    `judge` decides by what a report found. `question` is that of the page whose answer is on it, ''
    if there is none; `as_on_page` is whether that answer rests on the same test. One that is not
    `asked` belongs to no such study, but a study file may change after it was registered. Nothing
    is claimed of one that is only `estimated`, and one that is not `tested` has no test any more.
    """

    name: str
    test: str
    judge: Callable[[Findings], Judged]
    question: str = page.WHICH
    asked: bool = True
    estimated: bool = False
    as_on_page: bool = True
    tested: bool = True


def how_tested(study: Study, named: Iterable[str] = (), earlier: str = "") -> dict[str, str]:
    """Return the test of each hypothesis of a study, by its name; those of conditions first.

    `named` are some that may have a number of their own, such as the limit of a Weber fraction;
    `earlier` is that of the registration (`Registration.earlier`).
    """
    return {each.name: each.test for each in _all(study, named, earlier) if each.asked}


def require_asked(study: Study, names: Iterable[str]) -> None:
    """Refuse the name of a hypothesis that other studies have, with what this one lacks for it."""
    unasked = {each.name for each in _all(study, (), "") if not each.asked}
    for name in names:
        if name in unasked and (why := _lacking(study, name)):
            raise BadInput(f"no hypothesis {name!r} of this study: {why}")


def _lacking(study: Study, name: str) -> str:
    if not study.condition:
        return "it has no conditions"
    if name.endswith(hypothesis.NOTICED):
        return "nobody is asked about a change" if study.absolute else "it has no catch trials"
    if not _is_predicted(study):
        return "nothing is predicted, for its touches state no friction"
    return f"it has no more than {FEWEST_CONDITIONS} conditions" * (name == hypothesis.FOLLOWS)


def registered(study: Study, names: Sequence[str], earlier: str = "") -> list[Hypothesis]:
    """Return the hypotheses of these names; also one of which the study no longer has the parts."""
    known = {each.name: each for each in _all(study, names, earlier)}
    return [known.get(name) or _gone(name) for name in names]


def _gone(name: str) -> Hypothesis:
    why, question = _NOT_COMPARED, page.WHICH
    if name.endswith(hypothesis.NOTICED):
        why, question = _NO_SUCH_TRIALS, page.NOTICE
    return Hypothesis(name, "", lambda _: NotEstimable(why), question)


def _all(study: Study, named: Iterable[str], earlier: str) -> Iterator[Hypothesis]:
    own = _of_scores(study, earlier) if earlier else _of_responses(study)
    return chain(own, _of_conditions(study), _of_tracks(study, named))


def _is_predicted(study: Study) -> bool:
    """Return whether friction of any touch is known beforehand."""
    touches = (touch for item in study.condition for touch in item.touches)
    return study.surface.kind != "given" or any(touch.friction is not None for touch in touches)


def _effects(study: Study) -> Iterator[tuple[str, ...]]:
    """Yield the factors of each effect; sessions are a factor, too."""
    factors = (*study.factors, *["session"] * (study.design.sessions > 1))
    yield from (*zip(factors), *permutations(factors, 2))


def _of_responses(study: Study) -> Iterator[Hypothesis]:
    named = partial(Hypothesis, asked=bool(study.condition))
    # Without questions nothing is expected, so that scores may follow friction either way.
    what, either_way = "scores" if study.absolute else "responses", study.absolute
    yield named(
        hypothesis.OMNIBUS,
        f"Friedman's test of mean {what}, or the Skillings–Mack test where some are missing; "
        "p < .05",
        lambda found: _tested(found.trials.response_tests.omnibus_p),
        page.DIFFER,
    )
    for pair in permutations(study.conditions, 2):
        judge = partial(_pair, *pair, lambda found: found.trials.response_tests)
        yield named(hypothesis.above(*pair), _ABOVE.format(of=f" of mean {what}"), judge)
    predicted = partial(Hypothesis, asked=bool(study.condition) and _is_predicted(study))
    # With fewer conditions no p of the slope is below .05.
    can_follow = len(study.conditions) > FEWEST_CONDITIONS and _is_predicted(study)
    yield Hypothesis(
        hypothesis.FOLLOWS,
        f"slope of mean {what} on predicted contrasts, with the contrasts permuted over the "
        f"conditions; p < .05{', either way' if either_way else ' and a slope above 0'}",
        partial(_slope, either_way=either_way),
        page.FOLLOW,
        asked=can_follow,
    )
    judge_order = partial(_order, lambda found: found.trials.orders, either_way=either_way)
    ranked = _RANKED.format(of=what, sign="" if either_way else _RISING)
    yield predicted(hypothesis.ORDER, ranked, judge_order, page.FOLLOW)
    yield predicted(hypothesis.GAINS, _EQUAL, _gains, page.SENSITIVE)
    for pair in permutations(study.groups, 2):
        judge = partial(_groups, *pair, _group_responses)
        test = _BETWEEN.format(of=what)
        yield named(hypothesis.between(*pair), test, judge, page.GROUPS)
    for of in _effects(study):
        test = (_MAIN_EFFECT if len(of) == 1 else _INTERACTION).format(of=what)
        yield named(hypothesis.effect_of(*of), test, partial(_effect, of), page.FACTORS)


def _of_scores(study: Study, version: str) -> Iterator[Hypothesis]:
    """Yield what touchbeam 1 registered, with its tests; `version` is the one that registered."""
    named = partial(Hypothesis, asked=bool(study.condition), as_on_page=False)
    yield named(
        hypothesis.OMNIBUS,
        "Friedman's test, or the Skillings–Mack test where scores are missing; p < .05",
        lambda found: _tested(found.table.score_tests.omnibus_p),
        page.DIFFER,
    )
    for pair in permutations(study.conditions, 2):
        judge = partial(_pair, *pair, lambda found: found.table.score_tests)
        yield named(hypothesis.above(*pair), _ABOVE.format(of=""), judge)
    judge_order = partial(_order, lambda found: found.trials.orders_of_scores())
    yield named(
        hypothesis.ORDER, _RANKED.format(of="ratings", sign=_RISING), judge_order, page.FOLLOW
    )
    for pair in permutations(study.groups, 2):
        judge = partial(_groups, *pair, _group_scores)
        test = _BETWEEN.format(of="scores")
        yield named(hypothesis.between(*pair), test, judge, page.GROUPS)
    kinds = ("main effect", "interaction")
    gain = "gain of the ordinal mixed model M2; its 95 % interval lies above 0"
    untested = [
        (hypothesis.FOLLOWS, gain, page.FOLLOW),
        (hypothesis.GAINS, _MANDEL, page.SENSITIVE),
        *(
            (hypothesis.effect_of(*of), f"{kinds[len(of) - 1]} {_BY_FACTOR}", page.FACTORS)
            for of in _effects(study)
        ),
    ]
    for name, test, question in untested:
        why = (
            f"registered with touchbeam {version}, whose test of {name} this version does not have"
        )
        yield named(name, test, partial(_without_test, why), question, tested=False)


def _of_conditions(study: Study) -> Iterator[Hypothesis]:
    """Yield what touchbeam 1 tested as today, of studies with catch trials."""
    is_asked = bool(study.condition) and not study.absolute
    caught = partial(Hypothesis, asked=is_asked and bool(study.design.catch_trials))
    for each in ("", *study.conditions):
        corrected = ", corrected by Holm's method over all conditions" * bool(each)
        test = f"{_EXACT}{corrected}; p < .05"
        yield caught(
            f"{each} {hypothesis.NOTICED}".strip(), test, partial(_noticed, each), page.NOTICE
        )


def _of_tracks(study: Study, names: Iterable[str]) -> Iterator[Hypothesis]:
    named = partial(Hypothesis, question=page.THRESHOLDS)
    for a, b in permutations(study.track, 2):
        # On one axis: volts are not compared with metres.
        if a.axis == b.axis:
            yield named(
                hypothesis.threshold_of(a.name, b.name),
                "Wilcoxon's signed-rank test of the participants' log thresholds, two-sided; "
                "p < .05 and a geometric mean of the ratios above 1",
                partial(_higher, a.name, b.name),
            )
    estimated = "no test: the geometric mean of the participants' thresholds and its 95% interval"
    for each in study.track:
        judge = partial(_threshold, each.name)
        yield named(hypothesis.threshold_of(each.name), estimated, judge, estimated=True)
    # Of a place no contrast is predicted, nor of a comparison with nothing.
    felt = {track.name for track in study.track if track.standard and track.axis != "place"}
    for name in names:
        if of := hypothesis.weber_below(name):
            yield named(name, _WEBER, partial(_weber, *of), asked=of[0] in felt)


_ABOVE = (
    "Wilcoxon's signed-rank test{of}, two-sided, corrected by Holm's method over all pairs of "
    "conditions; p < .05 and a mean difference above 0"
)
_RANKED = (
    "Spearman's correlation of predicted contrasts and mean {of} of the conditions; p < .05{sign}"
)
_RISING = " and a correlation above 0"
_BETWEEN = (
    "Wilcoxon-Mann-Whitney test of the participants' mean {of}, two-sided, corrected by Holm's "
    "method over all pairs of groups; p < .05 and a Hodges-Lehmann shift above 0"
)
_EXACT = "exact test within people of reported changes against those on catch trials, one-sided"
_LARGER = (
    "permutation of levels, and F with Greenhouse and Geisser's correction; the larger p < .05"
)
_MAIN_EFFECT = f"main effect within participants on ranks of mean {{of}}: {_LARGER}"
_INTERACTION = f"interaction within participants on mean {{of}}: {_LARGER}"
_BY_FACTOR = f"within participants on mean scores: {_LARGER}"
_EQUAL = (
    "probability that all participants have the same gain, in the model of the answers and .50 "
    "before the study; below .05"
)
_MANDEL = "F test of the participants' slopes on the conditions' effects (Mandel); p < .05"
_WEBER = (
    "the 95% t interval of the geometric mean of the participants' Weber fractions, measured where "
    "friction was recorded of all of them, else predicted, lies below the limit"
)
_NO_GROUP = "no group has a response"
_NOT_COMPARED = "these conditions have no responses to compare"
_NO_SUCH_TRIALS = "there are no such trials to compare with catch trials"


# How results decide.


def _tested(p: float | NotEstimable) -> Judged:
    return p if isinstance(p, NotEstimable) else (p_equals(p), p, p < LEVEL)


def _pair(
    higher: str, lower: str, tests: Callable[[Findings], ConditionTests], found: Findings
) -> Judged:
    for pair in tests(found).pairwise:
        # Tests know a pair in one order, a hypothesis may name it in the other.
        if {pair.a, pair.b} == {higher, lower}:
            if isinstance(pair.test, NotEstimable):
                return pair.test
            by, p = pair.test.mean_difference * (1 if pair.a == higher else -1), pair.p_holm
            if isinstance(p, NotEstimable):
                return p
            told = f"mean difference {number(by, 2)}, {p_equals(p)} (Holm)"
            return told, p, by > 0 and p < LEVEL
    return NotEstimable(_NOT_COMPARED)


def _slope(found: Findings, *, either_way: bool) -> Judged:
    fit = found.trials.slope
    if isinstance(fit, NotEstimable):
        return fit
    ends = fit.interval
    told = "" if isinstance(ends, NotEstimable) else f", 95% CI {interval(ends)}"
    told = f"slope {number(fit.value, 2)}{told}, {p_equals(fit.p)}"
    # Two-sided p, so that responses against the prediction must not count for it.
    return told, fit.p, (either_way or fit.value > 0) and fit.p < LEVEL


def _without_test(why: str, _: Findings) -> Judged:
    return NotEstimable(why)


def _gains(found: Findings) -> Judged:
    rating = found.sensitivity.rating
    if isinstance(rating, NotEstimable):
        return rating
    if isinstance(rating.gain, NotEstimable):
        return rating.gain
    # A posterior probability decides, so that there is no p.
    equal = f"equal gains have {chance(rating.equal_gains)}, before the study .50"
    return equal, None, rating.gains_differ


def _order(
    orders: Callable[[Findings], _Orders], found: Findings, *, either_way: bool = False
) -> Judged:
    lock = found.loaded.lock
    order = orders(found).get(lock.registration.law if lock else LAW)
    if order is None or isinstance(order, NotEstimable):
        return NotEstimable("too few conditions with a prediction")
    rho, p = order.spearman, order.p
    if isinstance(rho, NotEstimable):
        return rho
    if isinstance(p, NotEstimable):
        return p
    # Two-sided p, so that an order against the law must not count for it.
    return f"ρ = {number(rho, 2)}, {p_equals(p)}", p, (either_way or rho > 0) and p < LEVEL


def _group_responses(found: Findings) -> Compared | NotEstimable:
    return NotEstimable(_NO_GROUP) if found.groups is None else found.groups.score


def _group_scores(found: Findings) -> Compared | NotEstimable:
    """Return the comparison of mean scores, as touchbeam 1 made it."""
    table, known = found.loaded.table, found.loaded.groups
    rows = [row for row, who in enumerate(table.subjects) if who in known]
    if not rows:
        return NotEstimable(_NO_GROUP)
    names = tuple(dict.fromkeys((*found.study.groups, *known.values())))
    groups = np.array([names.index(known[table.subjects[row]]) for row in rows])
    return compared(mean_scores(table.scores[rows]), groups, names)


def _groups(
    higher: str,
    lower: str,
    comparison: Callable[[Findings], Compared | NotEstimable],
    found: Findings,
) -> Judged:
    groups = comparison(found)
    if isinstance(groups, NotEstimable):
        return groups
    for pair in groups.pairs:
        if {pair.a, pair.b} == {higher, lower}:
            shift = pair.shift * (1 if pair.a == higher else -1)
            told = f"shift {number(shift, 2)}, {p_equals(pair.p_holm)} (Holm)"
            return told, pair.p_holm, shift > 0 and pair.differs
    return NotEstimable("these groups have no responses to compare")


def _noticed(condition: str, found: Findings) -> Judged:
    """Return the test of a condition, or of all together if it has no name."""
    for each in found.trials.noticed:
        if each.of.get("condition", "") == condition:
            if isinstance(each.found, NotEstimable):
                return each.found
            # That of all conditions needs no correction.
            p = each.found.p if each.p_holm is None else each.p_holm
            told = f"d′ = {number(each.found.d_prime, 2)}, {p_equals(p)}"
            return f"{told}{' (Holm)' * bool(condition)}", p, p < LEVEL
    return NotEstimable(_NO_SUCH_TRIALS)


def _effect(factors: Sequence[str], found: Findings) -> Judged:
    tests = found.trials.factorial
    for it in tests.effects if tests else ():
        if {*it.factors} == {*factors}:
            return _tested(at(it.effect, "p"))
    return NotEstimable(_NOT_COMPARED)


def _threshold(track: str, found: Findings) -> Judged:
    for each in found.thresholds.cohort if found.thresholds else ():
        if each.track == track:
            if isinstance(each.threshold, NotEstimable):
                return each.threshold
            told = f"{number(each.threshold, 3)} {each.unit}".strip()
            if not isinstance(each.threshold_interval, NotEstimable):
                told += f", 95% CI {interval(each.threshold_interval, 3)}"
            return told, None, None
    return NotEstimable("nobody has a threshold")


def _higher(higher: str, lower: str, found: Findings) -> Judged:
    logs: dict[str, dict[str, float]] = {higher: {}, lower: {}}
    for each in found.thresholds.people if found.thresholds else ():
        # Of a threshold beyond the levels the last one counts: to leave it out selects people.
        value = each.threshold if each.limit is None else each.limit
        if each.track in logs and value > 0:
            logs[each.track][each.participant] = log(value)
    both = [who for who in logs[higher] if who in logs[lower]]
    differences = np.array([logs[higher][who] - logs[lower][who] for who in both])
    test = signed_rank(differences)
    if isinstance(test, NotEstimable):
        return test
    ratio = exp(differences.mean())
    return f"ratio {number(ratio, 2)}, {p_equals(test.p)}", test.p, ratio > 1 and test.p < LEVEL


def _weber(track: str, limit: float, found: Findings) -> Judged:
    cohort = found.thresholds.cohort if found.thresholds else ()
    each = next((each for each in cohort if each.track == track), None)
    if each is None or isinstance(each.weber, NotEstimable):
        return NotEstimable("nobody's Weber fraction is known")
    ends = each.weber_interval
    if isinstance(ends, NotEstimable):
        return ends
    told = f"{number(each.weber, 3)} ({each.weber_of} friction), 95% CI {interval(ends, 3)}"
    # An interval decides, so that there is no p.
    return told, None, ends[1] < limit
