"""Lies and answers: what is told of a device that lies, and whether its output is really off then.

The device knows the truth. Whatever it says, nobody is told that an output is off which is on; what
it reports beyond the drive turns it off within `SOON_S` of its own time.
"""

import math
import re
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import pytest

from device.drivers.board import MONITOR_ABS_TOL_V
from device.drivers.limits import Setpoint
from device.errors import DeviceError, OutputUnknown
from device.force_channel.recording import SILENT_S, Block, decoded, encoded
from device.link.codec import block as in_block
from device.rig import RAMP_STEP_S
from tests.device.lying import WatchedRig, watched
from tests.device.rigs import LIMITS as ANY_LIMITS

LIMITS = replace(ANY_LIMITS, max_temperature_c=60)
DRIVE_V = 20
DRIVE = Setpoint(voltage_v=DRIVE_V, frequency_hz=24221.37, ramp_v_per_s=400)
SOON_S = 0.3
NOTICED_S = 0.5
"""The same while forces are recorded, whose blocks may be late or broken."""
OUTPUT = {"board": "OUTP?", "keysight": "OUTP1?", "rigol": "OUTP1?", "siglent": "C1:OUTP?"}
LAST = {**OUTPUT, "keysight": "OUTP?"}
"""What is asked when the output is to be off."""
OFF = {"board": "0", "keysight": "0", "rigol": "OFF", "siglent": "C1:OUTP OFF,LOAD,HZ,PLRT,NOR"}
ON = {"board": "1", "keysight": "1", "rigol": "ON", "siglent": "C1:OUTP ON,LOAD,HZ,PLRT,NOR"}
DIALECTS = tuple(OFF)

Told = Literal["off", "unknown", "nothing"]


@dataclass(frozen=True, kw_only=True)
class Lie:
    """What is untrue, from when on, and what is told of it.

    Attributes:
        says: what is answered to a query instead of the truth.
        fault: what is switched on in the device, which is then untrue or disobedient.
        panel: what somebody does at the panel, as a command.
        when: while it is driven, while it is off between two drives, or when off is asked for.
        told: that the output is off, that it is unknown, or nothing at all.
        because: why nobody can know better, where nothing, or something wrong, is told.
    """

    dialect: str
    name: str
    says: Mapping[str, str] = field(default_factory=dict)
    fault: str = ""
    panel: str = ""
    when: Literal["driving", "idle", "off"] = "driving"
    told: Told = "off"
    because: str = ""


_NUMBER = re.compile(r"[-+]?\d+(\.\d*)?(E[-+]?\d+)?")


def _shifted() -> Callable[[str], str]:
    """Each answer is the one before."""
    before = ["1"]

    def lie(line: str) -> str:
        before.append(line)
        return before[-2]

    return lie


LINES: Mapping[str, Callable[[], Callable[[str], str]]] = {
    "twice": lambda: lambda line: f"{line}\n{line}",
    "a 0 first": lambda: lambda line: f"0\n{line}",
    "a 1 after": lambda: lambda line: f"{line}\n1",
    "an OFF first": lambda: lambda line: f"OFF\n{line}",
    "two zeros first": lambda: lambda line: f"0;0\n{line}",
    "two zeros instead": lambda: lambda _: "0;0",
    "the one before": _shifted,
    "NUL at the end": lambda: lambda line: f"{line}\0",
    "0xFF first": lambda: lambda line: f"\xff{line}",
    "a vertical tab": lambda: lambda line: f"{line[:1]}\v{line[1:]}",
    "a superscript digit": lambda: lambda line: f"{line}\xb2",
    "commas for points": lambda: lambda line: f"{line.replace('.', ',')},",
    "not a number": lambda: lambda line: _NUMBER.sub("NAN", line),
    "1E36": lambda: lambda line: _NUMBER.sub("1E36", line),
    "less than nothing": lambda: lambda line: _NUMBER.sub("-7", line),
    "a unit": lambda: lambda line: f"{line} furlongs",
    "cut in two": lambda: lambda line: f"{line[: len(line) // 2]}",
    "nothing": lambda: lambda _: "",
    "too long": lambda: lambda line: f"{line}{'9' * 10_000}",
    "backwards": lambda: lambda line: line[::-1],
}
"""What may be done to every line that is answered."""
STILL_TRUE = {("commas for points", "siglent")}
"""What leaves the answer that the output is off, and the number beside it, as they were."""

