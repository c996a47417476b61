"""What every export is made from: the trials, the study's words, and facts its author gave."""

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from hashlib import sha256
from itertools import chain, count
from typing import Any, cast

import pandas as pd

from analysis.export.recordings import RecordedTouch, SessionKey, recorded_touches, session_key
from analysis.export.trial_table import (
    CONTRAST_COLUMNS,
    Frames,
    contrast_table,
    frames,
    participant_table,
)
from analysis.loading.sessions import Sessions, load_sessions
from analysis.loading.study_data import scale_of_scores
from analysis.loading.study_lock import default_rig, study_lock
from device.friction.calibration import NOMINAL, Calibration
from protocol.errors import BadInput, listed
from protocol.journal.events import StoredEvent
from protocol.study.columns import PARTICIPANT_COLUMNS, Column
from protocol.study.participant_texts import (
    language,
    rating_question,
    scale_in_words,
    study_codes,
    study_wording,
)
from protocol.study.rules import Publication, Rating
from protocol.study.study import Study
from protocol.study.track import AXIS_UNITS
from protocol.study_file.loading import scale_ends

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
    label_of: dict[str, str] = {}
    taken: set[str] = set()
    # Names that are labels already go first, so that they keep theirs.
    for name in sorted(distinct, key=lambda name: label(name) != name):
        wanted = label(name) or "s"
        free = chain([wanted], (f"{wanted}x{number}" for number in count(2)))
        label_of[name] = next(each for each in free if each.casefold() not in taken)
        taken.add(label_of[name].casefold())
    return {name: label_of[name] for name in distinct}


UNNAMED_TASK = "touch"
# Sorted keys, because the digest must not depend on the order in which they were stored.
_TOLD = json.JSONEncoder(sort_keys=True, allow_nan=False)
Chain = Sequence[StoredEvent]


_SESSION = ["participant", "session", "session_kind"]
"""The columns that identify a session."""


