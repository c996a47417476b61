"""From the journal's events to the table of scores and the trials behind it."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from itertools import chain, groupby
from operator import itemgetter
from typing import Literal, NamedTuple, TypeVar

import numpy as np
import pandas as pd

from analysis.estimates import BoolArray, FloatArray, IntArray, NotEstimable, ScoreTable
from analysis.friction.recorded import TouchForces
from analysis.loading.records import Exclusion, Incident, values
from analysis.loading.sessions import Sessions, is_scored, load_sessions
from analysis.loading.study_lock import StudyLock, study_lock
from protocol.errors import BadInput, listed
from protocol.journal.events import StoredEvent
from protocol.journal.records import VirtualTruth
from protocol.study.rules import Exclusions

# The study's rules on who and what is left out, settled beforehand, applied to all alike.

Judged = Literal["trial", "participant"]
Numbers = Mapping[str, FloatArray | IntArray]
"""What rules judge, each an array over the trials or the participants."""


class Rule(NamedTuple):
    """A rule of `Exclusions`: what it judges, what readers are told, and which numbers break it."""

    of: Judged
    words: str
    why: str
    breaks: Callable[[Numbers, float], BoolArray]


RULES = {
    "max_false_alarms": Rule(
        "participant",
        "a participant who reported a change on more than {:.0%} of the catch trials is left out",
        "a change reported on {alarms} of {catches} catch trials, more than {limit:.0%}",
        lambda n, limit: n["alarms"] / np.maximum(n["catches"], 1) > limit,
    ),
    "max_missing_scores": Rule(
        "participant",
        "a participant with more than {:.0%} of the scores missing is left out",
        "{missing} of {scored} scores missing, more than {limit:.0%}",
        lambda n, limit: n["missing"] / np.maximum(n["scored"], 1) > limit,
    ),
    "min_reaction_s": Rule(
        "trial",
        "a trial answered sooner than {:g} s is left out",
        "answered after {reaction_s:g} s, sooner than {limit:g} s",
        lambda n, limit: n["reaction_s"] < limit,
    ),
    "max_reaction_s": Rule(
        "trial",
        "a trial answered later than {:g} s is left out",
        "answered after {reaction_s:g} s, later than {limit:g} s",
        lambda n, limit: n["reaction_s"] > limit,
    ),
    "min_trials": Rule(
        "participant",
        "a participant with fewer than {} valid trials is left out",
        "{scored} valid trials, fewer than {limit}",
        lambda n, limit: n["scored"] < limit,
    ),
}


def broken_rules(rules: Exclusions, of: Judged, numbers: Numbers) -> dict[str, BoolArray]:
    """Return by the name of each rule that the study settled which trials or people break it.

    Trials are judged first, with the time to the first answer as `reaction_s` (NaN breaks no rule);
    then people, by how many trials are left to them: `scored`, without a score (`missing`),
    `catches`, and `alarms` among these.
    """
    settled = rules.model_dump(exclude_none=True)
    return {
        name: rule.breaks(numbers, settled[name])
        for name, rule in RULES.items()
        if rule.of == of and name in settled
    }


def excluded_by_rule(
    trials: pd.DataFrame, rules: Exclusions
) -> tuple[pd.DataFrame, tuple[Exclusion, ...]]:
    """Return the answered trials that the rules keep, and what they take out."""
    timed = trials["reaction_time_s"].where(trials["trial_kind"].isin(["trial", "catch", "track"]))
    told = _told(rules, "trial", {"reaction_s": timed.to_numpy(np.float64)})
    late = np.array([bool(why) for why in told], np.bool_)
    in_time, too_late = trials[~late], trials[late]
    left_out = [
        Exclusion(participant=participant, session=session, trial=index, by="rule", why=why)
        for participant, session, index, (why, *_) in zip(
            *(too_late[name] for name in ("participant", "session", "trial_index")),
            filter(None, told),
            strict=True,
        )
    ]
    scored, catch = is_scored(in_time), in_time["trial_kind"].eq("catch")
    counted = {
        "scored": scored,
        "missing": scored & in_time["score"].isna(),
        "catches": catch,
        # A catch trial without an answer is no false alarm.
        "alarms": catch & in_time["agrees"].eq(False).fillna(False),
    }
    counts = pd.DataFrame(counted).groupby(in_time["participant"]).sum()
    # Even a participant without any trial left is judged.
    counts = counts.reindex(trials["participant"].unique(), fill_value=0)
    told = _told(rules, "participant", {name: counts[name].to_numpy() for name in counted})
    gone = [
        Exclusion(participant=participant, by="rule", why=why)
        for participant, broken in zip(counts.index, told, strict=True)
        for why in broken
    ]
    kept = in_time[~in_time["participant"].isin([out.participant for out in gone])]
    return kept, (*left_out, *gone)


def _told(rules: Exclusions, of: Judged, numbers: Numbers) -> list[list[str]]:
    """Describe the rules that each trial or participant breaks."""
    broken = broken_rules(rules, of, numbers)
    rows = (dict(zip(numbers, row, strict=True)) for row in zip(*numbers.values(), strict=True))
    return [
        [
            RULES[name].why.format(**row, limit=getattr(rules, name))
            for name, breaks in broken.items()
            if breaks[number]
        ]
        for number, row in enumerate(rows)
    ]


def rules_in_words(rules: Exclusions) -> list[str]:
    """Return each rule that the study settled, as a reader is told it."""
    settled = rules.model_dump(exclude_none=True)
    return [rule.words.format(settled[name]) for name, rule in RULES.items() if name in settled]


# Why a cell of Table 4 has no score: not every such cell may be read as an answer.


class Why(StrEnum):
    """Why no trial of a subject under a condition has a score that counts."""

    WITHHELD = "withheld"
    BLANK = "blank"
    EXCLUDED = "excluded"
    NOT_REACHED = "not reached"


EmptyCells = Mapping[tuple[int, int], Why]
"""By row and column of the table, every cell without a score and nothing else."""

MARKS = {Why.WITHHELD: "–", Why.BLANK: "–", Why.EXCLUDED: "×", Why.NOT_REACHED: "○"}
"""What stands in such a cell where people read the table."""

LABELS = {**{why: str(why) for why in Why}, Why.WITHHELD: "not given"}
"""What readers of the page are told of such a cell."""

WITHHELD_AS = {
    "agrees": "the answer disagreed with the expectation",
    "noticed": "nothing was noticed",
    # Only the scores of a study whose rule was amended.
    "always": "the answer disagreed with the expectation",
}
"""Why a score was not given, by `rating.score_when`."""
_READ = frozenset({Why.WITHHELD, Why.BLANK})
_TOLD = {
    Why.BLANK: "blank in the published table",
    Why.EXCLUDED: "without a score, as the trials are excluded",
    Why.NOT_REACHED: "without a trial, as the session did not get there",
}


def empty_cells(table: ScoreTable, counted: pd.DataFrame, excluded: pd.DataFrame) -> EmptyCells:
    """Return why each cell without a score has none.

    An answered trial that counts and has no score explains its cell before an excluded one does.
    `excluded` are the trials taken out by the operator or by a rule.
    """
    published = counted["trial_kind"].eq("published")
    # A later line overwrites an earlier one, so that trials that count explain a cell before
    # excluded ones.
    known = dict.fromkeys(_scored_cells(excluded), Why.EXCLUDED)
    known |= dict.fromkeys(_scored_cells(counted[published]), Why.BLANK)
    known |= dict.fromkeys(_scored_cells(counted[~published]), Why.WITHHELD)
    return {
        (int(row), int(column)): known.get(
            (table.subjects[row], table.conditions[column]), Why.NOT_REACHED
        )
        for row, column in np.argwhere(~table.given)
    }


def _scored_cells(trials: pd.DataFrame) -> Iterable[tuple[str, str]]:
    scored = trials[is_scored(trials)]
    return zip(scored["participant"], scored["condition"], strict=True)


def withheld(table: ScoreTable, trials: pd.DataFrame) -> FloatArray:
    """Return the share of each cell's scores that was not given, shape (subjects, conditions).

    Blank cells of a published table count. Cells without a trial that counts have a share of 0.
    """
    counted = trials[is_scored(trials)]
    cell = [counted["participant"], counted["condition"]]
    shares = counted["score"].isna().groupby(cell).mean().unstack()
    return shares.reindex(index=table.subjects, columns=table.conditions).fillna(0.0).to_numpy()


def marks(empty: EmptyCells) -> dict[tuple[int, int], str]:
    """Return what stands in each cell without a score."""
    return {cell: MARKS[why] for cell, why in empty.items()}


def unscored(table: ScoreTable) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the subjects and the conditions without any score."""
    given = table.given
    return (
        tuple(who for row, who in enumerate(table.subjects) if not given[row].any()),
        tuple(name for column, name in enumerate(table.conditions) if not given[:, column].any()),
    )


