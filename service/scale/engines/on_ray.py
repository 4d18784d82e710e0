"""Tasks done on a Ray cluster."""

from __future__ import annotations

import math
import os
import time
from collections import deque
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

from ...errors import InvalidParameter
from . import work as chunks
from .work import Done, Engine, R, T, Work

# Chunks in flight for each worker: one that runs, and one that keeps it from waiting.
AHEAD = 2
OBJECT_STORE = 128 * 1024**2
# How often a cluster is tried to be started on this machine.
STARTS = 3
# How often a cluster is asked how many processors it has.
LOOK_SECONDS = 5.0


def on_ray(
    work: Work[T, R],
    address: str | None,
    workers: int | None,
    say: Callable[[str], None] = lambda _: None,
) -> Engine[T, R]:
    """Return an engine on Ray: a cluster at `address`, else one started here, of `workers` tasks.

    Raises:
        InvalidParameter: Ray is not installed, or no cluster answers.
    """
    try:
        import ray
    except ImportError as error:
        raise InvalidParameter(
            "engine", "Ray needs the extra: pip install 'pns-subdivision[ray]'"
        ) from error

    def engine(tasks: Iterator[T]) -> Iterator[list[R]]:
        started = not ray.is_initialized()
        if started:
            context = _connected(ray, address, workers)
            if url := context.dashboard_url:
                say(f"Ray's dashboard: http://{url}")
        # Retries are ours, for a row must say how often a file was tried.
        remote = ray.remote(num_cpus=1, max_retries=0)(_do)
        places, looked, size = 0, -math.inf, chunks.FIRST
        pending: dict[Any, list[T]] = {}
        again: deque[list[T]] = deque()
        try:
            while True:
                # A cluster grows and shrinks meanwhile.
                if time.monotonic() - looked >= LOOK_SECONDS:
                    places = workers or int(ray.cluster_resources().get("CPU", 1)) or 1
                    looked = time.monotonic()
                while len(pending) < AHEAD * places:
                    chunk = again.popleft() if again else list(islice(tasks, size))
                    if not chunk:
                        break
                    pending[remote.remote(work.job, chunk, work.seconds)] = chunk
                if not pending:
                    return
                for reference in ray.wait(list(pending), num_returns=1)[0]:
                    chunk = pending.pop(reference)
                    try:
                        done: Done[R] = ray.get(reference)
                    except ray.exceptions.RayTaskError as error:  # pyright: ignore[reportAttributeAccessIssue]
                        raise error.as_instanceof_cause() from None
                    except ray.exceptions.RayError:  # pyright: ignore[reportAttributeAccessIssue]
                        if len(chunk) > 1:
                            # Nobody knows which one it was: each is sent alone, as if it were new.
                            again.extend([task] for task in chunk)
                        elif retry := work.again(chunk[0]):
                            again.append([retry])
                        else:
                            yield [work.given_up(chunk[0], late=False)]
                        continue
                    if left := chunk[len(done.results) :]:
                        again.append(left)
                    size = done.next_size
                    yield done.results
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
            if address is not None:
                raise InvalidParameter("address", f"{address}: {error}") from error
            left -= 1
            if not left or "timed out during startup" not in str(error):
                raise InvalidParameter("engine", f"Ray cannot be started here: {error}") from error
            ray.shutdown()


def _do(job: Callable[[T], R], tasks: list[T], seconds: float | None) -> Done[R]:
    os.environ["OMP_NUM_THREADS"] = "1"
    return chunks.do(job, tasks, seconds)
