"""Work that is done in processes of its own, on the cores of this machine.

One module imports joblib, so that how processes are started, and how many threads each of them
may have, is decided in one place.
"""

import os
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TypeVar, cast
from warnings import catch_warnings

from protocol.errors import WorkFailed

Result = TypeVar("Result")
_OF_WORKERS = {
    # joblib starts its processes with `python -m` and `python -c`, which look in the current folder
    # first: in a study that somebody sent.
    "PYTHONSAFEPATH": "1",
    # The C library on Linux would give arrays back to the system after each step of a large fit,
    # which then clears new memory for the next ones: a seventh of the fit's time. Bytes.
    "MALLOC_MMAP_THRESHOLD_": str(2**25),
    "MALLOC_TRIM_THRESHOLD_": str(2**29),
}


def done(work: Iterable[Callable[[], Result]], workers: int) -> Generator[Result, None, None]:
    """Yield what each piece of work returns, as soon as it is there, in whatever order.

    Closing the generator ends what has not been done yet. The processes stay for the next work.

    Args:
        work: what is done; it and its results are pickled.
        workers: how many processes do it; each has one thread.

    Raises:
        WorkFailed: one of the processes was killed.
    """
    # joblib takes a quarter of a second to import, which most commands need not spend.
    from joblib import Parallel, delayed, parallel_config

    with _environment(), parallel_config(backend="loky", inner_max_num_threads=1):
        parallel = Parallel(n_jobs=workers, return_as="generator_unordered", batch_size=1)
        given = parallel(delayed(piece)() for piece in work)
        results = cast("Generator[Result, None, None]", given)
        try:
            for result in results:  # noqa: UP028 - `yield from` would close it, with a warning
                yield result
        except BrokenProcessPool as error:
            raise WorkFailed(
                "a process that computed was killed, as happens where memory runs out"
            ) from error
        finally:
            with catch_warnings(action="ignore"):  # of work that nobody waits for any more
                results.close()


@contextmanager
def _environment() -> Iterator[None]:
    """Let processes that are started meanwhile have the environment of workers."""
    before = {name: os.environ[name] for name in _OF_WORKERS if name in os.environ}
    os.environ.update(_OF_WORKERS)
    try:
        yield
    finally:
        for name in _OF_WORKERS:
            os.environ.pop(name, None)
        os.environ.update(before)
