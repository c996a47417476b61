"""The command of the sliding experiment: slide."""

from typing import TYPE_CHECKING, Annotated

import typer

from protocol.address import SIMULATED
from runner.cli.options import (
    Choosing,
    SimulatedLawOption,
    SimulatedRungOption,
    StudyArgument,
    address,
)
from runner.cli.output import say
from runner.clock import Pace

if TYPE_CHECKING:
    from runner.study.folder import StudyFolder

app = typer.Typer()


@app.command(cls=Choosing)
def slide(
    study: StudyArgument,
    device: Annotated[
        str | None,
        typer.Option(
            help="A serial port, socket://HOST:PORT, or sim. [default: the study's]",
            callback=address,
        ),
    ] = None,
    session: Annotated[
        int | None, typer.Option(min=1, help="[default: the last one, 1 if there is none]")
    ] = None,
    pace: Annotated[
        Pace | None,
        typer.Option(help="[default: stepped if the device is simulated, else wall]"),
    ] = None,
    rehearsal: Annotated[
        bool, typer.Option("--rehearsal", help="Keep the session apart, as a rehearsal.")
    ] = False,
    seed: Annotated[int | None, typer.Option(min=0, help="[default: the study's]")] = None,
    law: SimulatedLawOption = None,
    rung: SimulatedRungOption = None,
) -> None:
    """Draw a block along the beam and measure its friction.

    The sliding experiment of the paper's section 5.1, without a participant: the operator draws
    the block as the screen says. It resumes at the pass in which it stopped. On the simulated
    device it is a rehearsal.
    """
    from protocol.journal.events import SLIDE
    from runner.launch.device_access import touchbeam_command
    from runner.launch.run_session import SessionOptions, run_session
    from runner.study.folder import StudyFolder

    folder = StudyFolder(path=study)
    simulated = (device or folder.study().rig.device) == SIMULATED
    rehearsal = rehearsal or simulated
    number = session or _last_session(folder, rehearsal=rehearsal)
    options = SessionOptions(
        folder=folder,
        participant=SLIDE,
        number=number,
        device=device,
        ratings="virtual" if simulated else "console",
        pace=pace,
        rehearsal=rehearsal,
        seed=seed,
        law=law,
        rung=rung,
        slides=True,
        touchbeam=touchbeam_command(),
    )
    state = run_session(options, say=say)
    say(
        f"slide/{number} is complete: {len(state.answered)} passes, device off (read "
        f"back){'; this was a rehearsal' * rehearsal}."
    )


def _last_session(folder: "StudyFolder", *, rehearsal: bool) -> int:
    """Return the number of the last sliding experiment in the journal, 1 without any."""
    from protocol.journal.events import SLIDE
    from runner.journal.names import chains_of, parsed_name
    from runner.journal.opening import read_journal

    if not folder.journal.exists():
        return 1
    with read_journal(folder.journal) as journal:
        chains = chains_of(journal, SLIDE, rehearsal=rehearsal)
    return max((parsed_name(chain).number for chain in chains), default=1)
