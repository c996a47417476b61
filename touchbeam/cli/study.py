"""Commands that create, check, run and register a study."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Exit, Option, Typer

from protocol.errors import BadInput, page, typed_as
from runner.clock import Pace, WallClock
from touchbeam.cli import options, output
from touchbeam.cli.output import complain, counted, print_json, program, say

app = Typer()


@app.command()
def demo(
    out: Annotated[
        Path | None, Option(help="A new folder. [default: ./demo, then ./demo-2, …]")
    ] = None,
    participants: Annotated[int, Option(min=1, max=99, help="Virtual ones.")] = 9,
    seed: Annotated[int, Option(min=0, help="Of everything random.")] = 1,
    people: options.PeopleOption = None,
) -> None:
    """Run and report the paper's study in simulation.

    Uses the simulated device and virtual participants, who feel small changes as the paper's did.
    """
    from device.people.person import SENSITIVE
    from protocol.study_file.loading import template
    from runner.launch.rehearsal import rehearse_cohort
    from runner.study.folder import new_study, numbered
    from touchbeam.cli.results import write_report

    population = SENSITIVE if people is None else options.people_in_file(people)
    folder = options.study_folder(out or numbered(Path("demo")))
    # If the demo fails before its first session, its folder is removed again.
    with (
        new_study(folder, template("paper")),
        output.progress("participants", participants) as step,
    ):
        rehearse_cohort(folder, participants, seed, step, population)
    # Rehearsals: a simulated device makes nothing else.
    write_report(folder, None, rehearsals=True, as_json=False)
    sessions = "the session" if participants == 1 else f"each of {participants} sessions"
    say(f"Device off, read back after {sessions}.")
    say("The participants are virtual and the device is simulated: no person gave these scores.")
    say(
        f"Now open {typed_as(folder.report / 'report.html')} in a browser, "
        f"and begin a study of your own: {program()} new mystudy"
    )


@app.command(cls=options.Choosing)
def new(
    folder: Annotated[Path, Argument(metavar="DIR", help="A new or an empty folder.")],
    template: options.TemplateOption = "paper",
) -> None:
    """Create a study to edit."""
    from protocol.study_file.loading import template as template_text
    from protocol.study_file.loading import template_pictures, template_tests
    from runner.study.files import write_whole
    from runner.study.folder import named_after, new_study

    study = options.study_folder(folder)
    text = named_after(folder.resolve().name, template_text(template))
    with new_study(study, text):
        tests = folder / "test_study.py"
        write_whole(tests, template_tests().encode())
        for name, picture in template_pictures(template).items():
            write_whole(folder / name, picture)
    place = typed_as(folder)
    say(f"Edit {study.study_file}; {page('Study file')} describes every key. Then:")
    say(f"  {program()} check {place}")
    say(f"  {program()} run {place} --participant P01 --ratings virtual    # a rehearsal")
    say(f"{tests} tests the study with pytest, see {page('Test a study')}; you may delete it.")


@app.command()
def translate(
    study: options.StudyArgument,
    code: Annotated[str, Argument(metavar="CODE", help="The language, such as fr.")],
) -> None:
    """Copy the participants' texts into the study, to translate them.

    Writes texts/CODE.toml in English, or in the built-in language of that code.
    """
    folder = options.study_folder(study)
    file = folder.add_language(code)
    say(
        f'Translate {file}. Name "{code}" in `languages` of [session] in {folder.study_file}. Then:'
    )
    say(f"  {program()} check {typed_as(study)}")


@app.command()
def check(
    study: options.StudyArgument,
    participants: Annotated[
        int | None, Option(min=1, max=10_000, help="Whose plans to show. [default: the study's]")
    ] = None,
    as_json: options.JsonOption = False,
) -> None:
    """Show a study's plan, or list all its problems."""
    output.collect_rarely()
    from runner.study.check import checked

    lines, problems = checked(options.study_folder(study), participants, as_json=as_json)
    for problem in problems:
        complain(f"touchbeam: {problem}")
    for line in lines:
        (output.print_json_text if as_json else say)(line)
    if problems:
        raise Exit(2)


