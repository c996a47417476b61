"""The commands about the device and this machine: device, simulate-device, doctor."""

from pathlib import Path
from typing import Annotated

import typer

from runner.cli.options import Choosing, DialectOption, JsonOption, UrlArgument, Wire, print_json

app = typer.Typer()
device_commands = typer.Typer(help="The device: ports, identity and health, resonance.")
app.add_typer(device_commands, name="device")


@device_commands.command("list")
def device_list(as_json: JsonOption = False) -> None:
    """List the serial ports, without opening any."""
    from runner.launch.probe import ports

    found = ports()
    if as_json:
        print_json(found)
        return
    for port in found:
        typer.echo("  ".join(text for text in port.values() if text))
    if not found:
        typer.echo("no serial ports; a generator on the network is socket://ADDRESS:5025")


@device_commands.command("probe")
def device_probe(url: UrlArgument, as_json: JsonOption = False) -> None:
    """Say who answers, and how it is.

    Nothing is set; the device's output stays as it is.
    """
    from runner.launch.locks import rig_lock
    from runner.launch.probe import probed
    from runner.launch.rig import touchbeam_command

    with rig_lock(url, "touchbeam device probe"):
        said = probed(url, touchbeam_command())
    if as_json:
        print_json(said)
        return
    for name, value in said.items():
        typer.echo(f"{name:15} {value}")


@device_commands.command("sweep", cls=Choosing)
def device_sweep(
    url: UrlArgument,
    near: Annotated[float, typer.Option(min=100, max=95_000, metavar="HZ")] = 24_221.0,
    dialect: DialectOption = "board",
    keep: Annotated[
        Path | None, typer.Option(metavar="STUDY", help="Keep it as this study's calibration.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Find the resonance, untouched, at 10 V.

    Looks within 5 % of --near and turns the output off again.
    """
    from runner.launch.locks import rig_lock
    from runner.launch.probe import kept, swept
    from runner.launch.rig import touchbeam_command

    with rig_lock(url, "touchbeam device sweep"):
        found, idn = swept(url, near, dialect, touchbeam_command())
    file = kept(keep, found, idn) if keep else None
    if as_json:
        print_json(
            {
                "idn": idn,
                "frequency_hz": found.frequency_hz,
                "tip_m_per_v": found.tip_m_per_v,
                "kept": str(file) if file else None,
            }
        )
        return
    typer.echo(
        f"resonance {found.frequency_hz:.1f} Hz, {1e9 * found.tip_m_per_v:.1f} nm per volt at the "
        f"tip; device off (read back){f'; kept in {file}' if file else ''}"
    )


@app.command("simulate-device", cls=Choosing)
def simulate_device(
    wire: Annotated[Wire, typer.Argument(help="pty or tcp")],
    place: Annotated[str, typer.Argument(metavar="LINK|PORT", help="A path, or a loopback port.")],
    dialect: DialectOption = "board",
    control: Annotated[
        Path | None, typer.Option(metavar="SOCKET", help="A Unix socket to make.")
    ] = None,
    keep: Annotated[bool, typer.Option("--keep", help="Stay when the host is gone.")] = False,
    seed: Annotated[int, typer.Option(min=0)] = 0,
) -> None:
    """Simulate the device, in the foreground.

    Prints `ready URL` and ends when its host is gone.
    """
    from device.simulator.server import simulate

    simulate(wire, place, control, dialect=dialect, keep=keep, seed=seed, say=typer.echo)


@app.command()
def doctor(as_json: JsonOption = False) -> None:
    """Look at what this machine offers a session."""
    from runner.doctor import findings

    found = findings()
    if as_json:
        print_json([finding.record() for finding in found])
    else:
        for finding in found:
            typer.echo(finding.line())
    if not all(finding.ok for finding in found):
        raise typer.Exit(1)


@app.command("participant-window", hidden=True)
def participant_window() -> None:
    """Serve the participant's window; a session starts this and talks to it by its pipes."""
    from runner.window.server import serve_window

    serve_window()
