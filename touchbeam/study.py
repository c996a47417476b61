"""A study's data, as everything that reads them composes them: loading, tables, the report."""

import os
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from touchbeam.model import predicted_frame

if TYPE_CHECKING:
    import pandas as pd

    from analysis.export.trial_table import Frames
    from analysis.loading.sessions import Sessions
    from analysis.loading.study_data import StudyData
    from analysis.report.report import Report
    from device.beam.eq15 import Overlap
    from device.friction.calibration import Calibration
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
    from analysis.loading.sessions import load_sessions
    from runner.journal.opening import read_journal
    from runner.journal.verification import readable_chains

    path, broken = folder.existing_journal(), list[str]()
    with read_journal(path) as journal:
        text, file = folder.recorded(journal)
        withdrawals = journal.withdrawals()
        chains = readable_chains(journal, broken, rehearsals=rehearsals)
        recorded = load_sessions(followed(chains, len(journal.sessions())))
    return Study(
        folder=folder,
        file=file,
        recorded=recorded,
        rehearsals=rehearsals,
        broken=tuple(broken),
        _text=text,
        withdrawals=withdrawals,
    )


# Without `eq`, because comparing data frames gives a frame and no truth value.
@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """A study and what was recorded when it was loaded; `load` makes one.

    Its tables are made when they are first asked for. `columns` gives the meaning and the unit of
    each of their columns. Excluded trials and sessions are in the tables, flagged; only `scores`
    and `contrasts` leave them out, and rehearsals of another study file, as the report does.
    Withdrawn participants are not there; `withdrawals` counts their sessions.
    """

    folder: "StudyFolder"
    file: "StudyFile"
    recorded: "Sessions"
    rehearsals: bool
    broken: tuple[str, ...]
    withdrawals: int
    _text: str
    """The study file as it was loaded."""

    def __repr__(self) -> str:
        count = len(self.sessions)
        return f"<touchbeam.Study {self.folder.path}: {count} session{'s' * (count != 1)}>"

    @cached_property
    def _rig(self) -> "Calibration":
        """The rig as a sliding experiment calibrated it."""
        from runner.study.calibration import fitted_calibration

        return fitted_calibration(self.folder.path, self.file)

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
        """Mean scores, a row per participant and a column per condition."""
        import pandas as pd

        table = self._counted.table
        subjects = pd.Index(table.subjects, name="participant")
        return pd.DataFrame(
            table.scores, index=subjects, columns=pd.Index(table.conditions, name="condition")
        )

    @cached_property
    def responses(self) -> "pd.DataFrame":
        """Mean responses, of the shape of `scores`: what the report compares conditions by.

        The response of a trial is its score, counted from 1 at the lowest, if the change was
        answered as expected, and else 0; without a question it is the score.
        """
        import pandas as pd

        from analysis.loading.response import mean_responses, responses

        counted = self._counted
        given = responses(counted.trials, float(self.file.rating.minimum))
        names = counted.table.subjects, counted.table.conditions
        means = mean_responses(counted.trials, given, *names).scores
        return pd.DataFrame(means, index=self.scores.index, columns=self.scores.columns)

    @cached_property
    def contrasts(self) -> "pd.DataFrame":
        """The contrast of friction that each law predicts, a row per trial that counts.

        Positive where the trial changes friction as expected; missing where nothing is predicted.
        Measured force, place and drive are taken where they are known (`touch_measured`). The
        contrast that was measured, and its error, follow where friction was recorded. All are the
        numbers of the report.
        """
        from analysis.export.trial_table import NAMED_CONTRASTS
        from analysis.felt.measured_statistics import measured_trials
        from analysis.loading.study_lock import default_rig
        from analysis.trials.contrasts import trial_contrasts

        counted = self._counted
        rig = default_rig(counted.lock, counted.kinds, self._rig)
        found = trial_contrasts(self.file, counted.trials, counted.touches, rig)
        named = counted.trials[[*NAMED_CONTRASTS]]
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
        from analysis.loading.study_data import scale_of_scores
        from protocol.study.participant_texts import scale_in_words

        kinds = tuple(self.sessions["session_kind"].unique())
        scale = scale_of_scores(self.file, kinds)
        return self._frames.described(scale_in_words(self.file, scale))

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
        from analysis.report.report import report_files

        # A text is a sequence, too: of its letters.
        named = (sections,) if isinstance(sections, str) else sections
        shown = shown_sections(self.folder, named)
        result = report_on(self, shown, alone=named is not None)
        place = None if out is None else Path(out)
        files = report_files(result, figures=figures)
        write_report_files(self.folder, self.withdrawals, files, place)
        return (place or self.folder.report) / "report.html"

    def predict(
        self,
        scenes: "pd.DataFrame",
        *,
        law: str = "consistent",
        rung: str = "beam",
        tolerance: float = 1e-6,
        eq15_overlap: "Overlap" = "first",
    ) -> "pd.DataFrame":
        """Return what `touchbeam.predict` does, on the study's rig as calibrated.

        The study's touch fills missing cells.
        """
        from analysis.model.predict import study_defaults, study_rig

        options = {"law": law, "rung": rung, "tolerance": tolerance, "eq15_overlap": eq15_overlap}
        rig = study_rig(self.file, self._rig, instead="touchbeam.predict takes the paper's beam")
        return predicted_frame(scenes, study_defaults(self.file, rig), {**options, "rig": rig})


