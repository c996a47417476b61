"""Calls that the owner of a port makes one after the other, whoever asks for them."""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Job:
    """A call to make, and what becomes of it."""

    work: Callable[[], Any]
    result: "Future[Any]" = field(default_factory=Future)

    def settle(self) -> None:
        """Make the call; an error is its result, too."""
        try:
            self.result.set_result(self.work())
        except Exception as error:
            self.result.set_exception(error)
