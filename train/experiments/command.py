"""`python train/run.py reproduce`: progress with an estimate, and the page at the end."""

import os
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

from pns_common import PnsError
from train.experiments.at_once import run_each
from train.experiments.harness.experiment import Experiment
from train.experiments.harness.laboratory import FULL, Laboratory, silent
from train.experiments.harness.page import markdown_page
from train.experiments.harness.reproduce import Record, read_record
from train.experiments.registry import EXPERIMENTS
from train.output_file import prepare_output

PAGE = "README.md"
# Of the repository, where this is run.
INSTALLED = Path("results")


def reproduce_command(
    name: Annotated[str | None, typer.Argument(help="One experiment; all if not given.")] = None,
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
        progress.print(f"{len(experiments)} experiments, up to about {minutes} min")
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


def _chosen(name: str | None, published: Path | None, assets: Path | None) -> list[Experiment]:
    def lacks(experiment: Experiment) -> str | None:
        if experiment.needs_published and published is None:
            return "--published DIR"
        return "--assets DIR" if experiment.needs_assets and assets is None else None

    if name is None:
        return [experiment for experiment in EXPERIMENTS.values() if lacks(experiment) is None]
    if name not in EXPERIMENTS:
        raise typer.BadParameter(f"no experiment {name!r}; there are {', '.join(EXPERIMENTS)}")
    missing = lacks(EXPERIMENTS[name])
    if missing is not None:
        raise typer.BadParameter(f"{name} needs {missing}")
    return [EXPERIMENTS[name]]


def _records(output: Path) -> dict[str, Record]:
    records = {name: read_record(output / "cache" / f"{name}.json") for name in EXPERIMENTS}
    return {name: record for name, record in records.items() if record is not None}