class NothingToExport(BadInput):
    """A study without the trials that were asked for; the message says what to do."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Dataset:
    """A study's tables with the study file that they belong to.

    A session in which no trial was begun is not in `tables`. `rig` is the study's calibration at
    present.
    `source_sha256` is the digest of all the events that they were read from, `broken_chains` are
    the sessions whose events are not as they were recorded.
    """

    study: Study
    tables: Frames
    rehearsals_left_out: int
    sessions_without_trials: int
    source_sha256: str
    touchbeam: str
    rig: Calibration = NOMINAL
    broken_chains: tuple[str, ...] = ()
    recorded: Mapping[SessionKey, tuple[RecordedTouch, ...]] = field(default_factory=dict)
    """What was recorded during touches; sessions without any are not there."""

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

    @property
    def sessions(self) -> pd.DataFrame:
        """The sessions, with the columns of `analysis.loading.records.SessionRow`."""
        return self.tables.kept

    @property
    def trials(self) -> pd.DataFrame:
        """The trials, with the columns of `protocol.study.columns`."""
        return self.tables.exported

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        return self.tables.columns

    @property
    def shared_columns(self) -> tuple[Column, ...]:
        """Those of them that a data set for others has."""
        return tuple(column for column in self.columns if not column.private)

    @cached_property
    def participants(self) -> pd.DataFrame:
        """A row per participant, with the answers that were given once."""
        return participant_table(self.sessions, self.tables.flat, self.tables.questions)

    @cached_property
    def contrasts(self) -> pd.DataFrame:
        """A row per trial and friction law, with the predicted contrast."""
        lock = None
        with suppress(BadInput):  # a registration that was changed holds nothing
            lock = study_lock(self.tables.found.decisions, self.sessions)
        rig = default_rig(lock, self.kinds, self.rig)
        return contrast_table(self.study, self.tables.found, self.tables.flat, rig)

    @property
    def contrast_columns(self) -> tuple[Column, ...]:
        # The kinds of trials of this study, tracks among them.
        kind = next(column for column in self.columns if column.name == "trial_kind")
        return tuple(kind if it.name == kind.name else it for it in CONTRAST_COLUMNS)

    @property
    def participant_columns(self) -> tuple[Column, ...]:
        known = {column.name: column for column in (*self.columns, *PARTICIPANT_COLUMNS)}
        return tuple(known[str(name)] for name in self.participants)

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """Which kinds of sessions there are, in order of appearance."""
        return tuple(self.sessions["session_kind"].unique())

    @property
    def published(self) -> bool:
        """Whether all scores were imported from tables: nobody was asked here, nothing touched."""
        return self.kinds == ("published",)

    @cached_property
    def conditions(self) -> tuple[str, ...]:
        """All conditions of the sessions, in order of appearance."""
        return tuple(dict.fromkeys(chain.from_iterable(self.sessions["conditions"])))

    @cached_property
    def several_sessions(self) -> bool:
        """Whether anybody has another session than the first."""
        return bool(self.sessions["session"].ne(1).any())

    @cached_property
    def subject_labels(self) -> dict[str, str]:
        """The label of each participant, by pseudonym; a rehearsal of that name is apart."""
        return labels(self.sessions["subject"])

    @property
    def people(self) -> int:
        """The number of people; one who was in a rehearsal, too, counts once."""
        return int(self.sessions["participant"].nunique())

    @property
    def trials_excluded(self) -> int:
        """The number of trials here that the analysis leaves out."""
        return int(self.tables.flat["excluded"].ne("no").sum())

    def entities(self, subject: str, session: int) -> list[str]:
        """Return the labels of a session in the names of BIDS files."""
        several = [f"ses-{session}"] if self.several_sessions else []
        return [f"sub-{self.subject_labels[subject]}", *several]

    def by_session(self) -> Iterator[tuple[tuple[str, int], pd.DataFrame]]:
        """Yield participant and number of each session, and its trials."""
        for name, trials in self.trials.groupby(_SESSION, sort=False):
            yield (self.subject_of[name], cast("SessionKey", name)[1]), trials

    def recorded_by_session(self) -> Iterator[tuple[tuple[str, int], tuple[RecordedTouch, ...]]]:
        """Yield participant and number of each session that recorded touches, and those."""
        for name, touches in self.recorded.items():
            if name in self.subject_of and touches:
                yield (self.subject_of[name], name[1]), touches

    @cached_property
    def subject_of(self) -> "dict[Any, str]":
        """The subject by `SessionKey`."""
        return self.sessions.set_index(_SESSION)["subject"].to_dict()

    def summary(self) -> str:
        """Return in one line what is here and what is not."""
        return (
            f"{counted(len(self.tables.flat), 'trial')} of "
            f"{counted(self.people, 'participant')} "
            f"({counted(self.trials_excluded, 'trial')} excluded, marked); left out: "
            f"{counted(self.rehearsals_left_out, 'rehearsal')}, "
            f"{counted(self.tables.found.withdrawn, 'withdrawn session')}"
        )

    @property
    def rating(self) -> Rating:
        """The scale of the scores."""
        return scale_of_scores(self.study, self.kinds)

    def meaning(self, column: Column) -> str:
        """Return what `column` holds; scores lie on this study's scale, and answer its question."""
        if column.name != "score":
            return column.description
        scale = column.description.format(scale=scale_in_words(self.study, self.rating))
        # Nobody knows what was asked for imported scores, and tracks alone ask for none.
        if self.published or not self.study.condition:
            return scale
        return f"{scale} Asked: “{rating_question(self.study)}”."

    def levels(self, column: Column) -> Mapping[str, str]:
        """Return what the words in `column` stand for; this study may have words of its own."""
        if column.name == "condition":
            return self.condition_levels()
        if column.name == "track":
            units = {axis: f", {unit}" * bool(unit) for axis, unit in AXIS_UNITS.items()}
            return {
                each.name: f"{each.task}, {each.method}; levels of {each.axis}{units[each.axis]}"
                for each in self.study.track
            }
        if column.name == "language":
            return {code: language(self.study, code).name for code in study_codes(self.study)}
        return column.levels

    def condition_levels(self) -> dict[str, str]:
        """Return what each condition asks, as far as the study file still has it."""
        asked = {
            condition.name: f"asks about {condition.question}; expected: {condition.expected}"
            if condition.question
            else "scored at once, without a question"
            for condition in self.study.condition
        }
        if self.published:
            return dict.fromkeys(self.conditions, "a condition of the imported table")
        return {name: asked.get(name, "a parameter that changes") for name in self.conditions}

    def description(self) -> str:
        """Return what was done, in two or three sentences that hold for every study."""
        conditions = listed(self.conditions)
        # The files that imported scores come from, with their digests.
        imported = "; ".join(self.sessions["imported_from"].dropna().unique())
        tracks = listed(track.name for track in self.study.track)
        scale = f"from {self.rating.minimum} to {self.rating.maximum}"
        if self.published:
            return (
                f"Scores, {scale}, of subjects under the conditions {conditions}, imported from "
                f"{imported}. No session was run: how the scores were given is not known."
            )
        others = imported and f" Sessions of the kind `published` are imported from {imported}."
        asked = (
            f" Thresholds are measured by tracks ({tracks}), in each of which a question is asked "
            "again and again at levels that follow from the answers."
        )
        of = f"Study {self.study.study.name!r} of a touch device whose friction is changed by"
        if tracks and not self.conditions:
            return f"{of} vibration.{asked}"
        trial = (
            f"In each trial the participant touches under a condition ({conditions}) and scores "
            "what was felt"
            if self.study.absolute
            else f"In each trial a parameter changes ({conditions}), the participant touches and "
            "says what changed, and scores how strong the effect is"
        )
        return f"{of} vibration. {trial}, {scale}.{others}{asked if tracks else ''}"

    def instructions(self, code: str | None) -> str | None:
        """Return what participants read at first in a language; None if nobody knows."""
        if code not in study_codes(self.study):
            return None
        return study_wording(self.study, code).texts.get("welcome")


