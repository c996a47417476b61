"""Where tasks are computed: on the cores of this machine, or on a Dask cluster."""

import asyncio
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from logging import NOTSET, disable
from typing import TYPE_CHECKING

from analysis.power.job import Job, Task, records
from analysis.power.study_records import Records
from analysis.workers import done
from protocol.errors import BadInput, WorkFailed

if TYPE_CHECKING:
    from distributed import Client

# A person waits at the terminal: a wrong address must show within seconds.
_ANSWER_WITHIN_S = 5
_WORKERS_WITHIN_S = 8


Results = Generator[tuple[Task, Records], None, None]


def completed(
    job: Job, tasks: Sequence[Task], workers: int, scheduler: str | None = None
) -> Results:
    """Yield every task with its records as soon as they are there, in whatever order.

    They are computed by so many `workers` on this machine, or by the Dask cluster whose `scheduler`
    has this address.

    Raises:
        BadInput: the address is none, or the package for clusters is missing.
        WorkFailed: the cluster cannot be reached or does not work, or a process was killed.
    """
    if scheduler is not None:
        return _on_cluster(job, tasks, scheduler)
    # A process of its own would only add the time to start it.
    if workers == 1:
        return (_done(job, task) for task in tasks)
    return done((partial(_done, job, task) for task in tasks), min(workers, len(tasks)))


def _done(job: Job, task: Task) -> tuple[Task, Records]:
    return task, records(job, task)


def _on_cluster(job: Job, tasks: Sequence[Task], scheduler: str) -> Results:
    from distributed import KilledWorker, as_completed
    from distributed.client import FutureCancelledError

    with connected(scheduler) as client:
        # All at once, because a scheduler that ends between two would be an error of Dask's own;
        # not `pure`, because Dask would otherwise digest all arguments of each.
        futures = client.map(partial(_done, job), tasks, pure=False)
        try:
            for future in as_completed(futures, loop=client.loop):
                yield future.result()
                # A cluster would otherwise hold all results until the last one.
                future.release()
        except KilledWorker as error:
            raise WorkFailed(f"{scheduler}: a task ended its workers again and again") from error
        except (FutureCancelledError, OSError) as error:
            raise WorkFailed(f"{scheduler}: the scheduler ended or cannot be reached") from error


@contextmanager
def connected(scheduler: str) -> Iterator["Client"]:
    """Yield a connection to a Dask cluster that has workers.

    Raises:
        BadInput: the address is none, or the package for clusters is missing.
        WorkFailed: nobody answers there, or the cluster has no workers.
    """
    # Dask takes any other text for a name to look up, and waits.
    if not scheduler.startswith(("tcp://", "tls://")):
        raise BadInput(f"--scheduler must be an address such as tcp://HOST:8786, got {scheduler!r}")
    try:
        from distributed import Client
    except ImportError:
        needed = "--scheduler needs the package distributed; install touchbeam[cluster]"
        raise BadInput(needed) from None
    disable()  # it prints tracebacks of what is said here in one line
    try:
        if asyncio.run(_kind(scheduler)) != "Scheduler":
            how = "no Dask scheduler answers there; start one with: dask scheduler"
            raise WorkFailed(f"{scheduler}: {how}")
        # Not the default, so that Dask of the caller's own keeps its client.
        with Client(scheduler, timeout=_ANSWER_WITHIN_S, set_as_default=False) as client:
            try:
                client.wait_for_workers(1, timeout=_WORKERS_WITHIN_S)
            except TimeoutError:
                how = f"the cluster has no workers; start one with: dask worker {scheduler}"
                raise WorkFailed(f"{scheduler}: {how}") from None
            yield client
    finally:
        disable(NOTSET)


async def _kind(address: str) -> str:
    """Return what of a Dask cluster answers, such as "Scheduler"; empty if nothing of it does.

    A `Client` would wait far longer for what does not answer as a scheduler does.
    """
    from distributed import Security, rpc

    try:
        asked = Security().get_connection_args("client")
        async with asyncio.timeout(_ANSWER_WITHIN_S), rpc(address, connection_args=asked) as peer:
            return str((await peer.identity())["type"])
    except Exception:  # of its codec and of the peer's making, of many kinds
        return ""
