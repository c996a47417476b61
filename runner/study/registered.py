"""The registration of a study on disk: made, read, and compared with the journal."""

import json
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from protocol.errors import IMPOSSIBLE, BadInput
from protocol.journal.events import StudyRegistered
from protocol.registration.registration import (
    FILE,
    Registration,
    Setting,
    registered_event,
    registration_in,
    require_known,
)
from protocol.study.fields import require_printable
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, text_digest
from protocol.study_file.toml import LONGEST_TEXT
from runner.clock import Clock
from runner.journal.amendments import accepted_digests
from runner.journal.names import STUDY_CHAIN, real_sessions
from runner.journal.opening import journal_if_used, read_journal
from runner.journal.store import Journal, SessionLog
from runner.journal.verification import in_force
from runner.study.calibration import FILE as CALIBRATION_FILE
from runner.study.calibration import fitted_calibration
from runner.study.files import bytes_of, own_file, require_no_link, text_of, write_whole
from runner.study.folder import StudyFolder

REGISTRY_FILE = "registration.txt"
_MOST_TESTS = 50
_LONGEST_LINE = 10_000
_LONGEST_POWER_BYTES = 2**24
"""Of every design and pair of conditions there are some 800 bytes."""
Told = Callable[[Study, Registration], str]
"""Returns the text of a registration for a registry."""
_STALE = "it has changed since this analysis; run touchbeam power again"


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
    command = shlex.join(["touchbeam", "register", "STUDY", "--primary", made.primary, *asked])
    file = made.power.get("file")
    return f"{command} --power FILE (that with {file})" if file else command


def registration_problem(journal: Journal, folder: StudyFolder, told: Told | None = None) -> str:
    """Return what is wrong with the file of a study's registration, if anything; '' otherwise.

    Or, if there is what it is `told` as, which one of the files that it locks is not as it was
    registered.
    """
    recorded = in_force(journal)
    try:
        problem = file_problem(recorded, registration_of(folder.path))
        if problem or recorded is None or told is None:
            return problem
        made = registration_in(recorded.text)
        return (
            _changed_study(journal, folder)
            or _changed_calibration(folder, made)
            or _changed_registry_text(folder, made, told)
        )
    except BadInput as error:
        return str(error)


def _changed_study(journal: Journal, folder: StudyFolder) -> str:
    if text_digest(folder.text()) == accepted_digests(journal)[-1]:
        return ""
    return (
        f"{folder.study_file}: it, a language file or a picture is neither the registered nor an "
        "amended one; restore it, or accept it with touchbeam amend --reason TEXT"
    )


def _changed_calibration(folder: StudyFolder, made: Registration) -> str:
    """Return that the registered fit is gone or changed; another slide's is a later calibration."""
    settled, now = str(made.calibration.get("origin", "")), fitted_calibration(folder.path).origin
    same_session = settled.partition(",")[0] == now.partition(",")[0]
    if settled == now or (now and not same_session):
        return ""
    what = f"holds {now}" if now else "has no fit of the rig"
    return (
        f"{folder.path / CALIBRATION_FILE}: {what}, but {settled} is registered; restore the file "
        "from a copy"
    )


def _changed_registry_text(folder: StudyFolder, made: Registration, told: Told) -> str:
    """Return that the registry's text was changed, if this version made it from this study file."""
    path, text = folder.path / REGISTRY_FILE, folder.text()
    known = (made.touchbeam, made.study_sha256) == (version("touchbeam"), text_digest(text))
    # Another version may word it otherwise, and another study file gives another text.
    if not (known and path.exists()):
        return ""
    if bytes_of(path, most=LONGEST_TEXT) == told(parsed_study(text), made).encode():
        return ""
    return (
        f"{path}: was changed after touchbeam register wrote it; move it away and run touchbeam "
        "register again, with the options that were given then"
    )


