"""The study's rules on who and what is left out, settled beforehand, applied to all alike."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.loading.sessions import TrialRow
from protocol.study.design import Exclusions


@dataclass(frozen=True, kw_only=True)
class Exclusion:
    """A participant, a session or a trial that the report leaves out, by whom or what, and why."""

    participant: str
    by: str
    why: str
    session: int | None = None
    trial: int | None = None


def excluded_by_rule(
    rows: Sequence[TrialRow], rules: Exclusions
) -> tuple[tuple[TrialRow, ...], tuple[Exclusion, ...]]:
    """Return the trials that the rules keep, and what they take out.

    Trials are judged first, by the time to the first answer; then participants, by the trials
    that are left to them.
    """
    late = {_key(row): why for row in rows if (why := _reaction_broken(row, rules))}
    in_time = [row for row in rows if _key(row) not in late]
    gone = {
        participant: found
        for participant, own in _by_participant(in_time, rows)
        if (found := _participant_broken(own, rules))
    }
    left_out = [
        Exclusion(
            participant=row.participant,
            session=row.session,
            trial=row.index,
            by="rule",
            why=late[_key(row)],
        )
        for row in rows
        if _key(row) in late
    ]
    left_out += [
        Exclusion(participant=participant, by="rule", why=why)
        for participant, broken in gone.items()
        for why in broken
    ]
    return tuple(row for row in in_time if row.participant not in gone), tuple(left_out)


def _key(row: TrialRow) -> tuple[str, int, int]:
    return row.participant, row.session, row.index


def _by_participant(
    kept: Iterable[TrialRow], everyone: Iterable[TrialRow]
) -> Iterable[tuple[str, list[TrialRow]]]:
    own: dict[str, list[TrialRow]] = {row.participant: [] for row in everyone}
    for row in kept:
        own[row.participant].append(row)
    return own.items()


def _reaction_broken(row: TrialRow, rules: Exclusions) -> str | None:
    if row.reaction_s is None or row.kind not in {"trial", "catch"}:
        return None
    if rules.min_reaction_s is not None and row.reaction_s < rules.min_reaction_s:
        return f"answered after {row.reaction_s:g} s, sooner than {rules.min_reaction_s:g} s"
    if rules.max_reaction_s is not None and row.reaction_s > rules.max_reaction_s:
        return f"answered after {row.reaction_s:g} s, later than {rules.max_reaction_s:g} s"
    return None


def _participant_broken(rows: Sequence[TrialRow], rules: Exclusions) -> list[str]:
    """Which rules a participant breaks, in words."""
    catches = [row.agrees is False for row in rows if row.kind == "catch"]
    missing = [bool(np.isnan(row.score)) for row in rows if row.is_scored]
    broken = []
    if rules.max_false_alarms is not None and catches and np.mean(catches) > rules.max_false_alarms:
        broken.append(
            f"a change reported on {sum(catches)} of {len(catches)} catch trials, "
            f"more than {rules.max_false_alarms:.0%}"
        )
    limit = rules.max_missing_scores
    if limit is not None and missing and np.mean(missing) > limit:
        broken.append(f"{sum(missing)} of {len(missing)} scores missing, more than {limit:.0%}")
    if rules.min_trials is not None and len(missing) < rules.min_trials:
        broken.append(f"{len(missing)} valid trials, fewer than {rules.min_trials}")
    return broken


def rules_in_words(rules: Exclusions) -> list[str]:
    """Return each rule that the study settled, as a reader is told it."""
    texts = {
        "max_false_alarms": "a participant who reported a change on more than {:.0%} of the catch "
        "trials is left out",
        "max_missing_scores": "a participant of whose scores more than {:.0%} are missing is left "
        "out",
        "min_reaction_s": "a trial answered sooner than {:g} s is left out",
        "max_reaction_s": "a trial answered later than {:g} s is left out",
        "min_trials": "a participant with fewer than {} valid trials is left out",
    }
    settled = rules.model_dump(exclude_none=True)
    return [text.format(settled[name]) for name, text in texts.items() if name in settled]
