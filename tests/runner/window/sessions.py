"""Sessions of the built-in study, shortened, as an experimenter starts them from a terminal."""

import os
import re
import subprocess
import threading
import time
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from protocol.journal.events import StoredEvent
from protocol.study_file.loading import template
from runner.journal.names import chain_name
from runner.journal.opening import open_journal
from tests.runner.command_line import TOUCHBEAM
from tests.runner.window.person import Person

ENDS_WITHIN_S = 240.0

_SHORTER = {
    r"hold_s = \S+": "hold_s = 0.25\nlead_in_s = 0.3",
    r"sliding_speed_m_s = \S+": "sliding_speed_m_s = 0.284",
    r"ramp_v_per_s = \S+": "ramp_v_per_s = 2000",
    r"duration_s = 6\b": "duration_s = 0.4",
    r"watchdog_s = \S+": "watchdog_s = 5",  # the machine may be busy with other tests
}


READABLE_S = 1.0
"""As in every study that does not say otherwise."""


def short_study(readable_s: float = 0.3, conditions: Collection[str] = ()) -> str:
    """The paper's study with touches of a quarter of a second and little time to read.

    With names of `conditions` it has these alone.
    """
    text = template("paper")
    for pattern, shorter in _SHORTER.items():
        text, count = re.subn(pattern, shorter, text)
        assert count, f"the paper's study has no {pattern}"
    text = text.replace("[rating]", f"[timing]\nreadable_s = {readable_s}\n\n[rating]", 1)
    first, *others = text.split("[[condition]]")
    kept = [each for each in others if not conditions or each.split('"')[1] in conditions]
    assert len(kept) == len(conditions or others)
    return "[[condition]]".join([first, *kept])


def tiny_study() -> str:
    """The same with the first condition alone."""
    return short_study(conditions=["frequency"])


@dataclass
class Seat:
    """A study in `folder` and a participant at `display`."""

    folder: Path
    display: str
    study: str = field(default_factory=short_study)
    participant: str = "P01"
    more_environment: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.folder.mkdir(exist_ok=True)
        (self.folder / "study.toml").write_text(self.study, encoding="utf-8")
        home = self.folder.with_name("home")
        home.mkdir(exist_ok=True)
        self.environment = {
            **os.environ,
            "HOME": str(home),
            "DISPLAY": self.display,
            **self.more_environment,
        }

    def start(self, *options: str, ratings: str = "window") -> "Running":
        """Start the session; somebody serves the rig whenever the terminal asks for it."""
        arguments = [TOUCHBEAM, "run", str(self.folder), "--participant", self.participant]
        process = subprocess.Popen(
            [*arguments, "--ratings", ratings, "--rehearsal", *options],
            env=self.environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        return Running(process)

    def events(self) -> list[StoredEvent]:
        """Return the session's events from the journal."""
        with open_journal(self.folder / "study.db") as journal:
            return journal.events(chain_name(journal, self.participant, 1, rehearsal=True))

    def payloads(self, tag: str) -> list[Mapping[str, Any]]:
        """Return the payloads of one kind of event."""
        return [event.payload for event in self.events() if event.tag == tag]


@dataclass
class Running:
    """A running session."""

    process: "subprocess.Popen[str]"
    lose_display: Callable[[], None] = lambda: None
    said: list[str] = field(default_factory=list)
    complaint: str = field(default="", init=False)
    """What it wrote to standard error, once it has ended."""

    def __post_init__(self) -> None:
        self._operator = threading.Thread(target=self._serve_the_rig, daemon=True)
        self._operator.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _type: object, error: BaseException | None, _traceback: object) -> None:
        """Leave no process running and no pipe open; a failed test tells what the session said."""
        if self.process.poll() is None:
            self.process.kill()
        code = self.end()
        if error is not None:
            error.add_note(f"the session ended with {code}, saying {self.complaint!r}")

    def attend(self, person: Person) -> int:
        """Let `person` follow the screens until the session ends; return its exit code."""
        until_s = time.monotonic() + ENDS_WITHIN_S
        while self.process.poll() is None and time.monotonic() < until_s:
            person.act()
        return self.end()

    def end(self) -> int:
        """Wait for the end and close the pipes; return the exit code."""
        try:
            code = self.process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise
        self._operator.join()
        assert self.process.stderr is not None
        assert self.process.stdin is not None
        if not self.process.stderr.closed:
            with self.process.stderr as errors, suppress(BrokenPipeError), self.process.stdin:
                self.complaint = errors.read()
        return code

    def window_process(self) -> int:
        """Return the id of the window's process, a child of the session's."""
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
        for child in children.read_text().split():
            command = Path(f"/proc/{child}/cmdline").read_bytes()
            if b"participant-window" in command:
                return int(child)
        raise LookupError(f"{self.process.pid} has no window")

    def _serve_the_rig(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as lines:
            for line in lines:
                self.said.append(line)
                if "Mount the beam" in line or "nobody may touch the surface" in line:
                    self.type("\n")

    def type(self, text: str) -> None:
        """Type at the terminal."""
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):
            self.process.stdin.write(text)
            self.process.stdin.flush()