def new_registration(
    folder: StudyFolder,
    text: str,
    study: Study,
    *,
    hypotheses: tuple[str | None, Sequence[str], Iterable[str]],
    analysis: Mapping[str, Setting],
    exclusions: Sequence[str],
    power: Path | None,
) -> Registration:
    """Return the registration of a study with a file of this text.

    `hypotheses` are the primary one, else the first that is known, the others, and all that are
    known; `power` is the file of a power analysis. Raise `BadInput` for an unknown hypothesis, no
    planned size, or an unreadable power analysis.
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
    rig = fitted_calibration(folder.path)
    values = {name: value for name, value in vars(rig).items() if value is not None}
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
        power=power_result(power, text_digest(text), (primary, *secondary)) if power else {},
        touchbeam=version("touchbeam"),
    )


def power_result(path: Path, study_sha256: str, hypotheses: Sequence[str]) -> dict[str, str]:
    """Return a power analysis's answer, each test's power, its digest, and if its study is another.

    Of many tests those of the registered `hypotheses` come first, and the last are only counted.
    Raise `BadInput` if it is no JSON object, is too long, or has texts that are no printable lines.
    """
    content = bytes_of(path, most=_LONGEST_POWER_BYTES)
    try:
        result = json.loads(text_of(content, path))
        said = {"answer": _line(result["answer"])} if "answer" in result else {}
        tests = {_line(test["name"]): _power(test) for test in result.get("tests", [])}
        # Results of earlier versions do not name the study file and are taken as its.
        simulated = str(result.get("study_sha256", study_sha256))
    except IMPOSSIBLE as error:
        told = "not the result of a power analysis; run touchbeam power again"
        raise BadInput(f"{path}: {told}") from error
    wanted = [_ends(name) for name in hypotheses]
    names = list(tests)
    left_out = len(names) - _MOST_TESTS
    if left_out > 0:
        names.sort(key=lambda name: _ends(name) not in wanted)
    return {
        **said,
        **{f"power of {name}": tests[name] for name in names[:_MOST_TESTS]},
        **({"further tests": f"{left_out}, in {path.name}"} if left_out > 0 else {}),
        "file": f"SHA-256 {sha256(content).hexdigest()}",
        **({} if simulated == study_sha256 else {"study file": _STALE}),
    }


def _ends(name: str) -> list[str]:
    """Return what a test or a hypothesis compares: `a - b` is the test of `b above a`."""
    return sorted(re.split(" - | above | by | between groups", name))


def _line(given: object) -> str:
    """Return a text that stands in the registration as one printable line, or raise ValueError."""
    text = str(given)
    if len(text) > _LONGEST_LINE or len(f"{text}.".splitlines()) > 1:
        raise ValueError(f"each text must be one line of at most {_LONGEST_LINE} characters")
    text.encode()  # half a character is no text that can be written
    return require_printable(text)


def _power(test: Mapping[str, Any]) -> str:
    error = test.get("mc_error")
    exact = f"{test['power']:.3g}"
    return exact if error is None else f"{exact} (Monte Carlo error {error:.2g})"


def register(
    folder: StudyFolder, study: Study, made: Registration, clock: Clock, told: Told
) -> tuple[Registration, str]:
    """Write `made` into the study's folder and its journal; restore a lost file.

    Return the registration in force, and what it replaces and changes; '' if it replaces none.
    Raise `BadInput` if a session was recorded, the study is registered otherwise, or as `own_file`.
    """
    file, for_registry = (
        own_file(folder.path / name, folder.path) for name in (FILE, REGISTRY_FILE)
    )
    # Alone, so that no first session begins between the question whether there is one and the
    # registration.
    with journal_if_used(folder.journal) as journal, journal.alone():
        recorded, kept = in_force(journal), registration_of(folder.path)
        begun, replaced = real_sessions(journal), ""
        # The file was lost after sessions began: the journal has all of it, whatever options are
        # given now.
        if recorded is not None and kept is None and begun:
            made = registration_in(recorded.text)
        elif recorded is None or recorded.registration != made.digest:
            _require_new(recorded, kept, made, begun)
            SessionLog(journal, STUDY_CHAIN, clock).append(registered_event(made))
            if recorded:
                changed = ", ".join(_differences(registration_in(recorded.text), made))
                before = f"registration {recorded.registration[:12]}, which the journal keeps"
                replaced = f"{before}; changed: {changed}"
        elif kept is not None and kept.digest != made.digest:
            raise BadInput(file_problem(recorded, kept))
    # After the event: a file without one is refused, and a lost file is restored from the journal.
    write_whole(file, made.text().encode())
    write_whole(for_registry, told(study, made).encode())
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
        raise BadInput(
            f"already registered with digest {kept.digest[:12]}, and changed since: "
            f"{', '.join(_differences(kept, made))}; take that back, or move {FILE} away to "
            "register anew while no session is recorded"
        )


def _differences(kept: Registration, made: Registration) -> Iterator[str]:
    """Yield what was settled otherwise; the text as it was read says nothing more."""
    named = {"study_sha256": "study file", "touchbeam": "version of touchbeam"}
    for name, before in vars(kept).items():
        if name != "written" and before != vars(made)[name]:
            yield named.get(name, name)
