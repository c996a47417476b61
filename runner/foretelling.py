"""Predicted contrasts from a process of its own, which loads the friction model meanwhile.

Loading numpy takes about as long as reading a study file. A process that is forked before either
does the one while this one does the other. Where a process cannot fork, or does not answer, the
predictions are made here, and what is wrong with them is raised here.
"""

import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, BinaryIO, NoReturn

if TYPE_CHECKING:
    from device.change import Change

Contrasts = Callable[[Sequence["Change"]], list[float]]
"""From changes to the contrasts that the friction model predicts of them; to be asked once."""


@contextmanager
def foretelling() -> Iterator[Contrasts]:
    """Yield the model's contrasts, while it loads; afterwards its process is gone."""
    if not hasattr(os, "fork") or threading.active_count() > 1:
        yield contrasts
        return
    to_read, questions = os.pipe()
    answers, to_write = os.pipe()
    process = os.fork()
    if process == 0:
        os.close(questions)
        _answer(to_read, to_write)
    os.close(to_read)
    os.close(to_write)
    with os.fdopen(answers, "rb") as told, os.fdopen(questions, "wb") as asked:
        try:
            yield lambda changes: _told(changes, asked, told)
        finally:
            os.kill(process, signal.SIGKILL)
            os.waitpid(process, 0)


def contrasts(changes: Sequence["Change"]) -> list[float]:
    """Return the contrasts of `changes`, predicted in this process."""
    predicted_contrast = _model()
    return [predicted_contrast(change) for change in changes]


def _model() -> Callable[["Change"], float]:
    # One thread is enough for a few places, and a pool of them costs more than the rest of it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from device.contrast import predicted_contrast

    return predicted_contrast


def _answer(to_read: int, to_write: int) -> NoReturn:
    """Load the model, read the question, answer it, and end, in silence whatever happens."""
    try:
        _model()
        with os.fdopen(to_read, "rb") as asked:
            changes = pickle.load(asked)  # noqa: S301 - written by the process that forked this one
        with os.fdopen(to_write, "wb") as told:
            pickle.dump(contrasts(changes), told)
    finally:
        os._exit(0)


def _told(changes: Sequence["Change"], asked: BinaryIO, told: BinaryIO) -> list[float]:
    try:
        pickle.dump(changes, asked)
        asked.close()
        answer: list[float] = pickle.load(told)  # noqa: S301 - written by the forked process
    except (OSError, EOFError):
        return contrasts(changes)
    return answer
