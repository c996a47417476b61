"""The dialect `gauge`: lines of ASCII, each with a digest, as documented in the wire protocol."""

import math
import re
import zlib
from array import array
from collections.abc import Callable
from typing import ClassVar

from device.errors import DeviceError, ProtocolError
from device.force_channel.recording import CHANNELS, FULL_SCALE, Block, Scale, scale_of
from device.gauges.owner import GaugeDriver
from device.link.codec import fields, number, number_text, switch, whole
from device.link.link import Register

UNIT = "N"
# Values come with few digits, so that the largest one may be rounded up.
_BEYOND = 1.01
"""How far a value may lie beyond the range by its last digit."""


class LineGauge(GaugeDriver):
    """A gauge that says forces in newtons and places in metres, one line for each question."""

    dialect: ClassVar[str] = "gauge"
    idn: ClassVar["re.Pattern[str]"] = re.compile("touchbeam,GAUGE,", re.IGNORECASE)
    expected: ClassVar[str] = "a gauge (TOUCHBEAM,GAUGE,…)"
    register: ClassVar[Register] = Register(
        put="MARK {}", get="MARK?", told=re.compile(r"(\d{1,3})")
    )
    _scale: Scale = (1.0,) * CHANNELS

    def _require_unit(self) -> None:
        unit = self.link.ask("UNIT?")
        if unit != UNIT:
            raise DeviceError(f"the gauge must measure in {UNIT}, got {unit!r}")

    def start_sampling(self, rate_hz: float) -> Scale:
        # Asked again, because a unit can be changed at a gauge, and a gf is a hundredth of an N.
        self._require_unit()
        self._switch("STOP", on=False)  # a session that was killed left it on
        self.link.tell(f"RATE {number_text(rate_hz)}")
        kept_hz = self.link.query("RATE?", number)
        if not math.isclose(kept_hz, rate_hz, rel_tol=1e-6):
            raise DeviceError(f"the gauge's RATE was set to {rate_hz:g} and is {kept_hz:g}")
        # Before the start, because the counts of the first samples need it.
        self._scale = self.link.query(
            "RANG?", lambda said: scale_of([number(most) / FULL_SCALE for most in said.split(",")])
        )
        self._switch("STAR", on=True)
        return self._scale

    def sampled(self, first: int, checked: Callable[[Block], Block]) -> Block:
        return self.link.query(f"DATA? {first}", lambda line: checked(block(line, self._scale)))

    def stop_sampling(self) -> None:
        self._switch("STOP", on=False)

    def device_time_s(self) -> float:
        return self.link.query("TIME?", number)

    def _switch(self, command: str, *, on: bool) -> None:
        self.link.tell(command)
        # A gauge has no queue of errors: only asking shows whether it obeyed.
        if self.link.query("STAT?", switch) is not on:
            raise DeviceError(f"the gauge was told {command} and does not")


def block(line: str, scale: Scale) -> Block:
    """Return `first;time;count;t,n,x;…;digest` as counts; raise `ProtocolError` if damaged."""
    body, _, digest = line.rpartition(";")
    # The digest covers the text, because a digit that changed on the way is a number still.
    if f"{zlib.crc32(body.encode('ascii')):08X}" != digest.upper():
        raise ProtocolError(f"the gauge's samples differ from their digest, got {line[:40]!r}")
    head, samples = body.split(";")[:3], body.split(";")[3:]
    first, first_s, count = fields(";".join(head), 3)
    if whole(count) != len(samples):
        raise ProtocolError(f"the gauge must send {count} samples, got {len(samples)}")
    counts = array("h")
    for sample in samples:
        counts.extend(_counts(sample, scale))
    return Block(first=whole(first), first_s=number(first_s), counts=counts)


def _counts(sample: str, scale: Scale) -> list[int]:
    values = sample.split(",")
    if len(values) != CHANNELS:
        raise ProtocolError(f"a sample must have {CHANNELS} values, got {sample!r}")
    counts = [round(number(value) / size) for value, size in zip(values, scale, strict=True)]
    if max(map(abs, counts)) > _BEYOND * FULL_SCALE:
        raise ProtocolError(f"a sample must lie in its range, got {sample!r}")
    # Full scale is what marks a saturated sensor, so that nothing may exceed it.
    return [max(-FULL_SCALE, min(FULL_SCALE, count)) for count in counts]


GAUGE = LineGauge
