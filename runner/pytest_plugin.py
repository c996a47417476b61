"""Fixtures for the tests of a study, which pytest finds wherever touchbeam is installed.

Imports are inside the fixtures, so that the tests of other projects are not slowed down.
"""

from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import pytest

if TYPE_CHECKING:
    from protocol.plan.trials import Plan
    from protocol.registration.registration import Registration
    from protocol.study.study import Study
    from runner.launch.device_access import SessionRig
    from runner.launch.rehearsal import Rehearsal
    from runner.people.virtual_participant import VirtualParticipant
    from runner.study.folder import StudyFolder

_T = TypeVar("_T")
STUDY_FILE = "study.toml"
UNUSABLE = "the study cannot be used:"
_REPORTED = pytest.StashKey[set[str]]()


def pytest_configure(config: pytest.Config) -> None:
    """Prevent a study's folders, such as `analysis/`, from hiding touchbeam's packages."""
    if (config.invocation_params.dir / STUDY_FILE).is_file():
        config.option.importmode = "importlib"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: "pytest.CallInfo[None]"
) -> "Generator[None, pytest.TestReport, pytest.TestReport]":
    """Report only once why a study cannot be used: all its tests fail for the same reason."""
    report = yield
    if call.excinfo is None or not str(call.excinfo.value).startswith(UNUSABLE):
        return report
    reported = item.config.stash.setdefault(_REPORTED, set())
    if report.longreprtext in reported:
        report.longrepr = f"{UNUSABLE} see above"
    reported.add(report.longreprtext)
    return report


@pytest.fixture(scope="module")
def study_text(request: pytest.FixtureRequest) -> str:
    """Return the text of the study file beside the test."""
    return _usable(request, lambda folder: folder.text())


def _usable(request: pytest.FixtureRequest, read: "Callable[[StudyFolder], _T]") -> _T:
    """Return what `read` finds in the folder of the test; fail with one line if it cannot."""
    from protocol.errors import BadInput
    from runner.study.folder import StudyFolder

    try:
        return read(StudyFolder(path=Path(str(request.path)).parent))
    except BadInput as error:
        found = str(error)
    # Outside of `except`, or pytest would show the exception that led to it.
    pytest.fail(f"{UNUSABLE} {found}", pytrace=False)


@pytest.fixture(scope="module")
def study(study_text: str) -> "Study":
    """Return the validated study; fail with one line for each problem in it."""
    from protocol.study_file.loading import StudyError
    from runner.study.check import validated_study

    try:
        return validated_study(study_text, STUDY_FILE)
    except StudyError as error:
        found = [problem.located(STUDY_FILE) for problem in error.problems]
    pytest.fail("\n".join([UNUSABLE, *found]), pytrace=False)  # outside of `except` as above


@pytest.fixture(scope="module")
def registration(request: pytest.FixtureRequest) -> "Registration | None":
    """Return the registration beside the test, None if the study is not registered."""
    from runner.study.registered import checked_registration

    return _usable(request, checked_registration)


@pytest.fixture(scope="module")
def cohort(study: "Study", registration: "Registration | None") -> "tuple[Plan, ...]":
    """Return the session-1 plans of all participants: the study's number of them, or 40."""
    from protocol.plan.plan import cohort_plans
    from protocol.registration.registration import locked

    seeded = locked(study, registration.digest if registration else None)
    return cohort_plans(seeded, study.design.participants or 40)


@pytest.fixture(scope="module")
def plan(cohort: "tuple[Plan, ...]") -> "Plan":
    """Return the plan of the first participant."""
    return cohort[0]


@pytest.fixture(scope="module")
def simulated_rig(study: "Study") -> "Iterator[SessionRig]":
    """Yield a simulated device whose time passes only by waiting and by its control.

    `simulated_rig.device` is driven as in a session, with the same bytes;
    `simulated_rig.control` moves the finger, advances time and swaps the beam.
    """
    from runner.launch.device_access import stepped_rig

    with stepped_rig(study.rig, study.study.seed, force_channel=study.force_channel) as rig:
        yield rig


@pytest.fixture
def virtual_participant(simulated_rig: "SessionRig", study: "Study") -> "VirtualParticipant":
    """Return a virtual participant with a finger on the simulated device, in stepped time."""
    from datetime import UTC, datetime

    from device.people.person import DEFAULT, drawn_person
    from device.simulator.in_process import InProcessHand
    from runner.clock import SteppedClock
    from runner.people.virtual_participant import VirtualParticipant

    control = simulated_rig.control
    assert isinstance(control, InProcessHand)
    name = f"test/{study.study.seed}"
    return VirtualParticipant(
        control=control,
        clock=SteppedClock(datetime(2026, 1, 1, tzinfo=UTC), control.advance, control.now_s),
        person=drawn_person(DEFAULT, name),
        name=name,
    )


@pytest.fixture(scope="module")
def rehearsal(
    request: pytest.FixtureRequest,
    study: "Study",
    study_text: str,
    plan: "Plan",
    registration: "Registration | None",
) -> "Rehearsal":
    """Return a rehearsal: a whole session in stepped time, simulated device, virtual participant.

    It uses the calibration beside the study file, if there is one, and the pictures and tables.
    """
    from runner.launch.rehearsal import rehearse
    from runner.study.calibration import kept_calibration
    from runner.study.files import bytes_of

    folder = Path(str(request.path)).parent
    calibration = kept_calibration(folder)
    files = {name: bytes_of(folder / name) for name in (*study.pictures, *study.tables)}
    return rehearse(study_text, plan, study.study.seed, calibration, registration, files)
