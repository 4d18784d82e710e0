"""Several experiments at once, each in a process of its own."""

import multiprocessing
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import replace
from functools import partial
from pathlib import Path
from queue import Queue

from train.experiments.harness.experiment import Experiment
from train.experiments.harness.laboratory import Laboratory, silent
from train.experiments.harness.reproduce import reproduce
from train.experiments.registry import EXPERIMENTS

# Called with an experiment's name, what it is doing, how many steps are done, and of how many.
OnNews = Callable[[str, str, int, int], None]

NEWS_SECONDS = 0.2


def run_each(
    experiments: list[Experiment],
    laboratory: Laboratory,
    output: Path,
    processes: int,
    on_news: OnNews,
    *,
    force: bool,
) -> Iterator[tuple[Experiment, float]]:
    """Yield each experiment when it has ended, with the seconds it took.

    An experiment runs in one process and draws from seeds of its own: how many run at once changes
    no digit.
    """
    if processes == 1:
        for experiment in experiments:
            here = replace(laboratory, progress=partial(on_news, experiment.name))
            yield experiment, _seconds(experiment, here, output, force=force)
        return
    context = multiprocessing.get_context("spawn")
    unwatched = replace(laboratory, progress=silent)
    with context.Manager() as manager, ProcessPoolExecutor(processes, context) as pool:
        news = manager.Queue()
        running = {
            pool.submit(_in_process, each.name, unwatched, output, news, force=force): each
            for each in experiments
        }
        while running:
            ended, _ = wait(running, NEWS_SECONDS, FIRST_COMPLETED)
            while not news.empty():
                on_news(*news.get())
            for future in ended:
                yield running.pop(future), future.result()


def _in_process(
    name: str,
    laboratory: Laboratory,
    output: Path,
    news: Queue[tuple[str, str, int, int]],
    *,
    force: bool,
) -> float:
    def tell(text: str, done: int, of: int) -> None:
        news.put((name, text, done, of))

    here = replace(laboratory, progress=tell)
    return _seconds(EXPERIMENTS[name], here, output, force=force)


def _seconds(experiment: Experiment, laboratory: Laboratory, output: Path, *, force: bool) -> float:
    began = time.perf_counter()
    reproduce(experiment, laboratory, output, force=force)
    return time.perf_counter() - began
