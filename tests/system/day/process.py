"""A process of the laboratory, which may die at any of its dealings with the world outside.

Ports, files, clocks and people call `Process.crossing`. A process that is dead reaches none of
them any more, so that nothing of its cleanup happens: that is what SIGKILL does.
"""

import signal
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

Where = Literal["port", "disk", "clock", "people"]


class Dead(BaseException):
    """The process was killed."""


@dataclass(kw_only=True)
class Incident:
    """Something that happens `crossings` after the process has stored `events` events."""

    what: str
    events: int
    crossings: int
    happen: Callable[[], None]
    where: tuple[Where, ...] = ("port", "disk", "clock", "people")


@dataclass
class Process:
    """One run of a command, with what will happen to it."""

    incidents: list[Incident] = field(default_factory=list)
    alive: bool = True
    stored: int = 0
    happened: list[str] = field(default_factory=list)
    commit_kills: dict[int, Literal["before", "during", "after"]] = field(default_factory=dict)
    """The number of an event, and when of its commit the process dies."""
    checkpoint_kills: bool = False
    disk_errors: int = 0
    """How many of its next statements fail."""
    _busy: bool = False

    @property
    def will_die(self) -> bool:
        """Whether it is going to be killed, if it lives until then."""
        kills = any(incident.what == "killed" for incident in self.incidents)
        return bool(kills or self.commit_kills or self.checkpoint_kills)

    def crossing(self, where: Where) -> None:
        """Deal with the world outside; whatever is due happens first."""
        if not self.alive:
            raise Dead
        if self._busy or not self.incidents:
            return
        for incident in list(self.incidents):
            if self.stored >= incident.events and where in incident.where:
                incident.crossings -= 1
                if incident.crossings <= 0:
                    self._happens(incident)

    def _happens(self, incident: Incident) -> None:
        self.incidents.remove(incident)
        self.happened.append(incident.what)
        self._busy = True
        try:
            incident.happen()
        finally:
            self._busy = False

    def die(self) -> None:
        """Be killed."""
        self.alive = False
        raise Dead


def terminated() -> None:
    """Send this process SIGTERM."""
    signal.raise_signal(signal.SIGTERM)
