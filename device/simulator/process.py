"""A simulated device in a process of its own, for as long as somebody needs it."""

import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from device.errors import DeviceError

_END_S = 5.0


@dataclass(frozen=True, kw_only=True)
class Endpoints:
    """Where a running simulator is reached: its wire and its control socket."""

    url: str
    control: Path


@contextmanager
def simulator_process(
    touchbeam: Sequence[str],
    seed: int,
    *,
    dialect: str = "board",
    wire: str = "pty",
    keep: bool = False,
) -> Iterator[Endpoints]:
    """Start `touchbeam simulate-device` and end it, by its process, on the way out.

    Args:
        touchbeam: the command that starts touchbeam.
        seed: what the simulator's hidden properties follow from.
        dialect: what it speaks.
        wire: `pty` or `tcp`.
        keep: let it stay when its host is gone.

    Raises:
        DeviceError: it did not get ready.
    """
    with tempfile.TemporaryDirectory(prefix="touchbeam-") as folder:
        control = Path(folder, "control")
        place = str(Path(folder, "port")) if wire == "pty" else "0"
        options = ["--control", str(control), "--seed", str(seed), "--dialect", dialect]
        complaints = Path(folder, "complaints")
        with complaints.open("wb") as stderr:
            process = subprocess.Popen(
                [*touchbeam, "simulate-device", wire, place, *options, *(["--keep"] * keep)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=stderr,
                text=True,
                start_new_session=True,  # Ctrl-C is ours to handle: the device must outlive it
            )
        try:
            yield Endpoints(url=_ready_url(process, complaints), control=control)
        finally:
            _end(process)


def _ready_url(process: "subprocess.Popen[str]", complaints: Path) -> str:
    assert process.stdout is not None
    word, _, url = process.stdout.readline().strip().partition(" ")
    if word != "ready":
        said = complaints.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        why = said[-1].removeprefix("touchbeam: ") if said else "it said nothing"
        raise DeviceError(f"the simulated device did not start ({why})")
    return url


def _end(process: "subprocess.Popen[str]") -> None:
    process.terminate()
    try:
        process.wait(_END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stdout is not None:
        process.stdout.close()
