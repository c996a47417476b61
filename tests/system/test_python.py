"""touchbeam from Python: tables, plans, report and model as a notebook gets them."""

import doctest
import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import touchbeam
from protocol.journal.events import ResonanceMeasured, SessionOpened, TrialExcluded, Withdrawn
from protocol.plan.plan import plan
from protocol.study.columns import COLUMNS
from protocol.study_file.loading import parsed_study, template, text_digest
from runner.journal.opening import open_journal
from runner.study.calibration import keep_fit
from tests.analysis.chains import chain
from tests.analysis.friction.recorded_sessions import recorded_cohort
from tests.analysis.hostile_study import sessions, study_text
from tests.analysis.reports import PAPER, session_events
from tests.runner.command_line import typed
from tests.runner.journal.tampering import tampering

ROOT = Path(__file__).parents[2]
TRIAL = ["participant", "session", "session_kind", "trial_index"]
EXCLUDED = "the phone rang"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three participants' sessions, one trial excluded, and a rehearsal."""
    made = tmp_path_factory.mktemp("python") / "mystudy"
    made.mkdir()
    text = template("extended")
    (made / "study.toml").write_text(text, encoding="utf-8")
    study, rng = parsed_study(text), np.random.default_rng(1)
    with open_journal(made / "study.db") as journal, journal.alone():
        for slot, kind in enumerate(("participant", "participant", "participant", "rehearsal")):
            name = f"P{slot + 1:02d}"
            events = session_events(study, slot, rng, kind=kind, who=name)
            events += [TrialExcluded(index=9, reason=EXCLUDED)] * (slot == 1)
            for stored in chain(events):
                journal.append(f"{name}/1", stored)
    return made


@pytest.fixture(scope="module")
def study(folder: Path) -> touchbeam.Study:
    return touchbeam.load(folder)


