"""A day in the laboratory, drawn from one number; `-m tests.system.day.day SEED` repeats it."""

import gc
import hashlib
import json
import os
import random
import re
import shutil
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from device.simulator.faults import NAMES
from runner.journal.names import session_name
from runner.launch.locks import session_lock
from tests.system.day import technician
from tests.system.day.desk import at_the_desk
from tests.system.day.evening import in_the_evening
from tests.system.day.invariants import Violation, require
from tests.system.day.lab import Lab, Outcome
from tests.system.day.process import Incident, Process, Where, terminated
from tests.system.day.records import at_the_end, erased
from tests.system.day.studies import PAPERS, SURFACES, drawn_study
from tests.system.day.watch import HOT, SLACK
from touchbeam.cli import journal as commands

DEVICES = {
    "board": 70, "keysight": 6, "keysight-33220A": 5, "rigol": 6, "rigol-DG1062Z": 5, "siglent": 8,
}  # fmt: skip
"""The models, and of how many days in a hundred each is the device."""
NO_THERMOMETER = 0.25
"""Of how many boards the temperature cannot be measured."""
_NO_FAULTS_OF_A_BOARD = {"modulated", "signal-added"}
BOARD_FAULTS = (*(name for name in NAMES if name not in _NO_FAULTS_OF_A_BOARD), HOT, SLACK)
_NO_FAULTS_OF_A_GENERATOR = {
    "watchdog-dead", "over-temperature", "monitor-wrong", "scale-wrong", "peak-to-peak",
    "relay-stuck", "stage-shorted",
}  # fmt: skip
"""It has no watchdog, thermometer or monitor: what is wrong behind its output, nothing shows."""
GENERATOR_FAULTS = tuple(name for name in NAMES if name not in _NO_FAULTS_OF_A_GENERATOR)
MOST_EVENTS = 22
"""Of a short session: an incident after as many events happens in it."""
MOST_ATTEMPTS = 9
GUARDED = 0.7
"""Of how many generators a guardian can hold the port, too."""
STANDS_STILL = 0.1
"""On how many days the whole program stands still at some step of a session, for 1 to 12 s."""
Happening = Callable[[Process], None]
"""Plans what will happen to a process; its name is what happens."""
SECRET = "a lorry passed"
_RATED = 0.25
"""Days of whose studies what was felt is rated, without a question about a change."""
_IN_USE_BY = re.compile(r"in use by .*? \(process \d+\)")
_SESSION_THREAD: tuple[Where, ...] = ("clock", "people", "disk")


