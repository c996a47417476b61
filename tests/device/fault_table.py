"""What must happen when something fails: one row per fault and moment, as data.

A row says what the device does (`fault`, a name of the control socket's), when, and what the caller
must be told. SAFE means: the output is off (or UNKNOWN, and said to be), the rig has latched, and
nothing is driven again before it is armed anew. Numbers are those of the documented wire protocol.
"""

from dataclasses import dataclass, replace
from typing import Literal

from device.errors import DeviceError, ForeignOutput, LinkTimeout, OutputUnknown

Moment = Literal["driving", "between", "off", "handshake", "recording"]
"""While a drive is on; between two drives; while a drive is on, and off is asked for; before; while
a drive is on and forces are recorded."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """A fault and what it must lead to; no `error` means that nobody is to notice."""

    number: int
    fault: str
    when: Moment = "driving"
    error: type[Exception] | None = DeviceError
    told: str = ""
    dialect: str = "board"
    still_on: bool = False
    """Whether the device is expected to go on giving voltage: only the amplifier's switch helps."""

    @property
    def name(self) -> str:
        """What the test is called."""
        return f"{self.number}-{self.fault}-{self.when}-{self.dialect}"


_CUT = "output state UNKNOWN - cut the amplifier"
_OFF = "output off, read back"

