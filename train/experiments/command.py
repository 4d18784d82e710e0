"""`python train/run.py reproduce`: progress with an estimate, and the page at the end."""

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import replace
from functools import partial
from pathlib import Path
from queue import Queue
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from pns_common import PnsError
from train.experiments.harness.experiment import Experiment
from train.experiments.harness.laboratory import FULL, Laboratory, silent
from train.experiments.harness.page import markdown_page
from train.experiments.harness.reproduce import Record, read_record, reproduce
from train.experiments.registry import EXPERIMENTS
from train.output_file import prepare_output

PAGE = "README.md"
# Of the repository, where this is run.
INSTALLED = Path("results")


def reproduce_command(
    name: Annotated[str | None, typer.Argument(help="One experiment; all if not given.")] = None,
    listed: Annotated[
        bool, typer.Option("--list", help="Name the experiments and what each needs, and end.")
    ] = False,
    checkpoints: Annotated[
        Path | None,
        typer.Option(
            help="Networks to take by recipe name instead of training.",
            exists=True,
            file_okay=False,
        ),
    ] = None,
    published: Annotated[
        Path | None,
        typer.Option(
            help="The author's published data, or a clone with .pt files.",
            exists=True,
            file_okay=False,
        ),
    ] = None,
    assets: Annotated[
        Path | None,
        typer.Option(
            help="Folder of meshes for the experiments that read files.",
            exists=True,
            file_okay=False,
        ),
    ] = None,
    output: Annotated[Path, typer.Option(help="Folder to write.")] = Path("build/results"),
    install: Annotated[
        bool, typer.Option("--install", help="Write results/, which is tracked.")
    ] = False,
    force: Annotated[bool, typer.Option(help="Run finished experiments again.")] = False,
    processes: Annotated[
        int, typer.Option(min=1, help="Experiments at once; all cores if not given.")
    ] = os.cpu_count() or 1,
) -> None:
    """Make the paper's tables and figures again, and those that it leaves open."""
    console = Console()
    if listed:
        for experiment in EXPERIMENTS.values():
            console.print(_line(experiment), markup=False, highlight=False, soft_wrap=True)
        return
    try:
        chosen = _chosen(name, published, assets)
        output = INSTALLED if install else output
        prepare_output(output / PAGE)
        networks = output / "cache" / "networks"
        laboratory = Laboratory(FULL, networks, checkpoints, published, silent, assets)
        run_all(chosen, laboratory, output, console, processes, force=force)
    except PnsError as error:
        console.print(escape(str(error)), style="red", soft_wrap=True)
        raise typer.Exit(1) from error


def run_all(
    experiments: list[Experiment],
    laboratory: Laboratory,
    output: Path,
    console: Console,
    processes: int,
    *,
    force: bool,
) -> None:
    """Run experiments, some at once, and write the page of everything found so far."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console) as progress:
        total = sum(experiment.seconds for experiment in experiments)
        at_once = min(processes, len(experiments))
        minutes = max(1, round(total / at_once / 60))
        plural = "s" if len(experiments) > 1 else ""
        progress.print(f"{len(experiments)} experiment{plural}, up to about {minutes} min")
        overall = progress.add_task("all", total=total)
        steps: dict[str, TaskID] = {}

        def on_news(name: str, text: str, done: int, of: int) -> None:
            if name not in steps:
                steps[name] = progress.add_task(name)
            progress.update(steps[name], description=text, completed=done, total=of)

        # What takes longest starts first, so that all end at about one time.
        queue = sorted(experiments, key=lambda experiment: -experiment.seconds)
        for ended, seconds in run_each(queue, laboratory, output, at_once, on_news, force=force):
            if ended.name in steps:
                progress.remove_task(steps.pop(ended.name))
            progress.advance(overall, ended.seconds)
            console.print(f"{ended.name}: {seconds:.1f} s")
    page = output / PAGE
    before = page.read_text(encoding="utf-8") if page.is_file() else ""
    page.write_text(markdown_page(EXPERIMENTS, _records(output), before), encoding="utf-8")
    console.print(f"{escape(str(page))} written", soft_wrap=True)


def _line(experiment: Experiment) -> str:
    needs = {"--published DIR": experiment.needs_published, "--assets DIR": experiment.needs_assets}
    options = "".join(f", needs {option}" for option, needed in needs.items() if needed)
    minutes = max(1, round(experiment.seconds / 60))
    return f"{experiment.name:<22} {experiment.title} (about {minutes} min{options})"


def _chosen(name: str | None, published: Path | None, assets: Path | None) -> list[Experiment]:
    def lacks(experiment: Experiment) -> str | None:
        if experiment.needs_published and published is None:
            return "--published DIR"
        return "--assets DIR" if experiment.needs_assets and assets is None else None

    if name is None:
        return [experiment for experiment in EXPERIMENTS.values() if lacks(experiment) is None]
    if name not in EXPERIMENTS:
        known = f"there are {', '.join(EXPERIMENTS)}; the theorems T1 to T8 are in structural"
        raise typer.BadParameter(f"no experiment {name!r}; {known}")
    missing = lacks(EXPERIMENTS[name])
    if missing is not None:
        raise typer.BadParameter(f"{name} needs {missing}")
    return [EXPERIMENTS[name]]


def _records(output: Path) -> dict[str, Record]:
    records = {name: read_record(output / "cache" / f"{name}.json") for name in EXPERIMENTS}
    return {name: record for name, record in records.items() if record is not None}


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
