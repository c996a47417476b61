"""`touchbeam check`: a study's problems, or the plan that it gives."""

import json
from collections.abc import Hashable, Iterator, Sequence
from typing import Any

from device.friction.changes import trial_change
from device.study_limits import reach_problems
from protocol.errors import Problem
from protocol.plan.trials import Trial
from protocol.preview.preview import Predict, Preview, preview, preview_record
from protocol.preview.text import preview_lines
from protocol.proof.cohort import cohort_problems
from protocol.study.questions import PAPERS_BANDS
from protocol.study.study import Study
from protocol.study_file.loading import StudyError, located, parsed_study
from runner.study.folder import StudyFolder
from runner.study.model_process import Contrasts


def validated_study(text: str, source: str) -> Study:
    """Return the study that `text` describes, checked for everything that a session needs of it.

    Raises:
        StudyError: it cannot be used.
    """
    return parsed_study(text, source, _out_of_place)


def _out_of_place(study: Study) -> Iterator[Problem]:
    yield from reach_problems(study)
    if study.texts or study.rating.bands not in ((), PAPERS_BANDS):  # the built-in ones do fit
        from runner.window.preflight import fit_problems

        yield from fit_problems(study)


def checked(
    folder: StudyFolder,
    participants: int | None,
    contrasts: Contrasts,
    *,
    as_json: bool,
) -> tuple[str, list[str], bool]:
    """Return what to print, the problems as lines, and whether the study is in order.

    Args:
        folder: the study.
        participants: size of the cohort; the study's own, or 1, without it.
        contrasts: the friction model, to predict what is felt.
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
    return _text(shown, _predict(shown, contrasts), as_json=as_json), [], True


def _text(shown: Preview, predict: Predict, *, as_json: bool) -> str:
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


def _predict(shown: Preview, contrasts: Contrasts) -> Predict:
    """The friction model's prediction of every trial in `shown`."""
    trials = {_what_changes(trial): trial for plan in shown.plans for trial in plan.trials}
    changes = {
        what: trial_change(shown.study, trial.question, trial.expected, trial.touches)
        for what, trial in trials.items()
        if trial.question is not None
    }
    predicted = dict(zip(changes, contrasts(list(changes.values())), strict=True))
    return lambda trial: predicted.get(_what_changes(trial))


def _what_changes(trial: Trial) -> Hashable:
    """What a prediction depends on: many trials of a cohort share it."""
    return trial.question, trial.expected, trial.touches
