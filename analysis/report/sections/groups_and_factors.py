"""Comparisons that a design makes: between groups of people, and by factors and sessions."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import fields
from functools import partial
from types import SimpleNamespace

import numpy as np

from analysis.estimates import FloatArray, Json, NotEstimable, or_null, plain
from analysis.report import figure_data
from analysis.report.blocks import Column, Figure, Section, Table, columns, estimate, p_cell
from analysis.report.estimates_json import unknown, with_reasons
from analysis.report.findings import Findings
from analysis.report.results import of_groups
from analysis.report.wording import MISSING, interval, number, of_all, p_value
from analysis.statistics.factorial import (
    SESSION,
    Effect,
    LevelMean,
    TestedEffect,
    cell_intervals,
)
from analysis.statistics.groups import GAIN, Compared, GroupStatistics
from analysis.statistics.intervals import mean_interval
from protocol.errors import listed

# Groups of participants.

_WITH_GAINS = (
    "Groups are compared by one number of each participant: the mean response, the response to a "
    "condition, or the gain, which is the least-squares slope of the participant's own responses "
    "on predicted contrasts. The gains of the model of ratings are not compared by rank, because "
    "each borrows from the others, which draws groups together. Responses at an end of the scale "
    "make gains smaller and profiles flatter. "
)
_WITHOUT = (
    "Groups are compared by one number of each participant: the mean response, or the response to "
    "a condition. Responses at an end of the scale make profiles flatter. "
)
_METHOD = (
    "p counts the ways in which these people could have come into groups of these sizes: all of "
    "them, or random ones where an error is given. Group × condition permutes people with their "
    "whole profiles, less their own mean, so that a group that responds more strongly throughout "
    "does not count. p of mean response{} and group × condition are corrected over all questions "
    "of this page; differences in a condition count only if mean responses or profiles differ."
)


def groups(found: Findings) -> Section:
    """Return the comparisons between groups; nothing for a study without groups."""
    made = found.groups
    if made is None:
        return Section()
    mean = {found.in_measure("mean response"): made.score}
    gain = {GAIN: made.gain} if found.is_predicted else {}
    tests = mean | gain | dict(made.conditions)
    people = _people(found)
    return Section(
        title="Do the groups differ?",
        blocks=[
            of_groups(found, made),
            found.in_measure(_method(found)),
            _without(found),
            Table(
                name="groups-people",
                caption="Participants by group: planned, with a session that is not excluded, and "
                "left after the study's rules, which are the same in each group.",
                columns=columns("group", "planned", "took part", "analysed"),
                rows=[list(map(str, each.values())) for each in people],
            ),
            _groups_figure(found, _names(made)),
            Table(
                name="groups-measures",
                caption="Medians by group, with the number of participants in brackets, and the "
                "test of all groups: Mann and Whitney's U of two, Kruskal and Wallis' H of more.",
                columns=columns("measure", *_names(made), "statistic", "p"),
                rows=[[name, *_cells(made, test)] for name, test in tests.items()],
            ),
            Table.over(
                [
                    SimpleNamespace(measure=name, pair=pair)
                    for name, test in tests.items()
                    if isinstance(test, Compared)
                    for pair in test.pairs
                ],
                [
                    Column("measure", "measure", kind="text"),
                    Column("pair", lambda row: f"{row.pair.a} − {row.pair.b}", kind="text"),
                    Column("shift", "pair.shift", 2),
                    Column("95%", "pair.shift_interval", interval),
                    Column("U", "pair.u", 1),
                    Column("superiority", "pair.superiority", 2),
                    Column("p", "pair.p", p_cell),
                    Column("p (Holm)", "pair.p_holm", p_cell),
                ],
                name="groups-pairs",
                caption="Wilcoxon–Mann–Whitney tests of each pair of groups, two-sided, with the "
                "Hodges–Lehmann shift and its interval. Superiority: the share of pairs of people "
                "in which the one of the first group has more, ties half. p (Holm) is corrected "
                "over the pairs of a measure; of the conditions over all pairs in all of them.",
            ),
        ],
        data={
            "groups": {
                "people": people,
                **plain(made),
                "differ_in": [
                    {"condition": name, "a": pair.a, "b": pair.b}
                    for name, pair in made.in_conditions
                ],
            }
        },
    )


def _method(found: Findings) -> str:
    with_gains = found.is_predicted
    return (_WITH_GAINS if with_gains else _WITHOUT) + _METHOD.format(", gain" * with_gains)


def _names(made: GroupStatistics) -> list[str]:
    """Return the groups, as the first measure that can be compared has them."""
    tests = (made.score, made.gain, *made.conditions.values())
    known = next((test.groups for test in tests if isinstance(test, Compared)), ())
    return [group.name for group in known]


def _cells(made: GroupStatistics, test: Compared | NotEstimable) -> list[str]:
    if isinstance(test, NotEstimable):
        return [*[MISSING] * len(_names(made)), test.reason, MISSING]
    error = f" ± {test.error:.1g}" if test.error else ""
    medians = [f"{number(group.median, 2)} ({group.n})" for group in test.groups]
    return [*medians, number(test.statistic, 2), p_value(test.p) + error]


def _people(found: Findings) -> list[Json]:
    """Return each group with its planned size, and how many came and are analysed."""
    came = Counter(found.loaded.groups.values())
    left = Counter(found.loaded.groups.get(who) for who in found.loaded.table.subjects)
    planned = {group.name: group.size for group in found.study.group}
    return [
        {
            "name": name,
            "planned": planned.get(name, 0),
            "took_part": came[name],
            "analysed": left[name],
        }
        for name in dict.fromkeys((*planned, *came))
    ]


def _without(found: Findings) -> str:
    without = [who for who in found.loaded.table.subjects if who not in found.loaded.groups]
    return f"Without a group, and not compared: {listed(without)}." if without else ""


def _groups_figure(found: Findings, names: Sequence[str]) -> Figure:
    """Return mean responses by condition and group; nothing where no group can be compared."""
    if not names:
        return Figure(name="groups")
    table, known = found.trials.response_tests.table, found.loaded.groups
    of = np.array([known.get(who, "") for who in table.subjects])
    shown = figure_data.thinned(len(table.conditions), figure_data.MOST_INTERVALS)
    own = [
        [column[(of == name) & ~np.isnan(column)] for name in names] for column in table.scores.T
    ]
    cells = [
        [(np.mean(it), _half(it)) if it.size else (np.nan,) * 2 for it in own[c]] for c in shown
    ]
    means, halves = np.moveaxis(np.array(cells), 2, 0)
    factors = {"condition": tuple(table.conditions[c] for c in shown), "group": tuple(names)}
    return Figure(
        name="groups",
        title=f"{found.measure.capitalize()}s by group",
        caption=f"Mean {found.measure}s of participants by condition and group, with the 95% "
        f"interval (t) of each mean.{of_all(len(shown), len(table.conditions), 'conditions')}",
        draw=partial(
            figure_data.factor_figure, factors, means, halves, found.measure, found.response_scale
        ),
    )


def _half(values: FloatArray) -> float:
    ends = mean_interval(values)
    return float("nan") if isinstance(ends, NotEstimable) else (ends[1] - ends[0]) / 2


# Factors and sessions: main effects, and interactions of two.

# Six factors of the file, its conditions, and the sessions.
FIGURES = tuple(f"factor-{number}" for number in range(1, 9))


def factors(found: Findings) -> Section:
    """Return the effects, the means by level and a figure by factor; nothing without factors."""
    tests = found.factors
    if tests is None:
        return Section()
    return Section(
        title="Factors",
        blocks=[_effects(found, tests.effects), _levels(found, tests.levels), *_figures(found)],
        data={
            "factors": {
                "effects": [_effect_json(it) for it in tests.effects],
                "levels": [with_reasons(it) for it in tests.levels],
            }
        },
    )


def _effects(found: Findings, effects: tuple[TestedEffect, ...]) -> Table:
    return Table.over(
        effects,
        [
            Column("effect", "name", kind="text"),
            Column("people", "effect.people"),
            Column("F", "effect.f", 2),
            Column("df", "effect", _df),
            Column("p, shuffled", "effect.p_permuted", p_cell),
            Column("p, F", "effect.p_f", p_cell),
            Column("p, Holm", "p_holm", p_cell),
            *estimate("partial η²", "effect.partial_eta2"),
        ],
        name="factor-effects",
        caption=f"Main effects and interactions of two factors on {found.measure}s, within people. "
        "A main effect is tested on each person's ranks over all conditions; an interaction on "
        f"means, so that it is one of the scale of {found.measure}s. p, shuffled: the levels of "
        "these factors are shuffled within each person (exact where all can be listed); p, F: the "
        "same F, with Greenhouse and Geisser's correction. The larger one decides, corrected by "
        "Holm's method over all questions of this page. Partial η² with its 95% interval: share of "
        "an effect in what other effects and people's levels leave.",
    )


def _df(effect: Effect | NotEstimable) -> str:
    if isinstance(effect, NotEstimable):
        return effect.reason
    return f"{effect.df[0]}, {effect.df[1]}"


def _levels(found: Findings, levels: Sequence[LevelMean]) -> Table:
    return Table.over(
        levels,
        [
            Column("factor", "factor", kind="text"),
            Column("level", "level", kind="text"),
            Column(f"mean {found.measure}", "mean", 2),
            *estimate("difference", "difference"),
            *([] if found.measure == "score" else _MADE_OF),
        ],
        name="factor-levels",
        caption=f"Mean {found.measure} by level, over the other factors, and its difference from "
        "the mean of all levels with its 95% interval"
        + (
            "."
            if found.measure == "score"
            else f"; beside it what the response is made of: {_PARTS}."
        ),
    )


_PARTS = "the share of changes that were answered as expected, and the mean score of these"


def _share(value: float) -> str:
    return MISSING if np.isnan(value) else f"{value:.0%}"


_MADE_OF = (Column("as expected", "expected", _share), Column("their score", "score", 2))


def _figures(found: Findings) -> Iterator[Figure]:
    """Yield a figure for each factor, with a line for each level of the next one."""
    crossed, wide = found.trials.crossed or (None, None)
    every = wide or crossed
    names = list(every.factors) if every else []
    for place, name in enumerate(names, start=1):
        beside = names[place % len(names)]
        shown = [name] if beside == name else [name, beside]
        of = every if crossed is None or SESSION in shown else crossed
        if of is None or len(of.complete) < 2:
            continue
        factors, levels = {each: of.factors[each] for each in shown}, len(of.factors[name])
        means, halves = (each.reshape(levels, -1) for each in cell_intervals(of, *shown))
        by = f" and {beside}" * (len(shown) > 1)
        yield Figure(
            name=f"factor-{place}",
            title=f"{found.measure.capitalize()}s by {name}",
            caption=f"Mean {found.measure}s by {name}{by}, over the other factors, with 95% "
            "intervals that leave out differences between people's levels (Cousineau and Morey).",
            draw=partial(
                figure_data.factor_figure,
                factors,
                means,
                halves,
                found.measure,
                found.response_scale,
            ),
        )


def _effect_json(it: TestedEffect) -> Json:
    named = {"factors": list(it.factors), "p_holm": or_null(it.p_holm)}
    if isinstance(it.effect, NotEstimable):
        return {**named, **unknown(it.effect, *(each.name for each in fields(Effect)))}
    return {**named, "p": it.effect.p, **with_reasons(it.effect)}