BOARD = (
    Lie(dialect="board", name="another target", says={"VOLT?": "120"}),
    Lie(dialect="board", name="10 V more than driven", says={"VOLT:INST?": "30"}),
    Lie(dialect="board", name="another frequency", says={"FREQ?": "99000"}),
    Lie(dialect="board", name="a frequency of 0", says={"FREQ?": "0"}),
    Lie(dialect="board", name="900 °C", says={"MEAS:TEMP?": "900"}),
    Lie(dialect="board", name="a restart", says={"SYST:BOOT?": "9"}),
    Lie(dialect="board", name="a boot and a half", says={"SYST:BOOT?": "1.5"}),
    Lie(dialect="board", name="a trip", says={"OUTP:PROT:CAUS?": "CURR"}),
    Lie(dialect="board", name="a monitor of 0 V", says={"MEAS:VOLT?": "0"}),
    Lie(dialect="board", name="off", says={"OUTP?": "0"}),
    Lie(dialect="board", name="twice of all it is told", fault="scale-wrong"),
    Lie(dialect="board", name="twice what it means", fault="peak-to-peak"),
    Lie(dialect="board", name="half a monitor", fault="monitor-wrong"),
    Lie(dialect="board", name="ten times the drive", told="unknown",
        says={"VOLT:INST?": "200", "MEAS:VOLT?": "200"}),
    Lie(dialect="board", name="a little more than the drive", told="unknown",
        says={"VOLT:INST?": "24", "MEAS:VOLT?": "24"}),
    Lie(dialect="board", name="a monitor of 500 V", says={"MEAS:VOLT?": "500"}, told="unknown"),
    Lie(dialect="board", name="a monitor below 0 V", says={"MEAS:VOLT?": "-20"}, told="unknown"),
    Lie(dialect="board", name="a monitor of NAN", says={"MEAS:VOLT?": "NAN"}, told="unknown"),
    Lie(dialect="board", name="a monitor of 150 V though it is off", says={"MEAS:VOLT?": "150"},
        when="idle", told="unknown"),
    Lie(dialect="board", name="a voltage though it is off", fault="stage-shorted", when="idle",
        told="unknown"),
    Lie(dialect="board", name="a voltage that stays", fault="relay-stuck", when="off",
        told="unknown"),
    Lie(dialect="board", name="off, and a monitor that shows it is not", fault="off-ignored",
        says={"OUTP?": "0"}, when="off", told="unknown"),
    Lie(dialect="board", name="off before on", fault="off-ignored", says={"OUTP?": "0;0\n1"},
        when="off", told="unknown"),
    Lie(dialect="board", name="off, and a monitor that agrees", fault="off-ignored",
        says={"OUTP?": "0", "MEAS:VOLT?": "0"}, when="off", told="off",
        because="the switch and the independent monitor say the same"),
    Lie(dialect="board", name="as driven, at twice the voltage", fault="peak-to-peak",
        says={"MEAS:VOLT?": "20"}, told="nothing", because="the monitor is what would show it"),
)  # fmt: skip
PANEL = {
    "keysight": {
        **{
            name: f"SOUR1:{name}:STAT 1" for name in ("AM", "FM", "PM", "PWM", "FSK", "BPSK", "SUM")
        },
        "sweep": "SOUR1:SWE:STAT 1",
        "burst": "SOUR1:BURS:STAT 1",
        "list": "SOUR1:FREQ:MODE LIST",
        "combined": "SOUR1:COMB:FEED CH2",
        "second channel": "OUTP2 1",
        "load": "OUTP1:LOAD 50",
        "unit": "SOUR1:VOLT:UNIT VRMS",
        "offset": "SOUR1:VOLT:OFFS 1",
        "shape": "SOUR1:FUNC SQU",
        "limits": "SOUR1:VOLT:LIM:STAT 0",
        "a higher limit": "SOUR1:VOLT:LIM:HIGH 9",
        "amplitude": "SOUR1:VOLT 2.1",
        "frequency": "SOUR1:FREQ 24300",
        "output": "OUTP1 0",
    },
    "rigol": {
        **{name: f":SOUR1:MOD:TYP {name};:SOUR1:MOD ON" for name in ("AM", "FM", "PSK")},
        "sweep": ":SOUR1:SWE:STAT ON",
        "burst": ":SOUR1:BURS ON",
        "harmonics": ":SOUR1:HARM ON",
        "sum": ":SOUR1:SUM ON",
        "second channel": ":OUTP2 ON",
        "load": ":OUTP1:LOAD 50",
        "unit": ":SOUR1:VOLT:UNIT VRMS",
        "offset": ":SOUR1:VOLT:OFFS 1",
        "shape": ":SOUR1:FUNC SQU",
        "limits": ":OUTP1:VOLL OFF",
        "a higher limit": ":OUTP1:VOLL:HIGH 9",
        "amplitude": ":SOUR1:VOLT 2.1",
        "frequency": ":SOUR1:FREQ 24300",
        "output": ":OUTP1 OFF",
    },
    "siglent": {
        **{name: f"C1:MDWV STATE,ON,{name}" for name in ("AM", "FM", "PSK")},
        "sweep": "C1:SWWV STATE,ON",
        "burst": "C1:BTWV STATE,ON",
        "harmonics": "C1:HARM HARMSTATE,ON",
        "combined": "C1:CMBN ON",
        "coupled": "COUP ACOUP,ON",
        "second channel": "C2:OUTP ON",
        "load": "C1:OUTP LOAD,50",
        "offset": "C1:BSWV OFST,1",
        "amplitude": "C1:BSWV AMP,2.1",
        "frequency": "C1:BSWV FRQ,24300",
        "output": "C1:OUTP OFF",
    },
}
"""What somebody can do at a generator's panel while it is driven."""