@dataclass
class Day:
    """What is done in a day, and what is known of it."""

    lab: Lab
    stream: random.Random
    aside: random.Random
    """What is done at the desk beside the rig follows from it."""
    stills: random.Random
    """Whether and when the program stands still follows from it."""
    happened: Counter[str] = field(default_factory=Counter)
    excluded_trials: set[tuple[str, int]] = field(default_factory=set)
    gone: set[str] = field(default_factory=set)
    """Sessions that are excluded or withdrawn."""
    returned: set[str] = field(default_factory=set)
    """Sessions that were excluded and are included again: their slots may be another's, too."""
    withdrawn: set[str] = field(default_factory=set)
    """Participants who have withdrawn."""
    doubtful: set[str] = field(default_factory=set)
    """Participants for whom a command failed, so that it may have been done or not."""
    completed: set[str] = field(default_factory=set)
    running: str = ""
    unamended: bool = False

    def run(self) -> None:
        """Run three sessions of two participants, with all that a day must have."""
        due: list[Happening] = [self.killed, self.broken, self.broken, self.commanded]
        self.stream.shuffle(due)
        self.lab.tried()
        self._still = self.stills.random() < STANDS_STILL
        again = self.stream.choice(("P01", "P02"))
        for who, which in (("P01", 1), ("P02", 1), (again, 2)):
            gone = who in self.withdrawn | self.doubtful
            participant, number = self._another() if gone else (who, which)
            self._run_to_its_end(participant, number, due)
            while self.stream.random() < 0.3:
                self._command()
            if self.aside.random() < 0.5:
                at_the_desk(self, self.aside)
        while due:
            self._run_to_its_end(*self._another(), due)

    def digest(self) -> str:
        """Return a digest of the record of the day, without the names of folder and process."""
        record = repr(self.lab.record).replace(str(self.lab.folder.path), "")
        # What is removed may hold quotes, and so decide on those around it.
        same = _IN_USE_BY.sub("", record).replace('"', "'")
        return hashlib.sha256(same.encode()).hexdigest()

    def _another(self) -> tuple[str, int]:
        """Return the first session of somebody new: it is there for what has not happened yet."""
        known = {name.partition("/")[0] for name in self.lab.watch.planned}
        return f"P{len(known | {'P01', 'P02'}) + 1:02d}", 1

    def _run_to_its_end(self, participant: str, number: int, due: list[Happening]) -> None:
        name = session_name(participant, number)
        for attempt in range(MOST_ATTEMPTS):
            process = Process()
            left = due[:2] if attempt < 6 else []
            for happens in left:
                happens(process)
            if self._still and self.stills.random() < 0.5:
                self._stands_still(process)
            if self.stream.random() < (0.7, 0.4, 0.2, 0.0)[min(attempt, 3)]:
                self.stream.choice(self._others())(process)
            clean = not (process.incidents or process.commit_kills or process.checkpoint_kills)
            clean = clean and not self.lab.watch.faults_s
            self.running = name
            outcome = self.lab.session(participant, number, process)
            self.running = ""
            self._note(outcome, left, due)
            if self._over(name, outcome, clean):
                return
            if attempt or self.stream.random() < 0.7 or clean:
                self.lab.repair()
            if name in self.lab.watch.planned and self.aside.random() < 0.2:
                self._decided_on(name)
        require(11, False, f"{name} cannot be finished: {outcome.line}")

    def _decided_on(self, name: str) -> None:
        """Decide at the desk on a session that was broken off, or killed as it was completed."""
        outcome = self.lab.command(
            lambda: commands.status(study=self.lab.folder.path, as_json=True)
        )
        sessions = json.loads(outcome.line)["sessions"]
        if (*name.split("/"), "completed") in {
            (each["participant"], str(each["session"]), each["state"]) for each in sessions
        }:
            self.completed.add(name)
        self.aside.choice((self._exclude_trial, self._exclude_session))(name)
        at_the_desk(self, self.aside)

    def _note(self, outcome: Outcome, left: list[Happening], due: list[Happening]) -> None:
        """Take note of what has happened; it is due no longer."""
        happened = list(outcome.process.happened)
        if outcome.killed and "killed" not in happened:
            happened.append("killed")
        self.happened.update(happened)
        for happens in left:
            if happens.__name__ in happened:
                happened.remove(happens.__name__)
                due.remove(happens)

    def _over(self, name: str, outcome: Outcome, clean: bool) -> bool:
        """Return whether there is nothing left to do of the session."""
        participant = name.partition("/")[0]
        if outcome.code == 0:
            self.completed.add(name)
            return True
        if outcome.killed:
            return False
        if outcome.code == 2:
            why = name in self.gone or participant in self.doubtful
            stale = self.unamended or "study changed" in outcome.process.happened
            changed = "study.toml has changed" in outcome.line and stale
            done = "is already completed" in outcome.line
            require(11, why or changed or done, outcome.line)
            if changed and self.unamended:
                self._amended()
            if done:
                self.completed.add(name)
            return not changed
        require(11, not clean, f"nothing was wrong, but {name} ended with: {outcome.line}")
        return False

    # What may happen to a process.

    def _others(self) -> tuple[Happening, ...]:
        return (
            self.killed, self.broken, self.broken, self.commanded, self.typed, self.typed,
            self.stopped, self.hung, self.deserted, self.disk_full, self.disk_error, self.locked,
        )  # fmt: skip

    def killed(self, process: Process) -> None:
        kind = self.stream.random()
        if kind < 0.4:
            moment = self.stream.choice(("before", "during", "after"))
            process.commit_kills[self.stream.randint(1, MOST_EVENTS)] = moment  # type: ignore[assignment]
        elif kind < 0.5:
            process.checkpoint_kills = True
        else:
            self._plan(process, "killed", process.die)

    def broken(self, process: Process) -> None:
        board = self.lab.watch.is_board
        name = self.stream.choice(BOARD_FAULTS if board else GENERATOR_FAULTS)
        lasting = self.stream.random() < 0.6

        def breaks() -> None:
            self.lab.watch.fault(name)
            process.happened.append(name)
            if not lasting:
                crossings = self.stream.randint(1, 60)
                process.incidents.append(
                    Incident(
                        what="mended", events=0, crossings=crossings, happen=self.lab.watch.mended
                    )
                )

        self._plan(process, "broken", breaks)

    def commanded(self, process: Process) -> None:
        self._plan(process, "commanded", self._command)
        process.incidents[-1].events += 1  # before the first event there is nothing to command

    def typed(self, process: Process) -> None:
        keys = self.stream.choice(("p", "r", "s", " ", "\x05", "e", f"n{SECRET}\r", "rp", "x"))

        def types() -> None:
            if self.lab.typist is not None:
                self.lab.typist.typed.append(keys)

        self._plan(process, "typed", types)

    def stopped(self, process: Process) -> None:
        self._plan(process, "stopped", terminated, _SESSION_THREAD)

    def hung(self, process: Process) -> None:
        seconds = self.stream.uniform(0.05, 3.0)

        def hangs() -> None:
            if self.lab.person is not None:
                self.lab.person.hangs_s = seconds

        self._plan(process, "hung", hangs)

    def _stands_still(self, process: Process) -> None:
        """Let all of the program stand still, mostly in a touch, and else anywhere."""
        stream = self.stills
        seconds, in_a_touch = stream.uniform(1, 12), stream.random() < 0.85

        def stands_still() -> None:
            if in_a_touch and not self.lab.watch.is_driven:
                plan(events=0, crossings=stream.randint(1, 10))
            else:
                self._still = False
                process.happened.append("stood still")
                self.lab.stand_still(seconds)

        def plan(events: int, crossings: int) -> None:
            process.incidents.append(
                Incident(what="stills", events=events, crossings=crossings, happen=stands_still)
            )

        plan(events=stream.randint(0, MOST_EVENTS), crossings=stream.randint(1, 200))

    def deserted(self, process: Process) -> None:
        def leaves() -> None:
            if self.lab.person is not None:
                self.lab.person.gone = True

        self._plan(process, "deserted", leaves)

    def disk_full(self, process: Process) -> None:
        self._plan(process, "disk full", lambda: self.lab.disk.fill(self.stream.randint(0, 3)))

    def disk_error(self, process: Process) -> None:
        def fails() -> None:
            process.disk_errors = self.stream.choice((1, 2, 1000))

        self._plan(process, "disk error", fails)

    def locked(self, process: Process) -> None:
        self._plan(process, "locked", lambda: self.lab.disk.lock(self.stream.randint(1, 400)))

    def _plan(
        self,
        process: Process,
        what: str,
        happen: Callable[[], None],
        where: tuple[Where, ...] = ("port", "disk", "clock", "people"),
    ) -> None:
        searching = self.stream.random() < 0.2
        events = 0 if searching else self.stream.randint(0, MOST_EVENTS)
        crossings = self.stream.randint(1, 600 if searching else 40)
        process.incidents.append(
            Incident(what=what, events=events, crossings=crossings, happen=happen, where=where)
        )

    # What another process does meanwhile.

    def _command(self) -> None:
        known = sorted(self.lab.watch.planned)
        if not known:
            return
        name = self.stream.choice(known)
        self.stream.choice(
            (self._look, self._look, self._exclude_trial, self._exclude_trial, self._amend,
             self._exclude_session, self._withdraw)
        )(name)  # fmt: skip
        self.happened["command"] += 1

    def _look(self, _name: str) -> None:
        look = self.stream.choice((commands.status, commands.verify))
        outcome = self.lab.command(lambda: look(study=self.lab.folder.path))
        require(6, outcome.code == 0 or "locked" in outcome.line, outcome.line)

    def _exclude_trial(self, name: str) -> None:
        participant, number = name.split("/")
        trial = self.stream.choice(sorted(self.lab.watch.planned[name]))
        outcome = self.lab.command(
            lambda: commands.exclude(
                study=self.lab.folder.path,
                participant=participant,
                session=int(number),
                trial=trial,
                reason="a slip",
            )
        )
        self.refused_while_running(name, outcome)
        already = self.excluded_trials | self.lab.watch.left_out
        self.may_fail(outcome, name in self.gone or (name, trial) in already)
        if outcome.code == 0:
            require(10, name not in self.gone, f"{name} is gone: {outcome.line}")
            self.excluded_trials.add((name, trial))

    def _exclude_session(self, name: str) -> None:
        participant, number = name.split("/")
        outcome = self.lab.command(
            lambda: commands.exclude(
                study=self.lab.folder.path,
                participant=participant,
                session=int(number),
                reason="ill",
            )
        )
        self.refused_while_running(name, outcome)
        self.may_fail(outcome, name in self.gone)
        if outcome.code == 0:
            self.gone.add(name)

    def _withdraw(self, name: str) -> None:
        participant = name.partition("/")[0]
        outcome = self.lab.command(
            lambda: commands.withdraw(
                study=self.lab.folder.path, participant=participant, yes=True, as_json=True
            )
        )
        own = {other for other in self.lab.watch.planned if other.startswith(f"{participant}/")}
        if self.running in own:
            self.refused_while_running(self.running, outcome)
        elif outcome.code == 0:
            self.withdrawn.add(participant)
            self.gone |= own
            erased_of = set(json.loads(outcome.line)["sessions"])
            require(10, erased_of == own, f"erased are {erased_of}, not {own}")
            erased(self)
        else:
            self.may_fail(outcome, False)
            self.doubtful.add(participant)

    def may_fail(self, outcome: Outcome, done_before: bool) -> None:
        """A command fails only if there is nothing left to do, or others use the journal."""
        refused = outcome.code == 2 and done_before
        disturbed = outcome.code == 1 and self.running
        require(11, outcome.code == 0 or refused or disturbed, outcome.line)

    def refused_while_running(self, name: str, outcome: Outcome) -> None:
        """Nobody decides on a session that is running."""
        if name == self.running:
            require(12, outcome.code == 1, f"{name} runs, but: {outcome.line}")

    def _amend(self, _name: str) -> None:
        self.lab.write(self.lab.written + "# changed\n")
        self.unamended = True
        self.lab.disk.process.happened.append("study changed")  # after that process has read it
        if self.stream.random() < 0.8:
            self._amended()

    def _amended(self) -> None:
        outcome = self.lab.command(
            lambda: commands.amend(study=self.lab.folder.path, reason="a comment")
        )
        self.unamended = outcome.code != 0