@app.command()
def track(
    study: options.StudyArgument,
    name: Annotated[str, Argument(metavar="NAME", help="The name of a [[track]].")],
    answers: Annotated[
        str, Option(help='In their order, 1 for correct or yes, else 0: "1 1 0".')
    ] = "",
    as_json: options.JsonOption = False,
) -> None:
    """Show what a track would ask after these answers, and its estimate of the threshold.

    Nothing is driven or recorded.
    """
    from touchbeam.tracks import track as asked

    given = answers.replace(",", " ").split()
    if wrong := next((each for each in given if each not in {"0", "1"}), None):
        raise BadInput(f'--answers must be 1 or 0 each, such as "1 1 0", got {wrong!r}')
    options.study_folder(study)  # which says what is ignored in its file
    found = asked(study, name, [int(each) for each in given])
    if as_json:
        print_json(found)
        return
    for number, (value, each) in enumerate(zip(found["values"], given, strict=True), start=1):
        say(f"{number:>3}  level {found['levels'][number - 1]:>3}  {value:<10.5g}  {each}")
    following, estimate = found["next"], found["estimate"]
    if following is None:
        say("The track has ended.")
    else:
        value, volts = following["value"], following["volts"]
        say(f"Next: level {following['index']}, {value:.5g} ({volts:.5g} V)")
    defined = (
        f"{estimate['threshold_at']:.4g} {'yes' if found['task'] == 'yes or no' else 'correct'}"
    )
    if estimate["threshold"] is None:
        say(f"Threshold at {defined}: not determined by these answers")
    else:
        low, high = (f"{end:.4g}" for end in estimate["threshold_ci"])
        say(f"Threshold at {defined}: {estimate['threshold']:.4g}, 95% interval {low} to {high}")
    if (mean := estimate.get("reversal_mean")) is not None:
        at = estimate.get("reversal_mean_at")
        defined = "" if at is None else f", which converges to {at:.4g} correct"
        of = f"the last {estimate['reversals_in_mean']} of {estimate['reversals']} reversals"
        say(f"Mean of {of}: {mean:.4g}{defined}")


@app.command(cls=options.Choosing)
def run(
    study: options.StudyArgument,
    participant: Annotated[str, Option(help="A pseudonym, such as P01.")],
    session: Annotated[int, Option(min=1, help="Number of the participant's session.")] = 1,
    device: options.DeviceOption = None,
    ratings: options.RatingsOption = "window",
    pace: Annotated[
        Pace | None,
        Option(
            help="wall: real time; stepped: without waiting. "
            "[default: stepped if device and ratings are simulated, else wall]"
        ),
    ] = None,
    rehearsal: Annotated[
        bool, Option("--rehearsal", help="Take no slot of the design; omit from reports.")
    ] = False,
    language: options.LanguageOption = None,
    screen: Annotated[
        int | None,
        Option(
            min=0,
            help="The participant's screen, numbered from 0. [default: asked for once, then kept]",
        ),
    ] = None,
    windowed: Annotated[
        bool, Option("--windowed", help="Use a small window instead of the full screen.")
    ] = False,
    consent: options.ConsentOption = None,
    extra: Annotated[bool, Option("--extra", help="Allow a session that is not due.")] = False,
    override: Annotated[
        str | None,
        Option(
            help="Begin before or after the session is due, for this reason.", callback=options.text
        ),
    ] = None,
    group: Annotated[
        str | None,
        Option(help="The participant's group. [default: asked for, or as the study says]"),
    ] = None,
    new_name: Annotated[
        bool, Option("--new", help="The participant is new, though a name is nearly alike.")
    ] = False,
    seed: Annotated[
        int | None, Option(min=0, help="Of everything random. [default: the study's]")
    ] = None,
    law: options.SimulatedLawOption = None,
    rung: options.SimulatedRungOption = None,
    damping: options.SimulatedDampingOption = None,
    people: options.PeopleOption = None,
    at_window: Annotated[
        bool,
        Option(
            "--at-window",
            help="Virtual ratings are given at the participant's window, with its keys.",
        ),
    ] = False,
) -> None:
    """Run or resume a session.

    An interrupted session resumes at the trial in which it stopped. With a simulated device or
    virtual ratings it is a rehearsal, which leaves the participant's name free.
    """
    from runner.journal.cohort import Arrival, due_in_words, states
    from runner.journal.opening import read_journal
    from runner.launch.request import SessionOptions
    from runner.launch.run_session import run_session

    asked = SessionOptions(
        folder=options.study_folder(study),
        participant=participant,
        number=session,
        device=device,
        ratings=ratings,
        pace=pace,
        rehearsal=rehearsal,
        language=language,
        screen=screen,
        windowed=windowed,
        consent=consent,
        extra=extra,
        override=override,
        group=group,
        new_name=new_name,
        seed=seed,
        law=law,
        rung=rung,
        damping=damping,
        people=None if people is None else options.people_in_file(people),
        at_window=at_window,
    )
    state = run_session(asked, say=say, confirm=output.require_confirmation)
    dry_run = state.opened is not None and state.opened.kind == "rehearsal"
    # A generator reads back no force, so that each of its touches would count.
    unfelt = sum(state.unfelt.values()) if asked.folder.study().rig.dialect == "board" else 0
    fingerless = f"; {unfelt} touch{'es' * (unfelt > 1)} without a finger on the surface"
    following = ""
    if not dry_run:
        with read_journal(asked.folder.journal) as journal:
            who = Arrival(states(journal), participant, "participant")
        if due := who.next_due(asked.folder.study()):
            following = f"; the next session is due {due_in_words(due)}"
    say(
        f"{participant}/{session} is complete: {counted(len(state.answered), 'trial')} answered, "
        f"device off (read back){fingerless * (unfelt > 0)}"
        f"{'; this was a rehearsal' * dry_run}{following}."
    )


