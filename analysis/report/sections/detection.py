"""Detection: how often changes are noticed beside false alarms, d′ and criterion."""

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from analysis.estimates import Json, NotEstimable, plain
from analysis.loading.study_data import WITHHELD_AS
from analysis.report.blocks import Column, Figure, Section, Table, at, estimate, p_cell
from analysis.report.figure_data import MOST_INTERVALS, noticed_figure, thinned
from analysis.report.findings import Findings
from analysis.report.wording import MISSING, interval, of_all
from analysis.statistics.detection import Detection, Rate
from analysis.trials.answers import CATCH
from analysis.trials.trial_statistics import Detected, detected_by

TITLE = "Detection of changes"
ALL = "all conditions"
_Parts = Mapping[str, Sequence[Detected]]


def section(found: Findings) -> Section:
    """Return what was noticed by condition, level, group and person; nothing without catch trials.

    Every d′ here is from counts alone; that of M3 is at a contrast.
    """
    if not found.trials.noticed:
        return Section(name="detection", title=TITLE, blocks=[Figure(name="noticed")])
    *conditions, whole = found.trials.noticed
    parts = _parts(found)
    return Section(
        name="detection",
        title=TITLE,
        blocks=[
            _figure(found, conditions, whole, parts),
            _people_table(parts["subjects"]),
            _scores_line(found),
        ],
        data={
            "detection": {
                "conditions": list(map(_json, conditions)),
                "overall": _json(whole),
                **{name: list(map(_json, each)) for name, each in parts.items()},
            }
        },
    )


def _parts(found: Findings) -> _Parts:
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


def _name(of: Mapping[str, Any]) -> str:
    """Return in words which trials are told of.

    >>> _name({"group": "old", "condition": "voltage"}), _name({"condition": "a", "level": 0.5})
    ('voltage, old', 'a, level 0.5')
    """
    level = f"level {of['level']:g}" if "level" in of else ""
    return ", ".join(filter(None, [of.get("condition", ALL), level, of.get("group", "")]))


def _rate(rate: Rate | NotEstimable) -> str:
    if not isinstance(rate, Rate):
        return MISSING
    ends = interval(rate.share_interval, bounded=True)
    return f"{rate.reported} of {rate.trials} ({rate.share:.0%}, {ends})"


def _estimates(of: str) -> list[Column]:
    return [*estimate("d′", f"{of}found.d_prime"), *estimate("criterion", f"{of}found.criterion")]


class _Row(NamedTuple):
    """Trials with a name and how often a change was reported; catch trials have no more."""

    name: str
    rate: Rate | NotEstimable
    of: Detected | None = None


def _rows(shown: Sequence[Detected]) -> list[_Row]:
    """Return the rows of the table: the trials with a signal, and the catch trials beside all."""
    rows = []
    for each in shown:
        rows.append(_Row(_name(each.of), at(each, "found.hits"), each))
        if "condition" not in each.of:
            rows.append(
                _Row(_name({"condition": CATCH, **each.of}), at(each, "found.false_alarms"))
            )
    return rows


def _table(shown: Sequence[Detected]) -> Table:
    return Table.over(
        _rows(shown),
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


def _people_table(people: Sequence[Detected]) -> Table:
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


def _figure(
    found: Findings, conditions: Sequence[Detected], whole: Detected, parts: _Parts
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
                own[_name({**each.of, "group": ""})] = each.found.hits
            else:
                own[CATCH] = each.found.false_alarms
    # Catch trials first, because everything else is compared with them.
    names = list(dict.fromkeys([CATCH, *(name for own in series.values() for name in own)]))
    drawn = tuple(names[place] for place in thinned(len(names), MOST_INTERVALS))
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
        draw=partial(noticed_figure, drawn, ends),
        keep=found.keep,
        table=_table([*conditions, whole, *parts["levels"], *parts["groups"]]),
    )


def _json(each: Detected) -> Json:
    return {**plain(each.of), **plain(each.found), "p_holm": each.p_holm}
