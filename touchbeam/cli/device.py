"""Commands for the device and this computer: device, simulate-device, doctor."""

import os
import sys
from functools import partial
from pathlib import Path
from typing import Annotated

from typer import Argument, Exit, Option, Typer

from runner.clock import WallClock
from touchbeam.cli import options
from touchbeam.cli.output import bars, named_quantity, print_json, quantity, say

app = Typer()
device_commands = Typer(
    name="device",
    help="List ports, identify the device, find its resonance.",
    add_completion=False,
    rich_markup_mode=None,
)
app.add_typer(device_commands, name="device")


@device_commands.command("list")
def device_list(as_json: options.JsonOption = False) -> None:
    """List the serial ports without opening them."""
    from runner.launch.device_access import ports

    known = ports()
    if as_json:
        print_json(known)
        return
    for port in known:
        say("  ".join(text for text in port.values() if text))
    if not known:
        say("no serial ports found; for a generator on the network use socket://ADDRESS:5025")


@device_commands.command("probe")
def device_probe(url: options.UrlArgument, as_json: options.JsonOption = False) -> None:
    """Identify the device and report its status.

    Changes no setting; the device's output stays as it is.
    """
    from runner.launch.device_access import probed
    from runner.launch.locks import rig_lock

    with rig_lock(url):
        # Under the lock: two programs that ask at one port would get each other's answers.
        status = probed(url)
    if as_json:
        print_json(status)
        return
    for name, value in status.items():
        label, shown = named_quantity(name, "0" if value is None else value)
        shown = "not measured" if value is None else shown
        is_switch = name == "output" and shown in {"0", "1"}
        say(f"{label:15} {('off', 'on')[int(shown)] if is_switch else shown}")


@device_commands.command("sweep", cls=options.Choosing)
def device_sweep(
    url: options.UrlArgument,
    near: Annotated[
        float, Option(min=100, max=95_000, metavar="HZ", help="Expected resonance.")
    ] = 24_221.0,
    dialect: options.DialectOption = "board",
    keep: Annotated[
        Path | None, Option(metavar="STUDY", help="Save it as this study's calibration.")
    ] = None,
    as_json: options.JsonOption = False,
) -> None:
    """Find the resonance of the untouched beam at 10 V.

    Searches within 5% of --near, then turns the output off.
    """
    from runner.launch.device_access import swept
    from runner.launch.locks import rig_lock
    from runner.signals import never_suspended
    from runner.study.calibration import keep_calibration

    with rig_lock(url), never_suspended(ends=True):
        # Under the lock: this drives the beam, on which a participant's finger may lie.
        peak, idn = swept(url, near, dialect)
    now = WallClock().utc().isoformat(timespec="seconds")
    file = keep_calibration(keep, peak, idn, now) if keep else None
    if as_json:
        print_json(
            {
                "idn": idn,
                "resonance_hz": peak.frequency_hz,
                "frequency_hz": peak.frequency_hz,
                "tip_m_per_v": peak.tip_m_per_v,
                "curve": [list(point) for point in peak.curve],
                "kept": str(file) if file else None,
            }
        )
        return
    if peak.curve:
        first, last = (quantity(peak.curve[end][0], "Hz") for end in (0, -1))
        say(f"{first}  {bars([tip_m for _, tip_m in peak.curve])}  {last}")
    say(
        f"resonance {quantity(peak.frequency_hz, 'Hz')}, {1e9 * peak.tip_m_per_v:.1f} nm per "
        f"volt at the tip; device off (read back){f'; saved in {file}' if file else ''}"
    )


@app.command("simulate-device", cls=options.Choosing)
def simulate_device(
    wire: Annotated[options.Wire, Argument(help="pty or tcp")],
    place: Annotated[str, Argument(metavar="LINK|PORT", help="A path or a loopback port.")],
    dialect: options.DialectOption = "board",
    control: Annotated[Path | None, Option(metavar="SOCKET", help="Unix socket to create.")] = None,
    keep: Annotated[
        bool, Option("--keep", help="Keep running after the host disconnects.")
    ] = False,
    seed: Annotated[int, Option(min=0)] = 0,
    law: options.SimulatedLawOption = None,
    rung: options.SimulatedRungOption = None,
    damping: options.SimulatedDampingOption = None,
    gauge: Annotated[
        str | None,
        Option(metavar="LINK|PORT", help="Also a force gauge, at a path or loopback port."),
    ] = None,
    study: Annotated[Path | None, Option(help="Study whose surface is simulated.")] = None,
) -> None:
    """Simulate the device in the foreground.

    Prints `ready URL` and ends when its host disconnects.
    """
    from device.simulator.device import SimulatedDevice
    from device.simulator.server import simulate
    from runner.launch.device_access import simulated_surface

    touched = simulated_surface(study)
    make = partial(
        SimulatedDevice, seed, dialect=dialect, law=law, rung=rung, damping=damping, **touched
    )
    simulate(wire, place, control, make, gauge=gauge, keep=keep, say=say)


@app.command()
def doctor(as_json: options.JsonOption = False) -> None:
    """Check that this computer can run a session."""
    from runner.doctor import findings
    from runner.launch.device_access import touchbeam_command

    results = findings(touchbeam_command())
    if as_json:
        print_json([vars(finding) for finding in results])
    else:
        for finding in results:
            say(finding.line())
    if not all(finding.ok for finding in results):
        raise Exit(1)


@app.command("participant-screens", hidden=True)
def participant_screens(show: Annotated[bool, Option("--show")] = False) -> None:
    """Print the screens as JSON, or show their numbers until the standard input ends."""
    _leave_folder()
    from runner.screen_list import print_screens, show_numbers

    (show_numbers if show else print_screens)()


@app.command("participant-window", hidden=True)
def participant_window() -> None:
    """Serve the participant's window; started by a session, which uses its pipes."""
    _leave_folder()
    from runner.window.server import serve_window

    serve_window()


def _leave_folder() -> None:
    """Go where nothing lies but programs, before the libraries of screens and windows come.

    They load shared libraries from `lib`, fonts from `fonts` and settings from files in the
    current folder, which may be a study that somebody sent.
    """
    os.chdir(Path(sys.executable).parent)