def withheld_beside_scores(trials: pd.DataFrame, least: float = 0.0) -> list[str]:
    """Return in a line how many trials lack a score in cells that have one, if there are any."""
    counted = trials[is_scored(trials)]
    given = counted["score"].notna()
    cell = [counted["participant"], counted["condition"]]
    partly = counted["condition"][given.groupby(cell).transform("any") & ~given]
    if partly.empty:
        return []
    by_condition = listed(f"{name} {n}" for name, n in Counter(partly).items())
    return [
        f"Not given in cells with other scores: {len(partly)} of {len(counted)} scores "
        f"({by_condition}). The table has the mean of the others, which is too high if weaker "
        f"changes were not noticed; the scores are also read as {least:g} and as the lowest score."
    ]


def notes(
    table: ScoreTable, empty: EmptyCells, least: float = 0.0, score_when: str = "agrees"
) -> list[str]:
    """Return what stands under Table 4: each mark, how often, and who or what has no score."""
    causes = Counter(empty.values())
    readable = _READ if table.given.any() else frozenset()
    read = f"also read as {least:g} and as the lowest score."
    told = {**_TOLD, Why.WITHHELD: f"not given, as {WITHHELD_AS[score_when]}"}
    said = [
        f"{MARKS[why]} {told[why]}: {causes[why]} cell{'s' * (causes[why] != 1)}, "
        f"{read if why in readable else 'missing throughout.'}"
        for why in Why
        if causes[why]
    ]
    subjects, conditions = unscored(table)
    if subjects:
        said.append(f"No score at all, and not among the subjects analysed: {listed(subjects)}.")
    if conditions:
        said.append(
            f"Scored by nobody, and not among the conditions analysed: {listed(conditions)}."
        )
    return said


