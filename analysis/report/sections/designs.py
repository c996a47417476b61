"""What was noticed, and comparisons by the design: between groups, by factors and sessions."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from functools import partial
from itertools import groupby
from types import SimpleNamespace
from typing import Any

import numpy as np

from analysis.estimates import FloatArray, Json, NotEstimable, or_null, plain
from analysis.loading.study_data import WITHHELD_AS
from analysis.report import figure_data
from analysis.report.as_json import unknown, with_reasons
from analysis.report.blocks import (
    Column,
    Figure,
    Section,
    Table,
    at,
    columns,
    estimate,
    p_cell,
)
from analysis.report.findings import Design, Findings
from analysis.report.results import of_groups
from analysis.report.wording import MISSING, interval, number, of_all, p_equals, p_value
from analysis.statistics.detection import Detection, Rate
from analysis.statistics.factorial import (
    SESSION,
    Effect,
    LatentFactorial,
    LevelMean,
    TestedEffect,
    cell_intervals,
)
from analysis.statistics.groups import GAIN, SCORE, Compared, GroupStatistics
from analysis.statistics.intervals import mean_interval
from analysis.trials.answers import CATCH
from analysis.trials.trial_statistics import Detected, detected_by

# Detection: how often changes are noticed beside false alarms.

NOTICING = "Detection of changes"
ALL_CONDITIONS = "all conditions"
_NoticedParts = Mapping[str, Sequence[Detected]]


def detection(found: Findings) -> Section:
    """Return what was noticed by condition, level, group and person; nothing without catch trials.

    Every d′ here is from counts alone; that of M3 is at a contrast.
    """
    if not found.trials.noticed:
        return Section(name="detection", title=NOTICING, blocks=[Figure(name="noticed")])
    *conditions, whole = found.trials.noticed
    parts = _noticed_parts(found)
    return Section(
        name="detection",
        title=NOTICING,
        blocks=[
            _noticed_by_condition(conditions, whole, parts),
            _each_person(parts["subjects"]),
            _scores_line(found),
        ],
        data={
            "detection": {
                "conditions": list(map(_noticed_json, conditions)),
                "overall": _noticed_json(whole),
                **{name: list(map(_noticed_json, each)) for name, each in parts.items()},
            }
        },
    )


def _noticed_parts(found: Findings) -> _NoticedParts:
    """Return what was noticed at each level, in each group and by each subject."""
    trials, names = found.loaded.trials, found.loaded.table.conditions
    levels = sorted(
        detected_by(trials, "condition", "level"),
        key=lambda it: (names.index(it.of["condition"]), it.of["level"]),
    )
    several = [list(own) for _, own in groupby(levels, lambda it: it.of["condition"])]
    groups: list[Detected] = []
    if trials["group"].nunique() > 1:
        own = detected_by(trials, "group", "condition")
        for whole in detected_by(trials, "group"):
            of_group = [each for each in own if each.of["group"] == whole.of["group"]]
            groups += sorted(of_group, key=lambda it: names.index(it.of["condition"]))
            groups.append(whole)
    return {
        # A condition at a single level has been told already.
        "levels": [each for own in several if len(own) > 1 for each in own],
        "groups": groups,
        "subjects": list(detected_by(trials, "participant")),
    }


def _noticed_name(of: Mapping[str, Any]) -> str:
    """Return in words which trials are told of.

    >>> _noticed_name({"group": "old", "condition": "voltage"})
    'voltage, old'
    >>> _noticed_name({"condition": "a", "level": 0.5})
    'a, level 0.5'
    """
    level = f"level {of['level']:g}" if "level" in of else ""
    return ", ".join(
        filter(None, [of.get("condition", ALL_CONDITIONS), level, of.get("group", "")])
    )


def _rate(rate: Rate | NotEstimable) -> str:
    if not isinstance(rate, Rate):
        return MISSING
    ends = interval(rate.share_interval, bounded=True)
    return f"{rate.reported} of {rate.trials} ({rate.share:.0%}, {ends})"


def _estimates(of: str) -> list[Column]:
    return [*estimate("d′", f"{of}found.d_prime"), *estimate("criterion", f"{of}found.criterion")]


def _noticed_table(shown: Sequence[Detected]) -> Table:
    rows = []
    for each in shown:
        hits = at(each, "found.hits")
        rows.append(SimpleNamespace(name=_noticed_name(each.of), rate=hits, of=each))
        # Of the catch trials beside all conditions the rate alone is told.
        if "condition" not in each.of:
            name, alarms = _noticed_name({"condition": CATCH, **each.of}), "found.false_alarms"
            rows.append(SimpleNamespace(name=name, rate=at(each, alarms), of=None))
    return Table.over(
        rows,
        [
            Column("trials", "name"),
            Column("change reported", "rate", _rate),
            *_estimates("of."),
            Column("p", "of.found.p", p_cell),
            Column("p (Holm)", "of.p_holm", p_cell),
        ],
        name="noticed",
        caption="Trials on which a change in either direction was reported, with 95% intervals "
        "that allow for differences between people; d′ and criterion of the average rates, "
        "against the catch trials (0 V) of the same people. p: exact test within people that "
        "nobody reports more changes than on catch trials, one-sided; Holm's correction is over "
        "the conditions.",
    )


def _each_person(people: Sequence[Detected]) -> Table:
    return Table.over(
        people,
        [
            Column("subject", lambda it: it.of["participant"]),
            Column("change reported", "found.hits", _rate),
            Column("on catch trials", "found.false_alarms", _rate),
            *_estimates(""),
        ],
        name="noticed-subjects",
        caption="The same by subject. Intervals hold for independent trials; with few catch "
        "trials they are wide, and d′ is too small on average.",
    )


def _scores_line(found: Findings) -> str:
    """Return what it does to the tests of scores that some trials have none by the study's rule."""
    why = WITHHELD_AS[found.rating.score_when]
    scored = found.loaded.scored
    missing = scored["score"].isna()
    if found.rating.score_when == "always" or not missing.any():
        return ""
    by_condition = missing.groupby(scored["condition"], sort=False).mean()
    most = str(by_condition.idxmax())
    return (
        f"Tests of scores compare what was noticed: {missing.sum()} of {len(scored)} trials have "
        f"no score, as {why}, most of all of {most} ({by_condition[most]:.0%}). The mean of such a "
        "condition is of the trials, and of the people, in which it was felt most, so that it is "
        "too high, differences from other conditions look smaller, and fewer people can be "
        "compared. Whether changes are noticed at all is tested here, on every trial."
    )


