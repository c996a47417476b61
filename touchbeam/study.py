"""A study's data, as everything that reads them composes them: loading, tables, the report."""

import os
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from touchbeam.model import predicted_frame

if TYPE_CHECKING:
    import pandas as pd

    from analysis.export.trial_table import Frames
    from analysis.kept import Kept
    from analysis.loading.sessions import Sessions
    from analysis.loading.study_data import StudyData
    from analysis.report.report import Report
    from device.beam.eq15 import Overlap
    from device.friction.scenes import Calibration
    from protocol.journal.events import StoredEvent
    from protocol.study.study import Study as StudyFile
    from runner.study.folder import StudyFolder

    Chains = Iterable[Sequence[StoredEvent]]


def load(folder: "str | os.PathLike[str]", *, rehearsals: bool = False) -> "Study":
    """Return the study in `folder` with everything recorded so far; of rehearsals too if asked for.

    A journal that was modified outside touchbeam gives a warning.

    Raises:
        ValueError: there is no study or nothing is recorded yet; the message says what to do.
    """
    # Sums by several threads may differ in the last digit; numpy reads this when it is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from analysis.loading.study_data import changed_journal
    from runner.study.folder import StudyFolder

    study = read_study(StudyFolder(path=Path(folder)), rehearsals=rehearsals)
    if study.broken:
        # `stacklevel=2` makes the warning name the caller's line instead of this one.
        warnings.warn(changed_journal(study.broken), stacklevel=2)
    return study


def read_study(
    folder: "StudyFolder",
    *,
    rehearsals: bool,
    followed: "Callable[[Chains, int], Chains]" = lambda chains, _: chains,
) -> "Study":
    """Return the study as `load` does; `followed` gets the chains and how many there are."""
    from analysis.kept import Kept
    from analysis.loading.kept_sessions import KeptSessions, kept_sessions
    from analysis.loading.sessions import load_sessions
    from runner.journal.opening import read_journal
    from runner.journal.verification import readable_chains
    from runner.study.kept_files import code_version, journal_digest, kept_files

    path = folder.existing_journal()
    text, file = folder.text(), folder.study()
    with read_journal(path) as journal:
        shelf = kept_files(journal)
        withdrawals = journal.withdrawals()
    # Not while it is open here, when it has a log; and what is not kept needs no name.
    digest = journal_digest(path) if shelf else ""

    broken: list[str] = []
    loaded: list[Sessions] = []

    def read() -> "Sessions":
        with read_journal(folder.journal) as journal:
            readable = readable_chains(journal, broken, rehearsals=rehearsals)
            chains = followed(readable, len(journal.sessions()))
            loaded.append(load_sessions(chains))
        return loaded[0]

    @cache
    def unchanged() -> bool:
        return journal_digest(folder.journal) == digest

    if shelf is None:
        recorded = read()
    else:
        # Not the one of the report, which would hold the tables for as long.
        found = Kept(shelf, code_version()).made(
            lambda: kept_sessions(read(), broken),
            KeptSessions,
            digest,
            rehearsals,
            worth=lambda _: unchanged(),
        )
        recorded, broken = loaded[0] if loaded else found.sessions(), list(found.broken)
    return Study(
        folder=folder,
        file=file,
        recorded=recorded,
        rehearsals=rehearsals,
        broken=tuple(broken),
        # What a session added meanwhile is in the tables or not: no digest tells.
        _read=(digest if shelf and (not loaded or unchanged()) else "", text),
        _withdrawals=withdrawals,
    )


