"""The command of the sliding experiment: slide."""

from typing import TYPE_CHECKING, Annotated

from typer import Option, Typer

from protocol.address import SIMULATED
from protocol.errors import BadInput
from runner.clock import Pace
from touchbeam.cli import options
from touchbeam.cli.output import complain, print_json, say

if TYPE_CHECKING:
    from runner.study.folder import StudyFolder

app = Typer()


@app.command(cls=options.Choosing)
def slide(
    study: options.StudyArgument,
    device: options.DeviceOption = None,
    session: Annotated[
        int | None, Option(min=1, help="[default: the last one, 1 if there is none]")
    ] = None,
    analyse: Annotated[
        bool, Option("--analyse", help="Draw nothing; analyse what has been drawn.")
    ] = False,
    calibrate: Annotated[
        bool, Option("--calibrate", help="Keep the fitted values as the rig's calibration.")
    ] = False,
    pace: Annotated[
        Pace | None, Option(help="[default: stepped if the device is simulated, else wall]")
    ] = None,
    rehearsal: Annotated[
        bool, Option("--rehearsal", help="Keep the session apart, as a rehearsal.")
    ] = False,
    seed: Annotated[int | None, Option(min=0, help="Of all noise. [default: the study's]")] = None,
    law: options.SimulatedLawOption = None,
    rung: options.SimulatedRungOption = None,
    as_json: options.JsonOption = False,
) -> None:
    """Draw a block along the beam, and fit the rig to it.

    The sliding experiment of the paper's section 5.1, without a participant: the operator draws
    the block as the screen says. It resumes at the pass in which it stopped. On the simulated
    device it is a rehearsal. The result is printed and written to STUDY/slide.
    """
    from protocol.journal.events import SLIDE
    from runner.launch.request import SessionOptions
    from runner.launch.run_session import run_session

    folder = options.study_folder(study)
    if analyse:
        write_result(folder, session, rehearsal=rehearsal, calibrate=calibrate, as_json=as_json)
        return
    simulated = (device or folder.study().rig.device) == SIMULATED
    # What nobody drew at a rig must never count as an experiment.
    rehearsal = rehearsal or simulated
    # The last one, because the same command goes on where it stopped.
    number = session or _last_session(folder, rehearsal=rehearsal)
    asked = SessionOptions(
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
    )
    # Standard output then holds the JSON document alone.
    tell = complain if as_json else say
    state = run_session(asked, say=tell)
    made = f"{len(state.answered)} pass{'es' * (len(state.answered) != 1)}"
    tell(
        f"slide/{number} is complete: {made}, device off (read "
        f"back){'; this was a rehearsal' * rehearsal}."
    )
    write_result(folder, number, rehearsal=rehearsal, calibrate=calibrate, as_json=as_json)


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


def _nothing_drawn(number: int) -> BadInput:
    return BadInput(f"no block has been drawn here as slide/{number}; draw it with touchbeam slide")


def write_result(
    folder: "StudyFolder", number: int | None, *, rehearsal: bool, calibrate: bool, as_json: bool
) -> None:
    """Analyse a sliding experiment, write the result to the study's folder and print it.

    Without a `number` it is the last one; without a session of it, a rehearsal if there is one.
    """
    from analysis.sliding.experiment import drawn_session
    from analysis.sliding.result import sliding_result
    from protocol.journal.events import SLIDE
    from runner.journal import names, verification
    from runner.study import calibration, files

    if folder.study_file.is_file() and not folder.journal.is_file():
        raise _nothing_drawn(number or 1)
    with options.study_journal(folder) as journal:
        rehearsal = rehearsal or not names.chains_of(journal, SLIDE, rehearsal=False)
        chosen = number or _last_session(folder, rehearsal=rehearsal)
        chain = names.existing_chain(journal, SLIDE, chosen, rehearsal=rehearsal)
        if chain not in journal.sessions():
            raise _nothing_drawn(chosen)
        drawn = drawn_session(verification.readable_events(journal, chain))
    result = sliding_result(drawn)
    out = folder.path / "slide"
    files.write_files(result.files(), out, study=folder.path)
    kept = None
    if calibrate:
        fitted = {**result.found.calibration_record(), "rehearsal": drawn.rehearsal}
        kept = calibration.keep_fit(folder.path, drawn.resonance, drawn.idn, fitted)
    if as_json:
        print_json(result.record())
        return
    for line in result.lines():
        say(line)
    say(f"Written: {out / 'slide.html'} (open it in a browser); beside it JSON and the figure")
    if kept is not None:
        rehearsed = ", from a rehearsal" if drawn.rehearsal else ""
        say(f"Kept as the rig's calibration{rehearsed}: {kept}")
