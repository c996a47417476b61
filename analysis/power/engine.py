"""Where tasks are computed: on the cores of this machine, or on a Dask cluster."""

import asyncio
import io
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from functools import partial
from hmac import compare_digest, digest
from logging import NOTSET, disable
from typing import TYPE_CHECKING, Protocol

import numpy as np

from analysis.estimates import FloatArray
from analysis.power.job import Job, Task, numbers
from analysis.workers import done
from protocol.errors import BadInput, WorkFailed

if TYPE_CHECKING:
    from distributed import Client

# A person waits at the terminal: a wrong address must show within seconds.
_ANSWER_WITHIN_S = 5
_WORKERS_WITHIN_S = 8


class Chunks(Protocol):
    """Kept results of tasks."""

    @property
    def key(self) -> bytes:
        """What only those have whose results are believed."""
        ...

    def load(self, name: str) -> bytes | None:
        """Return what was kept under a name, if anything."""
        ...

    def save(self, name: str, content: bytes) -> None:
        """Keep it: all of it or, after a power cut, nothing."""
        ...


Results = Generator[tuple[Task, FloatArray], None, None]


def completed(
    job: Job, wanted: Sequence[Task], chunks: Chunks, workers: int, scheduler: str | None = None
) -> Results:
    """Yield every task with its numbers as soon as they are there, kept ones first.

    Each result is kept in `chunks` before it is yielded, so that a run that is interrupted goes on.
    What is not kept is computed by so many `workers` on this machine, or by the Dask cluster whose
    `scheduler` has this address.

    Raises:
        BadInput: the address is none, or the package for clusters is missing.
        WorkFailed: the cluster cannot be reached or does not work, or a process was killed.
    """
    left = []
    for task in wanted:
        if (found := kept(job, task, chunks)) is None:
            left.append(task)
        else:
            yield task, found
    if not left:
        return
    try:
        with closing(_computed(job, left, workers, scheduler)) as results:
            for task, found in results:
                content = io.BytesIO()
                # Nothing pickled is ever read back: that would execute what a stranger put there.
                np.save(content, found, allow_pickle=False)
                seal = _seal(job, task, content.getvalue(), chunks.key)
                chunks.save(task.name, seal + content.getvalue())
                yield task, found
    except (WorkFailed, OSError) as error:
        # Whoever sees this has often waited for hours.
        error.add_note("what is done is kept; the same command goes on from there")
        raise


def kept(job: Job, task: Task, chunks: Chunks) -> FloatArray | None:
    """Return the kept numbers of a task; None if there are none, or if their seal is not right."""
    # What is not there has no seal.
    content = chunks.load(task.name) or b""
    # The SHA-256 seal has 32 bytes and stands first.
    if not compare_digest(_seal(job, task, content[32:], chunks.key), content[:32]):
        return None
    found: FloatArray = np.load(io.BytesIO(content[32:]), allow_pickle=False)
    return found


def _seal(job: Job, task: Task, content: bytes, key: bytes) -> bytes:
    """Return the HMAC of numbers and of what they are the result of.

    It tells damage, and results that somebody else put into a study, who can compute a digest.
    """
    return digest(key, f"{job.digest}/{task.name}\n".encode() + content, "sha256")


def _computed(job: Job, left: Sequence[Task], workers: int, scheduler: str | None) -> Results:
    if scheduler is not None:
        return _on_cluster(job, left, scheduler)
    # A process of its own would only add the time to start it.
    if workers == 1:
        return (_numbered(job, task) for task in left)
    return done((partial(_numbered, job, task) for task in left), min(workers, len(left)))


def _numbered(job: Job, task: Task) -> tuple[Task, FloatArray]:
    return task, numbers(job, task)


def _on_cluster(job: Job, left: Sequence[Task], scheduler: str) -> Results:
    from distributed import KilledWorker, as_completed
    from distributed.client import FutureCancelledError

    with connected(scheduler) as client:
        # Not `pure`, because Dask would otherwise digest all arguments of each task.
        futures = [client.submit(_numbered, job, task, pure=False) for task in left]
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


def cluster_size(scheduler: str) -> int:
    with connected(scheduler) as client:
        return int(sum(client.nthreads().values()))
