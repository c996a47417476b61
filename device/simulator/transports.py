"""Transports of the simulated device: pseudo-terminal, loopback port and control socket."""

import contextlib
import os
import secrets
import socket
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Literal, Protocol

from device.errors import DeviceError
from device.link.codec import LineBuffer, text

LineKind = Literal["pty", "tcp"]
LOOPBACK = "127.0.0.1"
_CHUNK = 65_536


class Line(Protocol):
    """One wire, one host at a time."""

    url: str

    def fileno(self) -> int:
        """What becomes readable when the host does something."""

    def receive(self) -> bytes | None:
        """Return what the host sent, maybe nothing; None if there was a host and it is gone."""

    def send(self, data: bytes) -> None:
        """Send `data`; a host that does not read loses it."""

    def hang_up(self) -> None:
        """Vanish."""

    def come_back(self) -> None:
        """Be there again under the same address."""

    def close(self) -> None:
        """Leave nothing behind."""


class PtyLine:
    """A pseudo-terminal that a host opens under the name `link`."""

    def __init__(self, link: Path) -> None:
        self._link = link
        self.url = str(link)
        self.come_back()

    def come_back(self) -> None:
        """Make the pseudo-terminal, raw as a serial port is."""
        import tty

        self._master, slave = os.openpty()
        self._slave: int | None = slave
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        self._link.symlink_to(os.ttyname(slave))

    def fileno(self) -> int:
        return self._master

    def receive(self) -> bytes | None:
        """As a `Line`; our hold on the host's end is given up once the host has spoken."""
        try:
            data = os.read(self._master, _CHUNK)
        except BlockingIOError:
            return b""
        except OSError:
            return None
        if self._slave is not None:
            os.close(self._slave)
            self._slave = None
        return data

    def send(self, data: bytes) -> None:
        with contextlib.suppress(OSError):
            os.write(self._master, data)

    def close(self) -> None:
        self._link.unlink(missing_ok=True)
        for end in (self._master, self._slave):
            if end is not None and end >= 0:
                os.close(end)
        self._master, self._slave = -1, None

    hang_up = close


class TcpLine:
    """A port on the loopback interface; 0 lets the system choose one."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._host: socket.socket | None = None
        self._next: socket.socket | None = None
        self.come_back()
        self.url = f"socket://{LOOPBACK}:{self._port}"

    def come_back(self) -> None:
        self._listener = socket.create_server((LOOPBACK, self._port))
        self._listener.setblocking(False)
        self._port = self._listener.getsockname()[1]

    def hang_up(self) -> None:
        """Hang up on the host, and on whoever comes."""
        self.close()
        self._host = self._next = None

    def fileno(self) -> int:
        """Return the host's socket, or the listener's while there is none."""
        return (self._host or self._listener).fileno()

    def receive(self) -> bytes | None:
        """Return what came, maybe nothing; None once the host is gone. A new host is let in."""
        if self._host is None:
            self._host, self._next = self._next or self._accepted(), None
            return b""
        self._next = self._next or self._accepted()
        try:
            data = self._host.recv(_CHUNK)
        except BlockingIOError:
            # One host at a time: a second one finds its connection closed. The first is looked at
            # before, because the newcomer is the next host if that one has hung up.
            if self._next is not None:
                self._next.close()
                self._next = None
            return b""
        except OSError:
            data = b""
        if not data:
            self._host.close()
            self._host = None
            return None
        return data

    def send(self, data: bytes) -> None:
        if self._host is not None:
            with contextlib.suppress(OSError):
                self._host.sendall(data)

    def close(self) -> None:
        for end in (self._listener, self._host, self._next):
            if end is not None:
                end.close()

    def _accepted(self) -> socket.socket | None:
        try:
            host, _ = self._listener.accept()
        except (BlockingIOError, ConnectionAbortedError):
            return None
        host.setblocking(False)
        host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return host


class ControlDoor:
    """A listening Unix socket and whoever came in through it.

    Where the system has no Unix sockets (Windows), it is a loopback port. The file at `path`, which
    only this user can read, then holds the port and a token, which is a visitor's first line.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._token = "" if hasattr(socket, "AF_UNIX") else secrets.token_hex(16)
        if self._token:
            self._listener = socket.create_server((LOOPBACK, 0))
            # Only this user can read it.
            with open(path, "x", encoding="ascii", opener=partial(os.open, mode=0o600)) as file:
                file.write(f"{self._listener.getsockname()[1]} {self._token}\n")
        else:
            self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            self._listener.bind(str(path))
            path.chmod(0o600)
            self._listener.listen()
        self._listener.setblocking(False)
        self._inside: dict[socket.socket, LineBuffer] = {}
        self._strangers: set[socket.socket] = set()

    def sockets(self) -> list[socket.socket]:
        return [self._listener, *self._inside]

    def serve(self, answer: Callable[[str], str]) -> None:
        with contextlib.suppress(BlockingIOError):
            visitor, _ = self._listener.accept()
            visitor.setblocking(False)
            self._inside[visitor] = LineBuffer()
            if self._token:
                self._strangers.add(visitor)
        for visitor in list(self._inside):
            self._hear(visitor, answer)

    def close(self) -> None:
        for open_socket in self.sockets():
            open_socket.close()
        self._path.unlink(missing_ok=True)

    def _hear(self, visitor: socket.socket, answer: Callable[[str], str]) -> None:
        try:
            received = visitor.recv(_CHUNK)
            for line in self._inside[visitor].feed(received):
                if visitor in self._strangers:
                    self._admit(visitor, line)
                else:
                    visitor.sendall(answer(text(line)).encode("ascii") + b"\n")
        except BlockingIOError:
            return
        except (OSError, DeviceError):
            received = b""
        if not received:
            del self._inside[visitor]
            self._strangers.discard(visitor)
            visitor.close()

    def _admit(self, visitor: socket.socket, line: bytes) -> None:
        """Let a visitor in who knows the token; raise `DeviceError` if this one does not."""
        if not secrets.compare_digest(line.strip(), self._token.encode("ascii")):
            raise DeviceError("the control socket was opened without its token")
        self._strangers.remove(visitor)
