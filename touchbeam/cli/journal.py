"""Commands for a study's journal: status, verify, backup, exclude, include, amend, withdraw."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Exit, Option, Typer

from protocol.errors import BadInput, typed_as
from runner.clock import WallClock
from touchbeam.cli import options
from touchbeam.cli.output import counted, print_json, program, require_confirmation, say

if TYPE_CHECKING:
    from runner.journal.store import Journal
    from runner.journal.verification import SessionVerdict
    from runner.study.folder import StudyFolder
    from runner.study.old_results import OldResults
    from runner.study.progress import Progress

app = Typer()


@app.command()
def status(study: options.StudyArgument, as_json: options.JsonOption = False) -> None:
    """Show the progress of each session and what to do next."""
    folder = options.study_folder(study)
    with options.study_journal(folder) as journal:
        progress = _progress(folder, journal)
    if not as_json:
        for line in progress.lines():
            say(line)
        return
    print_json(
        {
            "sessions": progress.records(),
            "next_slot": progress.next_slot,
            "next_participant": progress.next_participant,
            **({"groups": progress.groups} if progress.groups else {}),
            "done": progress.done,
            "planned": progress.planned,
            **({"study_problem": progress.unusable} if progress.unusable else {}),
        }
    )


@app.command()
def verify(study: options.StudyOrBackupArgument, as_json: options.JsonOption = False) -> None:
    """Check the integrity of the journal or of a backup.

    Checks the hash chains, the order of events, and that each trial is answered exactly once; of a
    registered study also its files, and that the orders follow from its digest.
    """
    from runner.journal.names import session_name
    from runner.journal.opening import read_journal
    from runner.journal.store import JournalError
    from runner.journal.verification import verdicts
    from runner.launch.locks import held_sessions
    from runner.study.registered import lock_problem

    folder = options.study_folder(study)
    path = study if study.is_file() else folder.existing_journal()
    with read_journal(path, to_verify=True) as journal:
        checked, lacking = verdicts(journal), journal.lacking_triggers
        unlocked = ""
        with suppress(JournalError):  # a damaged event, which the verdicts tell
            if not study.is_file():
                unlocked = lock_problem(journal, folder)
    result = _verification(lacking, checked, unlocked)
    if as_json:
        print_json(result)
    else:
        for name in lacking:
            say(
                f"FAIL  trigger {name} is missing: events may have been changed or deleted; "
                "restore the file from a backup"
            )
        if unlocked:
            say(f"FAIL  {unlocked}")
        names = [session_name(verdict.participant, verdict.session) for verdict in checked]
        # Nobody runs a session in a backup.
        running = set() if study.is_file() else held_sessions(names, study)
        for verdict in checked:
            say(verdict.line(running))
        if not checked:
            say("The journal contains no sessions.")
    if not result["ok"]:
        raise Exit(1)


@app.command()
def backup(
    study: options.StudyArgument,
    file: Annotated[Path, Argument(metavar="FILE", help="The new file.")],
    as_json: options.JsonOption = False,
) -> None:
    """Copy the journal, even during a session.

    The copy is one new file, and is verified.
    """
    from runner.journal.verification import backed_up

    result = _verification(*backed_up(options.study_folder(study).existing_journal(), file))
    if as_json:
        print_json({"file": str(file), **result})
    else:
        says = "" if result["ok"] else f" with problems: see touchbeam verify {file}"
        say(
            f"Written and verified{says}: {file}, "
            f"{counted(len(result['sessions']), 'session')}, {counted(result['events'], 'event')}"
        )
    if not result["ok"]:
        raise Exit(1)


def _progress(folder: "StudyFolder", journal: "Journal") -> "Progress":
    from protocol.registration.registration import locked
    from protocol.study_file.loading import text_digest
    from runner.journal import amendments, cohort, names
    from runner.launch.locks import held_sessions
    from runner.study.progress import Progress
    from runner.study.registered import registration_of

    sessions, file, accepted, unusable = cohort.states(journal), None, False, ""
    try:
        registered = registration_of(folder.path)
        file = locked(folder.study(), registered.digest if registered else None)
        latest = amendments.accepted_digests(journal)[-1:]
        accepted = latest in ([], [text_digest(folder.text())])
    except BadInput as error:  # what is recorded is told all the same
        unusable = str(error)
    return Progress(
        folder=folder.path,
        study=file,
        sessions=sessions,
        running=held_sessions([names.parsed_name(chain).plain for chain in sessions], folder.path),
        now=WallClock().utc(),
        program=program(),
        accepted=accepted,
        unusable=unusable,
    )


def _verification(
    lacking: Sequence[str], checked: "Sequence[SessionVerdict]", unlocked: str = ""
) -> dict[str, Any]:
    from runner.journal.names import STUDY_CHAIN

    return {
        "ok": not (lacking or unlocked) and all(verdict.ok for verdict in checked),
        **({"registration_problem": unlocked} if unlocked else {}),
        "events": sum(verdict.events for verdict in checked),
        "lacking_triggers": list(lacking),
        "sessions": [v.record() for v in checked if v.participant != STUDY_CHAIN],
    }


def _decision(name: str, words: str, told: str) -> Callable[..., None]:
    """Return the command that excludes or includes a trial or a session; `told` is its help."""

    @app.command(name, help=told)
    def decide(
        study: options.StudyArgument,
        participant: options.ParticipantOption,
        reason: options.ReasonOption,
        session: options.SessionOption = 1,
        trial: options.TrialOption = None,
        rehearsal: options.OfRehearsalOption = False,
    ) -> None:
        from protocol.journal.events import SLIDE
        from runner.journal import amendments
        from runner.journal.names import existing_chain, session_name, spoken_name
        from runner.launch.locks import session_lock

        # No process may add to the session meanwhile.
        with (
            options.study_journal(options.study_folder(study), to_write=True) as journal,
            session_lock(session_name(participant, session), study),
        ):
            chain = existing_chain(journal, participant, session, rehearsal=rehearsal)
            unit = "pass" if participant == SLIDE else "trial"
            which = "" if trial is None else f", {unit} {trial}"
            where = f"{spoken_name(journal, chain)}{which}"
            getattr(amendments, name)(journal, WallClock(), chain, reason, trial)
        say(f"{where} is {words}: {reason}")

    return decide


exclude = _decision(
    "exclude",
    "excluded",
    "Exclude a trial or a session.\n\nReports omit and count it. An unfinished session frees its "
    "slot of the design. `touchbeam include` takes it back.",
)
include = _decision(
    "include",
    "included again",
    "Take back the exclusion of a trial or a session.\n\n"
    "The journal keeps both decisions, and reports name them.",
)


@app.command()
def amend(study: options.StudyArgument, reason: options.ReasonOption) -> None:
    """Accept changes to study.toml, which the first session or a registration locks."""
    from runner.journal.amendments import amend as accept
    from runner.journal.amendments import is_locked
    from runner.study.check import proved_study

    folder = options.study_folder(study)
    text = folder.text()
    # Before it is accepted: an accepted file cannot be taken back, only replaced.
    proved_study(text, str(folder.study_file))
    with options.study_journal(folder, to_write=True) as journal:
        if not is_locked(journal):
            say("Nothing to accept: rehearsals do not lock study.toml, the first session does.")
            return
        broken = accept(journal, clock := WallClock(), text, reason)
        stranded = list(_progress(folder, journal).stranded())
    but = ", but for those named below" * bool(stranded)
    say(f"The changed study.toml is accepted; sessions continue with it{but}.")
    for line in stranded:
        say(line)
    if broken is not None:
        say(
            f"This breaks the lock of registration {broken.registration[:12]} as of "
            f"{clock.utc():%Y-%m-%d %H:%M} UTC; reports list it as a deviation."
        )


@app.command()
def withdraw(
    study: options.StudyArgument,
    participant: options.ParticipantOption,
    rehearsal: options.OfRehearsalOption = False,
    yes: Annotated[bool, Option("--yes", help="Erase without asking.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Erase a participant's data.

    Shows what will be erased and asks first. This cannot be undone. The journal keeps the number
    and times of the events, not their content.
    """
    from runner.journal import amendments
    from runner.journal.names import chains_of, is_rehearsal, parsed_name, spoken_name
    from runner.launch import locks, request
    from runner.study.mentions import Person
    from runner.study.old_results import old_caches, old_results

    folder = options.study_folder(study)
    with options.study_journal(folder, to_write=True) as journal, ExitStack() as stack:
        chains = amendments.sessions_of(journal, participant, rehearsal=rehearsal)
        for name in dict.fromkeys(parsed_name(chain).plain for chain in chains):
            # A session that is running would go on writing what is being erased.
            stack.enter_context(locks.session_lock(name, study))
        names = {chain: spoken_name(journal, chain) for chain in chains}
        people = {parsed_name(chain).participant for chain in journal.sessions()}
        person = Person(
            name=participant,
            # Without any session of that name it is the rehearsal that withdraws.
            rehearsal=rehearsal or is_rehearsal(journal, chains[0]),
            others=tuple(people - {participant}),
        )
        left = amendments.unerased(journal, chains)
        if left and not yes:
            told = "; ".join(f"{names[chain]}, {what}" for chain, what in left.items())
            # A program cannot answer a question: it is told the option.
            ask = request.refused if as_json else require_confirmation
            ask(f"this erases for good: {told}", "add --yes to erase without a question")
        amendments.withdraw(journal, WallClock(), participant, rehearsal=rehearsal)
        kept = [] if rehearsal else chains_of(journal, participant, rehearsal=True)
        kept = [chain for chain in kept if chain not in chains]
    old, caches = old_results(study, person), old_caches()
    if as_json:
        print_json(
            {
                "sessions": chains,
                "salted": journal.salted,
                "holding": old.holding,
                "unsearched": len(old.unsearched),
                "unsearched_files": old.unsearched,
                "old_caches": [str(folder) for folder in caches],
            }
        )
        return
    if not left:
        say(f"Nothing was left to erase: already withdrawn: {', '.join(names.values())}.")
    erased = [names[chain] for chain in left]
    for line in _withdrawn(erased, participant, old, caches, salted=journal.salted):
        say(line)
    if kept:
        say(f"{participant} was a rehearsal, too, which stays; --rehearsal erases it.")


_SHOWN = 10
"""Files that could not be searched, of those that are named."""


def _withdrawn(
    names: list[str], participant: str, old: "OldResults", caches: Sequence[Path], *, salted: bool
) -> Iterator[str]:
    """Yield what a withdrawal did and what it could not do, line by line."""
    if names:
        yield f"Erased: {', '.join(names)}."
    if not salted:
        yield (
            "Digests without salt remain in this journal, which an earlier version made: a short "
            "secret, such as a consent reference, can be found by trying all of them."
        )
    for result in old.holding:
        yield f"Still contains {participant}: {result}. Make it again, correct it or delete it."
    if old.unsearched:
        first, others = ", ".join(old.unsearched[:_SHOWN]), len(old.unsearched) - _SHOWN
        yield (
            "Not searched, because too large, too many, damaged or without text: "
            f"{first}{f' and {others} more' if others > 0 else ''}. Look at them yourself."
        )
    if caches:
        yield (
            "Earlier versions of touchbeam kept results, scores of people among them, which "
            f"nothing reads any more; delete them: rm -r {' '.join(map(typed_as, caches))}"
        )
    yield "Copies, backups, and reports and exports kept elsewhere may still contain the data."