def _of_every_generator(dialect: str) -> tuple[Lie, ...]:
    ignored = Lie(
        dialect=dialect,
        name="on although told off",
        fault="off-ignored",
        when="off",
        told="unknown",
    )
    off, on = OFF[dialect], ON[dialect]
    return (
        ignored,
        replace(ignored, name="on, after an off", says={LAST[dialect]: f"{off}\n{on}"}),
        replace(ignored, name="on, before an off", says={LAST[dialect]: f"{on}\n{off}"}),
        replace(ignored, name="off although it is on", says={LAST[dialect]: off}, told="off",
                because="only its own word is known of its output"),
        Lie(dialect=dialect, name="twice the voltage", fault="peak-to-peak", told="nothing",
            because="a generator measures nothing"),
        Lie(dialect=dialect, name="on at the panel", fault="panel-on", when="idle"),
        Lie(dialect=dialect, name="on at the panel, after an off", fault="panel-on", when="idle",
            says={OUTPUT[dialect]: f"{off}\n{on}"},
            told="off" if OUTPUT[dialect] != LAST[dialect] else "unknown"),
    )  # fmt: skip


GENERATORS = (
    *(
        Lie(dialect=dialect, name=f"{name} at the panel", panel=panel)
        for dialect, rows in PANEL.items()
        for name, panel in rows.items()
    ),
    *(lie for dialect in PANEL for lie in _of_every_generator(dialect)),
)
LIES = (*BOARD, *GENERATORS)


def begin(watched_rig: WatchedRig, lie: Lie) -> None:
    """Bring the rig to the moment of `lie`, and let its device lie from then on."""
    watched_rig.rig.arm()
    if lie.when != "idle":
        watched_rig.rig.drive(DRIVE)
        watched_rig.live(0.2)
        assert watched_rig.port.device.instrument.output_v == pytest.approx(DRIVE.voltage_v)
    tell(watched_rig, lie)


