"""What must hold on every day in the laboratory, and the error that names what does not."""

from typing import ClassVar

INVARIANTS = {
    1: "no acknowledged event is lost",
    2: "no trial is answered twice, and the journal has the answers that were given",
    3: "the output is at 0 V within the watchdog of any silence",
    4: "the output never exceeds what was asked for, nor a limit, and is 0 V between touches",
    5: "the output is said to be off only when it is off",
    6: "the journal verifies",
    7: "plans and their balance are proved",
    8: "the state moves only along transitions",
    9: "a session runs as planned, beams and drives too, and is resumed where it was",
    10: "excluded and withdrawn data are in no report and no export",
    11: "every session ends with one line that tells the truth, and can be finished",
    12: "no thread, lock or handle is left over",
    13: "each touch of a study that records has one recording, which is whole",
}


class Violation(BaseException):
    """An invariant that does not hold. Nothing that handles errors may handle this one.

    `found` has all of them: an error in the clean-up that one causes cannot hide it.
    """

    found: ClassVar[list["Violation"]] = []

    def __init__(self, number: int, what: str) -> None:
        super().__init__(f"invariant {number} ({INVARIANTS[number]}): {what}")
        self.found.append(self)


def require(number: int, holds: object, what: str) -> None:
    """Raise a violation of the invariant `number` unless it holds."""
    if not holds:
        raise Violation(number, what)
