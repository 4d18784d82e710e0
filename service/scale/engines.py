"""Where tasks are done: in processes of this machine, or on a Ray cluster.

An engine takes tasks as they come and gives results as they end, in any order. It holds a bounded
number of tasks at a time. A task whose process died or hung is tried again, elsewhere.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from ..errors import InvalidParameter, JobTimeout, ServiceError, WorkerDied

if TYPE_CHECKING:
    from pebble import ProcessPool


class Attempted(Protocol):
    """A frozen dataclass that says how often it is tried now, from 1 on."""

    @property
    def attempt(self) -> int:
        """1, then 2 where the first worker died or hung, …"""
        ...


T = TypeVar("T", bound=Attempted)
R = TypeVar("R")
Engine = Callable[[Iterator[T]], Iterator[R]]


@dataclass(frozen=True)
class Work(Generic[T, R]):
    """What is done with each task.

    Attributes:
        job: done in a worker; what it raises is raised by the engine.
        lost: what a task gives whose workers died or hung each time; it may raise too.
        most_attempts: how often a task is tried.
        seconds: how long one try may take; None: any time.
    """

    job: Callable[[T], R]
    lost: Callable[[T, ServiceError], R]
    most_attempts: int
    seconds: float | None


# In flight on Ray for each worker: one that runs, and one that keeps it from waiting.
AHEAD = 2
# Workers that may end before they begin a task, in a row: so many are not killed by chance.
MOST_BROKEN = 100
OBJECT_STORE = 128 * 1024**2
# How often a cluster is tried to be started on this machine.
STARTS = 3
# How often a cluster is asked how many processors it has.
LOOK_SECONDS = 5.0


def prepare() -> None:
    """Set up a worker: one thread each, since the files are the parallelism."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ["OMP_NUM_THREADS"] = "1"
    # Before the first file, whose time it would be taken from.
    from ..meshfiles import convert  # noqa: F401


def local(work: Work[T, R], workers: int) -> Engine[T, R]:
    """An engine of `workers` processes on this machine.

    Each process has a pool of its own, and one task at a time: in a pebble pool of several, one
    that is killed between two tasks, or while it holds their common pipe, is the end of all.
    """
    from pebble import ProcessExpired, ProcessPool

    def engine(tasks: Iterator[T]) -> Iterator[R]:
        context = multiprocessing.get_context("spawn")

        def new_pool() -> ProcessPool:
            return ProcessPool(max_workers=1, initializer=prepare, context=context)

        idle = [new_pool() for _ in range(workers)]
        busy: dict[Future[R], tuple[T, ProcessPool]] = {}
        again: deque[T] = deque()
        broken = 0
        try:
            while True:
                while (
                    idle and (task := again.popleft() if again else next(tasks, None)) is not None
                ):
                    pool = idle.pop()
                    try:
                        future = pool.schedule(work.job, args=(task,), timeout=work.seconds)
                    except RuntimeError:  # its process died while it had nothing to do
                        pool = _replaced(pool, new_pool)
                        future = pool.schedule(work.job, args=(task,), timeout=work.seconds)
                    busy[future] = task, pool
                if not busy:
                    return
                for future in wait(busy, return_when=FIRST_COMPLETED).done:
                    task, pool = busy.pop(future)
                    try:
                        result = future.result()
                    except (TimeoutError, ProcessExpired) as error:
                        idle.append(pool)
                        if task.attempt < work.most_attempts:
                            again.append(_again(task))
                        else:
                            late = isinstance(error, TimeoutError) and work.seconds is not None
                            yield work.lost(task, _lost(work, timeout=late))
                    except BrokenProcessPool as error:
                        # It died before it began the task, which is not to blame.
                        idle.append(_replaced(pool, new_pool))
                        again.append(task)
                        broken += 1
                        if broken == MOST_BROKEN:
                            text = f"{broken} workers ended one after the other before any task"
                            raise WorkerDied(text) from error
                    except BaseException:
                        idle.append(pool)
                        raise
                    else:
                        idle.append(pool)
                        broken = 0
                        yield result
        finally:
            pools = [*idle, *(pool for _, pool in busy.values())]
            for pool in pools:
                pool.stop()
            for pool in pools:
                pool.join()

    return engine


def _replaced(pool: ProcessPool, new_pool: Callable[[], ProcessPool]) -> ProcessPool:
    pool.stop()
    pool.join()
    return new_pool()


