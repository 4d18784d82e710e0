"""What an iterator yields, made by a process of its own while this one works on the last."""

import multiprocessing
import pickle
import signal
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from typing import TypeVar

T = TypeVar("T")


def ahead(make: Callable[..., Iterator[T]], *arguments: object) -> Iterator[T]:
    """Yield what ``make(*arguments)`` yields: the next value is made while one is worked on.

    `make` is a function that a fresh process can import, the arguments and values can be pickled.
    What it raises is raised here.

    Raises:
        EOFError: the process was ended from outside.
    """
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_send_all, args=(there, make, arguments), daemon=True)
    process.start()
    there.close()
    try:
        while (message := pickle.loads(here.recv_bytes())) is not None:
            value, error = message
            if error is not None:
                raise error
            yield value
    finally:
        here.close()
        process.terminate()
        process.join()


def _send_all(
    there: Connection, make: Callable[..., Iterator[object]], arguments: tuple[object, ...]
) -> None:
    # Whoever interrupts the work means the process that does it, which ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        for value in make(*arguments):
            # Waits here, one value ahead. Bytes: tensors would be sent as open files, one each.
            there.send_bytes(pickle.dumps((value, None)))
        there.send_bytes(pickle.dumps(None))
    except Exception as error:
        there.send_bytes(pickle.dumps((None, error)))