def tell(watched_rig: WatchedRig, lie: Lie) -> None:
    """Let the device lie from now on."""
    device = watched_rig.port.device
    if lie.panel:
        device.answer(lie.panel, watched_rig.clock())
    if lie.fault:
        device.answer_control(f"fault {lie.fault} on")
    watched_rig.port.lies = {query: [answer] for query, answer in lie.says.items()}


def told_of(watched_rig: WatchedRig, when: str) -> Told:
    """Return what is told of the output, by the end of `SOON_S` at the latest."""
    if when == "off":
        told = told_by(watched_rig.rig.off)
        return "off" if told == "nothing" else told
    return told_by(lambda: watched_rig.live(SOON_S))


def told_by(work: Callable[[], object]) -> Told:
    """Return what is told of the output by the error in which `work` ends."""
    try:
        work()
    except OutputUnknown:
        return "unknown"
    except DeviceError as error:
        return "off" if str(error).endswith("output off, read back") else "nothing"
    return "nothing"


def is_on(watched_rig: WatchedRig) -> bool:
    """Whether the output gives a voltage, in truth."""
    instrument = watched_rig.port.device.instrument
    return instrument.output or instrument.output_v >= MONITOR_ABS_TOL_V


@pytest.mark.parametrize("lie", LIES, ids=lambda lie: f"{lie.dialect}-{lie.name}")
def test_a_lie_and_what_is_told_of_it(lie: Lie) -> None:
    with watched(LIMITS, lie.dialect) as watched_rig:
        begin(watched_rig, lie)
        begun_s = watched_rig.clock()
        told = told_of(watched_rig, lie.when)
        assert told == lie.told
        if told == "off":
            assert is_on(watched_rig) is bool(lie.because), "nobody can know better"
        if told != "nothing" and not is_on(watched_rig):
            assert (watched_rig.port.off_s or begun_s) - begun_s <= SOON_S
        assert told != "nothing" or lie.because


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("name", LINES)
def test_a_device_that_does_not_speak_its_language_any_more(dialect: str, name: str) -> None:
    """It obeys, but nothing that it says is believed."""
    with watched(LIMITS, dialect) as watched_rig:
        begin(watched_rig, Lie(dialect=dialect, name=name))
        watched_rig.port.line_lie = LINES[name]()
        told = "off" if (name, dialect) in STILL_TRUE else "unknown"
        assert told_of(watched_rig, "driving") == told
        assert not is_on(watched_rig), "it was told, although it did not say so"


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("name", LINES)
def test_nobody_is_told_off_of_an_output_that_stays_on(dialect: str, name: str) -> None:
    with watched(LIMITS, dialect) as watched_rig:
        begin(watched_rig, Lie(dialect=dialect, name=name, fault="off-ignored"))
        watched_rig.port.line_lie = LINES[name]()
        assert told_of(watched_rig, "off") == "unknown"
        assert is_on(watched_rig) or dialect == "board", "whose watchdog may have tripped since"


@pytest.mark.parametrize("dialect", ["keysight", "rigol"])
def test_a_unit_changed_in_mid_ramp_does_not_multiply_the_voltage(dialect: str) -> None:
    with watched(LIMITS, dialect) as watched_rig:
        watched_rig.rig.arm()
        watched_rig.rig.drive(replace(DRIVE, ramp_v_per_s=40))
        watched_rig.live(0.2)
        instrument, tell = watched_rig.port.device.instrument, watched_rig.port.send
        voltages = [instrument.output_v]

        def tell_and_look(data: bytes) -> None:
            tell(data)
            voltages.append(instrument.output_v)

        watched_rig.port.send = tell_and_look  # type: ignore[method-assign]
        watched_rig.port.device.answer(PANEL[dialect]["unit"], watched_rig.clock())
        assert told_of(watched_rig, "driving") == "off"
        assert 2 < voltages[0] < 15
        assert max(voltages) < voltages[0] + 2, "a step or two of the ramp"


