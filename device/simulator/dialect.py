"""What all dialects share: compound lines, the common commands, the error queue."""

from collections.abc import Callable

from device.simulator.scpi import Call, Handler, Headers, messages
from device.simulator.status import Status
from device.simulator.values import ScpiError, nothing, number


class Dialect:
    """Answers lines; what is wrong with them goes into the error queue."""

    plus = ""
    """What stands before a number that is not negative."""

    def __init__(self, status: Status, handlers: dict[str, Handler], channels: int = 1) -> None:
        self.status = status
        self._headers = Headers({**self._common(), **handlers}, channels)

    def answer(self, line: str) -> str | None:
        """Return what is answered to `line`, None if nothing."""
        answers = [self._answered(message.header, message.argument) for message in messages(line)]
        said = [answer for answer in answers if answer is not None]
        return ";".join(said) if said else None

    def _answered(self, header: str, argument: str) -> str | None:
        try:
            handler, channel = self._headers.found(header)
            return handler(Call(argument=argument, channel=channel))
        except ScpiError as error:
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
        value = number(call.argument)
        if not 0 <= value <= 255:
            raise ScpiError(-222, "Data out of range")
        setattr(self.status, register, int(value))

    def _next_error(self) -> str:
        code, text = self.status.next_error()
        return f'{self._whole(code)},"{text}"'

    def _whole(self, value: int) -> str:
        return f"{self.plus if value >= 0 else ''}{value}"


def asked(action: Callable[[], str | None]) -> Handler:
    """Return a handler that takes no argument."""

    def handle(call: Call) -> str | None:
        nothing(call.argument)
        return action()

    return handle
