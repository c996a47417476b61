"""Sessions: what was left out, interruptions, answer times, checks of order, drift and catches."""

from collections.abc import Mapping, Sequence
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np

from analysis.estimates import Json, NotEstimable, plain
from analysis.loading.exclusion_rules import rules_in_words
from analysis.loading.study_data import StudyData
from analysis.report import blocks, figure_data
from analysis.report.blocks import at, columns
from analysis.report.estimates_json import unknown, with_reasons
from analysis.report.findings import Findings
from analysis.report.wording import interval, number, of_all, p_equals, place_of
from analysis.trials import trial_checks
from analysis.trials.contrasts import FORCE_STEP, PLACE_STEP_M
from analysis.trials.trial_checks import OrderAsRun, order_as_run
from analysis.trials.trial_statistics import catch_answers
from protocol.errors import listed

FIGURES = ("course", "reaction-times", "forces", "places")


def section(found: Findings) -> blocks.Section:
    """Return the checks of whole sessions."""
    catch, as_run = catch_answers(found.loaded.of_noticing), order_as_run(found.loaded, found.study)
    order, carried, moved = found.trials.order_effect, found.trials.carry_over, found.trials.drift
    return blocks.Section(
        title="Sessions, touches and reaction times",
        # Of imported scores neither order nor touches are known, which is said once, below.
        blocks=[]
        if found.published
        else [
            blocks.Items(
                lines=[
                    _f_line("Place in the session", order),
                    _f_line("Carry-over from the scored trial directly before", carried),
                    _order_line(as_run),
                    _drift_line(moved),
                ]
            ),
            _follower_table(as_run, found.study.conditions),
            _course_figure(found),
            _reaction_times(found),
            _forces(found),
            _places(found),
        ],
        data={
            "checks": {
                "order": plain(order),
                "carry_over": plain(carried),
                "as_run": _as_run_json(as_run),
                "drift": plain(moved),
                "catch_trials": {
                    "overall": _discrimination_json(catch.overall),
                    "subjects": {
                        name: _discrimination_json(own) for name, own in catch.subjects.items()
                    },
                },
            }
        },
    )


def _f_line(name: str, test: trial_checks.FTest | NotEstimable) -> str:
    if isinstance(test, NotEstimable):
        return f"{name}: not estimable ({test.reason})."
    return f"{name}: F({test.df[0]}, {test.df[1]}) = {test.f:.3f}, {p_equals(test.p)}."


def _order_line(order: OrderAsRun | NotEstimable) -> str:
    if isinstance(order, NotEstimable):
        return f"Order as run: not known ({order.reason})."
    kept = "keeps every rule of the plan"
    if order.problems:
        kept = f"breaks rules of the plan ({'; '.join(order.problems)})"
    return (
        "Attempts that were repeated because a touch was not as instructed: "
        f"{order.attempts_repeated}. The order in which the trials were answered {kept}."
    )


def _follower_table(order: OrderAsRun | NotEstimable, names: Sequence[str]) -> blocks.Table | None:
    if isinstance(order, NotEstimable):
        return None
    counts = order.carry_over.counts
    return blocks.Table(
        name="followers",
        caption="How often each condition (column) was answered directly after another (row), "
        "within a block; catch trials between them are ignored here, while the test of carry-over "
        "leaves out trials that follow one.",
        columns=columns("after", *names),
        rows=[[name, *map(str, row)] for name, row in zip(names, counts, strict=True)],
    )


def _as_run_json(order: OrderAsRun | NotEstimable) -> Json:
    if isinstance(order, NotEstimable):
        return unknown(order)
    balance = ("counts", "across_blocks", "balanced", "imbalance")
    return {
        "attempts_repeated": order.attempts_repeated,
        "problems": list(order.problems),
        "carry_over": {name: plain(getattr(order.carry_over, name)) for name in balance},
    }


def _drift_line(drift: trial_checks.Drift | NotEstimable) -> str:
    if isinstance(drift, NotEstimable):
        return f"Drift: not estimable ({drift.reason})."
    return (
        f"Drift, mean of the subjects' slopes: {number(drift.points_per_trial)} points per trial, "
        f"95% interval {interval(drift.interval, 3)}, {p_equals(drift.p)} (t test, {drift.df} df)."
    )