BOARD = (
    Row(number=1, fault="vanish", error=OutputUnknown, told=_CUT),
    Row(number=2, fault="dead-peer", error=OutputUnknown, told=_CUT),
    Row(number=2, fault="dead-peer", when="off", error=OutputUnknown, told=_CUT),
    Row(number=3, fault="garbled-once", error=None),
    Row(number=3, fault="garbled", error=OutputUnknown, told=_CUT),
    Row(number=4, fault="late-reply-once", error=LinkTimeout, told=f"in time; {_OFF}"),
    Row(number=4, fault="late-reply", error=OutputUnknown, told=_CUT),
    Row(number=5, fault="truncated-reply", error=OutputUnknown, told=_CUT),
    Row(number=6, fault="reply-nan", error=OutputUnknown, told=f"{_CUT} .*'NAN'"),
    Row(number=6, fault="reply-inf", error=OutputUnknown, told=f"{_CUT} .*'INF'"),
    Row(number=6, fault="reply-overflow", error=OutputUnknown, told=f"{_CUT} .*'9.91E.37'"),
    Row(number=6, fault="reply-underscore", error=OutputUnknown, told=f"{_CUT} .*'1_000'"),
    Row(number=6, fault="reply-empty", error=OutputUnknown, told=f"{_CUT} .*''"),
    Row(number=7, fault="slow-drip", error=OutputUnknown, told=f"{_CUT} .*(in time|step)"),
    Row(number=8, fault="flood", error=OutputUnknown, told="keeps sending unsolicited lines"),
    Row(number=9, fault="echo", when="handshake", error=OutputUnknown, told="echoes commands"),
    Row(number=9, fault="echo", error=OutputUnknown, told=_CUT),
    Row(number=10, fault="line-end-cr", error=None),
    Row(number=10, fault="line-end-crlf", error=None),
    Row(number=10, fault="line-end-mixed", error=None),
    Row(number=11, fault="banner", when="handshake", error=None),
    Row(number=11, fault="banner", error=None),
    Row(number=12, fault="brown-out", told=rf"restarted \(boot \d+, now \d+\).*; {_OFF}"),
    Row(number=12, fault="brown-out", when="between", told="restarted"),
    Row(number=13, fault="read-back-differs", told=rf"FREQ was set to .* reads back as .*; {_OFF}"),
    Row(number=13, fault="read-back-differs", when="between", told="reads back as"),
    Row(number=14, fault="error-queued", when="handshake", error=None),
    Row(number=14, fault="error-queued", told=f"refused by the device: -310 System error; {_OFF}"),
    Row(number=14, fault="error-after-set", told=f"refused by the device: -310 .*; {_OFF}"),
    Row(number=15, fault="endless-errors", when="handshake", told="error queue does not end: -310"),
    Row(number=15, fault="endless-errors", told=f"error queue does not end: -310 .*; {_OFF}"),
    Row(number=16, fault="over-temperature", told=f"tripped: over-temperature; {_OFF}"),
    Row(number=16, fault="over-temperature", when="handshake", told="refused .* -240 .*too hot"),
    Row(number=17, fault="monitor-wrong", told=f"the monitor must show .* V, got .* V; {_OFF}"),
    Row(number=17, fault="scale-wrong", told=rf"must not exceed 100\.0 V, got .* V; {_OFF}"),
    Row(number=18, fault="watchdog-trip", told=f"its watchdog tripped: .*; {_OFF}"),
    Row(number=18, fault="watchdog-dead", error=None),
    Row(number=20, fault="opc-silent", error=LinkTimeout, told=rf"'\*OPC\?' in time; {_OFF}"),
    Row(number=21, fault="wrong-idn", when="handshake", error=ForeignOutput,
        told=rf"{_CUT} \(expected a board \(TOUCHBEAM,BOARD,…\), got 'ACME,Toaster 3000,0,1.0'"),
    Row(number=23, fault="deaf", error=OutputUnknown, told=_CUT),
    Row(number=24, fault="limits-lost", when="between", told="set to 120 .* as 200"),
    Row(number=25, fault="panel-changed", when="between", told="set to 120 .* as 200"),
    Row(number=25, fault="frequency-changed", told=f"FREQ was set to .* as 99000; {_OFF}"),
    Row(number=27, fault="silent", error=OutputUnknown, told=_CUT),
    Row(number=28, fault="off-ignored", when="off", error=OutputUnknown, told=_CUT, still_on=True),
    Row(number=28, fault="relay-stuck", when="off", error=OutputUnknown, told="monitor still shows",
        still_on=True),
    Row(number=29, fault="vanish", when="between", error=OutputUnknown, told=_CUT),
    Row(number=31, fault="peak-to-peak", told=f"the monitor must show .* V, got .* V; {_OFF}"),
    Row(number=32, fault="panel-on", when="between", told=f"nobody here switched it on; {_OFF}"),
    Row(number=32, fault="stage-shorted", when="between", error=OutputUnknown, told=_CUT,
        still_on=True),
)  # fmt: skip
RECORDING = (
    *(
        replace(row, when="recording")
        for row in BOARD
        if row.when == "driving"
        and row.fault in {"vanish", "dead-peer", "truncated-reply", "slow-drip", "garbled-once",
                          "late-reply", "flood", "echo", "line-end-mixed", "silent", "deaf",
                          "watchdog-trip", "monitor-wrong", "error-after-set"}
    ),
    Row(number=12, fault="brown-out", when="recording",
        told=f"(restarted|turned its output off by itself|samples of the force channel).*; {_OFF}"),
    Row(number=34, fault="block-garbled", when="recording", told=f"with a block, got .*; {_OFF}"),
    Row(number=34, fault="block-garbled-once", when="recording", error=None),
    Row(number=34, fault="block-truncated-once", when="recording", error=None),
    Row(number=34, fault="block-lost-once", when="recording", error=LinkTimeout,
        told=rf"no answer to 'TRAC:DATA\? \d+' in time; {_OFF}"),
    Row(number=34, fault="block-doubled-once", when="recording", error=None),
    Row(number=34, fault="block-stale", when="recording",
        # Before the first block of this recording, the last one of another is stale by its date.
        told=r"(sample \d+ of the force channel is due, got 0 again"
        rf"|the first sample of the force channel is dated .* from its time.*); {_OFF}"),
    Row(number=35, fault="samples-lost", when="recording",
        told=f"samples of the force channel were lost: .*; {_OFF}"),
    Row(number=35, fault="sensor-saturated", when="recording", error=None),
    Row(number=35, fault="sensor-drifts", when="recording", error=None),
)  # fmt: skip


def _generator(
    number: int, fault: str, when: Moment, told: str, error: type[Exception] | None = DeviceError
) -> Row:
    return Row(number=number, fault=fault, when=when, told=told, error=error, dialect="keysight")