# Without `eq`, because comparing data frames gives a frame and no truth value.
@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """A study and what was recorded when it was loaded; `load` makes one.

    Its tables are made when they are first asked for. `columns` gives the meaning and the unit of
    each of their columns. Excluded trials and sessions are in the tables, flagged; only `scores`
    and `contrasts` leave them out, and rehearsals of another study file, as the report does.
    Withdrawn participants are not there.
    """

    folder: "StudyFolder"
    file: "StudyFile"
    recorded: "Sessions"
    rehearsals: bool
    broken: tuple[str, ...]
    _read: tuple[str, str]
    """The digest of the journal and the text of the study, as they were loaded."""
    _withdrawals: int
    """How many sessions had been withdrawn when it was loaded."""

    def __repr__(self) -> str:
        count = len(self.sessions)
        return f"<touchbeam.Study {self.folder.path}: {count} session{'s' * (count != 1)}>"

    @cached_property
    def _rig(self) -> "Calibration":
        """The rig as a sliding experiment calibrated it."""
        from runner.study.calibration import fitted_calibration

        return fitted_calibration(self.folder.path)

    @cached_property
    def _frames(self) -> "Frames":
        from analysis.export.trial_table import frames

        return frames(self.file, self.recorded, rehearsals=self.rehearsals)

    @cached_property
    def _counted(self) -> "StudyData":
        from analysis.loading.study_data import study_data

        rules = self.file.exclusions
        return study_data(reported(self), rehearsals=self.rehearsals, rules=rules)

    @property
    def participants(self) -> "pd.DataFrame":
        """A row per participant: sessions, and answers given once, such as age or handedness."""
        return self._frames.participants

    @property
    def sessions(self) -> "pd.DataFrame":
        """A row per session: participant, language, device, what the operator noted."""
        return self._frames.sessions

    @property
    def trials(self) -> "pd.DataFrame":
        """A row per trial that was begun: its plan, answer, score and course."""
        return self._frames.trials

    @property
    def touches(self) -> "pd.DataFrame":
        """A row per touch: as planned, commanded, read back and judged."""
        return self._frames.touches

    def traces(
        self,
        participant: str | None = None,
        trial: int | None = None,
        *,
        session: int | None = None,
        touch: int | None = None,
    ) -> "pd.DataFrame":
        """Return time, force and place of the finger, a row per sample.

        All touches' samples, or those of one participant, trial (its `trial_index`), session or
        touch (from 0).
        """
        columns = ("participant", "session", "trial_index", "touch")
        traces = self._frames.traces
        for column, value in zip(columns, (participant, session, trial, touch), strict=True):
            if value is not None:
                traces = traces[traces[column].eq(value)]
        return traces.reset_index(drop=True)

    @cached_property
    def scores(self) -> "pd.DataFrame":
        """Mean scores, a row per participant and a column per condition, as Table 4 takes them."""
        import pandas as pd

        table = self._counted.table
        subjects = pd.Index(table.subjects, name="participant")
        return pd.DataFrame(
            table.scores, index=subjects, columns=pd.Index(table.conditions, name="condition")
        )

    @cached_property
    def contrasts(self) -> "pd.DataFrame":
        """The contrast of friction that each law predicts, a row per trial that counts.

        Positive where the trial changes friction as expected; missing where nothing is predicted.
        Measured force, place and drive are taken where they are known (`touch_measured`). The
        contrast that was measured, and its error, follow where friction was recorded. All are the
        numbers of the report.
        """
        from analysis.felt.measured_statistics import measured_trials
        from analysis.loading.study_lock import default_rig
        from analysis.trials.contrasts import trial_contrasts

        counted = self._counted
        rig = default_rig(counted.lock, counted.kinds, self._rig)
        found = trial_contrasts(self.file, counted.trials, counted.touches, rig)
        named = counted.trials[["participant", "session", "trial_index", "condition", "score"]]
        felt: dict[str, Any] = dict.fromkeys(
            ("measured_contrast", "measured_contrast_error"), float("nan")
        )
        if counted.forces:
            own = measured_trials(self.file, counted.trials, counted.touches, counted.forces)
            felt = {"measured_contrast": own.value, "measured_contrast_error": own.error}
        predicted = named.assign(touch_measured=found.measured, **found.by_law, **felt)
        return predicted.reset_index(drop=True)

    @property
    def columns(self) -> "pd.DataFrame":
        """Meaning, unit and levels of each column, a row per table and column."""
        from protocol.study.participant_texts import scale_in_words

        return self._frames.described(scale_in_words(self.file, self.file.rating))

    def track(self, name: str, answers: "Sequence[bool | int]") -> "dict[str, Any]":
        """Return what a track of the study asks after `answers`, as `touchbeam.track` does."""
        from touchbeam.tracks import track_of

        return track_of(self.file, self._rig, name, answers)

    def plan(
        self, participant: str, session: int = 1, *, group: str | None = None
    ) -> "pd.DataFrame":
        """Return the planned trials of a participant's session, a row each.

        As recorded, if the session was begun; else as `touchbeam run` would plan it now. With
        `rehearsals`, a rehearsal's if there is no session of that name. `group` is needed of a
        participant who has none yet, unless the study assigns groups at random.

        Raises:
            ValueError: no plan is known: the participant has withdrawn, or the scores are imported.
                Or the registration in the folder is not the journal's, or the group is not the
                participant's.
        """
        from analysis.export.trial_table import plan_frame
        from protocol.plan.plan import plan
        from protocol.registration.registration import locked
        from runner.journal import cohort, names, opening
        from runner.study.registered import registration_of, require_registered

        with opening.read_journal(self.folder.existing_journal()) as journal:
            named = names.existing_chain if self.rehearsals else names.chain_name
            chain = named(journal, participant, session, rehearsal=False)
            who = cohort.Arrival(cohort.states(journal), participant, "participant", chain)
            if chain in journal.sessions():
                if group is not None:
                    who.group(self.file, group, by="the argument group")
                return plan_frame(cohort.planned_trials(journal, chain))
            registered = registration_of(self.folder.path)
            require_registered(journal, registered, rehearsal=False)
            # A registration's digest seeds the plan of the sessions that run under it.
            file = locked(self.file, registered.digest if registered else None)
            group = who.group(file, group, by="the argument group")
            slot = who.slot(group)
        return plan_frame(plan(file.of_group(group), slot, session).trials)

    def report(
        self,
        out: "str | os.PathLike[str] | None" = None,
        *,
        sections: str | Sequence[str] | None = None,
        figures: bool = False,
    ) -> Path:
        """Write the report that `touchbeam report` writes; return the path of its page.

        Args:
            out: its folder; by default `report` in the study's folder.
            sections: one or more of the page, by name; by default those of `report.toml`, or all.
            figures: whether each figure is also written as files.

        Raises:
            ValueError: there is no section of that name.
        """
        from runner.study.files import write_files

        # A text is a sequence, too: of its letters.
        named = (sections,) if isinstance(sections, str) else sections
        names = None if named is None else tuple(named)
        asked = asked_report(
            self.folder,
            rehearsals=self.rehearsals,
            named=names,
            read=self._read,
            withdrawals=self._withdrawals,
        )

        def found() -> Found:
            return self.file, self._counted, self.broken

        made = asked.written(found, figures=figures)
        folder = self.folder.report if out is None else Path(out)
        # A folder that the user names may be a link; one within the study may come from a stranger.
        own = self.folder.path if out is None else None
        write_files(
            made.files, folder, made.figure_files, study=own, confirm=asked.require_no_withdrawal
        )
        return folder / "report.html"

    def predict(
        self,
        scenes: "pd.DataFrame",
        *,
        law: str = "consistent",
        rung: str = "auto",
        tolerance: float = 0.01,
        eq15_overlap: "Overlap" = "first",
    ) -> "pd.DataFrame":
        """Return what `touchbeam.predict` does, on the study's rig as calibrated.

        The study's touch fills missing cells.
        """
        from analysis.model.predict import study_defaults, study_rig

        options = {"law": law, "rung": rung, "tolerance": tolerance, "eq15_overlap": eq15_overlap}
        rig = study_rig(self.file, self._rig)
        return predicted_frame(scenes, study_defaults(self.file, rig), {**options, "rig": rig})


