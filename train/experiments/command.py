"""`python train/run.py reproduce`: experiments, some at once, and the page at the end."""

import multiprocessing
import os
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress

from pns_common import PnsError
from train.experiments.harness.experiment import Experiment
from train.experiments.harness.laboratory import FULL, Laboratory
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
    output: Annotated[Path, typer.Option(help="Folder to write.")] = Path("build/results"),
    install: Annotated[
        bool, typer.Option("--install", help="Write results/, which is tracked.")
    ] = False,
    force: Annotated[bool, typer.Option(help="Run finished experiments again.")] = False,
    processes: Annotated[
        int, typer.Option(min=1, help="Experiments at once; all cores if not given.")
    ] = os.cpu_count() or 1,
) -> None:
    """Make the paper's tables and figures again."""
    console = Console()
    if listed:
        for experiment in EXPERIMENTS.values():
            console.print(_line(experiment), markup=False, highlight=False, soft_wrap=True)
        return
    try:
        chosen = _chosen(name, published)
        output = INSTALLED if install else output
        prepare_output(output / PAGE)
        networks = output / "cache" / "networks"
        laboratory = Laboratory(FULL, networks, checkpoints, published)
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
    """Run experiments, some at once, and write the page of everything found so far.

    An experiment draws from seeds of its own: how many run at once changes no digit.
    """
    total = sum(experiment.seconds for experiment in experiments)
    at_once = min(processes, len(experiments))
    minutes, plural = max(1, round(total / at_once / 60)), "s" if len(experiments) > 1 else ""
    console.print(f"{len(experiments)} experiment{plural}, up to about {minutes} min")
    context = multiprocessing.get_context("spawn")
    with Progress(console=console) as progress, ProcessPoolExecutor(at_once, context) as pool:
        overall = progress.add_task("all", total=total)
        # What takes longest starts first, so that all end at about one time.
        queue = sorted(experiments, key=lambda experiment: -experiment.seconds)
        running = {
            pool.submit(_seconds, each.name, laboratory, output, force=force): each
            for each in queue
        }
        for future in as_completed(running):
            ended = running[future]
            progress.advance(overall, ended.seconds)
            console.print(f"{ended.name}: {future.result():.1f} s")
    page = output / PAGE
    before = page.read_text(encoding="utf-8") if page.is_file() else ""
    page.write_text(markdown_page(EXPERIMENTS, _records(output), before), encoding="utf-8")
    console.print(f"{escape(str(page))} written", soft_wrap=True)


def _line(experiment: Experiment) -> str:
    needs = ", needs --published DIR" if experiment.needs_published else ""
    minutes = max(1, round(experiment.seconds / 60))
    return f"{experiment.name:<22} {experiment.title} (about {minutes} min{needs})"


def _chosen(name: str | None, published: Path | None) -> list[Experiment]:
    able = [each for each in EXPERIMENTS.values() if published or not each.needs_published]
    if name is None:
        return able
    if name not in EXPERIMENTS:
        known = f"there are {', '.join(EXPERIMENTS)}; the theorems T1 to T8 are in structural"
        raise typer.BadParameter(f"no experiment {name!r}; {known}")
    if EXPERIMENTS[name] not in able:
        raise typer.BadParameter(f"{name} needs --published DIR")
    return [EXPERIMENTS[name]]


def _records(output: Path) -> dict[str, Record]:
    records = {name: read_record(output / "cache" / f"{name}.json") for name in EXPERIMENTS}
    return {name: record for name, record in records.items() if record is not None}


def _seconds(name: str, laboratory: Laboratory, output: Path, *, force: bool) -> float:
    """Run an experiment in this process; return how long it took."""
    began = time.perf_counter()
    reproduce(EXPERIMENTS[name], laboratory, output, force=force)
    return time.perf_counter() - began
