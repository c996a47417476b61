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
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, BinaryIO, NamedTuple, NoReturn

if TYPE_CHECKING:
    from device.friction.changes import Change


Contrasts = Callable[[Sequence["Change"]], list[float]]
"""From changes to the contrasts that the friction model predicts of them; to be asked once."""


@contextmanager
def foretelling() -> Iterator[Contrasts]:
    """Yield the model's contrasts, while it loads; afterwards its process is gone."""
    model = _forked() if hasattr(os, "fork") and threading.active_count() == 1 else None
    if model is None:
        yield contrasts
        return
    with os.fdopen(model.answers, "rb") as answers, os.fdopen(model.questions, "wb") as questions:
        try:
            yield lambda changes: _told(changes, questions, answers)
        finally:
            os.kill(model.process, signal.SIGKILL)
            os.waitpid(model.process, 0)


def contrasts(changes: Sequence["Change"]) -> list[float]:
    """Return the contrasts of `changes`, predicted in this process."""
    predicted_contrast = _model()
    return [predicted_contrast(change) for change in changes]


def _model() -> Callable[["Change"], float]:
    # One thread is enough for a few places, and a pool of them costs more than the rest of it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from device.friction.contrasts import predicted_contrast

    return predicted_contrast


class _Forked(NamedTuple):
    """The model's process: where to write the changes to, and to read the contrasts from."""

    process: int
    questions: int
    answers: int


def _forked() -> _Forked | None:
    """The model in a process of its own; None where there can be no more processes or files."""
    with ExitStack() as unless_forked:
        try:
            asked, questions = _pipe(unless_forked)
            answers, told = _pipe(unless_forked)
            process = os.fork()
        except OSError:
            return None
        unless_forked.pop_all()
    if process == 0:
        os.close(questions)
        _answer(asked, told)
    os.close(asked)
    os.close(told)
    return _Forked(process, questions, answers)


def _pipe(closing: ExitStack) -> tuple[int, int]:
    ends = os.pipe()
    for end in ends:
        closing.callback(os.close, end)
    return ends


def _answer(asked: int, told: int) -> NoReturn:
    """Load the model, read the question, answer it, and end, in silence whatever happens."""
    try:
        _model()
        with os.fdopen(asked, "rb") as questions:
            changes = pickle.load(questions)  # noqa: S301 - written by the process that forked this
        with os.fdopen(told, "wb") as answers:
            pickle.dump(contrasts(changes), answers)
    finally:
        os._exit(0)


def _told(changes: Sequence["Change"], questions: BinaryIO, answers: BinaryIO) -> list[float]:
    try:
        pickle.dump(changes, questions)
        questions.close()
        found: list[float] = pickle.load(answers)  # noqa: S301 - written by the forked process
    except (OSError, EOFError, pickle.UnpicklingError):
        return contrasts(changes)
    return found
