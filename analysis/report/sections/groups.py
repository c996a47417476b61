"""Comparisons between groups of participants."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from analysis.estimates import Json, NotEstimable, plain
from analysis.report.blocks import Column, Section, Table, columns, p_cell
from analysis.report.findings import Findings
from analysis.report.results import of_groups
from analysis.report.wording import MISSING, interval, number, p_value
from analysis.statistics.groups import GAIN, SCORE, Compared, GroupStatistics, TwoGroups

_METHOD = (
    "Groups are compared by one number of each participant: the mean score, the score of a "
    "condition, or the gain, which is the least-squares slope of the participant's own scores on "
    "predicted contrasts. The gains of the models are not compared, because each borrows from the "
    "other participants, which draws groups together. Scores at an end of the scale make gains "
    "smaller and profiles flatter. p counts the ways in which these people "
    "could have come into groups of these sizes: all of them, or random ones where an error is "
    "given. Group × condition permutes people with their whole profiles, less their own mean, so "
    "that a group that scores higher throughout does not count. Mean score, gain and group × "
    "condition are one family with Holm's correction; differences in a condition count only if "
    "mean scores or profiles differ."
)


def section(found: Findings) -> Section:
    """Return the comparisons between groups; nothing for a study without groups."""
    made = found.groups
    if made is None:
        return Section(name="groups", title="Groups", blocks=[])
    tests = {SCORE: made.score, GAIN: made.gain, **made.conditions}
    return Section(
        name="groups",
        title="Do the groups differ?",
        blocks=[
            of_groups(made),
            _METHOD,
            _without(found),
            _people_table(found),
            Table(
                name="groups-measures",
                caption="Medians by group, with the number of participants in brackets, and the "
                "test of all groups: Mann and Whitney's U of two, Kruskal and Wallis' H of more.",
                columns=columns("measure", *_names(made), "statistic", "p"),
                rows=[[name, *_cells(made, test)] for name, test in tests.items()],
            ),
            Table.over(
                _rows(tests),
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
        data={"groups": _json(found, made)},
    )


@dataclass(frozen=True)
class _Row:
    measure: str
    pair: TwoGroups


def _rows(tests: dict[str, Compared | NotEstimable]) -> Iterator[_Row]:
    for name, test in tests.items():
        if isinstance(test, Compared):
            yield from (_Row(name, pair) for pair in test.pairs)


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


def _people(found: Findings) -> list[tuple[str, int, int, int]]:
    """Return each group with its planned size, and how many came and are analysed."""
    came = Counter(found.loaded.groups.values())
    left = Counter(found.loaded.groups.get(who) for who in found.loaded.table.subjects)
    planned = {group.name: group.size for group in found.study.group}
    return [
        (name, planned.get(name, 0), came[name], left[name])
        for name in dict.fromkeys((*planned, *came))
    ]


def _without(found: Findings) -> str:
    without = [who for who in found.loaded.table.subjects if who not in found.loaded.groups]
    return f"Without a group, and not compared: {', '.join(without)}." if without else ""


def _people_table(found: Findings) -> Table:
    return Table(
        name="groups-people",
        caption="Participants by group: planned, with a session that is not excluded, and left "
        "after the study's rules, which are the same in each group.",
        columns=columns("group", "planned", "took part", "analysed"),
        rows=[[name, *map(str, counts)] for name, *counts in _people(found)],
    )


def _json(found: Findings, made: GroupStatistics) -> Json:
    people = ("name", "planned", "took_part", "analysed")
    return {
        "people": [dict(zip(people, each, strict=True)) for each in _people(found)],
        **plain(made),
        "differ_in": [
            {"condition": name, "a": pair.a, "b": pair.b} for name, pair in made.in_conditions
        ],
    }
