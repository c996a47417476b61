"""`touchbeam check`: a study's problems, or the plan that it gives."""

import json
import os
from collections.abc import Sequence
from typing import Any

from device.trial_change import trial_change
from protocol.cohort_check import cohort_problems
from protocol.preview import Predict, Preview, preview, preview_record
from protocol.preview_text import preview_lines
from protocol.problem import Problem
from protocol.study import Study
from protocol.study_file import StudyError, located
from protocol.trial import Trial
from runner.study_folder import StudyFolder
from runner.window.fit import fit_problems


def checked(
    folder: StudyFolder,
    participants: int | None,
    *,
    as_json: bool,
) -> tuple[str, list[str], bool]:
    """Return what to print, the problems as lines, and whether the study is in order.

    Args:
        folder: the study.
        participants: size of the cohort; the study's own, or 1, without it.
        as_json: whether to print one JSON document.

    Raises:
        BadInput: there is no study.
    """
    source = str(folder.study_file)
    try:
        study = folder.study()
    except StudyError as error:
        return _refused(source, error.problems, as_json=as_json)
    size = participants or study.design.participants or 1
    shown = preview(study, size)
    broken = [*cohort_problems(study, shown.plans), *fit_problems(study)]
    if broken:
        return _refused(source, located(folder.text(), broken), as_json=as_json)
    return _text(shown, as_json=as_json), [], True


def _text(shown: Preview, *, as_json: bool) -> str:
    predict = predictor(shown.study)
    if as_json:
        return _json({"ok": True, "problems": [], **preview_record(shown, predict)})
    return "\n".join(preview_lines(shown, predict))


def _refused(
    source: str, problems: Sequence[Problem], *, as_json: bool
) -> tuple[str, list[str], bool]:
    lines = [problem.located(source) for problem in problems]
    if not as_json:
        return "", lines, False
    found = [
        {
            "where": problem.where,
            "rule": problem.rule,
            "value": problem.value,
            "hint": problem.hint,
            "line": problem.line,
        }
        for problem in problems
    ]
    return _json({"ok": False, "problems": found, "participants": []}), lines, False


def _json(document: dict[str, Any]) -> str:
    return json.dumps(document, ensure_ascii=False, indent=1, allow_nan=False)


def predictor(study: Study) -> Predict:
    """Return the friction model's prediction of a trial of `study`."""
    # One thread is enough for a few places, and a pool of them costs more than the rest of it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from device.contrast import predicted_contrast

    def predicted(trial: Trial) -> float | None:
        if trial.question is None:
            return None
        return predicted_contrast(
            trial_change(study, trial.question, trial.expected, trial.touches)
        )

    return predicted
