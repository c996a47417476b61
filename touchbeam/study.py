"""A study's data, as everything that reads them composes them: loading, tables, the report."""

import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from touchbeam.model import predicted_frame

if TYPE_CHECKING:
    import pandas as pd

    from analysis.export.trial_table import Frames
    from analysis.loading.sessions import Sessions
    from analysis.loading.study_data import StudyData
    from analysis.report.report import Report
    from device.beam.eq15 import Overlap
    from device.friction.scenes import Calibration
    from protocol.study.study import Study as StudyFile
    from runner.study.folder import StudyFolder


def load(folder: "str | os.PathLike[str]", *, rehearsals: bool = False) -> "Study":
    """Return the study in `folder` with everything recorded so far; of rehearsals too if asked for.

    A journal that was modified outside touchbeam gives a warning.

    Raises:
        ValueError: there is no study or nothing is recorded yet; the message says what to do.
    """
    # Sums by several threads may differ in the last digit; numpy reads this when it is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from analysis.loading.sessions import load_sessions
    from analysis.loading.study_data import changed_journal
    from runner.journal.opening import read_journal
    from runner.journal.verification import readable_chains
    from runner.study.folder import StudyFolder

    source = StudyFolder(path=Path(folder))
    broken: list[str] = []
    with read_journal(source.existing_journal()) as journal:
        file = source.study()
        recorded = load_sessions(readable_chains(journal, broken))
    if broken:
        # `stacklevel=2` makes the warning name the caller's line instead of this one.
        warnings.warn(changed_journal(broken), stacklevel=2)
    return Study(
        folder=source, file=file, recorded=recorded, rehearsals=rehearsals, broken=tuple(broken)
    )


# Without `eq`, because comparing data frames gives a frame and no truth value.
@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """A study and what was recorded when it was loaded; `load` makes one.

    Its tables are made when they are first asked for. `columns` gives the meaning and the unit of
    each of their columns. Excluded trials and sessions are in the tables, flagged; only `scores`
    and `contrasts` leave them out, as the report does. Withdrawn participants are not there.
    """

    folder: "StudyFolder"
    file: "StudyFile"
    recorded: "Sessions"
    rehearsals: bool
    broken: tuple[str, ...]

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
        from analysis.export.dataset import asked_questions
        from analysis.export.trial_table import Frames
        from analysis.felt.measured_statistics import with_measures

        sessions = self.recorded.sessions
        rehearsed = sessions["session_kind"].eq("rehearsal")
        return Frames(
            found=with_measures(self.file, self.recorded),
            kept=sessions if self.rehearsals else sessions[~rehearsed],
            questions=asked_questions(self.file, self.recorded.answers),
        )

    @cached_property
    def _counted(self) -> "StudyData":
        from analysis.loading.study_data import OnlyRehearsals, study_data

        rules = self.file.exclusions
        try:
            return study_data(self.recorded, rehearsals=self.rehearsals, rules=rules)
        except OnlyRehearsals:
            # The error names the option of the command line, which does not help in Python.
            said = "nothing but rehearsals here; touchbeam.load(..., rehearsals=True) includes them"
            raise ValueError(said) from None

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
        chosen = {
            "participant": participant,
            "session": session,
            "trial_index": trial,
            "touch": touch,
        }
        traces = self._frames.traces
        for column, value in chosen.items():
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
        predicted = named.assign(
            touch_measured=found.measured,
            **found.by_law,
            measured_contrast=float("nan"),
            measured_contrast_error=float("nan"),
        )
        if counted.forces:
            felt = measured_trials(self.file, counted.trials, counted.touches, counted.forces)
            predicted["measured_contrast"] = felt.value
            predicted["measured_contrast_error"] = felt.error
        return predicted.reset_index(drop=True)

    @property
    def columns(self) -> "pd.DataFrame":
        """Meaning, unit and levels of each column, a row per table and column."""
        from protocol.study.participant_texts import scale_in_words

        return self._frames.described(scale_in_words(self.file, self.file.rating))

    def plan(self, participant: str, session: int = 1) -> "pd.DataFrame":
        """Return the planned trials of a participant's session, a row each.

        As recorded, if the session was begun; else as `touchbeam run` would plan it now. With
        `rehearsals`, a rehearsal's if there is no session of that name.

        Raises:
            ValueError: no plan is known: the participant has withdrawn, or the scores are imported.
                Or the registration in the folder is not the journal's.
        """
        from analysis.export.trial_table import plan_frame
        from protocol.plan.plan import plan
        from protocol.registration.registration import locked
        from runner.journal.cohort import planned_trials, slot_for, states
        from runner.journal.names import chain_name, existing_chain
        from runner.journal.opening import read_journal
        from runner.study.registered import registration_of, require_registered

        with read_journal(self.folder.existing_journal()) as journal:
            named = existing_chain if self.rehearsals else chain_name
            chain = named(journal, participant, session, rehearsal=False)
            if chain in journal.sessions():
                return plan_frame(planned_trials(journal, chain))
            slot = slot_for(states(journal), participant, "participant")
            registered = registration_of(self.folder.path)
            require_registered(journal, registered, rehearsal=False)
        # A registration's digest seeds the plan of the sessions that run under it.
        file = self.file if registered is None else locked(self.file, registered.digest)
        return plan_frame(plan(file, slot, session).trials)

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
        from analysis.report.report import FIGURE_FILES, report_files
        from runner.study.files import write_files

        # A text is a sequence, too: of its letters.
        named = (sections,) if isinstance(sections, str) else sections
        made = made_report(
            self.folder,
            self.file,
            self._counted,
            self.broken,
            rehearsals=self.rehearsals,
            named=None if named is None else tuple(named),
            recorded=self.recorded,
        )
        folder = self.folder.report if out is None else Path(out)
        # A folder that the user names may be a link; one within the study may come from a stranger.
        own = self.folder.path if out is None else None
        write_files(report_files(made, figures=figures), folder, replaced=FIGURE_FILES, study=own)
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
        from analysis.model.predict import study_defaults

        options = {"law": law, "rung": rung, "tolerance": tolerance, "eq15_overlap": eq15_overlap}
        defaults = study_defaults(self.file, self._rig)
        return predicted_frame(scenes, defaults, {**options, "rig": self._rig})


def made_report(
    folder: "StudyFolder",
    file: "StudyFile",
    found: "StudyData",
    broken: Sequence[str],
    *,
    rehearsals: bool,
    named: tuple[str, ...] | None,
    recorded: "Sessions | None",
) -> "Report":
    """Return the report on `found`, data of the study in `folder`; `recorded` are all sessions.

    The commands, the crate and Python programs get theirs here. Its page shows the sections
    `named`; without them those of `report.toml`, or all.

    Raises:
        ValueError: there is no section of that name.
    """
    from analysis.kept import Kept
    from analysis.report.findings import origin_of, title_of
    from analysis.report.report import report
    from runner.journal.opening import read_journal
    from runner.study.calibration import fitted_calibration
    from runner.study.kept_files import code_version, kept_files
    from runner.study.registered import registration_problem

    with read_journal(folder.existing_journal()) as journal:
        unlocked = registration_problem(journal, folder.path)
        keep = Kept(kept_files(journal), code_version())
    origin = origin_of(
        folder.path.resolve().name,
        folder.text(),
        rehearsals=rehearsals,
        broken=broken,
        rig=fitted_calibration(folder.path),
        unlocked=unlocked,
        sections=named,
    )
    shown = folder.report_sections() if named is None else named
    return report(title_of(file), found, file, origin, shown, recorded, keep=keep)