GENERATOR = (
    _generator(4, "late-reply", "driving", _CUT, OutputUnknown),
    _generator(4, "late-reply-once", "driving", f"in time; {_OFF}", LinkTimeout),
    _generator(10, "line-end-crlf", "driving", "", None),
    # A restart resets all settings, and what is read next tells first.
    _generator(
        12,
        "brown-out",
        "driving",
        f"(nobody here switched it|reads back as .*|load must be .*); {_OFF}",
    ),
    _generator(13, "read-back-differs", "between", "reads back as"),
    _generator(14, "error-after-set", "driving", f"refused by the device: -310 .*; {_OFF}"),
    _generator(21, "wrong-idn", "handshake", f"{_CUT} .*generator .*, got 'ACME", ForeignOutput),
    _generator(24, "limits-lost", "driving", f"limits must be on .*; {_OFF}"),
    _generator(24, "limits-lost", "between", "limits must be on"),
    _generator(25, "panel-changed", "driving", f"(load must be INF|reads back as).*; {_OFF}"),
    _generator(25, "panel-changed", "handshake", "", None),
    _generator(25, "frequency-changed", "driving", f"FREQ was set to .* as 99000; {_OFF}"),
    _generator(25, "modulated", "driving", f"generator's FM must be off, got 1; {_OFF}"),
    _generator(25, "modulated", "between", f"generator's FM must be off, got 1; {_OFF}"),
    _generator(25, "modulated", "handshake", "", None),
    _generator(25, "signal-added", "driving", f"combined channel must be NONE, got CH2; {_OFF}"),
    _generator(25, "signal-added", "handshake", "", None),
    _generator(32, "panel-on", "between", f"output is on, and nobody .*; {_OFF}"),
)


def _one_a_line(dialect: str, modulated: str, added: str) -> tuple[Row, ...]:
    """The rows of a generator that takes one query a line, and what it says of modulation."""
    rows: tuple[tuple[int, str, Moment, str, type[Exception] | None], ...] = (
        (4, "late-reply-once", "driving", f"in time; {_OFF}", LinkTimeout),
        (5, "truncated-reply", "driving", _CUT, OutputUnknown),
        (10, "line-end-crlf", "driving", "", None),
        (12, "brown-out", "driving",
         f"(nobody here switched it|reads back as .*|load must be .*); {_OFF}", DeviceError),
        (13, "read-back-differs", "between", "reads back as", DeviceError),
        (21, "wrong-idn", "handshake", f"{_CUT} .*generator .*, got 'ACME", ForeignOutput),
        (25, "panel-changed", "driving", f"(load must be|reads back as|refused .* -222).*; {_OFF}",
         DeviceError),
        (25, "panel-changed", "handshake", "", None),
        (25, "frequency-changed", "driving", f"FREQ was set to .* as 99000; {_OFF}", DeviceError),
        (25, "modulated", "driving", f"modulation must be off, got {modulated}; {_OFF}",
         DeviceError),
        (25, "modulated", "between", f"modulation must be off, got {modulated}", DeviceError),
        (25, "modulated", "handshake", "", None),
        (25, "signal-added", "driving", f"{added} must be off, got ON; {_OFF}", DeviceError),
        (25, "signal-added", "handshake", "", None),
        (32, "panel-on", "between", f"output is on, and nobody .*; {_OFF}", DeviceError),
    )  # fmt: skip
    return tuple(
        Row(number=number, fault=fault, when=when, told=told, error=error, dialect=dialect)
        for number, fault, when, told, error in rows
    )


RIGOL = (
    *_one_a_line("rigol", "ON", "sum"),
    Row(number=14, fault="error-after-set", told=f"refused by the device: -310 .*; {_OFF}",
        dialect="rigol"),
    Row(number=24, fault="limits-lost", told=f"limits must be on .*; {_OFF}", dialect="rigol"),
)  # fmt: skip
SIGLENT = (
    *_one_a_line("siglent", "STATE,ON,FM.*", "combined channel"),
    Row(number=3, fault="garbled-once", error=None, dialect="siglent"),
)
LEFT_ON = Row(
    number=1,
    fault="vanish",
    dialect="keysight",
    error=OutputUnknown,
    told=_CUT,
    still_on=True,
)
"""A generator has no watchdog: when its cable is pulled, only the amplifier's switch helps."""

FAULTS = (*BOARD, *RECORDING, *GENERATOR, *RIGOL, *SIGLENT, LEFT_ON)