def handles() -> tuple[int, int]:
    """Return how many threads and open files there are."""
    return threading.active_count(), len(list(Path("/proc/self/fd").iterdir()))


@contextmanager
def workplace() -> Iterator[Path]:
    """A folder for a day, in memory where there is such a place."""
    memory = Path("/dev/shm")
    place = memory if memory.is_dir() else Path(tempfile.gettempdir())
    folder = place / f"touchbeam-day-{os.getpid():08d}"  # messages in the journal contain it
    folder.mkdir(mode=0o700)
    try:
        yield folder
    finally:
        shutil.rmtree(folder)


def day(seed: int) -> Day:
    """Run the day that is drawn from `seed`.

    Raises:
        AssertionError: an invariant does not hold; the message has the command that repeats it.
    """
    stream = random.Random(f"day/{seed}")
    rigs, aside = random.Random(f"rig/{seed}"), random.Random(f"aside/{seed}")
    (model,) = rigs.choices([*DEVICES], [*DEVICES.values()])
    before = handles()
    Violation.found.clear()
    try:
        with workplace() as folder:
            # Half of the days have the paper's beam.
            surface = random.Random(f"surface/{seed}").choice([*SURFACES, *[PAPERS] * 2])
            rated = random.Random(f"rated/{seed}").random() < _RATED
            text = drawn_study(stream, model.partition("-")[0], surface, rated=rated)
            lab = Lab(folder, text, stream, model)
            if lab.watch.is_board and rigs.random() < NO_THERMOMETER:
                technician.without_thermometer(lab)
            guardians = random.Random(f"guardian/{seed}").random() < GUARDED
            lab.watch.has_guardian = guardians and not lab.watch.is_board
            with lab.entered():
                technician.tried(lab, aside)
                done = Day(lab, stream, aside, random.Random(f"still/{seed}"))
                done.run()
                at_the_end(done)
                technician.tried_in_the_evening(lab, random.Random(f"technician/{seed}"))
                technician.asked(lab)
                for name in lab.watch.planned:
                    with session_lock(name, folder):
                        pass
            in_the_evening(done, seed)
        require(12, handles() == before, f"threads and files {before}, now {handles()}")
    except (Violation, Exception) as error:
        first = (*Violation.found, error)[0]
        text = f"{first or first!r}\nrepeat it with: {sys.executable} -m {__spec__.name} {seed}"
        raise AssertionError(text) from first
    return done


if __name__ == "__main__":
    gc.freeze()
    for given in sys.argv[1:]:
        finished = day(int(given))
        print(given, finished.lab.model, dict(finished.happened))