@app.command()
def register(
    study: options.StudyArgument,
    primary: Annotated[
        str | None,
        Option(metavar="NAME", help='The hypothesis tested first. ["conditions differ"]'),
    ] = None,
    hypothesis: Annotated[
        list[str] | None,
        Option(metavar="NAME", help='A further one, such as "voltage above structure".'),
    ] = None,
    as_json: options.JsonOption = False,
) -> None:
    """Lock the plan and the analysis before the first session.

    Writes registration.toml, whose digest then seeds every order, and prints what it settles.
    """
    from analysis.loading.exclusion_rules import rules_in_words
    from analysis.report.hypotheses import how_tested, require_asked
    from analysis.report.sections.registration import analysis_settings
    from protocol.registration.registration import FILE
    from protocol.registration.registry_text import registry_text
    from runner.journal.opening import checked_place, mounts_of_this_machine
    from runner.study.check import runnable_study
    from runner.study.registered import new_registration
    from runner.study.registered import register as write

    folder = options.study_folder(study)
    text = folder.text()
    checked = runnable_study(text, str(folder.study_file))
    checked_place(folder.path, mounts_of_this_machine())
    asked = hypothesis or []
    named = [*filter(None, (primary, *asked))]
    require_asked(checked, named)
    known = how_tested(checked, named)
    made = new_registration(
        folder,
        text,
        checked,
        hypotheses=(primary, asked, known),
        analysis=analysis_settings(),
        exclusions=rules_in_words(checked.exclusions),
    )
    made, replaced = write(folder, made, WallClock())
    tests = how_tested(checked, made.hypotheses, made.earlier)
    text = "".join(f"{line}\n" for line in registry_text(made, tests, checked.surface))
    if as_json:
        print_json(
            {
                "digest": made.digest,
                "file": str(study / FILE),
                "primary": made.primary,
                "secondary": list(made.secondary),
                "participants": made.participants,
                "replaced": replaced,
                "text": text,
            }
        )
        return
    for line in text.splitlines():
        say(line)
    say("")
    if replaced:
        say(f"This replaces {replaced}")
    say(f"Written: {study / FILE}")
    say("Put it into a registry now, with the study file and the text above.")
    say(f"Next: touchbeam check {typed_as(study)}")
