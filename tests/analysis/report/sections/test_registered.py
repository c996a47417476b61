"""The report of a registered study: results marked, deviations listed, calibrations in force."""

from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version

import numpy as np
import pytest

from analysis.estimates import NotEstimable
from analysis.loading.study_data import StudyData, load_study_data
from analysis.loading.study_lock import StudyLock
from analysis.report.findings import Origin
from analysis.report.hypotheses import how_tested, registered
from analysis.report.report import Report, report, report_html, report_json
from analysis.report.sections.registration import (
    NamedResult,
    analysis_settings,
    conduct,
    gated,
    marked,
    named_results,
    registered_lines,
)
from analysis.sensitivity.answers_model import Rated
from analysis.trials.trial_checks import order_as_run
from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import LAW, RUNG
from protocol.journal.events import (
    Answered,
    Event,
    SessionExcluded,
    SessionOpened,
    StoredEvent,
    StudyAmended,
    StudyRegistered,
    Withdrawn,
)
from protocol.journal.records import RigCalibration
from protocol.registration.deviations import deviations
from protocol.registration.registration import FOLLOWS, NOTICED, Registration, locked
from protocol.study_file.loading import parsed_study, template
from tests.analysis.chains import chain
from tests.analysis.reports import (
    PAPER,
    plain_report,
    session_events,
    study_report,
    with_sensitivity,
)

SHA256 = "7" * 64
OLD, NEW = (
    RigCalibration(
        damping_ratio=damping,
        gain=1.05,
        body_height_m=NOMINAL.body_height_m,
        resonance_hz=None,
        origin=origin,
    )
    for damping, origin in ((0.004, "session slide/1"), (0.008, "session slide/2"))
)
REGISTERED = Registration(
    study="a study",
    study_sha256=SHA256,
    primary="conditions differ",
    secondary=("voltage above pressure", "ratings follow the prediction", "gains differ"),
    law=LAW,
    rung=RUNG,
    calibration={name: value for name, value in vars(OLD).items() if value is not None},
    participants=4,
    sessions=1,
    analysis=analysis_settings(),
    touchbeam=version("touchbeam"),
)
ORIGIN = Origin(command="touchbeam report study", study_sha256=SHA256, rig=Calibration(**vars(OLD)))
ORDERED = locked(PAPER, REGISTERED.digest)


def session(slot: int, rig: RigCalibration | None = OLD) -> list[Event]:
    opened, *others = session_events(ORDERED, slot, np.random.default_rng(slot))
    assert isinstance(opened, SessionOpened)
    under = replace(
        opened,
        registration=REGISTERED.digest,
        study_sha256=SHA256,
        versions={"touchbeam": version("touchbeam")},
        calibration=rig,
    )
    return [under, *others]


def withdrawn(slot: int) -> list[Event]:
    return [*session(slot), Withdrawn()]


def data(*further: Event, sessions: list[list[Event]] | None = None) -> StudyData:
    decided: list[Event] = [
        StudyRegistered(
            registration=REGISTERED.digest, study_sha256=SHA256, text=REGISTERED.text()
        ),
        *further,
    ]
    run = [session(slot) for slot in range(4)] if sessions is None else sessions
    chains: list[list[StoredEvent]] = [chain(decided), *map(chain, run)]
    return load_study_data(chains, rehearsals=False)


@cache
def registered_report() -> Report:
    return report("a study", data(), PAPER, ORIGIN)


def lock_of(loaded: StudyData) -> StudyLock:
    assert loaded.lock is not None
    return loaded.lock


def told(loaded: StudyData, origin: Origin = ORIGIN) -> list[tuple[str, str]]:
    """Return the deviations that a report on these data lists, without its estimates."""
    lock = lock_of(loaded)
    found = replace(registered_report(), loaded=loaded, origin=origin.under(lock))
    listed = deviations(lock.registration, conduct(found, lock))
    return [(each.kind, each.text) for each in listed]


def test_a_study_without_registration_has_no_word_of_it() -> None:
    plain = plain_report()
    assert "registration" not in report_json(plain)
    assert "egist" not in report_html(plain)
    assert list(registered_lines(plain)) == []


