"""Dry runs recover what their virtual participants were given: M2 against the journalled truth."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from analysis.report.findings import Origin
from analysis.report.report import Report, report, report_html, report_json
from device.friction.changes import LAW, RUNG
from device.people.person import DEFAULT, drawn_person, person_name
from protocol.study_file.loading import parsed_study, template
from tests.system.in_process_sessions import loaded_rehearsals

STUDY = template("extended")
"""It has opposite trials."""


def rehearsed(
    folder: Path,
    text: str,
    people: int,
    seed: int,
    *model: str,
    slips: Callable[[], bool] = lambda: False,
    shown: tuple[str, ...] | None = None,
) -> Report:
    """The report on sessions of virtual participants, in this process and on simulated time.

    With names of sections `shown` nothing is fitted for the others.
    """
    found = loaded_rehearsals(folder, text, people, seed, *model, slips=slips)
    origin = Origin(command="report", study_sha256="0", alone=shown is not None)
    return report("rehearsals", found, parsed_study(text), origin, shown)


def covered(found: Report) -> list[bool]:
    return [entry["gain_covered"] for entry in report_json(found)["recovery"]["subjects"]]


def test_a_dry_run_with_opposite_trials_recovers_what_the_journal_holds(tmp_path: Path) -> None:
    found = rehearsed(tmp_path, STUDY, 2, seed=1)
    shown = report_json(found)["recovery"]
    assert shown["reported"] == shown["simulated"][0] == {"law": LAW, "rung": RUNG}
    for entry in shown["subjects"]:
        person = drawn_person(DEFAULT, person_name(1, entry["subject"]))
        assert vars(person).items() <= entry["true"].items()
    assert all(covered(found))
    opposite = found.loaded.trials[found.loaded.trials["opposite"]]
    assert len(opposite) == 2 * 5 - 2, "one of each condition that has a contrary"
    assert opposite["score"].mean() > 6
    assert "follow the same model" in report_html(found)


def test_the_report_names_another_law_of_the_simulated_beam(tmp_path: Path) -> None:
    found = rehearsed(tmp_path, template("paper"), 3, 1, "coulomb", "own-mode")
    shown = report_json(found)["recovery"]
    assert shown["simulated"] == [{"law": "coulomb", "rung": "own-mode"}]
    page = report_html(found)
    assert "The simulated beam followed the law coulomb on the rung own-mode" in page
    assert "differ systematically" in page


@pytest.mark.soak
def test_intervals_cover_the_gains_of_two_hundred_people(tmp_path: Path) -> None:
    found = covered(rehearsed(tmp_path, STUDY, 200, seed=1))
    share = float(np.mean(found))
    print(f"\nM2 covers the gains of {share:.3f} of {len(found)} virtual participants")
    assert share >= 0.93 - 2 * np.sqrt(0.93 * 0.07 / len(found))