@pytest.fixture(scope="module")
def exported(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    out = tmp_path_factory.mktemp("exported") / "csv"
    assert typed("export", folder, out, "--format", "csv") == 0
    return pd.read_csv(out / "trials.csv", dtype={"study_sha256": str})


def conditions(planned: pd.DataFrame) -> list[str]:
    return planned.condition.dropna().tolist()


def conditions_of_slot(slot: int) -> list[str]:
    trials = plan(parsed_study(template("extended")), slot).trials
    return [trial.condition for trial in trials if trial.condition]


def test_responses_are_the_means_of_those_of_the_trials(study: touchbeam.Study) -> None:
    trials = study.trials[study.trials.excluded.eq("no")].dropna(subset=["response"])
    means = trials.groupby(["participant", "condition"]).response.mean().unstack()
    assert list(study.responses) == list(study.scores)
    means = means.reindex(index=study.responses.index, columns=study.responses.columns)
    np.testing.assert_allclose(study.responses, means)


def test_trials_are_the_exported_ones(study: touchbeam.Study, exported: pd.DataFrame) -> None:
    names = [column.name for column in COLUMNS if not column.per_touch]
    assert list(study.trials) == [*names, "response"]
    for name in map(str, study.trials):
        ours, theirs = study.trials[name], exported[name]
        if name.endswith("_utc"):
            theirs = pd.to_datetime(theirs, utc=True)
        assert ours.isna().tolist() == theirs.isna().tolist(), name
        assert ours.dropna().tolist() == theirs.dropna().tolist(), name
    assert (study.trials.excluded == "trial").sum() == 1


def test_touches_are_the_exported_ones_a_row_each(
    study: touchbeam.Study, exported: pd.DataFrame
) -> None:
    assert len(study.touches) == exported.touches.sum()
    voltages = study.touches.groupby(TRIAL).commanded_voltage_v
    assert [";".join(map(repr, told)) for _, told in voltages] == exported.sort_values(TRIAL)[
        "commanded_voltage_v"
    ].tolist()
    assert study.touches.groupby(TRIAL).touch.agg(list).map(len).tolist() == (
        study.trials.sort_values(TRIAL).touches.tolist()
    )


def test_a_trace_is_found_by_its_trial(study: touchbeam.Study) -> None:
    both = study.traces("P02", 5)
    second = study.traces("P02", trial=5, session=1, touch=1)
    assert both.touch.tolist() == [0] * 8 + [1] * 8
    assert second.equals(both[both.touch == 1].reset_index(drop=True))
    assert second.t_s.tolist() == [0.1 * step for step in range(8)]
    assert len(study.traces()) == 8 * len(study.touches)
    assert study.traces("P99").empty


def test_every_column_is_described(study: touchbeam.Study) -> None:
    tables = {
        "participants": study.participants,
        "sessions": study.sessions,
        "trials": study.trials,
        "touches": study.touches,
        "traces": study.traces(),
        "contrasts": study.contrasts,
    }
    described = [(name, column) for name, table in tables.items() for column in map(str, table)]
    assert study.columns.index.tolist() == described
    assert study.columns.meaning.notna().all()
    units = {
        "s": "s",
        "v": "V",
        "per_v": "m/V",
        "hz": "Hz",
        "m": "m",
        "m_s": "m/s",
        "n": "N",
        "n_per_s": "N/s",
    }
    for (_, column), unit in zip(described, study.columns.unit, strict=True):
        ending = re.search(r"_(m_s|n_per_s|s|per_v|v|hz|m|n)$", column)
        assert unit == units[ending[1]] if ending else pd.isna(unit), column


def test_participants_stand_with_what_they_said_once(study: touchbeam.Study) -> None:
    assert study.participants.participant.tolist() == ["P01", "P02", "P03"]
    assert study.participants.sessions.tolist() == [1, 1, 1]


def test_own_questions_have_columns(tmp_path: Path) -> None:
    """Braces in the words of a study are no places for numbers."""
    (tmp_path / "study.toml").write_text(study_text(), encoding="utf-8")
    with open_journal(tmp_path / "study.db") as journal:
        for session in sessions(study_text()):
            for event in session.events:
                journal.append(f"{session.participant}/{session.number}", event)
    hostile = touchbeam.load(tmp_path, rehearsals=True)
    assert list(hostile.trials) == hostile.columns.loc["trials"].index.tolist()
    assert not hostile.touches.empty
    assert hostile.participants.participant.is_unique


def test_scores_are_those_of_table_4(study: touchbeam.Study) -> None:
    counted = study.trials[(study.trials.trial_kind == "trial") & (study.trials.excluded == "no")]
    means = counted.groupby(["participant", "condition"]).score.mean().unstack()
    pd.testing.assert_frame_equal(
        study.scores, means[study.scores.columns], check_names=False, check_index_type=False
    )


def test_contrasts_stand_beside_the_trials_that_count(study: touchbeam.Study) -> None:
    scored = study.contrasts.dropna(subset=["condition", "score"])
    assert study.contrasts.touch_measured.all()
    assert study.contrasts.measured_contrast.isna().all()
    assert scored.consistent.notna().all()
    excluded = study.trials[study.trials.excluded == "trial"].iloc[0]
    assert not (
        (study.contrasts.participant == excluded.participant)
        & (study.contrasts.trial_index == excluded.trial_index)
    ).any()


def test_contrasts_are_those_of_the_report(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(template("paper"), encoding="utf-8")
    with open_journal(tmp_path / "study.db") as journal, journal.alone():
        for number, events in enumerate(recorded_cohort(PAPER, 3, skipped=3)[0], start=1):
            for stored in events:
                journal.append(f"P{number:02d}/1", stored)
    study = touchbeam.load(tmp_path)
    told = json.loads(study.report().with_name("report.json").read_text(encoding="utf-8"))
    for (_, row), trial in zip(study.contrasts.iterrows(), told["trials"], strict=True):
        found = row.astype(object).where(row.notna(), None)
        measured = trial["measured"] or {"contrast": None, "error": None}
        assert (found.participant, found.trial_index) == (trial["subject"], trial["index"])
        assert found[list(trial["predicted"])].to_dict() == trial["predicted"]
        assert found.touch_measured == trial["touch_measured"]
        assert found.measured_contrast == measured["contrast"]
        assert found.measured_contrast_error == measured["error"]
    assert study.contrasts.measured_contrast.notna().sum() > len(told["trials"]) / 2


def test_rehearsals_are_there_if_asked_for(folder: Path, study: touchbeam.Study) -> None:
    assert study.sessions.participant.tolist() == ["P01", "P02", "P03"]
    rehearsed = touchbeam.load(str(folder), rehearsals=True)
    assert rehearsed.sessions.session_kind.tolist() == [*["participant"] * 3, "rehearsal"]
    assert "P04" in set(rehearsed.traces().participant)
    assert conditions(rehearsed.plan("P04")) == conditions_of_slot(3)


def test_a_study_of_rehearsals_alone_names_the_argument_that_includes_them(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(template("paper"), encoding="utf-8")
    opened, *rest = session_events(PAPER, 0, np.random.default_rng(1), kind="rehearsal")
    assert isinstance(opened, SessionOpened)
    opened = replace(opened, study_sha256=text_digest(template("paper")))
    with open_journal(tmp_path / "study.db") as journal, journal.alone():
        for stored in chain([opened, *rest]):
            journal.append("P01/1", stored)
    rehearsed = touchbeam.load(tmp_path)
    assert rehearsed.trials.empty
    for asked in (lambda: rehearsed.scores, lambda: rehearsed.contrasts, rehearsed.report):
        with pytest.raises(ValueError, match=r"\(in Python rehearsals=True\) to include them"):
            asked()
    assert len(touchbeam.load(tmp_path, rehearsals=True).scores) == 1


def test_a_plan_is_the_recorded_one_or_the_next_one(study: touchbeam.Study) -> None:
    begun = study.trials[study.trials.participant == "P02"].reset_index(drop=True)
    planned = study.plan("P02")
    for name in ("trial_index", "block", "trial_kind", "condition", "level", "expected"):
        assert planned[name].dropna().tolist() == begun[name].dropna().tolist(), name
    touches = study.touches[study.touches.participant == "P02"].groupby("trial_index")
    assert planned.planned_voltage_v.tolist() == touches.planned_voltage_v.agg(tuple).tolist()
    assert conditions(study.plan("P77")) == conditions_of_slot(3)


def test_without_a_plan_there_is_an_error(tmp_path: Path) -> None:
    scores = tmp_path / "scores.csv"
    scores.write_text("subject,voltage,pressure\nP01,7,8\nP02,6,\nP03,5,9\n")
    assert typed("import", scores, tmp_path / "published") == 0
    published = touchbeam.load(tmp_path / "published")
    assert published.trials.score.tolist()[:3] == [7.0, 8.0, 6.0]
    assert published.touches.empty
    assert published.traces().empty
    with pytest.raises(ValueError, match="P01/1 has no plan"):
        published.plan("P01")
    with open_journal(tmp_path / "published" / "study.db") as journal:
        journal.append("P01/1", chain([TrialExcluded(index=0, reason=""), Withdrawn()])[1])
        journal.erase_payloads(["P01/1"])
    with pytest.raises(ValueError, match="P01/1 has no plan"):
        published.plan("P01")
    assert touchbeam.load(tmp_path / "published").sessions.participant.tolist() == ["P02", "P03"]


def test_the_report_is_the_command_s(tmp_path: Path) -> None:
    scores = ROOT / "tests" / "data" / "published_scores.csv"
    assert typed("import", scores, tmp_path / "published") == 0
    assert typed("report", tmp_path / "published", "--out", tmp_path / "typed") == 0
    page = touchbeam.load(tmp_path / "published").report()
    assert page == tmp_path / "published" / "report" / "report.html"
    written = {path.name: path.read_bytes() for path in page.parent.rglob("*") if path.is_file()}
    typed_out = (tmp_path / "typed").rglob("*")
    assert written == {path.name: path.read_bytes() for path in typed_out if path.is_file()}


def test_friction_has_the_shape_of_its_arguments(study: touchbeam.Study) -> None:
    assert float(touchbeam.friction()) == float(touchbeam.friction(voltage_v=100))
    assert float(touchbeam.friction(voltage_v=0, friction_coefficient=0.3)) == 0.3
    table = touchbeam.friction(voltage_v=[[0], [100]], x_m=[0.03, 0.0414, 0.05])
    assert table.shape == (2, 3)
    scenes = pd.DataFrame({"voltage_v": [100, 100], "x_m": [0.03, 0.05]}, index=["near", "far"])
    predicted = touchbeam.predict(scenes)
    assert predicted.loc["near", "mu_effective"] == table[1, 0]
    assert predicted.loc["far", "mu_effective"] == table[1, 2]
    assert touchbeam.predict(scenes, law="coulomb").mu_effective.ne(predicted.mu_effective).all()
    assert study.predict(scenes).finger_load_n.eq(study.file.touch.force_n).all()


@pytest.mark.parametrize(
    "given",
    [
        [0.03, None],
        [0.03, np.nan],
        [0.03, pd.NA],
        pd.array([0.03, None], dtype="Float64"),
        np.ma.masked_greater([0.03, 0.05], 0.04),  # type: ignore[no-untyped-call]
    ],
    ids=["None", "NaN", "NA", "nullable", "masked"],
)
def test_what_is_missing_in_any_way_is_the_papers(given: Any) -> None:
    expected = touchbeam.friction(x_m=[0.03, 0.0414])
    np.testing.assert_array_equal(touchbeam.friction(x_m=given), expected)


def test_a_calibrated_rig_is_taken(folder: Path, study: touchbeam.Study, tmp_path: Path) -> None:
    calibrated = shutil.copytree(folder, tmp_path / "calibrated")
    measured = ResonanceMeasured(frequency_hz=24_140.0, tip_m_per_v=1e-8)
    known = {"session": "slide/1", "damping_ratio": {"value": 0.004, "low": 0.003, "high": 0.005}}
    keep_fit(calibrated, measured, "BOARD", known)
    own = touchbeam.load(calibrated)
    scenes = pd.DataFrame({"voltage_v": [100]})
    assert own.predict(scenes).damping_ratio.tolist() == [0.004]
    assert study.predict(scenes).damping_ratio.tolist() == [0.005]
    assert own.contrasts.consistent.ne(study.contrasts.consistent).any()


@pytest.mark.parametrize(
    ("scene", "problem"),
    [
        ({"voltage": 3}, "unknown column 'voltage'; did you mean 'voltage_v'"),
        ({"voltage_v": [1, -3]}, "line 3, column voltage_v: must be a finite number of at least 0"),
        ({"voltage_v": [1, 2], "x_m": [1, 2, 3]}, "shape mismatch"),
    ],
)
def test_a_wrong_scene_is_refused(scene: dict[str, object], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        touchbeam.friction(**scene)  # type: ignore[arg-type]


def test_a_study_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"no sessions here .*; record one with touchbeam run"):
        touchbeam.load(tmp_path)


def test_a_changed_journal_gives_a_warning(tmp_path: Path) -> None:
    (tmp_path / "scores.csv").write_text("subject,voltage\nP01,7\nP02,6\n")
    assert typed("import", tmp_path / "scores.csv", tmp_path / "published") == 0
    with tampering(tmp_path / "published" / "study.db") as journal:
        journal.execute("UPDATE event SET payload = replace(payload, '7.0', '9.0')")
    with pytest.warns(UserWarning, match="broken in P01/1; touchbeam verify"):
        touchbeam.load(tmp_path / "published")


def python(program: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", program],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("name", ["protocol", "device", "runner", "analysis"])
def test_another_package_of_the_same_name_is_named(name: str, tmp_path: Path) -> None:
    theirs = tmp_path / "lab" / name / "__init__.py"
    theirs.parent.mkdir(parents=True)
    theirs.write_text("")
    said = python("import touchbeam; touchbeam.load", tmp_path, PYTHONPATH=str(tmp_path / "lab"))
    assert said.returncode == 1
    assert (
        f"ImportError: touchbeam needs its own package {name!r} in {ROOT}, but Python finds "
        f"{theirs} under that name; rename that one"
    ) in said.stderr


def test_a_module_beside_the_notebook_is_named_even_once_imported(tmp_path: Path) -> None:
    (tmp_path / "analysis.py").write_text("mine = True")
    said = python(
        "import analysis; assert analysis.mine; import touchbeam; touchbeam.load", tmp_path
    )
    assert f"but Python finds {tmp_path / 'analysis.py'} under that name" in said.stderr


def test_importing_touchbeam_is_light_and_opens_no_window(folder: Path) -> None:
    program = (
        "import sys, touchbeam; heavy = {'pandas', 'numpy', 'scipy', 'pydantic', 'matplotlib'};"
        "assert not heavy & set(sys.modules);"
        f"touchbeam.load({str(folder)!r}).scores; touchbeam.friction();"
        "assert not {'psychopy', 'pyglet', 'serial', 'rich', 'typer'} & set(sys.modules)"
    )
    said = python(program, folder.parent)
    assert said.returncode == 0, said.stderr


def test_the_examples_of_the_module_are_right() -> None:
    assert doctest.testmod(touchbeam).failed == 0


def run_examples(program: str, folder: Path) -> None:
    said = python(program, folder.parent, MPLBACKEND="agg", PYTHONWARNINGS="error")
    assert said.returncode == 0, said.stderr


def test_the_examples_of_the_page_run(folder: Path) -> None:
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    run_examples("\n".join(re.findall(r"```python\n(.*?)```", page, re.DOTALL)), folder)


def test_the_notebook_runs_in_the_kernel_that_jupyterlab_starts(folder: Path) -> None:
    from jupyter_client.manager import start_new_kernel

    notebook = json.loads((ROOT / "docs" / "python.ipynb").read_text(encoding="utf-8"))
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
    manager, client = start_new_kernel(cwd=str(folder.parent), kernel_name="python3")
    try:
        for cell in ("import warnings; warnings.simplefilter('error')", *map(source, code)):
            told = client.execute_interactive(cell, output_hook=lambda _: None)["content"]
            assert told["status"] == "ok", f"{cell}\n{told}"
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)


def source(cell: dict[str, Any]) -> str:
    return "".join(cell["source"])