def _noticed_by_condition(
    conditions: Sequence[Detected], whole: Detected, parts: _NoticedParts
) -> Figure:
    """Return shares by condition, and by level or by group where there are several."""
    series: dict[str, dict[str, Rate]] = {}
    by_level = {each.of["condition"] for each in parts["levels"]}
    rows = parts["groups"] or [
        whole,
        *(each for each in conditions if each.of["condition"] not in by_level),
        *parts["levels"],
    ]
    for each in rows:
        own = series.setdefault(each.of.get("group", "all people"), {})
        if isinstance(each.found, Detection):
            if "condition" in each.of:
                own[_noticed_name({**each.of, "group": ""})] = each.found.hits
            else:
                own[CATCH] = each.found.false_alarms
    # Catch trials first, because everything else is compared with them.
    names = list(dict.fromkeys([CATCH, *(name for own in series.values() for name in own)]))
    drawn = tuple(
        names[place] for place in figure_data.thinned(len(names), figure_data.MOST_INTERVALS)
    )
    nothing = (np.nan,) * 3
    ends = {
        group: np.array(
            [(r.share, *r.share_interval) if (r := own.get(name)) else nothing for name in drawn]
        )
        for group, own in series.items()
    }
    return Figure(
        name="noticed",
        title="Noticed changes",
        caption="Share of trials on which a change in either direction was reported, with 95% "
        f"intervals; on catch trials nothing changed.{of_all(len(drawn), len(names), 'shares')}",
        draw=partial(figure_data.noticed_figure, drawn, ends),
        table=_noticed_table([*conditions, whole, *parts["levels"], *parts["groups"]]),
    )


def _noticed_json(each: Detected) -> Json:
    return {**plain(each.of), **plain(each.found), "p_holm": each.p_holm}


# Comparisons between groups of participants.

_READ_AS = {"zero": "withheld as lowest possible", "lowest": "withheld as lowest given"}
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


def groups(found: Findings) -> Section:
    """Return the comparisons between groups; nothing for a study without groups."""
    made = found.groups
    if made is None:
        return Section(name="groups", title="Groups", blocks=[])
    tests = {SCORE: made.score, GAIN: made.gain, **made.conditions}
    readings = {name: of.groups.p_holm for name, of in _reread(found) if of.groups}
    people = _people(found)
    return Section(
        name="groups",
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
                rows=[[name, *map(str, counts)] for name, *counts in people],
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
                "people": [dict(zip(_PEOPLE, each, strict=True)) for each in people],
                **plain(made),
                "differ_in": [
                    {"condition": name, "a": pair.a, "b": pair.b}
                    for name, pair in made.in_conditions
                ],
                "p_holm_by_reading": plain(readings),
            }
        },
    )


def _reread(found: Findings) -> Iterator[tuple[str, Design]]:
    """Yield the design under each other reading of withheld scores, with its name."""
    for name, table in list(found.table.tables.items())[1:]:
        if made := found.design_by(name, table):
            yield name, made