def test_no_choice_of_sections_leaves_the_deviations_out() -> None:
    chosen = replace(registered_report(), shown=("methods", "trials"))
    assert [each.name for each in chosen.chosen] == ["registration", "methods", "trials"]
    assert "Section Registration has the results" in (page := report_html(chosen))
    assert '<details id="h-registration"' in page
    last = replace(registered_report(), shown=("methods", "registration"))
    assert [each.name for each in last.chosen] == ["methods", "registration"]
    plain = replace(plain_report(), shown=("methods",))
    assert [each.name for each in plain.chosen] == ["methods"]


def test_registered_and_other_results_are_kept_apart() -> None:
    found = registered_report()
    (asked, answer), *others = marked(found)
    assert asked == "What was registered?"
    assert answer.startswith(
        "Registered: conditions differ (primary), voltage above pressure, ratings follow the "
        "prediction, gains differ. Not registered: every other result"
    )
    questions = dict(others)
    assert "Do the conditions differ? (registered: conditions differ)" in questions
    assert "Which ones? (registered: voltage above pressure)" in questions
    # The primary hypothesis has no part in the correction, nor in what that promises.
    assert "Holm's correction over the others" in questions["What was found? (not registered)"]
    assert (
        "(registered, tested alone)"
        in questions["Do the conditions differ? (registered: conditions differ)"]
    )
    assert all(
        question.endswith("registered)") or "(registered: " in question for question in questions
    )
    assert answer in report_html(found)


def test_each_registered_result_is_that_of_the_report() -> None:
    found = registered_report()
    record = report_json(found)
    omnibus, pair, follows, spread = record["registration"]["results"]
    assert (omnibus["name"], omnibus["primary"]) == ("conditions differ", True)
    tested = next(it for it in record["pairwise"] if {it["a"], it["b"]} == {"voltage", "pressure"})
    assert pair["p"] == tested["p_holm"]
    # Of four people the ratings have no model.
    assert (spread["p"], spread["supported"]) == (None, None)
    assert spread["found"] == record["rating"]["reason"]
    assert follows["p"] == record["responses"]["slope"]["p"]
    assert record["registration"]["schema"] == 2
    assert record["registration"]["deviations"] == []
    assert record["registration"]["participants"] == {"registered": 4, "completed": 4}
    assert "The study did not deviate from its registration." in report_html(found)
    lines = list(registered_lines(found))
    assert [line.split(": ")[1] for line in lines] == list(REGISTERED.hypotheses)


@pytest.mark.parametrize("equal", [0.049, 0.051])
def test_registered_gains_differ_where_equal_ones_are_improbable(equal: float) -> None:
    rating = study_report().sensitivity.rating
    assert isinstance(rating, Rated)
    known = replace(study_report().sensitivity, rating=replace(rating, equal_gains=equal))
    found = with_sensitivity(registered_report(), known)
    (hypothesis,) = registered(found.study, ["gains differ"])
    told = "equal gains have P\xa0=\xa0.05, before the study .50"
    assert hypothesis.judge(found) == (told, None, equal < 0.05)


@pytest.mark.parametrize(
    ("primary", "other", "expected"),
    [(True, True, True), (False, True, False), (None, True, False), (True, False, False)],
)
def test_a_secondary_hypothesis_counts_only_after_the_primary_one(
    primary: bool | None, other: bool, expected: bool
) -> None:
    first = NamedResult(name="a", primary=True, found="", p=None, supported=primary)
    second = NamedResult(name="b", primary=False, found="p = .01", p=0.01, supported=other)
    made = gated(first, second)
    assert made.supported is expected
    assert ("does not count" in made.found) == (other and not expected)


def test_secondary_ones_of_an_untested_primary_one_are_judged_and_said_to_be_unprotected() -> None:
    untested = NamedResult(name="a", primary=True, found="", p=None, supported=None, tested=False)
    assert untested.verdict == "not tested"
    for supported, verdict in ((True, "supported"), (False, "not supported")):
        second = NamedResult(name="b", primary=False, found="p", p=0.5, supported=supported)
        made = gated(untested, second)
        assert (made.supported, made.verdict, made.protected) == (supported, verdict, False)
        assert made.found == "p; not protected by a primary hypothesis"
    neither = replace(second, supported=None)
    assert gated(untested, neither) == neither


