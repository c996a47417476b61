"""Work that is done in processes of its own, on the cores of this machine.

One module imports joblib, so that how processes are started, and how many threads each of them
may have, is decided in one place.
"""

from collections.abc import Callable, Generator, Iterable
from typing import TypeVar, cast
from warnings import catch_warnings

Result = TypeVar("Result")


def done(work: Iterable[Callable[[], Result]], workers: int) -> Generator[Result, None, None]:
    """Yield what each piece of work returns, as soon as it is there, in whatever order.

    Closing the generator ends what has not been done yet. The processes stay for the next work.

    Args:
        work: what is done; it and its results are pickled.
        workers: how many processes do it; each has one thread.
    """
    # joblib takes a quarter of a second to import, which most commands need not spend.
    from joblib import Parallel, delayed, parallel_config

    with parallel_config(backend="loky", inner_max_num_threads=1):
        parallel = Parallel(n_jobs=workers, return_as="generator_unordered", batch_size=1)
        given = parallel(delayed(piece)() for piece in work)
        results = cast("Generator[Result, None, None]", given)
        try:
            for result in results:  # noqa: UP028 - `yield from` would close it, with a warning
                yield result
        finally:
            with catch_warnings(action="ignore"):  # of work that nobody waits for any more
                results.close()
