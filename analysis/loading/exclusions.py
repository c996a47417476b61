"""The study's rules on who and what is left out, settled beforehand, applied to all alike."""

import pandas as pd

from analysis.loading.records import TEXT, Exclusion
from analysis.loading.sessions import is_scored
from protocol.study.rules import Exclusions


def excluded_by_rule(
    trials: pd.DataFrame, rules: Exclusions
) -> tuple[pd.DataFrame, tuple[Exclusion, ...]]:
    """Return the answered trials that the rules keep, and what they take out.

    Trials are judged first, by the time to the first answer; then participants, by the trials
    that are left to them.
    """
    timed = zip(trials["trial_kind"], trials["reaction_time_s"], strict=True)
    late = pd.Series([_reaction_broken(*one, rules) for one in timed], trials.index, TEXT)
    in_time, too_late = trials[late.isna()], trials[late.notna()]
    gone = _participants_broken(in_time, rules, trials["participant"].unique().tolist())
    left_out = [
        Exclusion(participant=participant, session=session, trial=index, by="rule", why=why)
        for participant, session, index, why in zip(
            *(too_late[name] for name in ("participant", "session", "trial_index")),
            late.dropna(),
            strict=True,
        )
    ]
    left_out += [
        Exclusion(participant=participant, by="rule", why=why)
        for participant, broken in gone.items()
        for why in broken
    ]
    return in_time[~in_time["participant"].isin(gone.keys())], tuple(left_out)


def _reaction_broken(kind: str, reaction_s: float, rules: Exclusions) -> str | None:
    """Describe the rule that a trial breaks by the time to its first answer."""
    if kind not in {"trial", "catch"}:
        return None
    if rules.min_reaction_s is not None and reaction_s < rules.min_reaction_s:
        return f"answered after {reaction_s:g} s, sooner than {rules.min_reaction_s:g} s"
    if rules.max_reaction_s is not None and reaction_s > rules.max_reaction_s:
        return f"answered after {reaction_s:g} s, later than {rules.max_reaction_s:g} s"
    return None


def _participants_broken(
    trials: pd.DataFrame, rules: Exclusions, participants: list[str]
) -> dict[str, list[str]]:
    """Describe the rules that each participant breaks, even one without any trial left."""
    scored, catch = is_scored(trials), trials["trial_kind"].eq("catch")
    counted = {
        "scored": scored,
        "missing": scored & trials["score"].isna(),
        "catches": catch,
        "alarms": catch & trials["agrees"].eq(False).fillna(False),
    }
    counts = pd.DataFrame(counted).groupby(trials["participant"]).sum()
    found = {
        who: _broken(rules, *own)
        for who, *own in counts.reindex(participants, fill_value=0).itertuples(name=None)
    }
    return {who: broken for who, broken in found.items() if broken}


def _broken(rules: Exclusions, scored: int, missing: int, catches: int, alarms: int) -> list[str]:
    """Describe the rules that one participant's numbers of trials break."""
    broken = []
    limit = rules.max_false_alarms
    if limit is not None and catches and alarms / catches > limit:
        broken.append(
            f"a change reported on {alarms} of {catches} catch trials, more than {limit:.0%}"
        )
    limit = rules.max_missing_scores
    if limit is not None and scored and missing / scored > limit:
        broken.append(f"{missing} of {scored} scores missing, more than {limit:.0%}")
    if rules.min_trials is not None and scored < rules.min_trials:
        broken.append(f"{scored} valid trials, fewer than {rules.min_trials}")
    return broken


def rules_in_words(rules: Exclusions) -> list[str]:
    """Return each rule that the study settled, as a reader is told it."""
    texts = {
        "max_false_alarms": "a participant who reported a change on more than {:.0%} of the catch "
        "trials is left out",
        "max_missing_scores": "a participant with more than {:.0%} of the scores missing is "
        "left out",
        "min_reaction_s": "a trial answered sooner than {:g} s is left out",
        "max_reaction_s": "a trial answered later than {:g} s is left out",
        "min_trials": "a participant with fewer than {} valid trials is left out",
    }
    settled = rules.model_dump(exclude_none=True)
    return [text.format(settled[name]) for name, text in texts.items() if name in settled]