EARLIER = replace(REGISTERED, schema=1, touchbeam="1.0.0", analysis=analysis_settings(1))


def of_version_1() -> Report:
    """A registration of version 1 on the same sessions, half of whose scores were withheld."""
    sessions = [
        [
            replace(event, agrees=event.index % 2 == 0, score=event.index)
            if isinstance(event, Answered) and event.kind == "trial"
            else event
            for event in session(slot)
        ]
        for slot in range(4)
    ]
    loaded = data(sessions=sessions)
    lock = replace(lock_of(loaded), registration=EARLIER)
    return report("a study", replace(loaded, lock=lock), PAPER, ORIGIN)


def test_what_version_1_registered_is_judged_on_scores_and_marked_so() -> None:
    found = of_version_1()
    record = report_json(found)
    omnibus, pair, *_ = record["registration"]["results"]
    of_scores, of_responses = record["scores"]["friedman"], record["friedman"]
    assert of_scores["p_exact"] != of_responses["p_exact"]
    assert (
        omnibus["p"] == found.table.score_tests.omnibus_p != found.trials.response_tests.omnibus_p
    )
    assert pair["p"] in {it.p_holm for it in found.table.score_tests.pairwise}
    assert record["registration"]["schema"] == 1
    questions = dict(marked(found))
    assert (
        "Do the conditions differ? (registered with another test: conditions differ)" in questions
    )
    assert "They compare scores, not responses, and are done here as registered" in report_html(
        found
    )


def test_the_settings_of_version_1_are_no_deviation_where_its_tests_are_done_as_registered() -> (
    None
):
    found = of_version_1()
    lock = found.loaded.lock
    assert lock is not None
    said = [each for each in deviations(EARLIER, conduct(found, lock)) if each.kind == "analysis"]
    assert said == []
    other = replace(EARLIER, analysis={**EARLIER.analysis, "pairwise test": "sign test"})
    said = deviations(other, conduct(found, lock))
    settings = [text for kind, text in said if kind == "analysis"]
    today = "Wilcoxon signed rank, two-sided, zeros dropped"
    assert settings == [f"pairwise test: {today}; registered: sign test"]


def test_each_hypothesis_of_version_1_has_a_test_or_says_that_it_has_none() -> None:
    """Every name of today is one of version 1, too, and those of factors and gains have no test."""
    text = (
        template("paper")
        + """
[[factor]]
name = "volts"
varies = "ramp_to_v"
values = [50, 100]
[[group]]
name = "young"
size = 4
[[group]]
name = "old"
size = 5
"""
    )
    text = (
        text[: text.index("[[condition]]")]
        + """
[[condition]]
name = "slide"
question = "roughness"
expected = "smoother"
touches = [{ place = "smooth", voltage_v = 0, duration_s = 1 }]
"""
        + text[text.index("[[factor]]") :]
    )
    study = parsed_study(text.replace("participants = 9", "sessions = 2"))
    today, earlier = how_tested(study), how_tested(study, (), "1.0.0")
    # So few conditions have no slope with a p below .05, so that none can be registered any more.
    assert earlier.keys() - today.keys() == ({FOLLOWS} if len(study.conditions) <= 3 else set())
    assert today.keys() <= earlier.keys()
    assert {name for name in today if today[name] != earlier[name]} == {
        name for name in today if NOTICED not in name
    }
    untested = [each.name for each in registered(study, [*today], "1.0.0") if not each.tested]
    assert untested == [
        "gains differ",
        "effect of volts",
        "effect of session",
        "volts by session",
        "session by volts",
    ]
    assert all(each.tested for each in registered(study, [*today]))
    shared = [each.name for each in registered(study, [*today], "1.0.0") if each.as_on_page]
    assert set(shared) == {name for name in today if today[name] == earlier[name]}


