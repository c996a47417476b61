"""The study's rules on who and what is left out, settled beforehand, applied to all alike."""

from collections.abc import Callable, Mapping
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd

from analysis.estimates import BoolArray, FloatArray, IntArray
from analysis.loading.records import Exclusion
from analysis.loading.sessions import is_scored
from protocol.study.rules import Exclusions

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
        "a participant with more than {:.0%} of the planned trials without an answer is left out",
        "{missing} of {planned} planned trials without an answer, more than {limit:.0%}",
        lambda n, limit: n["missing"] / np.maximum(n["planned"], 1) > limit,
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
OLDER_RULES = {
    **RULES,
    "max_missing_scores": RULES["max_missing_scores"]._replace(
        words="a participant with more than {:.0%} of the scores missing is left out",
        why="{missing} of {planned} scores missing, more than {limit:.0%}",
    ),
}
"""The rules of studies of version 1, where a score that was not asked for is a missing one, too."""


def broken_rules(rules: Exclusions, of: Judged, numbers: Numbers) -> dict[str, BoolArray]:
    """Return by the name of each rule that the study settled which trials or people break it.

    Trials are judged first, with the time to the first answer as `reaction_s` (NaN breaks no rule);
    then people, by how many trials are left to them: `scored`, `catches`, and `alarms` among these;
    and by how many were `planned` and are `missing`, as they have no answer.
    """
    settled = rules.model_dump(exclude_none=True)
    return {
        name: rule.breaks(numbers, settled[name])
        for name, rule in RULES.items()
        if rule.of == of and name in settled
    }


class Kept(NamedTuple):
    """The answered trials that the rules keep, what they take out, and whom for not noticing."""

    trials: pd.DataFrame
    left_out: tuple[Exclusion, ...]
    unnoticing: tuple[str, ...]


def excluded_by_rule(
    trials: pd.DataFrame, planned: "pd.Series[int]", rules: Exclusions, *, older: bool
) -> Kept:
    """Return what the rules keep of the answered trials.

    Args:
        trials: rows of `Sessions.answered` with `participant`, none that the operator excluded.
        planned: by participant, how many trials of conditions were planned, none of those either.
        rules: the study's.
        older: whether the rules are those of version 1 (`OLDER_RULES`).
    """
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
    if older:  # version 1 judged nobody who had answered nothing
        planned = planned.loc[trials["participant"].unique()]
    counts = _counts(trials, in_time, planned)
    by_today = _broken_by_people(counts, rules, RULES)
    broken = _broken_by_people(_of_version_1(counts), rules, OLDER_RULES) if older else by_today
    gone = [
        Exclusion(participant=participant, by="rule", why=why)
        for participant, reasons in broken.items()
        for why in reasons
    ]
    kept = in_time[~in_time["participant"].isin([out.participant for out in gone])]
    unnoticing = tuple(who for who, reasons in broken.items() if reasons and not by_today[who])
    return Kept(kept, (*left_out, *gone), unnoticing)


def _counts(trials: pd.DataFrame, in_time: pd.DataFrame, planned: "pd.Series[int]") -> pd.DataFrame:
    """Return what the rules on people judge, a row per participant of `planned`.

    `in_time` are those of `trials` that no rule on trials takes out.
    """
    scored, catch = is_scored(in_time), in_time["trial_kind"].eq("catch")
    of_rules = {
        "scored": scored,
        "unscored": scored & in_time["score"].isna(),
        "catches": catch,
        # A catch trial without an answer is no false alarm.
        "alarms": catch & in_time["agrees"].eq(False).fillna(False),
    }
    answered = is_scored(trials)
    # What was answered otherwise than expected is not missing, whether a score was asked for or no.
    otherwise = trials["agrees"].eq(False).fillna(False)
    blank = answered & trials["score"].isna() & ~otherwise
    counts, of_answers = (
        # Even a participant without any trial left is judged.
        pd.DataFrame(flags).groupby(names).sum().reindex(planned.index, fill_value=0)
        for flags, names in (
            (of_rules, in_time["participant"]),
            ({"given": answered, "blank": blank}, trials["participant"]),
        )
    )
    missing = planned - of_answers["given"] + of_answers["blank"]
    return counts.assign(planned=planned, missing=missing)


def _of_version_1(counts: pd.DataFrame) -> pd.DataFrame:
    """Return the counts as version 1 had them: of answered trials, each without a score missing."""
    return counts.assign(planned=counts["scored"], missing=counts["unscored"])


def _broken_by_people(
    counts: pd.DataFrame, rules: Exclusions, named: Mapping[str, Rule]
) -> dict[str, list[str]]:
    """Return the rules that each participant breaks, in words."""
    numbers = {str(name): counts[name].to_numpy() for name in counts}
    reasons = _told(rules, "participant", numbers, named)
    return dict(zip(counts.index, reasons, strict=True))


def _told(
    rules: Exclusions, of: Judged, numbers: Numbers, named: Mapping[str, Rule] = RULES
) -> list[list[str]]:
    """Describe the rules that each trial or participant breaks."""
    broken = broken_rules(rules, of, numbers)
    rows = (dict(zip(numbers, row, strict=True)) for row in zip(*numbers.values(), strict=True))
    return [
        [
            named[name].why.format(**row, limit=getattr(rules, name))
            for name, breaks in broken.items()
            if breaks[number]
        ]
        for number, row in enumerate(rows)
    ]


def rules_in_words(rules: Exclusions, *, older: bool = False) -> list[str]:
    """Return each rule that the study settled, as a reader is told it; of version 1 if `older`."""
    settled = rules.model_dump(exclude_none=True)
    named = OLDER_RULES if older else RULES
    return [rule.words.format(settled[name]) for name, rule in named.items() if name in settled]