def reported(study: Study) -> "Sessions":
    """Return what is recorded, of rehearsals those of the study file as it was loaded."""
    from analysis.loading.sessions import rehearsed_with
    from protocol.study_file.loading import text_digest

    if not study.rehearsals:
        return study.recorded
    return rehearsed_with(study.recorded, text_digest(study._read[1]))


Found = tuple["StudyFile", "StudyData", Sequence[str]]
"""A study file, the data that count, and the broken chains."""

_MOST_KEPT = 2**25
"""Bytes of a report that is kept whole; of a larger one the tests, fits and figures are kept."""


@dataclass(frozen=True, kw_only=True)
class Written:
    """The files of a report, by relative path, and what the command says of it.

    `figure_files` are the paths of all figures that a report may have.
    """

    files: Mapping[str, bytes]
    figure_files: tuple[str, ...]
    table4: tuple[tuple[str, ...], ...]
    lines: tuple[str, ...]
    broken: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class AskedReport:
    """What a report depends on besides its data, and what is kept of such reports.

    The commands, the crate and Python programs get theirs here. Its page shows the sections
    `named`; without them those of `report.toml`, or all.
    """

    folder: "StudyFolder"
    journal: str
    text: str
    rehearsals: bool
    named: tuple[str, ...] | None
    shown: tuple[str, ...] | None
    unlocked: str
    rig: "Calibration"
    keep: "Kept"
    withdrawals: int

    def made(self, file: "StudyFile", found: "StudyData", broken: Sequence[str]) -> "Report":
        """Return the report on `found`, data of the study."""
        from analysis.report.findings import Origin
        from analysis.report.report import report
        from protocol.errors import typed_as
        from protocol.study_file.loading import text_digest

        options = ["--rehearsals"] * self.rehearsals
        options += [] if self.named is None else ["--sections", ",".join(self.named)]
        origin = Origin(
            # Quoted, because a folder's name may have spaces and the line is to be run again.
            command=" ".join(
                map(typed_as, ["touchbeam", "report", self.folder.path.resolve().name, *options])
            ),
            study_sha256=text_digest(self.text),
            broken_chains=tuple(broken),
            rig=self.rig,
            unlocked=self.unlocked,
            # A `report.toml` chooses sections by itself.
            alone=self.named is not None,
        )
        title = file.publication.title or file.study.name
        return report(title, found, file, origin, self.shown, keep=self.keep)

    def written(self, load: Callable[[], Found], *, figures: bool) -> Written:
        """Return the files of the report on what `load` returns, which is the data of `journal`.

        Of a journal whose bytes are as they were, it is the report that was made then.
        """
        from runner.study.kept_files import journal_digest

        def whole(made: Written) -> bool:
            """Return whether it is small enough, and of the journal that it was asked of."""
            size = sum(map(len, made.files.values()))
            return size <= _MOST_KEPT and journal_digest(self.folder.journal) == self.journal

        # All that the report depends on besides the data: with anything else it must be made anew.
        asked = (self.folder.path.resolve().name, self.rehearsals, self.named, self.shown, figures)
        known = (self.journal, self.text, self.unlocked, self.rig, asked)
        make = partial(self._written, load, figures=figures)
        made = self.keep.made(make, Written, *known, worth=whole)
        self.require_no_withdrawal()
        return made

    def require_no_withdrawal(self) -> None:
        """Raise `WorkFailed` if somebody withdrew since it was asked for, or its data loaded."""
        from runner.journal.verification import require_no_withdrawal

        require_no_withdrawal(self.folder.journal, self.withdrawals)

    def _written(self, load: Callable[[], Found], *, figures: bool) -> Written:
        from analysis.loading.study_data import marks
        from analysis.report import results, table4_text, wording
        from analysis.report.report import FIGURE_FILES, report_files
        from analysis.report.sections import registration, session_checks

        result = self.made(*load())
        scored, main = bool(result.loaded.table.conditions), result.table.main
        why = marks(result.loaded.empty)
        table4 = table4_text.table4_lines(main.table4, "–", why) if scored else []
        return Written(
            files=report_files(result, figures=figures),
            figure_files=tuple(sorted(FIGURE_FILES)),
            table4=tuple(map(tuple, table4)),
            lines=(
                *(result.table_notes if scored else ["No conditions: no table of scores."]),
                *([wording.omnibus_line(main)] if scored else []),
                *results.threshold_lines(result),
                *registration.registered_lines(result),
                *session_checks.left_out_lines(result.loaded),
            ),
            broken=tuple(result.origin.broken_chains),
        )