def _course_figure(found: Findings) -> blocks.Figure:
    places, means, errors, counts = figure_data.course(found.trials.scored)
    if not len(places):
        return blocks.Figure(name="course")
    return blocks.Figure(
        name="course",
        title="Scores over the session",
        caption="Mean score with standard error, by the trial's place in the session.",
        draw=partial(figure_data.course_figure, places, means, errors, found.scale),
        table=blocks.Table.over(
            zip(places, means, errors, counts, strict=True),
            [
                blocks.Column("place", itemgetter(0)),
                blocks.Column("mean score", itemgetter(1), 2),
                blocks.Column("standard error", itemgetter(2), 2),
                blocks.Column("scores", itemgetter(3)),
            ],
            name="course",
            caption="Numbers shown in the figure: mean score by place in the session.",
        ),
    )


def _reaction_times(found: Findings) -> blocks.Figure:
    times = found.loaded.scored[["condition", "reaction_time_s"]].dropna()
    own = {
        name: times["reaction_time_s"][times["condition"] == name]
        for name in found.study.conditions
    }
    at_once = found.at_once
    began = "the scale to the score" if at_once else "the question to the first answer"
    return _strips(
        "reaction-times",
        "Reaction times",
        f"Time from {began} of each scored trial; bars show medians.",
        own,
        ("reaction time, s", "condition"),
        # Reaction times are skewed to the right: on a linear axis a few slow ones would take all
        # the room.
        logarithmic=True,
    )


def _forces(found: Findings) -> blocks.Figure:
    """Return the measured force of each touch over the one that was asked for."""
    touches = found.loaded.touches.dropna(subset=["force_n"])
    made = touches["force_n"] / (found.study.touch.force_n * touches["press"])
    return _strips(
        "forces",
        "Force of the touches",
        "Median force of each touch over the force that was asked for (dashed), in steps of "
        f"{FORCE_STEP:.0%}, by subject; bars show medians.",
        # In the steps in which the model takes force, so that the figure shows what is analysed.
        _by_subject(found, (made / FORCE_STEP).round() * FORCE_STEP, touches),
        ("force, made / asked", "subject"),
        asked=1.0,
    )


def _places(found: Findings) -> blocks.Figure:
    """Return the measured place of each touch at a place, less the one that was asked for."""
    touches = found.loaded.touches.dropna(subset=["place_m"])
    usual_m = found.study.touch.smooth_place_m
    asked_m = [each.own_place_m for each in touches["planned"]]
    apart_m = touches["place_m"] - [usual_m if own_m is None else own_m for own_m in asked_m]
    return _strips(
        "places",
        "Places of the touches",
        "Median place of each touch less the place that was asked for (dashed), in steps of "
        f"{1e3 * PLACE_STEP_M:g} mm, by subject; bars show medians.",
        _by_subject(found, (apart_m / PLACE_STEP_M).round() * PLACE_STEP_M * 1e3, touches),
        ("place, made − asked, mm", "subject"),
        asked=0.0,
    )


def _by_subject(found: Findings, values: Any, touches: Any) -> dict[str, Any]:
    """Return values of the touches of the trials that count, by subject of those shown."""
    subjects = found.loaded.table.subjects
    who = touches["attempt_id"].map(found.loaded.trials["participant"])
    shown = figure_data.thinned(len(subjects), figure_data.MOST_INTERVALS)
    return {subjects[place]: values[who == subjects[place]] for place in shown}


def _strips(
    name: str,
    title: str,
    caption: str,
    groups: Mapping[str, Any],
    axes: tuple[str, str],
    **style: Any,
) -> blocks.Figure:
    """Return the figure of values in groups, with a table; none without values."""
    given = {group: np.asarray(own, np.float64) for group, own in groups.items() if len(own)}
    if not given:
        return blocks.Figure(name=name)
    axis, across = axes
    # Quartiles in the table are of all values; only points are thinned.
    most = figure_data.MOST_POINTS // len(given)
    drawn = {group: own[figure_data.thinned(len(own), most)] for group, own in given.items()}
    medians = [float(np.median(own)) for own in given.values()]
    count, of = (sum(map(len, groups.values())) for groups in (drawn, given))
    return blocks.Figure(
        name=name,
        title=title,
        caption=caption + of_all(count, of, "points"),
        draw=partial(figure_data.strips_figure, drawn, medians, axis=axis, across=across, **style),
        table=blocks.Table.over(
            given.items(),
            blocks.spread_columns(across),
            name=name,
            caption=f"Numbers shown in the figure: {axis}.",
        ),
    )


def _discrimination_json(answers: trial_checks.Discrimination | NotEstimable) -> Json:
    found: Json = plain(answers)
    if isinstance(answers, trial_checks.Discrimination):
        found |= {name: with_reasons(at(answers, name)) for name in ("hits", "false_alarms")}
    return found


# Exclusions with their reasons, interruptions, and operator notes.

_text = partial(blocks.Column, kind="text")


