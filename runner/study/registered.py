"""The registration of a study on disk: made, read, and compared with the journal."""

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

from protocol.errors import BadInput
from protocol.journal.events import StudyRegistered
from protocol.registration.registration import (
    FILE,
    Registration,
    Setting,
    registered_event,
    registration_in,
    require_known,
)
from protocol.study.study import Study
from protocol.study_file.loading import text_digest
from protocol.study_file.toml import LONGEST_TEXT
from runner.clock import Clock
from runner.journal.amendments import accepted_digests
from runner.journal.names import STUDY_CHAIN, real_sessions
from runner.journal.opening import journal_if_used, read_journal
from runner.journal.store import Journal, SessionLog
from runner.journal.verification import in_force
from runner.study.calibration import FILE as CALIBRATION_FILE
from runner.study.calibration import fitted_calibration
from runner.study.files import bytes_of, own_file, require_no_link, write_whole
from runner.study.folder import StudyFolder


def registration_of(folder: Path) -> Registration | None:
    """Return the registration in a study's folder, if any; `BadInput` if its file is damaged."""
    path = folder / FILE
    if not path.exists():
        return None
    require_no_link(path)
    # As it is: line ends and a byte order mark, too, would change the digest.
    return registration_in(bytes_of(path, most=LONGEST_TEXT).decode(errors="replace"), str(path))


def checked_registration(folder: StudyFolder) -> Registration | None:
    """Return the same after `require_registered`; a copy may be without its journal."""
    kept = registration_of(folder.path)
    if folder.journal.is_file():
        with read_journal(folder.journal) as journal:
            require_registered(journal, kept, rehearsal=False)
    return kept


def require_registered(journal: Journal, kept: Registration | None, *, rehearsal: bool) -> None:
    """Raise `BadInput` unless file and journal agree; a rehearsal may be without the journal."""
    if problem := file_problem(in_force(journal), kept, rehearsal=rehearsal):
        raise BadInput(problem)


def file_problem(
    recorded: StudyRegistered | None, kept: Registration | None, *, rehearsal: bool = False
) -> str:
    """Return how the file of a registration differs from what the journal holds; '' if it fits."""
    if recorded is None:
        return (
            f"the journal does not hold the registration in {FILE}; run touchbeam register again"
            if kept and not rehearsal
            else ""
        )
    if kept is None:
        return (
            f"{FILE} is missing, but the study is registered; restore it with: "
            f"{_command(registration_in(recorded.text))}"
        )
    if kept.digest != recorded.registration:
        return (
            f"{FILE} has digest {kept.digest[:12]}, but the journal holds registration "
            f"{recorded.registration[:12]}; restore that file from a copy, or move it away and run "
            "touchbeam register"
        )
    return ""


def _command(made: Registration) -> str:
    asked = [word for name in made.secondary for word in ("--hypothesis", name)]
    return shlex.join(["touchbeam", "register", "STUDY", "--primary", made.primary, *asked])


def registration_problem(journal: Journal, folder: StudyFolder) -> str:
    """Return what is wrong with the file of a study's registration, if anything; '' otherwise."""
    try:
        return file_problem(in_force(journal), registration_of(folder.path))
    except BadInput as error:
        return str(error)


def lock_problem(journal: Journal, folder: StudyFolder) -> str:
    """Return the same, or which of the files that it locks is not as it was registered."""
    recorded = in_force(journal)
    if (problem := registration_problem(journal, folder)) or recorded is None:
        return problem
    try:
        made = registration_in(recorded.text)
        return _changed_study(journal, folder) or _changed_calibration(folder, made)
    except BadInput as error:
        return str(error)


def _changed_study(journal: Journal, folder: StudyFolder) -> str:
    if text_digest(folder.text()) == accepted_digests(journal)[-1]:
        return ""
    return (
        f"{folder.study_file}: it, a language file, a picture or a table is neither the registered "
        "nor an amended one; restore it, or accept it with touchbeam amend --reason TEXT"
    )


def _changed_calibration(folder: StudyFolder, made: Registration) -> str:
    """Return that the registered fit is gone or changed; another slide's is a later calibration."""
    settled, now = (
        str(made.calibration.get("origin", "")),
        fitted_calibration(folder.path, folder.study()).origin,
    )
    same_session = settled.partition(",")[0] == now.partition(",")[0]
    if settled == now or (now and not same_session):
        return ""
    what = f"holds {now}" if now else "has no fit of the rig"
    return (
        f"{folder.path / CALIBRATION_FILE}: {what}, but {settled} is registered; restore the file "
        "from a copy"
    )


