"""The owner of a port: what any thread asks for is done by one of them, one call after another."""

import contextlib
import queue
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager, nullcontext
from typing import TypeVar

from device.errors import DeviceError
from device.force_channel.recording import Recorder, Samples

_Result = TypeVar("_Result")


class PortOwner(ABC):
    """Makes the calls to a port one by one: in a thread once it has one, else in the caller's."""

    unbroken: Callable[[], AbstractContextManager[None]] = nullcontext
    """Surrounds each step: where the caller works, no signal may leave half a command behind."""

    def __init__(self) -> None:
        self._calls: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._owner: threading.Thread | None = None
        self._is_over = False
        self._recording: Recorder | None = None
        self._fault: DeviceError | None = None

    def step(self, wait_s: float | None = 0.0) -> bool:
        """As the owner, make the next call within `wait_s` and what is due; False once closed."""
        if self._is_over:
            return False
        with self.unbroken():
            with contextlib.suppress(queue.Empty):
                call = self._calls.get(timeout=wait_s)
                if call is None:
                    return False
                self._make(call)
            self._go_on()
        return True

    @abstractmethod
    def idle_s(self) -> float | None:
        """Return how long the owner may wait for a call; None if only a call gives it work."""

    @abstractmethod
    def _go_on(self) -> None:
        """Do what is due; no error may leave it."""

    def _make(self, call: Callable[[], None]) -> None:
        call()

    def _begin(self, name: str) -> None:
        # A daemon, so that a device that hangs does not keep the program from ending.
        self._owner = threading.Thread(target=self._serve, name=name, daemon=True)
        self._owner.start()

    def _serve(self) -> None:
        while self.step(self.idle_s()):
            pass

    def _put(self, work: Callable[[], _Result]) -> "Future[_Result]":
        result: Future[_Result] = Future()

        def call() -> None:
            """Make the call; an error is its result, too."""
            try:
                self._require_port()
                result.set_result(work())
            except Exception as error:
                result.set_exception(error)

        self._calls.put(call)
        if self._is_over:
            self._refuse()
        # Without a thread, as on a stepped clock, the caller does the owner's work.
        elif self._owner is None:
            self.step()
        return result

    def _recorded(self) -> Samples:
        if self._recording is None:
            # The fault that ended the recording says more.
            raise self._fault or DeviceError("nothing is recorded")
        try:
            return self._recording.finished()
        finally:
            self._recording = None

    def _end(self) -> None:
        self._calls.put(None)
        if self._owner is not None:
            self._owner.join()
        self._is_over = True
        self._refuse()

    def _require_port(self) -> None:
        if self._is_over:
            raise DeviceError("its port is closed")

    def _refuse(self) -> None:
        """Have the calls fail that nobody makes any more: else another thread waits for ever."""
        with contextlib.suppress(queue.Empty):
            while True:
                if (call := self._calls.get_nowait()) is not None:
                    call()
