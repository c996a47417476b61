"""The faults that a device can have, as a table; each can be switched on and off at any time.

Numbers are those of docs/wire-protocol.md, "Faults"; missing ones are the host's. What a fault
does to the wire stands in `wire`, what it does to the device in `broken`.
"""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault's number, its name on the control socket, and what happens."""

    number: int
    name: str
    what: str


FAULTS = (
    Fault(number=1, name="vanish", what="the port vanishes; off brings it back, output off"),
    Fault(number=2, name="dead-peer", what="nothing gets through in either direction"),
    Fault(number=3, name="garbled", what="every answer has bytes that are no ASCII"),
    Fault(number=3, name="garbled-once", what="the next answer has bytes that are no ASCII"),
    Fault(number=4, name="late-reply", what="every answer comes 0.6 s late"),
    Fault(number=4, name="late-reply-once", what="the next answer comes 0.6 s late"),
    Fault(number=5, name="truncated-reply", what="answers stop half way, without a line end"),
    Fault(number=6, name="reply-nan", what="measured and set values answer NAN"),
    Fault(number=6, name="reply-inf", what="measured and set values answer INF"),
    Fault(number=6, name="reply-overflow", what="measured and set values answer 9.91E+37"),
    Fault(number=6, name="reply-underscore", what="measured and set values answer 1_000"),
    Fault(number=6, name="reply-empty", what="measured and set values answer an empty line"),
    Fault(number=7, name="slow-drip", what="answers come a byte every 0.05 s"),
    Fault(number=8, name="flood", what="the device talks without being asked, without end"),
    Fault(number=9, name="echo", what="the device sends back what it is sent"),
    Fault(number=10, name="line-end-cr", what="lines end in CR"),
    Fault(number=10, name="line-end-crlf", what="lines end in CR LF"),
    Fault(number=10, name="line-end-mixed", what="lines end in LF, CR LF and CR by turns"),
    Fault(number=11, name="banner", what="a banner comes before the next answer"),
    Fault(number=12, name="brown-out", what="the device restarts: output off, settings lost"),
    Fault(number=13, name="read-back-differs", what="nine tenths of what is set are kept"),
    Fault(number=14, name="error-queued", what="an error stands in the queue"),
    Fault(number=14, name="error-after-set", what="every command that sets leaves an error"),
    Fault(number=15, name="endless-errors", what="the error queue never ends"),
    Fault(number=16, name="over-temperature", what="protection trips, and does not clear"),
    Fault(number=17, name="monitor-wrong", what="the monitor shows half of the voltage"),
    Fault(number=17, name="scale-wrong", what="twice of what is set comes out, and is reported"),
    Fault(number=18, name="watchdog-trip", what="the watchdog trips"),
    Fault(number=20, name="opc-silent", what="*OPC? is not answered"),
    Fault(number=21, name="wrong-idn", what="*IDN? answers with another device's name"),
    Fault(number=23, name="deaf", what="the device stops reading"),
    Fault(number=24, name="limits-lost", what="limits go back to their defaults"),
    Fault(number=25, name="panel-changed", what="load, unit and offset are changed at the panel"),
    Fault(number=25, name="frequency-changed", what="the frequency is changed at the panel"),
    Fault(number=27, name="silent", what="the device obeys and answers nothing"),
    Fault(number=28, name="off-ignored", what="OUTP OFF is ignored"),
    Fault(number=28, name="relay-stuck", what="the voltage stays when the output is switched off"),
    Fault(number=31, name="peak-to-peak", what="twice the amplitude that was set comes out"),
    Fault(number=32, name="panel-on", what="the output is switched on at the panel"),
    Fault(number=32, name="stage-shorted", what="150 V are at the output though it is off"),
)
NAMES = tuple(fault.name for fault in FAULTS)