def shown_sections(folder: "StudyFolder") -> tuple[str, ...] | None:
    """Return the sections that `report.toml` chooses, None for all.

    A section that an earlier version had gives a warning, and is left out.
    """
    from analysis.report.page import FORMER_SECTIONS

    names = folder.report_sections() or ()
    if former := [name for name in names if name in FORMER_SECTIONS]:
        where = folder.path / "report.toml"
        said = f"{where}: sections that only earlier versions had are left out: {', '.join(former)}"
        warnings.warn(said, stacklevel=2)
    return tuple(name for name in names if name not in FORMER_SECTIONS) or None


def asked_report(
    folder: "StudyFolder",
    *,
    rehearsals: bool,
    named: tuple[str, ...] | None,
    read: tuple[str, str] | None = None,
    withdrawals: int | None = None,
) -> AskedReport:
    """Return what a report on the study depends on now; or, of journal and text, when `read`.

    There were so many `withdrawals` then.

    Raises:
        BadInput: nothing is recorded yet, or a file of the study cannot be read.
    """
    from analysis.kept import Kept
    from runner.journal.opening import read_journal
    from runner.study.calibration import fitted_calibration
    from runner.study.kept_files import code_version, journal_digest, kept_files
    from runner.study.registered import registration_problem

    now = journal_digest(folder.existing_journal())
    digest, text = read or (now, folder.text())
    with read_journal(folder.journal) as journal:
        # What was read before a withdrawal must not come back to where that has deleted it.
        shelf = kept_files(journal) if digest == now else None
        unlocked = registration_problem(journal, folder)
        withdrawals = journal.withdrawals() if withdrawals is None else withdrawals
    return AskedReport(
        folder=folder,
        journal=digest,
        text=text,
        rehearsals=rehearsals,
        named=named,
        shown=shown_sections(folder) if named is None else named,
        unlocked=unlocked,
        rig=fitted_calibration(folder.path),
        keep=Kept(shelf, code_version()),
        withdrawals=withdrawals,
    )
