"""`python train/run.py train`: a checkpoint, and the held-out table."""

import time
from collections.abc import Generator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from pns_common import PnsError, pns
from train.fitting.determinism import machine_fingerprint
from train.fitting.trainer import Fit, fit
from train.metrics.card import card_metrics
from train.metrics.one_step import improvement_table, improvements_as_data
from train.models.checkpoint import Checkpoint, save_checkpoint
from train.models.recipe import Recipe, of_length
from train.models.recipes import RECIPES
from train.models.torch_model import recipe_model
from train.output_file import prepare_output

CHECKPOINTS = Path("build/checkpoints")

Output = Annotated[
    Path | None,
    typer.Option(
        dir_okay=False,
        help="Checkpoint to write; build/checkpoints/RECIPE.safetensors if not given.",
    ),
]

if TYPE_CHECKING:
    RecipeName = str
else:  # A type checker cannot see the members that a table gives.
    RecipeName = StrEnum("RecipeName", {name: name for name in RECIPES})
DEFAULT_RECIPE = RecipeName("paper")


def train_command(
    recipe: Annotated[RecipeName, typer.Option(help="What to train.")] = DEFAULT_RECIPE,
    seed: Annotated[int, typer.Option(min=0, help="Of the weights and batches.")] = 0,
    steps: Annotated[int | None, typer.Option(min=1, help="In place of the recipe's.")] = None,
    output: Output = None,
    shapes: Annotated[
        Path, typer.Option(help="Folder that `train/run.py shapes` made; some recipes read it.")
    ] = Path("build/shapes"),
    pairs: Annotated[Path, typer.Option(help="Where pairs made of these shapes are kept.")] = Path(
        "build/pairs"
    ),
) -> None:
    """Train a recipe, write its checkpoint and print the held-out table."""
    console = Console()
    chosen = RECIPES[recipe](seed)
    chosen = chosen if steps is None else of_length(chosen, steps)
    path = output or CHECKPOINTS / f"{chosen.name}.safetensors"
    with _errors_told(console):
        prepare_output(path)
    began = time.perf_counter()
    with _progress(console) as progress:
        task = progress.add_task(f"training {chosen.name}", total=chosen.steps, loss=float("nan"))
        with _errors_told(console):
            trained = fit(
                chosen,
                lambda done, loss: progress.update(task, completed=done, loss=loss),
                (shapes, pairs),
            )
    _measure_and_save(path, chosen, trained, console)
    _say_written(path, began, console)


@contextmanager
def _errors_told(console: Console) -> Generator[None, None, None]:
    """End the command in a line that says what was wrong."""
    try:
        yield
    except PnsError as error:
        console.print(escape(str(error)), style="red", soft_wrap=True)
        raise typer.Exit(1) from error


def _measure_and_save(path: Path, recipe: Recipe, trained: Fit, console: Console) -> None:
    network = trained.network
    scheme = pns(recipe_model(recipe, network), recipe.budget)
    improvements = card_metrics(recipe, scheme)
    metrics = {name: improvements_as_data(rows) for name, rows in improvements.items()}
    machine = machine_fingerprint()
    save_checkpoint(path, Checkpoint(recipe, network, metrics, machine))
    for name, rows in improvements.items():
        console.print(improvement_table(f"{name}, recipe {recipe.name}", rows))


def _say_written(path: Path, began: float, console: Console) -> None:
    seconds = time.perf_counter() - began
    console.print(f"{escape(str(path))} written in {seconds:.1f} s", soft_wrap=True)


def _progress(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("loss {task.fields[loss]:.6f}"),
        TimeRemainingColumn(),
        console=console,
    )