def new_registration(
    folder: StudyFolder,
    text: str,
    study: Study,
    *,
    hypotheses: tuple[str | None, Sequence[str], Iterable[str]],
    analysis: Mapping[str, Setting],
    exclusions: Sequence[str],
) -> Registration:
    """Return the registration of a study with a file of this text.

    `hypotheses` are the primary one, else the first that is known, the others, and all that are
    known. Raise `BadInput` for an unknown hypothesis, or no planned size.
    """
    from device.friction.changes import LAW, RUNG

    primary, secondary, known = hypotheses
    primary = primary or next(iter(known))
    for name in (primary, *secondary):
        require_known(name, known)
    participants = study.design.participants
    if participants is None:
        raise BadInput(
            "design.participants must be set in study.toml: it is the registered stopping rule"
        )
    rig = fitted_calibration(folder.path, study)
    values = {name: value for name, value in rig.values.items() if value is not None}
    return Registration(
        study=study.study.name,
        study_sha256=text_digest(text),
        primary=primary,
        secondary=tuple(name for name in dict.fromkeys(secondary) if name != primary),
        law=LAW,
        rung=RUNG,
        calibration=values if rig.origin else {},
        participants=participants,
        sessions=study.design.sessions,
        groups={group.name: group.size for group in study.group},
        exclusions=tuple(exclusions),
        analysis=analysis,
        touchbeam=version("touchbeam"),
    )


def register(folder: StudyFolder, made: Registration, clock: Clock) -> tuple[Registration, str]:
    """Write `made` into the study's folder and its journal; restore a lost file.

    Return the registration in force, and what it replaces and changes; '' if it replaces none.
    Raise `BadInput` if a session was recorded, the study is registered otherwise, or as `own_file`.
    """
    file = own_file(folder.path / FILE, folder.path)
    # Alone, so that no first session begins between the question whether there is one and the
    # registration.
    with journal_if_used(folder.journal) as journal, journal.alone():
        recorded, kept = in_force(journal), registration_of(folder.path)
        held = (
            None
            if recorded is None
            else registration_in(recorded.text, "the registration in the journal")
        )
        begun, replaced = real_sessions(journal), ""
        # The file was lost after sessions began: the journal has all of it, whatever options are
        # given now.
        if held is not None and kept is None and begun:
            made = held
        # The same plan keeps the text that an earlier version wrote of it, and so its digest.
        made = next((earlier for earlier in (held, kept) if earlier == made), made)
        if held is None or held.digest != made.digest:
            _require_new(recorded, kept, made, begun)
            SessionLog(journal, STUDY_CHAIN, clock).append(registered_event(made))
            if held is not None:
                changed = ", ".join(_differences(held, made))
                before = f"registration {held.digest[:12]}, which the journal keeps"
                replaced = f"{before}; changed: {changed}"
        elif kept is not None and kept.digest != made.digest:
            raise BadInput(file_problem(recorded, kept))
    # After the event: a file without one is refused, and a lost file is restored from the journal.
    write_whole(file, made.text().encode())
    return made, replaced


def _require_new(
    recorded: StudyRegistered | None,
    kept: Registration | None,
    made: Registration,
    begun: Sequence[str],
) -> None:
    if begun:
        raise BadInput(
            f"{begun[0]} is recorded: a study must be registered before its first session "
            "(rehearsals do not count)"
            if recorded is None
            else f"{begun[0]} is recorded under registration {recorded.registration[:12]}, which "
            "cannot be replaced; touchbeam amend accepts a changed study file"
        )
    if kept is not None and kept.digest != made.digest:
        changed = list(_differences(kept, made))
        named_only = {*changed} <= {"primary", "secondary"}
        way_back = f"repeat {_command(kept)}" if named_only else "take that back"
        raise BadInput(
            f"already registered with digest {kept.digest[:12]}, and changed since: "
            f"{', '.join(changed)}; {way_back}, or move {FILE} away to "
            "register anew while no session is recorded"
        )


def _differences(kept: Registration, made: Registration) -> Iterator[str]:
    """Yield what was settled otherwise; the text as it was read says nothing more."""
    named = {"study_sha256": "study file", "touchbeam": "version of touchbeam"}
    for name, before in vars(kept).items():
        if name != "written" and before != vars(made)[name]:
            yield named.get(name, name)
