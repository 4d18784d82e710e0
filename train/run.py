"""The laboratory's entry: `python train/run.py` trains the default recipe.

It writes a checkpoint and prints the held-out table.
"""

import time
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from pns_common.schemes import pns
from train.certificates.command import certify_command
from train.experiments.command import reproduce_command
from train.fitting.determinism import machine_fingerprint
from train.fitting.trainer import Fit, fit
from train.metrics.card import card_metrics
from train.metrics.one_step import improvements_as_data
from train.metrics.tables import improvement_table
from train.models.checkpoint import Checkpoint, save_checkpoint
from train.models.recipes import RECIPES, Recipe
from train.models.torch_model import recipe_model

CHECKPOINTS = Path("checkpoints")

if TYPE_CHECKING:
    RecipeName = str
else:  # A type checker cannot see the members that a table gives.
    RecipeName = StrEnum("RecipeName", {name: name for name in RECIPES})
DEFAULT_RECIPE = RecipeName("paper")

app = typer.Typer(help="Train, measure and certify the operator.", pretty_exceptions_enable=False)
app.command("reproduce")(reproduce_command)
app.command("certify")(certify_command)


@app.callback(invoke_without_command=True)
def main(context: typer.Context) -> None:
    """Train the default recipe where no command is named."""
    if context.invoked_subcommand is None:
        train()


@app.command()
def train(
    recipe: Annotated[RecipeName, typer.Option(help="What to train.")] = DEFAULT_RECIPE,
    seed: Annotated[int, typer.Option(min=0, help="Of the weights and batches.")] = 0,
    output: Annotated[
        Path | None,
        typer.Option(help="Checkpoint to write; checkpoints/RECIPE.safetensors if not given."),
    ] = None,
) -> None:
    """Train a recipe, write its checkpoint and print the held-out table."""
    console = Console()
    chosen = RECIPES[recipe](seed)
    path = output or CHECKPOINTS / f"{chosen.name}.safetensors"
    began = time.perf_counter()
    trained = _fit_with_progress(chosen, console)
    scheme = pns(recipe_model(chosen, trained.network, trained.vertex_network), chosen.budget)
    improvements = card_metrics(chosen, scheme)
    metrics = {name: improvements_as_data(rows) for name, rows in improvements.items()}
    made = Checkpoint(
        chosen, trained.network, metrics, machine_fingerprint(), trained.vertex_network
    )
    save_checkpoint(path, made)
    for name, rows in improvements.items():
        console.print(improvement_table(f"{name}, recipe {chosen.name}", rows))
    console.print(f"{path} written in {time.perf_counter() - began:.1f} s", soft_wrap=True)


def _fit_with_progress(recipe: Recipe, console: Console) -> Fit:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("loss {task.fields[loss]:.6f}"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as progress:
        task = progress.add_task(f"training {recipe.name}", total=recipe.steps, loss=float("nan"))
        return fit(recipe, lambda done, loss: progress.update(task, completed=done, loss=loss))


if __name__ == "__main__":
    app()