_WHICH = {
    False: "here; add --rehearsals to include them",
    True: "on another scale than that of study.toml here; restore it, or rehearse again",
}


def _on_one_scale(found: Sessions, rating: Rating) -> Sessions:
    """Return `found` without rehearsals on another scale: one column cannot hold scores of both."""
    texts = found.attempts.groupby("session_id")["study_text"].last().dropna()
    ends = {text: scale_ends(text) for text in texts.unique()}
    off = texts[texts.map(ends).isin(set(ends.values()) - {None, (rating.minimum, rating.maximum)})]
    other = found.sessions["session_kind"].eq("rehearsal") & found.sessions.index.isin(off.index)
    return replace(found, sessions=found.sessions[~other], other_rehearsals=int(other.sum()))


def dataset(
    chains: Iterable[Chain],
    study: Study,
    touchbeam: str,
    *,
    rehearsals: bool,
    rig: Calibration = NOMINAL,
    broken_chains: Iterable[str] = (),
) -> Dataset:
    """Return what is to be exported of the sessions in `chains`.

    Args:
        chains: the events of each session, the study's own chain among them or not, read one
            session at a time.
        study: the study file as it is now.
        touchbeam: the version that exports.
        rehearsals: whether dry runs are wanted too.
        rig: as calibrated at present.
        broken_chains: the sessions whose chain of hashes is broken; known once `chains` are read.

    Raises:
        NothingToExport: there is no trial.
    """
    digest = sha256()
    recorded: dict[SessionKey, tuple[RecordedTouch, ...]] = {}
    sessions = load_sessions(_recorded(_digested(chains, digest), recorded))
    sessions = _on_one_scale(sessions, study.rating)
    tables = frames(study, sessions, rehearsals=rehearsals)
    found, kept = tables.found, tables.kept
    left_out = len(found.sessions) - len(kept) + found.other_rehearsals
    begun = kept.index.isin(found.attempts["session_id"])
    if not begun.any():
        raise NothingToExport(
            # The message names the way out only where there is one.
            f"nothing but rehearsals {_WHICH[rehearsals]}"
            if left_out
            else "no trials here: nobody has begun one, or all have withdrawn"
        )
    return Dataset(
        study=study,
        tables=replace(tables, kept=kept[begun]),
        rehearsals_left_out=left_out,
        sessions_without_trials=int((~begun).sum()),
        source_sha256=digest.hexdigest(),
        touchbeam=touchbeam,
        rig=rig,
        broken_chains=tuple(broken_chains),
        recorded=recorded,
    )


def counted(number: int, what: str) -> str:
    """Return a number of things in words, such as `1 trial`."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def _recorded(
    chains: Iterable[Chain], found: dict[SessionKey, tuple[RecordedTouch, ...]]
) -> Iterator[Chain]:
    """Yield `chains` one by one; put what each recorded into `found`."""
    for events in chains:
        if key := session_key(events):
            found[key] = recorded_touches(events)
        yield events


def _digested(chains: Iterable[Chain], digest: Any) -> Iterator[Chain]:
    """Yield `chains` one by one; feed the JSON list of all their events to `digest`."""
    # The whole is the digest of one JSON list, fed piece by piece, because it need not fit into the
    # memory.
    mark = "["
    for events in chains:
        if events:
            told = [
                [event.tag, event.utc.isoformat(), event.monotonic_s, dict(event.payload)]
                for event in events
            ]
            # The list of a session at once: setting the encoder up takes longer than an event.
            digest.update(f"{mark}{_TOLD.encode(told)[1:-1]}".encode())
            mark = ", "
        yield events
    digest.update(b"]" if mark == ", " else b"[]")


def known(facts: Mapping[str, Any]) -> dict[str, Any]:
    # What nobody gave is left out, so that a validator can say that it is missing.
    return {name: value for name, value in facts.items() if value}