def engine_of(
    work: Work[T, R],
    name: str,
    address: str | None,
    workers: int | None,
    say: Callable[[str], None],
) -> Engine[T, R]:
    """The engine of a name, local or ray; an address implies Ray, and local takes all processors.

    ``say`` is told where Ray's dashboard is.

    Raises:
        InvalidParameter: Ray is not installed.
    """
    if name == "ray" or address is not None:
        return on_ray(work, address, workers, say)
    return local(work, workers or os.cpu_count() or 1)


def on_ray(
    work: Work[T, R],
    address: str | None,
    workers: int | None,
    say: Callable[[str], None] = lambda _: None,
) -> Engine[T, R]:
    """An engine on Ray: a cluster at `address`, else one started here; `workers` bounds its tasks.

    Raises:
        InvalidParameter: Ray is not installed, or no cluster answers.
    """
    try:
        import ray
    except ImportError as error:
        raise InvalidParameter(
            "engine", "Ray needs the extra: pip install 'pns-subdivision[ray]'"
        ) from error

    def engine(tasks: Iterator[T]) -> Iterator[R]:
        started = not ray.is_initialized()
        if started:
            context = _connected(ray, address, workers)
            if url := context.dashboard_url:
                say(f"Ray's dashboard: http://{url}")
        # Retries are ours, for a row must say how often a file was tried.
        remote = ray.remote(num_cpus=1, max_retries=0)(_watched)
        places, looked = 0, -math.inf
        pending: dict[Any, T] = {}
        try:
            while True:
                # A cluster grows and shrinks meanwhile.
                if time.monotonic() - looked >= LOOK_SECONDS:
                    places = workers or int(ray.cluster_resources().get("CPU", 1)) or 1
                    looked = time.monotonic()
                while len(pending) < AHEAD * places and (task := next(tasks, None)) is not None:
                    pending[remote.remote(work.job, task, work.seconds)] = task
                if not pending:
                    return
                for reference in ray.wait(list(pending), num_returns=1)[0]:
                    task = pending.pop(reference)
                    try:
                        yield ray.get(reference)
                    except ray.exceptions.RayTaskError as error:  # pyright: ignore[reportAttributeAccessIssue]
                        raise error.as_instanceof_cause() from None
                    except ray.exceptions.RayError:  # pyright: ignore[reportAttributeAccessIssue]
                        if task.attempt < work.most_attempts:
                            again = _again(task)
                            pending[remote.remote(work.job, again, work.seconds)] = again
                        else:
                            yield work.lost(task, _lost(work, timeout=False))
        finally:
            for reference in pending:
                ray.cancel(reference, force=True)
            if started:
                ray.shutdown()

    return engine


def _connected(ray: Any, address: str | None, workers: int | None) -> Any:
    """Connect to a cluster, or start one here.

    Raises:
        InvalidParameter: no cluster answers, or none can be started.
    """
    left = STARTS
    while True:
        try:
            return ray.init(
                address=address,
                num_cpus=workers if address is None else None,
                # Rows are small, and so is what they travel through.
                object_store_memory=OBJECT_STORE if address is None else None,
                log_to_driver=False,
                configure_logging=False,
            )
        except (ConnectionError, RuntimeError) as error:
            if address is not None:
                raise InvalidParameter("address", f"{address}: no cluster answers") from error
            raise InvalidParameter("engine", f"Ray cannot be started here: {error}") from error
        except Exception as error:
            # Ray gives its daemons half a minute, which may be too little on a busy machine, and
            # says so in words alone.
            left -= 1
            if not left or "timed out during startup" not in str(error):
                raise InvalidParameter("engine", f"Ray cannot be started here: {error}") from error
            ray.shutdown()


def _watched(job: Callable[[T], R], task: T, seconds: float | None) -> R:
    """A job that ends its own process past its time, even while it holds the interpreter."""
    os.environ["OMP_NUM_THREADS"] = "1"
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, seconds or 0)
    try:
        return job(task)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def _again(task: T) -> T:
    changed: Any = task
    return replace(changed, attempt=task.attempt + 1)


def _lost(work: Work[T, R], *, timeout: bool) -> ServiceError:
    times = "twice" if work.most_attempts == 2 else f"{work.most_attempts} times"
    if timeout:
        return JobTimeout(f"it ran longer than {work.seconds:g} seconds, {times}")
    longer = "" if work.seconds is None else f", or longer than {work.seconds:g} seconds"
    return WorkerDied(f"its worker ended, {times}: out of memory, a fault{longer}")
