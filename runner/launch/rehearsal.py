"""Rehearsals: whole sessions in stepped time with a simulated device and virtual participants."""

import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar

from device.people.person import Population
from device.resonance import Resonance
from protocol.address import SIMULATED
from protocol.journal.events import Answered, DeviceOff, Event, StoredEvent, TouchEnded
from protocol.journal.state import SessionState
from protocol.plan.trials import Plan
from protocol.registration.registration import FILE, Registration
from protocol.study_file.loading import without_digests
from runner.journal.names import chain_name
from runner.journal.opening import open_journal
from runner.launch.request import SessionOptions
from runner.launch.run_session import run_session
from runner.people.virtual_participant import VirtualParticipantLeft
from runner.study.folder import StudyFolder

_Kind = TypeVar("_Kind", bound=Event)


@dataclass(frozen=True, kw_only=True)
class Rehearsal:
    """A rehearsal that has been run: its plan, its events, and the state they result in."""

    plan: Plan
    events: tuple[StoredEvent, ...]
    state: SessionState

    @property
    def answers(self) -> dict[int, str | None]:
        """The reported changes by trial index."""
        return {answered.index: answered.change for answered in self._records(Answered)}

    @property
    def largest_voltage_v(self) -> float:
        """The largest amplitude that the device read back, V."""
        ended = self._records(TouchEnded)
        return max((entry.voltage_v for touch in ended for entry in touch.read_back), default=0.0)

    def assert_complete(self) -> None:
        """Assert that every planned trial was answered once and the device read back as off."""
        answers = len(self._records(Answered))
        asked = [trial.index for trial in self.plan.trials]
        missing = sorted(set(asked) - set(self.state.answered))
        if missing or self.state.aborted or answers != len(asked):
            raise AssertionError(
                f"every trial must be answered once, got {answers} answers to "
                f"{len(asked)} trials; missing {missing}, aborted {list(self.state.aborted)}"
            )
        off = [event.confirmed for event in self._records(DeviceOff)]
        if self.state.name != "completed" or not off or not off[-1]:
            raise AssertionError(
                f"a session must end completed and with the device off, got {self.state.name!r}, "
                f"off confirmed: {off}"
            )

    def _records(self, kind: type[_Kind]) -> list[_Kind]:
        return [it.record for it in self.events if isinstance(it.record, kind)]


def rehearse(
    study_text: str,
    plan: Plan,
    seed: int = 1,
    calibration: Resonance | None = None,
    registration: Registration | None = None,
    files: Mapping[str, bytes] = MappingProxyType({}),
) -> Rehearsal:
    """Run a rehearsal of the study in a temporary folder, with its other `files`, and return it.

    Its events will be compared with `plan`, that of the first slot. All that is simulated follows
    from `seed`; a device that cannot measure its resonance has that of the `calibration`.
    """
    with tempfile.TemporaryDirectory(prefix="touchbeam-") as place:
        folder = StudyFolder(path=Path(place))
        # The folder adds the digests of its files itself.
        alone = without_digests(study_text) if files else study_text
        folder.study_file.write_text(alone, encoding="utf-8")
        for name, content in files.items():
            (folder.path / name).parent.mkdir(parents=True, exist_ok=True)
            (folder.path / name).write_bytes(content)
        if registration is not None:
            (folder.path / FILE).write_bytes(registration.text().encode())
        options = SessionOptions(
            folder=folder,
            participant="P01",
            group=plan.group,
            device=SIMULATED,
            ratings="virtual",
            rehearsal=True,
            consent="rehearsal",
            seed=seed,
            calibration=calibration,
        )
        state = run_session(options, say=lambda _: None)
        with open_journal(folder.journal) as journal:
            chain = chain_name(journal, "P01", 1, rehearsal=True)
            events = tuple(journal.events(chain))
    return Rehearsal(plan=plan, events=events, state=state)


def rehearse_cohort(
    folder: StudyFolder,
    participants: int,
    seed: int,
    after_each: Callable[[], None],
    people: Population | None = None,
) -> None:
    """Run a session of each virtual participant from P01 on, drawn from `people` or the default.

    One who drops out leaves the session unfinished. `after_each` is called after each session.
    """
    for number in range(1, participants + 1):
        options = SessionOptions(
            folder=folder,
            participant=f"P{number:02d}",
            device=SIMULATED,
            ratings="virtual",
            seed=seed,
            people=people,
        )
        with suppress(VirtualParticipantLeft):
            run_session(options, say=lambda _: None)
        after_each()