def _reread_groups(readings: Mapping[str, Mapping[str, float]]) -> str:
    """Tell the questions about groups under the other readings of withheld scores."""
    told = [
        f"{_READ_AS[name]}, {'; '.join(f'{of}: {p_equals(p)}' for of, p in p_holm.items())}"
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


_PEOPLE = ("name", "planned", "took_part", "analysed")


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


def _groups_figure(found: Findings, names: Sequence[str]) -> Figure:
    """Return mean scores by condition and group; nothing where no group can be compared."""
    table, known = found.loaded.table, found.loaded.groups
    of = np.array([known.get(who, "") for who in table.subjects])
    shown = figure_data.thinned(len(table.conditions), figure_data.MOST_INTERVALS)
    own = [
        [column[(of == name) & ~np.isnan(column)] for name in names] for column in table.scores.T
    ]
    cells = [
        [(np.mean(it), _half(it)) if it.size else (np.nan,) * 2 for it in own[c]] for c in shown
    ]
    if not names:
        return Figure(name="groups")
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


# Effects of factors and sessions: main ones and interactions of two.


def factors(found: Findings) -> Section:
    """Return the effects, the means by level and a figure by factor; nothing without factors."""
    tests, title = found.factors, "Factors"
    if tests is None:
        return Section(name="factors", title=title, blocks=[])
    latent = found.trials.latent_factorial
    readings = {
        name: {it.name: it.p_holm for it in (of.factors.effects if of.factors else ())}
        for name, of in _reread(found)
    }
    return Section(
        name="factors",
        title=title,
        blocks=[
            _effects(tests.effects, latent, readings),
            _model(latent),
            _levels(tests.levels, latent),
            *_figures(found),
        ],
        data={
            "factors": {
                "effects": [_effect_json(it) for it in tests.effects],
                "levels": [with_reasons(it) for it in tests.levels],
                "latent": plain(latent),
                "p_holm_by_reading": {
                    name: {effect: or_null(p) for effect, p in again.items()}
                    for name, again in readings.items()
                },
            }
        },
    )


_Latent = LatentFactorial | NotEstimable | None
_Readings = dict[str, dict[str, float | NotEstimable]]


def _effects(effects: tuple[TestedEffect, ...], latent: _Latent, readings: _Readings) -> Table:
    wald = {it.factors: it for it in latent.effects} if isinstance(latent, LatentFactorial) else {}
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
            Column("general η²", "effect.generalized_eta2", 2),
            *[Column("latent p", lambda it: wald[it.factors].p, p_cell)] * bool(wald),
            *(
                Column(
                    f"Holm, {_READ_AS[name]}",
                    partial(lambda of, it: of.get(it.name), again),
                    p_cell,
                )
                for name, again in readings.items()
            ),
        ],
        name="factor-effects",
        caption="Main effects and interactions of two factors within people. p, shuffled: the "
        "levels of these factors are shuffled within each person (exact where all arrangements "
        "could be listed); p, F: the same F, with Greenhouse and Geisser's correction. The larger "
        "one decides, corrected by Holm's method over all questions of this page. Partial η² with "
        "its 95% interval: share of an effect in what other effects and people's levels leave; "
        "general η²: its share in all but the other effects. Latent: Wald's test in the ordinal "
        "mixed model below, which an end of the scale does not bend; if people differ in an "
        "effect, its p is too small.",
    )


def _df(effect: Effect | NotEstimable) -> str:
    if isinstance(effect, NotEstimable):
        return effect.reason
    return f"{effect.df[0]}, {effect.df[1]}"


def _model(latent: _Latent) -> str:
    if not isinstance(latent, LatentFactorial):
        why = latent.reason if latent else ""
        return f"Ordinal mixed model of the factors: not estimable ({why})."
    cells = (
        "" if latent.cell_sd is None else f", between a subject's cells {number(latent.cell_sd)}"
    )
    return (
        "Ordinal mixed model of the factors (cumulative probit; main effects and interactions of "
        f"two): between-subject standard deviation {number(latent.subject_sd)}{cells}, in standard "
        "deviations of the latent residual."
    )


def _levels(levels: Sequence[LevelMean], latent: _Latent) -> Table:
    known = latent.levels if isinstance(latent, LatentFactorial) else ()
    model = {(it.factor, it.level): it for it in known}
    return Table.over(
        levels,
        [
            Column("factor", "factor", kind="text"),
            Column("level", "level", kind="text"),
            Column("mean", "mean", 2),
            *estimate("difference", "difference"),
            *(
                Column(own.name, partial(lambda own, it: own.cell(model[it.factor, it.level]), own))
                for own in estimate("latent", "effect")
                if known
            ),
        ],
        name="factor-levels",
        caption="Mean score by level, over the other factors; its difference from the mean of all "
        "levels, in points, and the same in the ordinal mixed model, in standard deviations of its "
        "latent residual, each with its 95% interval.",
    )


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
            title=f"Scores by {name}",
            caption=f"Mean scores by {name}{by}, over the other factors, with 95% intervals that "
            "leave out differences between people's levels (Cousineau and Morey).",
            draw=partial(figure_data.factor_figure, factors, means, halves, found.scale),
        )


def _effect_json(it: TestedEffect) -> Json:
    named = {"factors": list(it.factors), "p_holm": or_null(it.p_holm)}
    if isinstance(it.effect, NotEstimable):
        return {**named, **unknown(it.effect, *(each.name for each in fields(Effect)))}
    return {**named, "p": it.effect.p, **with_reasons(it.effect)}
