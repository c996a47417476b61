"""Commands for results: report, predict, fit, ladder."""

import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option, Typer

from protocol.errors import BadInput
from runner.people.terminal import at_terminal
from touchbeam.cli import options, output
from touchbeam.study import read_study, report_on, shown_sections, write_report_files

if TYPE_CHECKING:
    from analysis.report.report import Report
    from analysis.tables.table_cells import Cells
    from analysis.thresholds.answer_table import Track
    from protocol.study.study import Study as StudyFile
    from runner.study.folder import StudyFolder

app = Typer()


@app.command()
def report(
    study: options.StudyArgument,
    out: Annotated[
        Path | None,
        Option(parser=options.named_folder, metavar="DIR", help="[default: STUDY/report]"),
    ] = None,
    rehearsals: options.RehearsalsOption = False,
    sections: Annotated[
        str | None,
        Option(
            metavar="NAMES",
            help="Sections of the page, by commas; else those of report.toml, or all.",
        ),
    ] = None,
    figures: Annotated[
        bool, Option("--figures", help="Also write each figure as files: SVG, PDF, PNG.")
    ] = False,
    show: Annotated[bool, Option("--open", help="Open the page in a browser.")] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Report scores, statistics and figures.

    Writes an HTML page with all figures, CSV, LaTeX and JSON files.
    """
    output.collect_rarely()
    folder = options.study_folder(study)
    named = None if sections is None else tuple(map(str.strip, sections.split(",")))
    write_report(folder, out, rehearsals=rehearsals, as_json=as_json, named=named, figures=figures)
    if show:
        import webbrowser

        webbrowser.open(((out or folder.report) / "report.html").resolve().as_uri())


@app.command(cls=options.Choosing)
def predict(
    scenes: Annotated[Path, Argument(metavar="SCENES.csv", help="One row per scene.")],
    out: Annotated[
        Path, Option("-o", "--out", metavar="OUT.csv", help="Output file; - for standard output.")
    ],
    law: options.LawOption = "consistent",
    rung: Annotated[str, Option(help="A rung of `touchbeam ladder`.")] = "beam",
    tolerance: Annotated[float, Option(help="Largest error in μ' on the rung beam.")] = 1e-6,
    eq15_overlap: options.OverlapOption = "first",
    study: Annotated[Path | None, Option(help="Study whose values fill blank cells.")] = None,
) -> None:
    """Predict the friction of many scenes.

    Every column is optional; 'Friction model' (touchbeam docs) lists them. If any cell is
    invalid, nothing is written.
    """
    from analysis.model.predict import PredictOptions, study_defaults, study_rig
    from analysis.model.predict import predict as predicted
    from device.friction.calibration import NOMINAL
    from runner.study.calibration import fitted_calibration
    from runner.study.files import bytes_of, is_stream, text_of, write_whole

    file = options.study_folder(study).study() if study else None
    rig = fitted_calibration(study, file) if study and file else NOMINAL
    beside = "leave --study out for the paper's beam"
    asked = PredictOptions(
        law=law,
        rung=rung,
        tolerance=tolerance,
        eq15_overlap=eq15_overlap,
        rig=study_rig(file, rig, instead=beside) if file else rig,
    )
    defaults = study_defaults(file, rig) if file else None
    text = predicted(str(scenes), text_of(bytes_of(scenes), scenes), asked, defaults)
    to_stdout = str(out) == "-"
    if to_stdout:
        output.print_csv(text)
    else:
        write_whole(out, text.encode())
    # Keep the message out of a stream that a program reads as a table.
    streamed = to_stdout or is_stream(out)
    if not streamed or at_terminal(sys.stderr):
        own = f" on the rig with {rig}" if rig.origin else ""
        told = f"{output.counted(text.count(chr(10)) - 1, 'scene')} predicted{own}: {out}"
        (output.complain if streamed else output.say)(told)


@app.command(cls=options.Choosing)
def fit(
    table: Annotated[
        Path,
        Argument(
            metavar="TABLE",
            help="A CSV or text file or workbook (.xlsx) with columns participant, track, level, "
            "trials, correct, or without trials; or a study's folder.",
        ),
    ],
    task: options.TaskOption = None,
    shape: options.ShapeOption = "weibull",
    threshold_at: Annotated[
        float | None,
        Option(
            metavar="SHARE",
            help="Share correct that defines the threshold. [default: the curve's midpoint]",
        ),
    ] = None,
    lapse: Annotated[
        float | None,
        Option(metavar="RATE", help="The lapse rate, if it is known. [default: estimated]"),
    ] = None,
    guess: options.GuessOption = None,
    columns: Annotated[
        str | None,
        options.columns_option(
            "What columns are: subject=, condition=, level=, trials=, answer=, ignore=. "
            "[default: by their names]"
        ),
    ] = None,
    answers: Annotated[
        str | None,
        Option(
            metavar="WORD=MEANING,…",
            help="What words of answers mean: 1 or 0, as longer=1,shorter=0.",
            callback=options.text,
        ),
    ] = None,
    missing: options.MissingOption = None,
    rehearsals: options.RehearsalsOption = False,
    sheet: options.SheetOption = None,
    encoding: options.EncodingOption = None,
    decimal: options.DecimalOption = None,
    as_json: options.JsonOption = False,
) -> None:
    """Fit thresholds to a table of answers, or to those of a study.

    Prints threshold, slope and lapse rate of each participant and track, with 95% intervals, and
    compares the tracks of each participant. A row has the answers at one level, or, without the
    column trials, one trial. Missing answers are left out and counted.
    """
    from analysis.estimates import plain
    from analysis.thresholds.answer_table import (
        COLUMNS,
        columns_line,
        comparison_lines,
        comparisons,
        fits_of,
        left_out_line,
        lines_of,
        pooled_line,
        tracks_in,
        yes_or_no_line,
    )
    from analysis.thresholds.psychometric import guess_rate

    dialect = {"sheet": sheet, "encoding": encoding, "decimal": decimal}
    cells, of_study = _answers_in(table, dialect, rehearsals=rehearsals)
    cells = cells.without(missing)
    tracks = tracks_in(cells, shape, columns, answers)
    task = task or _only_task(of_study, tracks, str(table))
    asked = {"task": task, "shape": shape, "threshold_at": threshold_at, "lapse": lapse}
    fits = fits_of(tracks, str(table), **asked, guess=guess)
    fitted = list(output.followed("tracks", fits, len(tracks), alone=as_json))
    compared = list(comparisons(fitted, shape))
    unread = [f"{cells.source}: {part}." for part in cells.understood if part.endswith("left out")]
    if as_json:
        records = [track.record(threshold) for track, threshold in fitted]
        beside = {"comparisons": [plain(each) for each in compared]}
        output.print_json({"task": task, "shape": shape, "tracks": records, **beside})
        for line in filter(None, (*unread, pooled_line(cells, columns))):
            output.complain(f"touchbeam: warning: {line}")
        return
    at = fitted[0][1].threshold_at
    what = "of the curve" if guess_rate(task, guess) is None else "correct"
    output.print_table(f"Thresholds at {at:.3g} {what}", [*lines_of(fitted), [""] * len(COLUMNS)])
    if compared:
        output.print_table("Tracks compared", [*comparison_lines(compared), [""] * 5])
    said = columns_line(cells, columns), pooled_line(cells, columns)
    for line in filter(None, (*unread, *said, left_out_line(tracks), yes_or_no_line(fitted))):
        output.say(line)


def _answers_in(
    table: Path, dialect: dict[str, Any], *, rehearsals: bool
) -> "tuple[Cells, StudyFile | None]":
    """Return the cells of a file, or of the trials of a study in a folder, and that study."""
    from analysis.tables.reading import cells_in, frame_cells
    from analysis.thresholds.answer_table import MOST_BYTES, MOST_ROWS, NO_TRACKS
    from runner.study.files import bytes_of

    if not table.is_dir():
        content = bytes_of(table, most=MOST_BYTES)
        return cells_in(content, str(table), most=MOST_ROWS, **dialect), None
    folder = options.study_folder(table)
    tracks: Sequence[Any] | None = None
    with suppress(BadInput):  # what reads the results says what is wrong
        tracks = folder.study().track
    # Before anything is read, which may take long.
    if tracks is not None and not tracks:
        raise BadInput(f"{table}: {NO_TRACKS}")
    study = read_study(folder, rehearsals=rehearsals)
    if study.trials.empty:
        how = "" if rehearsals else "; add --rehearsals to include them, if there are any"
        raise BadInput(f"{table}: no trials of sessions here{how}")
    return frame_cells(study.trials, str(table)), study.file


def _only_task(study: "StudyFile | None", tracks: "Sequence[Track]", source: str) -> str:
    """Return the task of a study's tracks; of a table that of two intervals."""
    if study is None:
        return "two intervals"
    asked = {track.name: str(track.task) for track in study.track}
    tasks = {asked[track.track] for track in tracks if track.track in asked}
    if len(tasks) != 1:
        raise BadInput(
            f"{source}: its tracks ask {' and '.join(sorted(tasks)) or 'what study.toml lacks'}; "
            "add --task"
        )
    return tasks.pop()


@app.command()
def ladder(
    study: Annotated[
        Path | None, Argument(metavar="STUDY", help="Its beam is measured. [default: the paper's]")
    ] = None,
    as_json: options.JsonOption = False,
    plot: Annotated[
        Path | None, Option(metavar="FILE", help="Plot error against time: svg, png or pdf.")
    ] = None,
) -> None:
    """Measure speed and accuracy of the friction model.

    Runs every rung of the model, and the whole beam at each tolerance, on this computer: on the
    beam of the study as calibrated, or the paper's. A rung that the beam does not allow is named.
    """
    from analysis.model.ladder import (
        ladder_lines,
        ladder_panel,
        ladder_words,
        measured_ladder,
        study_scene,
    )
    from device.friction.scenes import Scene
    from runner.study.calibration import fitted_calibration

    # Refused before the rungs are timed, which takes a while.
    kind = plot.suffix.removeprefix(".").lower() if plot else "svg"
    if kind not in ("svg", "png", "pdf"):
        raise BadInput(f"--plot must end in .svg, .png or .pdf, got {plot}")
    scene = Scene()
    if study is not None:
        file = options.study_folder(study).study()
        scene = study_scene(file, fitted_calibration(study, file))
    rows = measured_ladder(scene)
    if plot:
        from analysis.report.drawing import panels_files
        from runner.study.files import write_whole

        write_whole(plot, panels_files([ladder_panel(rows)], [kind])[kind])
        (output.complain if as_json else output.say)(f"Written: {plot}")
    if as_json:
        beam = {"length_m": scene.structure.beam.length_m, "mode": scene.drive.mode}
        output.print_json([asdict(row) | beam for row in rows])
        return
    output.print_table("The ladder", ladder_lines(rows))
    for line in ladder_words(scene, rows):
        output.say(line)


def write_report(
    folder: "StudyFolder",
    out: Path | None,
    *,
    rehearsals: bool,
    as_json: bool,
    named: tuple[str, ...] | None = None,
    figures: bool = False,
) -> None:
    """Write the report on the study in `folder` to the folder `out` and print the table of scores.

    Without `out` it goes to `report` in the study's folder. Its `figures` become files if asked.
    Its page shows the sections `named`; without them those of `report.toml`, or all.
    """
    from analysis.report.report import FIGURE_FILES, report_files

    place = out or folder.report
    if place.exists() and not place.is_dir():
        raise BadInput(f"{place}: must be a folder for the report, got a file")
    # Before anything is read, which may take long.
    shown = shown_sections(folder, named)
    bar = partial(output.followed, "sessions", alone=as_json)
    study = read_study(folder, rehearsals=rehearsals, followed=bar)
    result, withdrawals = report_on(study, shown, alone=named is not None), study.withdrawals
    # The tables of all sessions would stay in memory beside the page that is made of them.
    del study
    files = report_files(result, figures=figures)
    warn_of_broken(result.origin.broken_chains, folder.path)
    write_report_files(folder, withdrawals, files, out)
    if as_json:
        output.print_json_text(files["report.json"].decode())
        return
    _print_results(result)
    drawn = len(FIGURE_FILES & files.keys())
    beside = [
        *sorted(files.keys() - {*FIGURE_FILES, "report.html"}),
        f"{drawn} figure files" if figures else "with --figures figure files",
    ]
    output.say(
        f"Written: {place / 'report.html'} (open it in a browser); beside it {', '.join(beside)}"
    )


def _print_results(result: "Report") -> None:
    """Print the table of scores and the lines that say what a report found."""
    from analysis.report import results, table4_text, wording
    from analysis.report.sections import registration, session_checks

    for line in results.contrary_lines(result):
        output.say(line)
    if result.loaded.table.conditions:
        table, tests = result.table.table4, result.trials.response_tests
        lines = table4_text.table4_lines(
            table, wording.MISSING, result.loaded.marks, result.mean_name
        )
        output.print_table("Table 4" if result.is_papers else "Scores", lines)
        of = "Responses. " * (result.measure == "response")
        said = [
            *result.loaded.notes,
            f"{of}{wording.omnibus_line(tests)}",
            *[f"{results.TOGETHER} {results.together(result)}"]
            * (len(result.questions.p_holm) > 1),
        ]
    else:
        said = ["No conditions: no table of scores."]
    for line in (
        *said,
        *results.threshold_lines(result),
        *registration.registered_lines(result),
        *session_checks.left_out_lines(result.loaded),
    ):
        output.say(line)


def warn_of_broken(sessions: "Sequence[str]", study: Path) -> None:
    """Warn that the journal of these sessions was changed, if there are any."""
    if not sessions:
        return
    named = ", ".join(sessions[:10]) + (f" and {len(sessions) - 10} more" if sessions[10:] else "")
    output.complain(
        f"touchbeam: warning: the journal was modified outside touchbeam, in {named}; "
        f"see touchbeam verify {study}"
    )