@pytest.mark.parametrize("dialect", DIALECTS)
def test_an_honest_device_is_told_nothing_of(dialect: str) -> None:
    with watched(LIMITS, dialect) as watched_rig:
        begin(watched_rig, Lie(dialect=dialect, name="none"))
        watched_rig.live(1.0)
        assert is_on(watched_rig)
        assert told_of(watched_rig, "off") == "off"
        assert not is_on(watched_rig)
        watched_rig.live(1.0)


BLOCKS: Mapping[str, Callable[[Block], Block]] = {
    "a sample further": lambda block: replace(block, first=block.first + 1),
    "a sample again": lambda block: replace(block, first=block.first - 1),
    "the first one": lambda block: replace(block, first=0),
    "samples lost": lambda block: replace(block, lost=True),
    "twice as many": lambda block: replace(block, counts=2 * block.counts),
    "nothing new": lambda block: replace(block, counts=block.counts[:0]),
    "a tenth slower": lambda block: replace(block, first_s=1.1 * block.first_s),
    "an hour later": lambda block: replace(block, first_s=block.first_s + 3600),
    "a time before": lambda block: replace(block, first_s=-block.first_s),
    "a time of NAN": lambda block: replace(block, first_s=math.nan),
    "a time of INF": lambda block: replace(block, first_s=math.inf),
}
"""What may be said of samples, with a digest that fits."""
BYTES: Mapping[str, Callable[[bytes], bytes]] = {
    "a bit of a count": lambda content: content[:20] + bytes([content[20] ^ 1]) + content[21:],
    "a bit of the digest": lambda content: content[:-1] + bytes([content[-1] ^ 128]),
    "two samples side by side": lambda content: content[:16] + content[22:28] + content[16:],
    "its header alone": lambda content: content[:16],
    "nothing": lambda _: b"",
    "no samples, all zero": lambda _: bytes(20),
    "a count of one more": lambda content: _digested(content[:4] + b"\xff\x00" + content[6:-4]),
    "a flag of no meaning": lambda content: _digested(content[:6] + b"\x02\x00" + content[8:-4]),
}
"""What may become of a block's bytes."""


def _digested(body: bytes) -> bytes:
    return body + zlib.crc32(body).to_bytes(4, "little")


def of_blocks(lie: Callable[[bytes], bytes]) -> Callable[[str], str]:
    """Apply `lie` to the content of every block of samples that a board answers."""

    def told(line: str) -> str:
        if not line.startswith("#"):
            return line
        return in_block(lie(line.encode("latin-1")[2 + int(line[1]) :])).decode("latin-1")

    return told


def told_of_samples(name: str) -> Callable[[bytes], bytes]:
    return BYTES.get(name) or (lambda content: encoded(BLOCKS[name](decoded(content))))


@pytest.mark.parametrize("late_s", [1.0, -1.0, 0.2, -0.2])
def test_samples_dated_at_another_time_than_they_were_taken_are_not_believed(late_s: float) -> None:
    """From the first one on, and evenly: their rate is right, and the wrong part would count."""
    with watched(LIMITS, "board") as watched_rig:
        begin(watched_rig, Lie(dialect="board", name="dated"))

        def late(content: bytes) -> bytes:
            block = decoded(content)
            return encoded(replace(block, first_s=block.first_s + late_s))

        watched_rig.port.line_lie = of_blocks(late)
        watched_rig.rig.record(1000)
        with pytest.raises(DeviceError, match=r"is dated .* s from its time; .* output off, read"):
            watched_rig.live(SOON_S)
        assert not is_on(watched_rig)


def test_a_board_whose_clock_is_set_while_it_records_is_found_at_the_end() -> None:
    with watched(LIMITS, "board") as watched_rig:
        _recording(watched_rig)
        said = float(watched_rig.port.device.answer("SYST:TIME?", watched_rig.clock()) or 0)
        watched_rig.port.lies = {"SYST:TIME?": [f"{said}", f"{said - 1}"]}
        with pytest.raises(
            DeviceError, match=r"clock of the force channel moved by .*; output off"
        ):
            watched_rig.rig.recorded()
        assert not is_on(watched_rig)


