"""Each line that a driver sends, word for word, from arming to off: nothing more, nothing else.

A device that ignores what it does not know, such as a Siglent, would not show a wrong word.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from device.drivers.board import Board
from device.drivers.driver import Driver, driver_of
from device.link.link import Link
from protocol.journal.records import Identity
from tests.device import rigs
from tests.device.lying import LyingPort, SteppedClock
from tests.device.rigs import DRIVE

LIMITS = replace(rigs.LIMITS, watchdog_s=5)
DIALOGUES = Path(__file__).with_name("dialogues")
MODELS = (
    "board", "keysight", "keysight-33220A", "rigol", "rigol-DG1062Z", "siglent",
)  # fmt: skip


class Spoken:
    """A driver, its device, and what was sent, under a heading for each call."""

    def __init__(self, model: str) -> None:
        self.clock = SteppedClock()
        self.port = LyingPort(model, self.clock)
        kind = driver_of(model.partition("-")[0])
        self.driver: Driver = kind(Link(self.port, monotonic=self.clock), LIMITS, self.clock)
        self.lines: list[str] = []

    def called(self, heading: str, call: Callable[[], object]) -> object:
        """Return what `call` returns; time passes before it, enough for a ramp."""
        self.clock.advance(1)
        result = call()
        self.lines += [f"# {heading}", *self.port.sent, ""]
        self.port.sent.clear()
        return result


def spoken(model: str) -> Spoken:
    """Arm, drive, and turn off in each way."""
    talk = Spoken(model)
    driver = talk.driver
    assert isinstance(talk.called("arm", driver.arm), Identity)
    talk.called("drive", lambda: driver.drive(DRIVE))
    assert talk.called("end the ramp", driver.carry_on) is False
    assert talk.called("have nothing left to do", driver.carry_on) is False
    talk.called("step the frequency", lambda: driver.drive(replace(DRIVE, frequency_hz=24_000)))
    talk.called("check", driver.check)
    talk.called("drive at 0 V", lambda: driver.drive(replace(DRIVE, voltage_v=0)))
    assert talk.called("end at 0 V", driver.carry_on) is False
    talk.called("off", driver.off)
    if isinstance(driver, Board):
        assert talk.called("test the watchdog", driver.watchdog_trips) is True
        talk.called("sample", lambda: driver.start_sampling(1000))
        talk.called("ask for samples", lambda: driver.sampled(0, lambda block: block))
        talk.called("stop sampling", driver.stop_sampling)
        talk.called("measure the vibration", driver.vibration_m)
    for name, query in driver.health.items():
        assert talk.called(f"know {name}", partial(driver.link.ask, query)), name
    assert driver.drained_errors() == []
    return talk


@pytest.mark.parametrize("model", MODELS)
def test_each_line_that_is_sent_is_the_one_that_is_meant(model: str) -> None:
    said = "\n".join(spoken(model).lines)
    assert said == (DIALOGUES / f"{model}.txt").read_text(encoding="utf-8")


IDENTITIES = {
    "keysight": ("Agilent Technologies,33511B,MY1,3", "OUTP2 0"),
    "rigol": ("Rigol Technologies,DG831,DG8A1,00.02", ":OUTP2 OFF"),
}


@pytest.mark.parametrize("dialect", IDENTITIES)
def test_a_model_with_one_channel_is_not_asked_for_a_second_one(dialect: str) -> None:
    idn, second = IDENTITIES[dialect]
    for lies, has_it in (({}, True), ({"*IDN?": [idn]}, False)):
        talk = Spoken(dialect)
        talk.port.lies = lies
        talk.driver.arm()
        assert (second in talk.port.sent) is has_it
