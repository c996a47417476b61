"""The command of the sliding experiment: slide."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypedDict, Unpack

from typer import Option, Typer

from protocol.address import SIMULATED
from protocol.errors import BadInput
from runner.clock import Pace
from touchbeam.cli import options
from touchbeam.cli.output import complain, counted, print_json, say

if TYPE_CHECKING:
    from analysis.sliding.experiment import DrawnSession
    from protocol.study.surface import Surface
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
    table: Annotated[
        Path | None,
        Option(
            metavar="FILE.csv",
            help="Write the measured friction as a table for a surface of kind measured.",
        ),
    ] = None,
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
    device it is a rehearsal. The rig that is fitted has the beam of the study; without a model of
    its surface friction is measured, and nothing fitted. The result is printed and written to
    STUDY/slide.
    """
    from protocol.journal.events import SLIDE
    from runner.launch.request import SessionOptions
    from runner.launch.run_session import run_session

    folder = options.study_folder(study)
    # Refused before anybody draws.
    if table is not None and table.suffix.lower() != ".csv":
        raise BadInput(f"--table must end in .csv, as [surface] table has it, got {table}")
    asked_for: _Asked = {"calibrate": calibrate, "table": table, "as_json": as_json}
    if analyse:
        write_result(folder, session, rehearsal=rehearsal, **asked_for)
        return
    file = folder.study()
    if calibrate:
        _require_calibrated(file.surface)
    simulated = (device or file.rig.device) == SIMULATED
    # What nobody drew at a rig must never count as an experiment.
    rehearsal = rehearsal or simulated
    # The last one, because the same command goes on where it stopped.
    number = session or _last_session(folder, rehearsal=rehearsal)
    session_asked = SessionOptions(
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
    state = run_session(session_asked, say=tell)
    made = f"{len(state.answered)} pass{'es' * (len(state.answered) != 1)}"
    tell(
        f"slide/{number} is complete: {made}, device off (read "
        f"back){'; this was a rehearsal' * rehearsal}."
    )
    write_result(folder, number, rehearsal=rehearsal, **asked_for)


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


def _require_calibrated(surface: "Surface") -> None:
    if surface.kind == "given":
        raise BadInput(
            "--calibrate keeps nothing of a surface of kind given, whose friction no model "
            "predicts; leave it out (--table writes what was measured)"
        )


class _Asked(TypedDict):
    """What is to come of a sliding experiment, beside its result."""

    calibrate: bool
    table: Path | None
    as_json: bool


def _drawn(folder: "StudyFolder", number: int | None, *, rehearsal: bool) -> "DrawnSession":
    """Return a sliding experiment of the study's journal.

    Without a `number` it is the last one; without a session of it, a rehearsal if there is one.
    """
    from analysis.sliding.experiment import drawn_session
    from protocol.journal.events import SLIDE
    from runner.journal import names, verification

    if folder.study_file.is_file() and not folder.journal.is_file():
        raise _nothing_drawn(number or 1)
    with options.study_journal(folder) as journal:
        rehearsal = rehearsal or not names.chains_of(journal, SLIDE, rehearsal=False)
        chosen = number or _last_session(folder, rehearsal=rehearsal)
        chain = names.existing_chain(journal, SLIDE, chosen, rehearsal=rehearsal)
        if chain not in journal.sessions():
            raise _nothing_drawn(chosen)
        return drawn_session(verification.readable_events(journal, chain))


def write_result(
    folder: "StudyFolder", number: int | None, *, rehearsal: bool, **asked_for: Unpack[_Asked]
) -> None:
    """Analyse a sliding experiment, write the result to the study's folder and print it.

    Which one it is, see `_drawn`.
    """
    from analysis.sliding.friction_table import friction_csv, friction_rows
    from analysis.sliding.result import sliding_result
    from runner.study import calibration, files

    drawn = _drawn(folder, number, rehearsal=rehearsal)
    if asked_for["calibrate"]:
        _require_calibrated(drawn.surface)
    result, table = sliding_result(drawn), asked_for["table"]
    # Before anything is written: a table that lacks something is refused.
    rows = [] if table is None else friction_rows(drawn, result.found)
    out = folder.path / "slide"
    files.write_files(result.files(), out, study=folder.path)
    rehearsed = ", from a rehearsal" * drawn.rehearsal
    said = [f"Written: {out / 'slide.html'} (open it in a browser); beside it JSON and the figure"]
    if table is not None:
        files.write_whole(table, friction_csv(rows).encode())
        at = rows[0].index("place_m")
        first_mm, last_mm = (1e3 * float(row[at]) for row in (rows[1], rows[-1]))
        said.append(
            f"Table of {counted(len(rows) - 1, 'row')} of friction{rehearsed}, at {first_mm:g} to "
            f"{last_mm:g} mm, where touch.path_m and touch.smooth_place_m must lie: {table}"
        )
    if asked_for["calibrate"]:
        fitted = {
            **result.found.calibration_record(),
            **calibration.beam_of(drawn.surface),
            "rehearsal": drawn.rehearsal,
        }
        kept = calibration.keep_fit(folder.path, drawn.resonance, drawn.idn, fitted)
        said.append(f"Kept as the rig's calibration{rehearsed}: {kept}")
    if asked_for["as_json"]:
        print_json(result.record())
        return
    for line in (*result.lines(), *said):
        say(line)
