"""The simulated device as a client has it: the hand on it, and a device in its own process."""

import json
import os
import socket
import subprocess
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypedDict, Unpack

from device.errors import DeviceError

if TYPE_CHECKING:
    from device.friction.surfaces import AnySurface

_ANSWER_TIMEOUT_S = 5.0
_END_S = 5.0
_LOOPBACK = "127.0.0.1"


class BeamControl(ABC):
    """Touches the beam, swaps it and lets time pass, as only a hand (or a simulation) can."""

    def touch(
        self, force_n: float, position_m: float, direction: str, speed_m_s: float = 0.0
    ) -> float:
        """Put the finger down, to move on or, without a speed, to and fro; return its friction."""
        answer = self._ask(f"touch {force_n!r} {position_m!r} {direction} {speed_m_s!r}")
        return float(answer["friction_coefficient"])

    def lift(self) -> None:
        """Take the finger off the beam."""
        self._ask("lift")

    def sensor(self, name: str, value: float) -> None:
        """Change a number of the force sensor or of the finger's skin."""
        self._ask(f"sensor {name} {value!r}")

    def swap_beam(self, body_spacing_m: float) -> None:
        """Mount a beam with this spacing of its ciliary bodies; 0 for none."""
        self._ask(f"beam {body_spacing_m!r}")

    def advance(self, seconds: float) -> None:
        """Let `seconds` of device time pass at once."""
        self._ask(f"advance {seconds!r}")

    def fault(self, name: str, *, on: bool = True) -> None:
        """Switch a fault on or off."""
        self._ask(f"fault {name} {'on' if on else 'off'}")

    def reset(self) -> None:
        """Switch every fault off and restart the device, without counting that as a boot."""
        self._ask("reset")

    def state(self) -> dict[str, Any]:
        """Return the device's true state."""
        return self._ask("state")

    @abstractmethod
    def _answer(self, line: str) -> str:
        """Return the device's answer to a line of the control channel, empty if it is gone."""

    def _ask(self, line: str) -> dict[str, Any]:
        try:
            answer = json.loads(self._answer(line) or "{}")
        except (OSError, ValueError) as error:
            raise DeviceError(f"the simulated device is gone: {error}") from error
        if not answer or "error" in answer:
            raise DeviceError(
                f"the simulated device refused {line!r}: {answer.get('error', 'gone')}"
            )
        return dict(answer)


class ControlClient(BeamControl):
    """The hand on a device in another process, through its control socket."""

    def __init__(self, socket_path: Path) -> None:
        try:
            self._socket = _connected(socket_path)
        except (OSError, ValueError) as error:
            raise DeviceError(f"{socket_path}: no simulated device answers ({error})") from error
        self._answers = self._socket.makefile("r", encoding="ascii")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._answers.close()
        self._socket.close()

    def _answer(self, line: str) -> str:
        self._socket.sendall(line.encode("ascii") + b"\n")
        return self._answers.readline()


def _connected(path: Path) -> socket.socket:
    """Return a connection to the control socket at `path`; see `ControlDoor`."""
    if hasattr(socket, "AF_UNIX"):
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            connection.settimeout(_ANSWER_TIMEOUT_S)
            connection.connect(str(path))
        except OSError:
            connection.close()
            raise
        return connection
    port, token = path.read_text(encoding="ascii").split()
    connection = socket.create_connection((_LOOPBACK, int(port)), _ANSWER_TIMEOUT_S)
    connection.sendall(f"{token}\n".encode("ascii"))
    return connection


@dataclass(frozen=True, kw_only=True)
class Endpoints:
    """Where a running simulator is reached: its wire, its control socket, and its gauge's wire."""

    url: str
    control: Path
    gauge: str


class Friction(TypedDict, total=False):
    """Law and rung of a simulated beam, by default the report's, and damping, else the seed's."""

    law: str | None
    rung: str | None
    damping: float | None


class SimulatedSurface(TypedDict, total=False):
    """The surface, by default the paper's beam, and about where it resonates, Hz."""

    surface: "AnySurface"
    nominal_hz: float | None


class Touched(Friction, SimulatedSurface, total=False):
    """All that a simulated device is told of its surface."""


@contextmanager
def simulator_process(
    touchbeam: Sequence[str],
    seed: int,
    *,
    dialect: str = "board",
    wire: str | None = None,
    keep: bool = False,
    study: Path | None = None,
    **friction: Unpack[Friction],
) -> Iterator[Endpoints]:
    """Start `touchbeam simulate-device`, and end it on the way out.

    `touchbeam` is the command, `study` a folder whose surface is simulated; the others are as in
    `server.simulate`. The wire is by default a
    pseudo-terminal, where the system has them, else a loopback port; a gauge has one of its own.
    Raise `DeviceError` if it did not get ready.
    """
    with tempfile.TemporaryDirectory(prefix="touchbeam-") as folder:
        control = Path(folder, "control")
        wire = wire or ("pty" if hasattr(os, "openpty") else "tcp")
        place = str(Path(folder, "port")) if wire == "pty" else "0"
        options = ["--control", str(control), "--seed", str(seed), "--dialect", dialect]
        options += ["--gauge", str(Path(folder, "gauge")) if wire == "pty" else "0"]
        given = {name: str(value) for name, value in friction.items() if value is not None}
        given |= {} if study is None else {"study": str(study)}
        options += [word for name in given for word in (f"--{name}", given[name])]
        complaints = Path(folder, "complaints")
        with (
            complaints.open("wb") as stderr,
            subprocess.Popen(
                [*touchbeam, "simulate-device", wire, place, *options, *(["--keep"] * keep)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=stderr,
                text=True,
                # Ctrl-C is ours to handle: the device must outlive it.
                start_new_session=True,
                creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
            ) as process,
        ):
            try:
                gauge = _said_url(process, complaints, "gauge")
                url = _said_url(process, complaints, "ready")
                yield Endpoints(url=url, control=control, gauge=gauge)
            finally:
                process.terminate()
                try:
                    process.wait(_END_S)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()


def _said_url(process: "subprocess.Popen[str]", complaints: Path, what: str) -> str:
    assert process.stdout is not None
    word, _, url = process.stdout.readline().strip().partition(" ")
    if word != what:
        said = complaints.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        why = said[-1].removeprefix("touchbeam: ") if said else "it said nothing"
        raise DeviceError(f"the simulated device did not start ({why})")
    return url
