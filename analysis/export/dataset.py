"""What every export is made from: the trials, the study's words, and facts its author gave."""

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256

from analysis.cells import Cell
from analysis.loading.records import TrialRecord, Trials
from analysis.loading.sessions import Recorded, trials
from protocol.study.design import Publication
from protocol.study.study import Study
from protocol.study.texts import language, study_codes, study_wording

_OTHER = re.compile(r"[^0-9A-Za-z]")


def label(text: str) -> str:
    """Return what remains of `text` when all but ASCII letters and digits is left out.

    >>> label("P-01 触觉")
    'P01'
    """
    return _OTHER.sub("", text)


def labels(names: Iterable[str]) -> dict[str, str]:
    """Return a label for each of `names`, no two alike, not even on disks that ignore case.

    A name that is a label already keeps it; where several come to the same, the later ones get
    `x2`, `x3` and so on; a name without letters or digits becomes `s`.

    >>> labels(["P-01", "P01", "p_01", "受试者"])
    {'P-01': 'P01x2', 'P01': 'P01', 'p_01': 'p01x3', '受试者': 's'}
    """
    distinct = list(dict.fromkeys(names))
    found: dict[str, str] = {}
    taken: set[str] = set()
    for name in sorted(distinct, key=lambda name: label(name) != name):
        found[name] = _free(label(name) or "s", taken)
        taken.add(found[name].casefold())
    return {name: found[name] for name in distinct}


def _free(wanted: str, taken: set[str]) -> str:
    candidate, number = wanted, 1
    while candidate.casefold() in taken:
        number += 1
        candidate = f"{wanted}x{number}"
    return candidate


UNNAMED_TASK = "touch"


@dataclass(frozen=True, kw_only=True)
class Dataset:
    """A study's trials with the study file that they belong to.

    `source_sha256` is the digest of all the events that they were read from, `broken_chains` are
    the sessions whose events are not as they were recorded.
    """

    study: Study
    trials: Trials
    source_sha256: str
    touchbeam: str
    broken_chains: tuple[str, ...] = ()

    @property
    def facts(self) -> Publication:
        """What only the study's author knows."""
        return self.study.publication

    @property
    def title(self) -> str:
        """The author's title, else the study's name."""
        return self.facts.title or self.study.study.name

    @property
    def task(self) -> str:
        """What the task is called in the names of files."""
        return label(self.study.study.name) or UNNAMED_TASK

    @property
    def task_name(self) -> str:
        """What the task is called; its letters and digits are those of `task`."""
        return self.study.study.name if label(self.study.study.name) else UNNAMED_TASK

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """Which kinds of sessions there are, in order of appearance."""
        return _once(trial.session.kind for trial in self.trials.trials)

    @property
    def published(self) -> bool:
        """Whether all scores come from published tables: nobody was asked, nothing was touched."""
        return self.kinds == ("published",)

    @cached_property
    def sources(self) -> tuple[str, ...]:
        """The files that published scores come from, with their digests."""
        opened = (trial.session.opened for trial in self.trials.trials)
        return _once(
            f"{table['source']} (SHA-256 {table['source_sha256']})"
            for table in opened
            if "source" in table
        )

    @cached_property
    def conditions(self) -> tuple[str, ...]:
        """All conditions of the sessions, in order of appearance."""
        return _once(name for trial in self.trials.trials for name in trial.session.conditions)

    @cached_property
    def several_sessions(self) -> bool:
        """Whether anybody has another session than the first."""
        return any(trial.session.number != 1 for trial in self.trials.trials)

    def subject_labels(self) -> dict[str, str]:
        """Return the label of each participant, by pseudonym."""
        return labels(trial.session.participant for trial in self.trials.trials)

    def levels(self, column: "Column") -> Mapping[str, str]:
        """Return what the words in `column` stand for; this study may have words of its own."""
        if column.name == "condition":
            return self.condition_levels()
        if column.name == "language":
            return {code: language(self.study, code).name for code in study_codes(self.study)}
        return column.levels

    def condition_levels(self) -> dict[str, str]:
        """Return what each condition asks, as far as the study file still has it."""
        asked = {
            condition.name: f"asks about {condition.question}; expected: {condition.expected}"
            for condition in self.study.condition
        }
        if self.published:
            return dict.fromkeys(self.conditions, "a condition of the published table")
        return {name: asked.get(name, "a parameter that changes") for name in self.conditions}

    def description(self) -> str:
        """Return what was done, in two or three sentences that hold for every study."""
        conditions, imported = ", ".join(self.conditions), "; ".join(self.sources)
        if self.published:
            return (
                f"Published scores, from 0 to 10, of subjects under the conditions {conditions}, "
                f"imported from {imported}. No session was run: how the scores were given is not "
                "known."
            )
        return (
            f"Study {self.study.study.name!r} of a touch device whose friction is changed by "
            f"vibration. In each trial a parameter changes ({conditions}), the "
            "participant touches and says what changed, and scores how strong the effect is, "
            "from 0 to 10."
            + (
                f" Sessions of the kind `published` are imported from {imported}."
                if imported
                else ""
            )
        )

    def instructions(self, code: str | None) -> str | None:
        """Return what participants read at first in a language; None if nobody knows."""
        if code not in study_codes(self.study):
            return None
        return study_wording(self.study, code).texts.get("welcome")


def dataset(
    chains: Iterable[Sequence[Recorded]],
    study: Study,
    touchbeam: str,
    *,
    rehearsals: bool,
    broken_chains: Iterable[str] = (),
) -> Dataset:
    """Return what is to be exported of the sessions in `chains`.

    Args:
        chains: the events of each session, the study's own chain among them or not.
        study: the study file as it is now.
        touchbeam: the version that exports.
        rehearsals: whether dry runs are wanted too.
        broken_chains: the sessions whose chain of hashes is broken.

    Raises:
        NothingToExport: there is no trial.
    """
    sessions = list(chains)
    return Dataset(
        study=study,
        trials=trials(sessions, rehearsals=rehearsals),
        source_sha256=_digest(sessions),
        touchbeam=touchbeam,
        broken_chains=tuple(broken_chains),
    )


def language_of(rows: Sequence[TrialRecord]) -> str | None:
    """Return the language of a session; None for a published one."""
    found: str | None = rows[0].session.opened.get("language")
    return found


def _digest(chains: Iterable[Sequence[Recorded]]) -> str:
    events = [
        [event.tag, event.utc.isoformat(), event.monotonic_s, dict(event.payload)]
        for chain in chains
        for event in chain
    ]
    return sha256(json.dumps(events, sort_keys=True, allow_nan=False).encode()).hexdigest()


def _once(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(names))


@dataclass(frozen=True, kw_only=True)
class Column:
    """One column. A column `per_touch` lists a value for each touch of the trial."""

    name: str
    description: str
    of: Callable[[TrialRecord], Cell]
    unit: str | None = None
    levels: Mapping[str, str] = field(default_factory=dict)
    per_touch: bool = False


YES_NO = {"true": "yes", "false": "no"}
