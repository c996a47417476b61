"""The base of all dialects: compound lines, common commands, status registers and error queue."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from device.simulator.models import scpi
from device.simulator.models.scpi import Call, Handler, ScpiError

QUEUE_LENGTH = 20
Happenings = Mapping[str, Callable[[], object]]
POWER_ON = 128
OPERATION_COMPLETE = 1
_EVENT_BITS = {1: 32, 2: 16, 3: 8, 4: 4}
"""Hundreds of an error's code → its bit in the standard event register."""


@dataclass
class Registers:
    """The status: errors wait until they are asked for; events until the register is read."""

    errors: deque[tuple[int, str]] = field(default_factory=deque)
    events: int = POWER_ON
    enabled_events: int = 0
    enabled_requests: int = 0
    always: tuple[int, str] | None = None
    """An error that every look at the queue finds: a queue without end."""

    def complain(self, error: ScpiError) -> None:
        """Put `error` into the queue; a full one ends in -350, as SCPI asks."""
        # Any other hundred is the maker's own: device-dependent (bit 3) in IEEE 488.2.
        self.events |= _EVENT_BITS.get(abs(error.code) // 100, 8)
        if len(self.errors) < QUEUE_LENGTH:
            self.errors.append((error.code, error.text))
        else:
            self.errors[-1] = (-350, "Queue overflow")

    def taken_events(self) -> int:
        events, self.events = self.events, 0
        return events

    def byte(self) -> int:
        # SCPI-99: bit 2 says that there are errors, bit 5 events, bit 6 either of them.
        errors = 4 if self.errors else 0
        events = 32 if self.events & self.enabled_events else 0
        request = 64 if (errors | events) & self.enabled_requests else 0
        return errors | events | request

    def clear(self) -> None:
        self.errors.clear()
        self.events = 0

    def power_on(self) -> None:
        self.clear()
        self.events = POWER_ON
        self.enabled_events = self.enabled_requests = 0

    def complete(self) -> None:
        """Note that what was asked for is done: at once, here."""
        self.events |= OPERATION_COMPLETE


class Dialect:
    """Answers lines; what is wrong with them goes into the error queue."""

    idn = ""
    banner = ""
    """What the device says when it starts."""
    plus = ""
    """What stands before a number that is not negative."""

    def __init__(self, handlers: dict[str, Handler], channels: int = 1) -> None:
        self.status = Registers()
        self._headers = scpi.Headers({**self._common(), **handlers}, channels)

    def answer(self, line: str) -> str | None:
        answers = [self._answered(*message) for message in scpi.messages(line)]
        said = [answer for answer in answers if answer is not None]
        return ";".join(said) if said else None

    def restart(self) -> None:
        """Lose power and come back."""
        raise NotImplementedError

    def passes(self, time_s: float) -> None:
        """Sample what happens up to a device time that has not come yet."""

    def follow(self) -> None:
        """Put on the beam what is given now that time has passed."""

    def happenings(self) -> Happenings:
        """Return what happens in this dialect alone when a fault is switched on, by its name."""
        return {}

    def _answered(self, header: str, argument: str) -> str | None:
        try:
            handler, channel = self._headers.found(header)
            return handler(Call(argument=argument, channel=channel))
        except ScpiError as error:
            # SCPI: a wrong command has no answer, and the rest of the line is executed.
            self.status.complain(error)
            return None

    def _common(self) -> dict[str, Handler]:
        status = self.status
        return {
            "*CLS": asked(status.clear),
            "*ESE": lambda call: self._enable("enabled_events", call),
            "*ESE?": asked(lambda: self._whole(status.enabled_events)),
            "*ESR?": asked(lambda: self._whole(status.taken_events())),
            "*OPC": asked(status.complete),
            "*OPC?": asked(lambda: "1"),
            "*SRE": lambda call: self._enable("enabled_requests", call),
            "*SRE?": asked(lambda: self._whole(status.enabled_requests)),
            "*STB?": asked(lambda: self._whole(status.byte())),
            "*TST?": asked(lambda: self._whole(0)),
            "*WAI": asked(lambda: None),
            "SYSTem:ERRor[:NEXT]?": asked(self._next_error),
        }

    def _enable(self, register: str, call: Call) -> None:
        value = scpi.number(call.argument)
        if not 0 <= value <= 255:
            raise ScpiError(-222, "Data out of range")
        setattr(self.status, register, int(value))

    def _next_error(self) -> str:
        status = self.status
        none = (0, "No error")
        code, text = status.always or (status.errors.popleft() if status.errors else none)
        return f'{self._whole(code)},"{text}"'

    def _whole(self, value: int) -> str:
        return f"{self.plus if value >= 0 else ''}{value}"


def asked(action: Callable[[], str | None]) -> Handler:
    """Return a handler that takes no argument."""

    def handle(call: Call) -> str | None:
        scpi.nothing(call.argument)
        return action()

    return handle
