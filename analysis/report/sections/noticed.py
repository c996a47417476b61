"""What was noticed: how often changes are reported beside false alarms."""

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import groupby
from types import SimpleNamespace
from typing import Any

import numpy as np

from analysis.estimates import Json, NotEstimable, plain
from analysis.report import figure_data
from analysis.report.blocks import Column, Figure, Section, Table, at, estimate, p_cell
from analysis.report.estimates_json import with_reasons
from analysis.report.findings import Findings
from analysis.report.wording import MISSING, interval, of_all
from analysis.statistics.detection import Detection, Rate
from analysis.trials.answers import CATCH
from analysis.trials.trial_statistics import Detected, detected_by

ALL_CONDITIONS = "all conditions"
_NoticedParts = Mapping[str, Sequence[Detected]]


def section(found: Findings) -> Section:
    """Return what was noticed by condition, level, group and person; nothing without catch trials.

    Every d′ here is from counts alone.
    """
    if not found.trials.noticed:
        return Section()
    *conditions, whole = found.trials.noticed
    parts = _noticed_parts(found)
    return Section(
        title="Detection of changes",
        blocks=[
            _noticed_by_condition(conditions, whole, parts),
            _each_person(parts["subjects"]),
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
    trials, names = found.loaded.of_noticing, found.loaded.table.conditions
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
        f"the conditions.{_without_interval(shown)}",
    )


def _without_interval(shown: Sequence[Detected]) -> str:
    """Return why some d′ and criterion have no interval, in words."""
    ends = (at(each, "found.d_prime_interval") for each in shown)
    reasons = dict.fromkeys(one.reason for one in ends if isinstance(one, NotEstimable))
    return "".join(f" No interval of d′ and criterion: {reason}." for reason in reasons)


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
        "trials they are wide.",
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
    return {**plain(each.of), **with_reasons(each.found), "p_holm": each.p_holm}
