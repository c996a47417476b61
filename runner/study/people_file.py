"""The people file that a command is given."""

from pathlib import Path

from device.people.people_file import people_in
from device.people.population import Population
from protocol.errors import BadInput
from runner.study.files import short_text


def people_file(path: Path) -> Population:
    """Return the virtual people that the file describes.

    Raises:
        BadInput: there is no such file, or it cannot be used; all problems are told.
    """
    try:
        return people_in(short_text(path), str(path))
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror or error})") from error