def reported(study: Study) -> "Sessions":
    """Return what is recorded, of rehearsals those of the study file as it was loaded."""
    from analysis.loading.sessions import rehearsed_with
    from protocol.study_file.loading import text_digest

    if not study.rehearsals:
        return study.recorded
    return rehearsed_with(study.recorded, text_digest(study._text))


def shown_sections(folder: "StudyFolder", named: Sequence[str] | None) -> tuple[str, ...] | None:
    """Return the sections `named`; without them those of `report.toml`, None for all.

    A section of earlier versions in `report.toml` gives a warning, and is left out.

    Raises:
        BadInput: there is no section of one of the names.
    """
    from analysis.report.page import FORMER_SECTIONS, require_sections

    if named is not None:
        require_sections(named)
        return tuple(named)
    names = folder.report_sections() or ()
    if former := [name for name in names if name in FORMER_SECTIONS]:
        where = folder.path / "report.toml"
        rest = "" if {*names} - FORMER_SECTIONS else "; all sections are shown"
        said = f"{where}: sections that only earlier versions had are left out: {', '.join(former)}"
        warnings.warn(said + rest, stacklevel=3)
    shown = tuple(name for name in names if name not in FORMER_SECTIONS)
    require_sections(shown)
    return shown or None


def report_on(study: Study, shown: tuple[str, ...] | None, *, alone: bool) -> "Report":
    """Return the report on the study; its page shows the sections `shown`.

    `alone` is whether they were named for this report, so that no other section is computed.
    """
    from analysis.report.findings import Origin
    from analysis.report.report import report
    from protocol.errors import typed_as
    from protocol.study_file.loading import text_digest
    from runner.journal.opening import read_journal
    from runner.study.registered import registration_problem

    with read_journal(study.folder.journal) as journal:
        unlocked = registration_problem(journal, study.folder)
    options = ["--rehearsals"] * study.rehearsals
    options += ["--sections", ",".join(shown or ())] if alone else []
    origin = Origin(
        # Quoted, because a folder's name may have spaces and the line is to be run again.
        command=" ".join(
            map(typed_as, ["touchbeam", "report", study.folder.path.resolve().name, *options])
        ),
        study_sha256=text_digest(study._text),
        broken_chains=study.broken,
        rig=study._rig,
        unlocked=unlocked,
        alone=alone,
    )
    title = study.file.publication.title or study.file.study.name
    return report(title, study._counted, study.file, origin, shown)


def write_report_files(
    folder: "StudyFolder", withdrawals: int, files: Mapping[str, bytes], out: Path | None
) -> None:
    """Write the files of a report on the study into `out`, by default `report` in its folder.

    Raises:
        WorkFailed: somebody withdrew since the study had so many `withdrawals`.
    """
    from analysis.report.report import FIGURE_FILES
    from runner.journal.verification import require_no_withdrawal
    from runner.study.files import write_files

    write_files(
        files,
        out or folder.report,
        sorted(FIGURE_FILES),
        # A folder that the user names may be a link; one within the study may come from a stranger.
        study=None if out else folder.path,
        confirm=partial(require_no_withdrawal, folder.journal, withdrawals),
    )