def test_the_order_as_run_is_that_of_the_digest() -> None:
    found = order_as_run(registered_report().loaded, PAPER)
    assert not isinstance(found, NotEstimable)
    assert found.problems == ()
    unlocked = replace(data(), lock=None)
    assert isinstance(order_as_run(unlocked, PAPER), NotEstimable), "not that of the study's seed"


def test_deviations_come_from_the_journal() -> None:
    amended = StudyAmended(study_sha256="8" * 64, reason="a slip", breaks=REGISTERED.digest)
    (change,) = told(data(amended))
    assert change[0] == "study file"
    assert "which broke the lock: a slip" in change[1]
    fewer = data(sessions=[session(slot) for slot in range(3)])
    assert told(fewer) == [("participants", "3 completed, fewer than the 4 registered")]
    left_out = [session(slot) for slot in range(5)]
    left_out[2].append(SessionExcluded(reason="asleep"))
    assert told(data(sessions=left_out)) == [
        ("exclusion", "without a registered rule: P03, session 1: asleep")
    ]
    assert told(data(sessions=[*map(session, range(4)), withdrawn(4)])) == [
        (
            "withdrawal",
            "sessions withdrawn, whose data are erased: 1, of which 1 had been completed",
        )
    ]
    other = replace(ORIGIN, study_sha256="9" * 64)
    assert told(data(), other) == [
        ("study file", "the present study file is not the registered one")
    ]
    broken = replace(ORIGIN, unlocked="registration.toml is missing")
    assert told(data(), broken) == [("registration", "registration.toml is missing")]


def test_every_changed_character_of_the_settings_is_a_deviation(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    settled, loaded = analysis_settings(), data()
    for name, value in settled.items():
        text = str(value)
        for place, old in enumerate(text):
            if isinstance(value, str) or old.isdigit():
                changed = f"{text[:place]}{'2' if old == '1' else '1'}{text[place + 1 :]}"
                used = {**settled, name: type(value)(changed)}
                monkeypatch.setattr(
                    f"{conduct.__module__}.analysis_settings", lambda _, now=used: now
                )
                said = f"{name}: {used[name]}; registered: {value}"
                assert told(loaded) == [("analysis", said)]


def test_each_session_is_predicted_under_the_calibration_in_force() -> None:
    rigs = [OLD, OLD, NEW, NEW]
    mixed = data(sessions=[session(slot, rig) for slot, rig in enumerate(rigs)])
    assert mixed.trials["rig"].map(lambda rig: rig.origin).groupby(
        mixed.trials["participant"]
    ).first().tolist() == [rig.origin for rig in rigs]
    assert told(mixed) == [
        (
            "calibration",
            "registered: session slide/1; in force: session slide/2, in sessions: P03/1, P04/1",
        )
    ]
    nominal = data(sessions=[session(slot, None) for slot in range(4)])
    assert set(nominal.trials["rig"]) == {NOMINAL}


def test_a_later_calibration_stands_beside_it_not_registered() -> None:
    later = replace(ORIGIN, rig=Calibration(**vars(NEW)))
    lock = lock_of(data())
    assert later.under(lock).rig == Calibration(**vars(OLD)), "what was registered predicts"
    assert later.under(lock).later == Calibration(**vars(NEW))
    assert ORIGIN.under(lock).later is None
    found = replace(registered_report(), origin=later.under(lock))
    (deviation,) = told(data(), later)
    assert deviation[0] == "calibration"
    assert "session slide/2 is later than the sessions" in deviation[1]
    beside = report_json(found)["registration"]["later_calibration"]
    assert set(beside) == set(PAPER.conditions)
    assert beside["voltage"]["later"] < beside["voltage"]["in_force"], "more damping"
    assert report_json(registered_report())["registration"]["later_calibration"] == {}


def test_the_time_of_registration_is_told() -> None:
    assert lock_of(data()).utc == datetime(2026, 1, 1, tzinfo=UTC)
    assert "registered at 2026-01-01 00:00 UTC" in report_html(registered_report())
    assert [each.name for each in named_results(registered_report(), lock_of(data()))] == list(
        REGISTERED.hypotheses
    )