Value = TypeVar("Value")


class NothingToReport(BadInput):
    """A study without the sessions that a report needs; the message says which option helps."""


@dataclass(frozen=True, kw_only=True)
class RecordedUnder:
    """What the scores were recorded under: each value once, in order of appearance."""

    versions: tuple[str, ...] = ()
    seeds: tuple[int, ...] = ()
    studies: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()
    devices: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class SessionOrder:
    """The numbers of a session's trials in the order in which they were answered.

    `slot` is its place in the counterbalanced order of the `group`, `conditions` those of the
    trials.
    """

    session: int
    slot: int
    group: str | None
    trials: tuple[int, ...]
    conditions: tuple[str | None, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyData:
    """The scores and trials of a study, their kinds, and what was left out and why.

    - `trials`: the answered trials that count, excluded ones not among them: `Sessions.answered`
      with `participant`, `session` and `group`.
    - `answers`: those to the study's own questions, of the sessions and trials that count:
      `Sessions.answers` with `participant`, `session`, `trial_kind` and `condition`.
    - `touches`: those of `trials`: `Sessions.touches` with `place_m`.
    - `forces`: of those of `touches` that were recorded, as `Sessions.forces`.
    - `empty`: why a cell of the table has no score.
    - `groups`: the group of each participant of these sessions who has one, left out or not.
    - `orders`: of the sessions that count, excluded trials among them; none of published scores.
    - `virtual`: true parameters of the virtual participants, by name; of their last sessions.
    - `other_rehearsals`: how many rehearsals of another study file are left out.
    - `withdrawn_completed`: how many of the withdrawn sessions had been completed.
    - `lock`: the registration, None of a study without one.
    """

    table: ScoreTable
    kinds: tuple[str, ...]
    rehearsals_left_out: int
    unfinished: tuple[str, ...]
    unfinished_sessions: tuple[int, ...]
    sessions_excluded: int
    sessions_withdrawn: int
    trials_excluded: int
    trials: pd.DataFrame
    touches: pd.DataFrame
    forces: Mapping[int, TouchForces | NotEstimable]
    answers: pd.DataFrame
    left_out: tuple[Exclusion, ...]
    incidents: tuple[Incident, ...]
    recording: RecordedUnder
    empty: EmptyCells
    orders: tuple[SessionOrder, ...]
    virtual: Mapping[str, VirtualTruth]
    lock: StudyLock | None = None
    other_rehearsals: int = 0
    withdrawn_completed: int = 0
    groups: Mapping[str, str] = field(default_factory=dict)

    @property
    def scored(self) -> pd.DataFrame:
        """The trials that count for Table 4."""
        return self.trials[is_scored(self.trials)]

    def readings(self, least: float = 0.0) -> dict[str, ScoreTable]:
        """Return the table with withheld scores left "missing", as "zero" and as "lowest" score.

        "zero" is the `least` score of the scale, which is 0 in the paper.

        A score is withheld when the answer disagrees with the expectation (paper, section 5.2), or
        by `rating.score_when` when nothing was noticed. This can mean nothing, none at all, or an
        effect no stronger than the weakest reported. A cell with other scores is the mean of all,
        those that were withheld among them; one that is empty for another reason stays missing. A
        complete table without withheld scores, and one without any score, has the first reading
        only.
        """
        table, shares = self.table, withheld(self.table, self.trials)
        if not table.given.any() or (table.is_complete and not shares.any()):
            return {"missing": table}
        # A cell without any score has nothing but withheld ones, if it is filled at all.
        given = np.nan_to_num(table.scores) * (1 - shares)
        fills = {"zero": least, "lowest": float(self.scored["score"].min())}
        return {"missing": table} | {
            name: replace(table, scores=np.where(shares > 0, given + shares * score, table.scores))
            for name, score in fills.items()
        }


def load_study_data(
    chains: Iterable[Sequence[StoredEvent]], *, rehearsals: bool, rules: Exclusions | None = None
) -> StudyData:
    """Return the scores of the sessions whose events `chains` yields, as `study_data` does."""
    return study_data(load_sessions(chains), rehearsals=rehearsals, rules=rules)


def study_data(found: Sessions, *, rehearsals: bool, rules: Exclusions | None = None) -> StudyData:
    """Return the scores of all sessions; of rehearsals too if asked for.

    A participant's score for a condition is the mean over that participant's trials. `rules` are
    the study's, on who and what is left out.

    Raises:
        NothingToReport: there are no sessions to report on.
    """
    excluded = found.sessions["exclusion"].notna()
    rehearsal = ~excluded & found.sessions["session_kind"].eq("rehearsal")
    sessions = found.sessions[~excluded if rehearsals else ~(excluded | rehearsal)]
    if sessions.empty:
        none = "no sessions here; record one with touchbeam run"
        if found.other_rehearsals:
            none = (
                "nothing but rehearsals of another study.toml here "
                f"({found.other_rehearsals}); rehearse the present one with touchbeam run"
            )
        how = "add --rehearsals (in Python rehearsals=True) to include them"
        raise NothingToReport(f"nothing but rehearsals here; {how}" if rehearsal.any() else none)
    sessions = sessions.assign(participant=sessions["subject"])
    names = sessions[["participant", "session"]]
    answered = found.answered.join(names.assign(group=sessions["group"]), "session_id", "inner")
    trials, by_rule = excluded_by_rule(
        answered[answered["exclusion"].isna()], Exclusions() if rules is None else rules
    )
    gone = {out.participant for out in by_rule if out.trial is None}
    subjects = _once(name for name in sessions["participant"] if name not in gone)
    if not subjects:
        last = by_rule[-1]
        raise NothingToReport(
            f"the rules of [exclusions] leave nobody: {last.participant} has {last.why}"
        )
    conditions = _once(chain.from_iterable(sessions["conditions"]))
    cells = trials[is_scored(trials)].groupby(["participant", "condition"])["score"].mean()
    # A subject without any score keeps a row of missing ones, and is named under the table.
    means = cells.unstack().reindex(index=subjects, columns=conditions)
    table = ScoreTable(subjects=subjects, conditions=conditions, scores=means.to_numpy())
    kept = set(names.itertuples(index=False, name=None))
    trials_left_out = [
        out
        for out in found.exclusions
        if out.trial is not None and (out.participant, out.session) in kept
    ]
    touches = found.touches[found.touches["attempt_id"].isin(trials.index)]
    return StudyData(
        table=table,
        kinds=_once(sessions["session_kind"]),
        rehearsals_left_out=0 if rehearsals else int(rehearsal.sum()),
        unfinished=tuple(sessions["participant"][~sessions["session_completed"]]),
        unfinished_sessions=tuple(sessions["session"][~sessions["session_completed"]]),
        sessions_excluded=int(excluded.sum()),
        other_rehearsals=found.other_rehearsals,
        sessions_withdrawn=found.withdrawn,
        withdrawn_completed=found.withdrawn_completed,
        trials_excluded=len(trials_left_out),
        trials=trials,
        touches=touches.assign(place_m=found.places_m),
        forces={touch: found.forces[touch] for touch in touches.index if touch in found.forces},
        answers=_answers(found, names[names["participant"].isin(subjects)], trials),
        left_out=(
            *(out for out in found.exclusions if out.trial is None),
            *trials_left_out,
            *by_rule,
        ),
        incidents=tuple(it for it in found.incidents if (it.participant, it.session) in kept),
        recording=_recording(sessions),
        empty=empty_cells(table, trials, answered.drop(trials.index)),
        # With excluded trials, because they were felt and may carry over to the next.
        orders=_orders(found.answered, sessions),
        virtual={
            name: truth
            for name, truth in zip(sessions["participant"], sessions["virtual"], strict=True)
            # The column has NaN for people.
            if isinstance(truth, VirtualTruth) and name in subjects
        },
        lock=study_lock(found.decisions, sessions),
        groups=dict(sessions[["participant", "group"]].dropna().itertuples(index=False, name=None)),
    )


def _orders(answered: pd.DataFrame, sessions: pd.DataFrame) -> tuple[SessionOrder, ...]:
    # A published score has no slot, and its place in an order is not known.
    counting = sessions[["session", "slot", "group"]].dropna(subset="slot")
    known = answered.join(counting, on="session_id", how="inner")
    names = ("session_id", "session", "slot", "group", "trial_index", "condition")
    rows = sorted(zip(*(values(known[name]) for name in names), strict=True), key=itemgetter(0))
    orders = []
    for _, own in groupby(rows, key=itemgetter(0)):
        _, session, slot, group, trials, conditions = zip(*own, strict=True)
        of = {"session": session[0], "slot": slot[0], "group": group[0]}
        orders.append(SessionOrder(**of, trials=trials, conditions=conditions))
    return tuple(orders)


def _answers(found: Sessions, names: pd.DataFrame, trials: pd.DataFrame) -> pd.DataFrame:
    """Return the answers to the study's own questions in sessions and trials that count."""
    answers = found.answers.join(names, on="session_id", how="inner")
    of_trial = answers.join(trials[["trial_kind", "condition"]], on="attempt_id")
    # An answer about a block or a session has no trial that could be left out.
    return of_trial[of_trial["attempt_id"].isna() | of_trial["trial_kind"].notna()]


def _recording(sessions: pd.DataFrame) -> RecordedUnder:
    return RecordedUnder(
        versions=_once(
            ", ".join(f"{name} {number}" for name, number in versions.items())
            for versions in sessions["versions"]
            if versions
        ),
        seeds=_once(sessions["seed"].dropna()),
        studies=_once(sessions["study_sha256"].dropna()),
        sources=_once(sessions["imported_from"].dropna()),
        devices=_once(sessions["device"].dropna()),
    )


def _once(values: Iterable[Value]) -> tuple[Value, ...]:
    """Return each value once, in order of first appearance."""
    return tuple(dict.fromkeys(values))


def changed_journal(sessions: Sequence[str]) -> str:
    """Return what the results of a journal may be where the chains of `sessions` are broken."""
    return (
        "The journal was changed by other means than touchbeam, so that these may not be the "
        f"answers that were given. The chain of hashes is broken in {', '.join(sessions)}; "
        "touchbeam verify tells more."
    )
