"""The control socket's shell: lets hands in and passes their lines on."""

import contextlib
import socket
from collections.abc import Callable
from pathlib import Path

from device.errors import DeviceError
from device.wire import LineBuffer, text

_CHUNK = 65_536


class ControlDoor:
    """A listening Unix socket and whoever came in through it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(str(path))
        path.chmod(0o600)
        self._listener.listen()
        self._listener.setblocking(False)
        self._inside: dict[socket.socket, LineBuffer] = {}

    def sockets(self) -> list[socket.socket]:
        """Return everything that may become readable."""
        return [self._listener, *self._inside]

    def serve(self, answer: Callable[[str], str]) -> None:
        """Answer every line that has come."""
        with contextlib.suppress(BlockingIOError):
            visitor, _ = self._listener.accept()
            visitor.setblocking(False)
            self._inside[visitor] = LineBuffer()
        for visitor in list(self._inside):
            self._hear(visitor, answer)

    def close(self) -> None:
        """Close everything and remove the socket."""
        for open_socket in self.sockets():
            open_socket.close()
        self._path.unlink(missing_ok=True)

    def _hear(self, visitor: socket.socket, answer: Callable[[str], str]) -> None:
        try:
            received = visitor.recv(_CHUNK)
            for line in self._inside[visitor].feed(received):
                visitor.sendall(answer(text(line)).encode("ascii") + b"\n")
        except BlockingIOError:
            return
        except (OSError, DeviceError):
            received = b""
        if not received:
            del self._inside[visitor]
            visitor.close()
