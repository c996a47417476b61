"""What `touchbeam status` says about each session, and what to do next."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest

from protocol.journal.events import (
    DeviceArmed,
    Event,
    RigDescribed,
    SessionCompleted,
    SessionExcluded,
    SessionOpened,
    TouchStarted,
    TrialStarted,
)
from protocol.journal.records import CommandedDrive, InstructionResponse
from protocol.journal.state import folded
from protocol.study_file.loading import parsed_study, template
from runner.study.progress import Progress
from tests.analysis.chains import BEGAN, chain, opened

STUDY = parsed_study(template("paper"))


def progress(
    *sessions: tuple[str, Sequence[Event]], hours: float = 1.0, running: str = ""
) -> Progress:
    return Progress(
        folder=Path("my study"),
        study=STUDY,
        sessions={name: folded(chain(events)) for name, events in sessions},
        running={running},
        now=BEGAN + timedelta(hours=hours),
    )


def begun(who: str, kind: str = "participant", slot: int = 0) -> list[Event]:
    return [opened(who, ["voltage"], kind=kind, slot=slot)]


def test_an_interrupted_session_says_until_when_and_how_to_go_on() -> None:
    session, cohort = progress(("P02/1", begun("P02"))).lines()
    until = (BEGAN + timedelta(hours=24)).astimezone()
    assert session == (
        f"P02/1  participant  interrupted  0 of 0 trials; go on before {until:%A %H:%M} with: "
        "touchbeam run 'my study' --participant P02"
    )
    assert cohort == (
        "Done: 0 of 9 participants. The next participant gets slot 1 of the design, for example: "
        "touchbeam run 'my study' --participant P03"
    )


@pytest.mark.parametrize(("trace", "ratings"), [(None, " --ratings console"), ({}, "")])
def test_a_session_at_the_console_goes_on_there(
    trace: dict[str, object] | None, ratings: str
) -> None:
    ready = InstructionResponse(answer="ready", reaction_time_s=1.0, trace=trace)
    drive = CommandedDrive(voltage_v=0.0, frequency_hz=24_000.0, ramp_v_per_s=400.0)
    touched: list[Event] = [
        DeviceArmed(idn="rig", boot=1, device_time_s=0.0),
        TrialStarted(index=0, kind="trial"),
        TouchStarted(touch=0, commanded=drive, instruction=ready),
    ]
    session, _ = progress(("P02/1", [*begun("P02"), *touched])).lines()
    assert session.endswith(f"touchbeam run 'my study' --participant P02{ratings}")


def test_a_stale_session_is_to_be_excluded() -> None:
    session, _ = progress(("P02/2", begun("P02")), hours=25).lines()
    assert session.endswith(
        "; too old to be resumed: touchbeam exclude 'my study' --participant P02 --session 2 "
        "--reason 'not resumed in time'"
    )


def test_what_the_operator_noted_is_shown() -> None:
    noted = RigDescribed(answers={"skin state": "dry", "humidity": "", "room temperature": "21"})
    armed = DeviceArmed(idn="rig", boot=1, device_time_s=0.0)
    session, _ = progress(("P02/1", [*begun("P02"), armed, noted]), running="P02/1").lines()
    assert session.endswith("0 of 0 trials; noted: skin state dry, room temperature 21")


def test_a_running_session_needs_no_advice() -> None:
    session, _ = progress(("P02/1", begun("P02")), running="P02/1").lines()
    assert session == "P02/1  participant  running  0 of 0 trials"


def test_a_rehearsal_takes_no_name_and_is_resumed_as_one() -> None:
    session, cohort = progress(("P01/1 (rehearsal)", begun("P01", "rehearsal"))).lines()
    assert session.endswith("touchbeam run 'my study' --participant P01 --rehearsal")
    assert cohort.endswith("gets slot 0 of the design, for example: touchbeam run 'my study' "
                           "--participant P01")  # fmt: skip


def test_a_finished_study_is_to_be_reported() -> None:
    done = [
        (f"P{n}/1", [*begun(f"P{n}"), SessionExcluded(reason="x")]) for n in range(1)
    ] + [(f"P{n}/1", [*begun(f"P{n}"), SessionCompleted()]) for n in range(1, 10)]  # fmt: skip
    found = progress(*done)
    assert (found.done, found.planned, found.next_participant) == (9, 9, "P10")
    assert list(found.lines())[-1] == "Done: 9 of 9 participants. Next: touchbeam report 'my study'"


def test_who_lacks_a_session_is_not_done_and_is_to_come_again() -> None:
    design = STUDY.design.model_copy(update={"sessions": 2})
    both = [*begun("P01"), SessionCompleted()], [*begun("P01"), SessionCompleted()]
    of_one = [*begun("P02", slot=1), SessionCompleted()]
    rehearsed = [*begun("P02", "rehearsal"), SessionCompleted()]
    names = ("P01/1", "P01/2", "P02/1", "P02/1 (rehearsal)")
    sessions = zip(names, (*both, of_one, rehearsed), strict=True)
    found = replace(progress(*sessions), study=STUDY.model_copy(update={"design": design}))
    assert found.done == 1
    lines = list(found.lines())
    assert [line.partition("; ")[2] for line in lines[:-1]] == [
        "",
        "",
        "1 of 2 sessions, next: touchbeam run 'my study' --participant P02 --session 2",
        "",
    ]
    assert lines[-1].startswith("Done: 1 of 9 participants. The next participant gets slot 2")


@pytest.mark.parametrize(
    ("names", "following"),
    [((), "P01"), (("P09",), "P10"), (("7", "12"), "13"), (("lab-3a", "lab-04"), "lab-05")],
)
def test_the_next_participant_has_the_next_number(names: Sequence[str], following: str) -> None:
    sessions = [(f"{name}/1", begun(name)) for name in names]
    assert progress(*sessions).next_participant == following


def test_each_group_is_counted_and_the_one_that_lacks_most_comes_next() -> None:
    sizes = {"young": 1, "old": 3}
    groups = "".join(f'[[group]]\nname = "{name}"\nsize = {n}\n' for name, n in sizes.items())
    text = template("paper").replace("\nparticipants = 9 ", "\n# ") + groups
    study = parsed_study(text)

    def had(*of: str) -> Progress:
        sessions = []
        for number, group in enumerate(of):
            (first,) = begun(f"P{number}", slot=of[:number].count(group))
            assert isinstance(first, SessionOpened)
            sessions.append((f"P{number}/1", [replace(first, group=group), SessionCompleted()]))
        return replace(progress(*sessions), study=study)

    session, cohort = had("young").lines()
    assert session == "P0/1  participant of young  completed  0 of 0 trials"
    assert cohort == (
        "Done: 1 of 4 participants. Groups: young 1 of 1; old 0 of 3. The next participant, for "
        "example: touchbeam run 'my study' --participant P1 --group old"
    )
    found = had("young", "old", "young", "old")
    assert [(it["done"], it["next_slot"]) for it in found.groups] == [(2, 2), (2, 2)]
    assert found.next_slot is None
    assert list(found.lines())[-1].endswith("--participant P4 --group old"), "one is still missing"
    whole = had("young", *["old"] * 3)
    assert list(whole.lines())[-1].endswith("Next: touchbeam report 'my study'")
    drawn = study.design.model_copy(update={"assign_groups": "at random"})
    by_chance = replace(had("young"), study=study.model_copy(update={"design": drawn}))
    assert list(by_chance.lines())[-1].endswith("--participant P1"), "nobody knows it before"
