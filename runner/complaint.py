"""What a failed command says, in one line, and its exit code."""

import errno

import typer

from protocol.errors import BadInput, WorkFailed

WORK_FAILED = 1
BAD_INPUT = 2

_PATHS_GIVEN_WRONG = {
    errno.EACCES,
    errno.EEXIST,
    errno.EISDIR,
    errno.ELOOP,
    errno.ENAMETOOLONG,
    errno.ENOENT,
    errno.ENOTDIR,
    errno.EPERM,
}


def complaint(error: BaseException) -> tuple[str, int]:
    """Return the line that tells a user what `error` means, and the exit code of the command."""
    line, code = _told(error)
    notes = [note for note in getattr(error, "__notes__", ()) if note not in line]
    return " ".join("; ".join([line, *notes]).split()), code


def _told(error: BaseException) -> tuple[str, int]:
    match error:
        case typer.TyperException():
            return f"{error.format_message()} (see touchbeam --help)", error.exit_code
        case BadInput():
            return str(error), BAD_INPUT
        case WorkFailed():
            return str(error), WORK_FAILED
        case OSError(filename=str() as path, strerror=str() as why):
            code = BAD_INPUT if error.errno in _PATHS_GIVEN_WRONG else WORK_FAILED
            return f"{path}: {why}", code
        case OSError(errno=errno.ENOSPC | errno.EFBIG | errno.EDQUOT, strerror=str() as why):
            return f"standard output cannot be written ({why})", WORK_FAILED
    return f"internal error, {type(error).__name__}: {error} (--debug shows where)", WORK_FAILED
