"""Comparisons between groups of participants."""

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from types import SimpleNamespace

import numpy as np

from analysis.estimates import FloatArray, Json, NotEstimable, plain
from analysis.report import figure_data
from analysis.report.blocks import Column, Figure, Section, Table, columns, p_cell
from analysis.report.findings import Findings
from analysis.report.results import of_groups
from analysis.report.wording import MISSING, READ_AS, interval, number, of_all, p_equals, p_value
from analysis.statistics.groups import GAIN, SCORE, Compared, GroupStatistics
from analysis.statistics.intervals import mean_interval

_METHOD = (
    "Groups are compared by one number of each participant: the mean score, the score of a "
    "condition, or the gain, which is the least-squares slope of the participant's own scores on "
    "predicted contrasts. The gains of the models are not compared, because each borrows from the "
    "other participants, which draws groups together. Scores at an end of the scale make gains "
    "smaller and profiles flatter. p counts the ways in which these people "
    "could have come into groups of these sizes: all of them, or random ones where an error is "
    "given. Group × condition permutes people with their whole profiles, less their own mean, so "
    "that a group that scores higher throughout does not count. p of mean score, gain and "
    "group × condition are corrected over all questions of this page; differences in a condition "
    "count only if mean scores or profiles differ."
)


def section(found: Findings) -> Section:
    """Return the comparisons between groups; nothing for a study without groups."""
    made = found.groups
    if made is None:
        return Section()
    tests = {SCORE: made.score, GAIN: made.gain, **made.conditions}
    readings = {name: of.groups.p_holm for name, of in found.reread() if of.groups}
    people = _people(found)
    return Section(
        title="Do the groups differ?",
        blocks=[
            of_groups(made, adjusted=not found.loaded.table.given.all()),
            _METHOD,
            _without(found),
            _reread_groups(readings),
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
                "p_holm_by_reading": plain(readings),
            }
        },
    )


def _reread_groups(readings: Mapping[str, Mapping[str, float]]) -> str:
    """Tell the questions about groups under the other readings of withheld scores."""
    told = [
        f"{READ_AS[name]}, {'; '.join(f'{of}: {p_equals(p)}' for of, p in p_holm.items())}"
        for name, p_holm in readings.items()
    ]
    return f"Withheld scores read otherwise, by Holm's correction: {'. '.join(told)}." * bool(told)


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
    return f"Without a group, and not compared: {', '.join(without)}." if without else ""


def _groups_figure(found: Findings, names: Sequence[str]) -> Figure:
    """Return mean scores by condition and group; nothing where no group can be compared."""
    if not names:
        return Figure(name="groups")
    table, known = found.loaded.table, found.loaded.groups
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
        title="Scores by group",
        caption="Mean scores of participants by condition and group, with the 95% interval (t) of "
        f"each mean.{of_all(len(shown), len(table.conditions), 'conditions')}",
        draw=partial(figure_data.factor_figure, factors, means, halves, found.scale),
    )


def _half(values: FloatArray) -> float:
    ends = mean_interval(values)
    return float("nan") if isinstance(ends, NotEstimable) else (ends[1] - ends[0]) / 2