def left_out(found: Findings) -> blocks.Section:
    """Return the exclusions, and the incidents of the sessions."""
    loaded = found.loaded
    rules = rules_in_words(found.study.exclusions, older=loaded.older_rules)
    counts = _counts(loaded)
    unfinished = "; ".join(_unfinished(loaded)) or "none"
    if found.published:
        # An imported table does not tell, which is not the same as none.
        unfinished = "unknown for an imported table"
    return blocks.Section(
        title="Exclusions and interruptions",
        blocks=[
            f"Prespecified exclusion rules: {'; '.join(rules)}."
            if rules
            else "The study prespecified no exclusion rules.",
            _unnoticing(loaded),
            blocks.Items(
                lines=[
                    f"rehearsals left out: {counts['rehearsals']}",
                    *(f"{why}: {n}" for why, n in counts.items() if why != "rehearsals"),
                    f"unfinished sessions: {unfinished}",
                ]
            ),
            _table(
                loaded.left_out,
                [_text("by", "by"), _text("reason", "why")],
                # A session without a number stands for all of them.
                lambda of: "all" if of is None else str(of),
                name="left-out",
                caption="Data excluded from every number in this report, with the reasons.",
            ),
            _table(
                loaded.incidents,
                [_text("event", "what"), _text("description", "text")],
                name="incidents",
                caption="Interruptions and operator notes.",
            ),
            _interruptions_line(found),
        ],
        data={
            "unfinished": list(loaded.unfinished),
            "left_out": counts,
            "exclusions": plain(loaded.left_out),
            "left_out_for_not_noticing": list(loaded.unnoticing),
            "incidents": plain(loaded.incidents),
        },
    )


def _table(
    entries: Sequence[Any], further: Sequence[blocks.Column], place: Any = blocks.text, **told: str
) -> blocks.Table | None:
    """Return a table of what happened where, or None if nothing did."""
    where = ("participant", "session", "trial")
    columns = [*(_text(name, name, place) for name in where), *further]
    return blocks.Table.over(entries, columns, **told) if entries else None


def _unnoticing(loaded: StudyData) -> str:
    """Return who is left out for not noticing, by a rule of version 1; '' if nobody is."""
    if not loaded.unnoticing:
        return ""
    return (
        f"Left out only because they noticed few changes: {listed(loaded.unnoticing)}. By the rule "
        "of touchbeam 1 a score that was not asked for is a missing one; this selects by the "
        "answers, so that the others notice more than the participants did."
    )


_MOST_LINES = 12
_OTHER_REHEARSALS = "rehearsals of another study.toml"
_TOLD = ("rehearsals", _OTHER_REHEARSALS, "sessions withdrawn")
"""What the terminal is told of besides the exclusions, if there is any."""


def left_out_lines(loaded: StudyData) -> list[str]:
    """Return for the terminal who and what the report leaves out, and why."""
    said = [f"{place_of(entry)} ({entry.by}): {entry.why}" for entry in loaded.left_out]
    if (more := len(said) - _MOST_LINES) > 0:
        said[_MOST_LINES:] = [f"{more} more, listed under Exclusions in the report"]
    counts = _counts(loaded)
    said += [f"{of}: {counts[of]}" for of in _TOLD if counts.get(of)]
    return [
        *(f"Left out: {each}" for each in said),
        *filter(None, [_unnoticing(loaded)]),
        *(f"Not finished: {which}" for which in _unfinished(loaded)[:_MOST_LINES]),
    ]


def _unfinished(loaded: StudyData) -> list[str]:
    those = zip(loaded.unfinished, loaded.unfinished_sessions, strict=True)
    return [f"{who}, session {number}" for who, number in those]


def _counts(loaded: StudyData) -> dict[str, int]:
    by_rule = [entry for entry in loaded.left_out if entry.by == "rule"]
    return {
        "rehearsals": loaded.rehearsals_left_out,
        **({_OTHER_REHEARSALS: loaded.other_rehearsals} if loaded.other_rehearsals else {}),
        "sessions excluded": loaded.sessions_excluded,
        "sessions withdrawn": loaded.sessions_withdrawn,
        "trials excluded": loaded.trials_excluded,
        "trials excluded by rule": sum(e.trial is not None for e in by_rule),
        "participants excluded by rule": len({e.participant for e in by_rule if e.trial is None}),
    }


def _interruptions_line(found: Findings) -> str:
    """Return a sentence on missing incidents, or an empty text if there were incidents."""
    if found.published:
        return (
            "Interruptions, and the order in which scores were given, are unknown for an imported "
            "table: effects of order cannot be tested."
        )
    if found.loaded.incidents:
        return ""
    other = "other incident was" if found.loaded.unfinished else "interruptions or notes were"
    return f"No {other} recorded."
