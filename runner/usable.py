"""A study that can be carried out: by its file alone, and on the beam that there is."""

from device.reach import reach_problems
from protocol.study import Study
from protocol.study_file import parsed_study
from runner.study_folder import StudyFolder


def usable_study(folder: StudyFolder) -> Study:
    """Return the study in `folder`, checked for everything that a session needs of it.

    Raises:
        BadInput: there is none.
        StudyError: it cannot be used.
    """
    return usable(folder.text(), str(folder.study_file))


def usable(text: str, source: str) -> Study:
    """Return the study that `text` describes. Raises as `usable_study`."""
    return parsed_study(text, source, reach_problems)
