"""A study that can be carried out: by its file, on the beam that there is, in the window."""

from collections.abc import Iterator

from device.reach import reach_problems
from protocol.problem import Problem
from protocol.rating import PAPERS_BANDS
from protocol.study import Study
from protocol.study_file import parsed_study


def usable(text: str, source: str) -> Study:
    """Return the study that `text` describes, checked for everything that a session needs of it.

    Raises:
        StudyError: it cannot be used.
    """
    return parsed_study(text, source, _out_of_place)


def _out_of_place(study: Study) -> Iterator[Problem]:
    yield from reach_problems(study)
    if study.texts or study.rating.bands not in ((), PAPERS_BANDS):  # the built-in ones do fit
        from runner.window.fit import fit_problems

        yield from fit_problems(study)