def _recording(watched_rig: WatchedRig) -> None:
    begin(watched_rig, Lie(dialect="board", name="recording"))
    watched_rig.rig.record(1000)
    watched_rig.live(0.3)
    assert watched_rig.rig.forces is not None


@pytest.mark.parametrize("name", [*BLOCKS, *BYTES])
def test_a_board_that_lies_of_samples_is_turned_off(name: str) -> None:
    with watched(LIMITS, "board") as watched_rig:
        _recording(watched_rig)
        watched_rig.port.line_lie = of_blocks(told_of_samples(name))
        with pytest.raises(DeviceError, match="; output off, read back"):
            watched_rig.live(SILENT_S + SOON_S)
        assert not is_on(watched_rig)


def _until_off(watched_rig: WatchedRig) -> float:
    """Let the session live until the rig fails; return how long its output was on, s."""
    begun_s = watched_rig.clock()
    with pytest.raises(DeviceError, match="; output off, read back"):
        watched_rig.live(2)
    assert not is_on(watched_rig)
    return (watched_rig.port.off_s or math.inf) - begun_s


@pytest.mark.parametrize("late_s", [0.1, 0.15, 0.2, 0.38])
def test_blocks_that_come_late_hardly_delay_the_notice_of_a_fault(late_s: float) -> None:
    with watched(LIMITS, "board") as watched_rig:
        _recording(watched_rig)
        watched_rig.port.slow_s = {"TRAC:DATA?": late_s}
        behind_s = watched_rig.clock() + 0.5
        while watched_rig.clock() < behind_s:
            watched_rig.live(RAMP_STEP_S)
        watched_rig.port.lies = {"MEAS:TEMP?": ["900"]}
        assert _until_off(watched_rig) < NOTICED_S


@pytest.mark.parametrize("kept", [0.1, 0.5, 0.99])
def test_a_board_whose_blocks_are_always_cut_short_is_turned_off_in_time(kept: float) -> None:
    with watched(LIMITS, "board") as watched_rig:
        _recording(watched_rig)
        watched_rig.port.line_lie = lambda line: (
            line[: int(kept * len(line))] if line.startswith("#") else line
        )
        assert _until_off(watched_rig) < NOTICED_S


@pytest.mark.parametrize("name", LINES)
def test_a_recording_board_that_does_not_speak_its_language_any_more(name: str) -> None:
    with watched(LIMITS, "board") as watched_rig:
        _recording(watched_rig)
        watched_rig.port.line_lie = LINES[name]()
        assert told_of(watched_rig, "driving") == "unknown"
        assert not is_on(watched_rig)


@pytest.mark.parametrize(
    "scale",
    ["0,1E-4,1E-6", "1E-4,1E-4", "1E-4,1E-4,1E-6,1E-6", "1E-4,-1E-4,1E-6", "1E-4,NAN,1E-6",
     "1E-4,1E-4,9.9E37", "N", "1E-4,9E36,1E-6", "1E-4,1E-4,1E-3", "1,1E-4,1E-6", "1E-9,1E-4,1E-6"],
)  # fmt: skip
def test_a_board_that_lies_of_its_scale_is_refused(scale: str) -> None:
    with watched(LIMITS, "board") as watched_rig:
        begin(watched_rig, Lie(dialect="board", name="scale", says={"TRAC:SCAL?": scale}))
        with pytest.raises(DeviceError, match=r"must (answer|measure) .*; output off, read back"):
            watched_rig.rig.record(1000)
        assert not is_on(watched_rig)


def test_a_board_that_sampled_less_than_it_says_is_found_at_the_end() -> None:
    with watched(LIMITS, "board") as watched_rig:
        _recording(watched_rig)
        watched_rig.port.lies = {"SYST:TIME?": ["900"]}
        with pytest.raises(DeviceError, match=r"the last \d+ samples .* were lost; output off"):
            watched_rig.rig.recorded()


def test_there_are_lies_enough() -> None:
    assert len(LIES) + len(LINES) * len(DIALECTS) + len(BLOCKS) + len(BYTES) >= 80
