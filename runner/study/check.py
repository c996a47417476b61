"""`touchbeam check`: a study's problems, or the plan that it gives."""

import json
import os
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

from device.friction.changes import trial_change
from device.study_limits import reach_problems
from protocol.errors import Problem
from protocol.plan.trials import Trial
from protocol.preview.preview import Predict, preview, preview_record
from protocol.preview.text import preview_lines
from protocol.proof.cohort import cohort_problems
from protocol.study.study import Study
from protocol.study.texts import worded_as_built
from protocol.study.touch import Touch
from protocol.study_file.language_files import located
from protocol.study_file.loading import StudyError, parsed_study
from runner.study.folder import StudyFolder, dialects


def validated_study(text: str, source: str) -> Study:
    """Return the study that `text` describes, checked for everything that a session needs of it.

    Raises:
        StudyError: it cannot be used.
    """
    return parsed_study(text, source, _out_of_place, dialects)


def _out_of_place(study: Study) -> Iterator[Problem]:
    yield from reach_problems(study)
    if not worded_as_built(study):  # the built-in texts do fit
        from runner.window.preflight import fit_problems

        yield from fit_problems(study)


def checked(
    folder: StudyFolder, participants: int | None, *, as_json: bool
) -> tuple[str, list[str], bool]:
    """Return what to print, the problems as lines, and whether the study is in order.

    Args:
        folder: the study.
        participants: size of the cohort; the study's own, or 1, without it.
        as_json: whether to print one JSON document.

    Raises:
        BadInput: there is no study.
    """
    source, text = str(folder.study_file), folder.text()
    try:
        study = validated_study(text, source)
    except StudyError as error:
        return _refused(source, error.problems, as_json=as_json)
    size = participants or study.design.participants or 1
    shown = preview(study, size)
    broken = cohort_problems(study, shown.plans)
    if broken:
        return _refused(source, located(text, broken), as_json=as_json)
    predict = _prediction(study)
    if as_json:
        return _json({"ok": True, "problems": [], **preview_record(shown, predict)}), [], True
    return "\n".join(preview_lines(shown, predict)), [], True


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
            **({"file": problem.file} if problem.file else {}),
        }
        for problem in problems
    ]
    return _json({"ok": False, "problems": found, "participants": []}), lines, False


def _json(document: dict[str, Any]) -> str:
    return json.dumps(document, ensure_ascii=False, indent=1, allow_nan=False)


def _prediction(study: Study) -> Predict:
    """Return what the friction model predicts of a trial; it is loaded for studies in order."""
    # One thread is enough for a few places; starting a pool of them takes longer than the work.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from device.friction.contrasts import predicted_contrast

    @cache  # a cohort's trials share few of these, and a prediction depends on nothing else
    def contrast(question: str, expected: str | None, touches: tuple[Touch, ...]) -> float:
        return predicted_contrast(trial_change(study, question, expected, touches))

    def predict(trial: Trial) -> float | None:
        if trial.question is None:
            return None
        return contrast(trial.question, trial.expected, trial.touches)

    return predict
