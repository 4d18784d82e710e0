"""The exporter's entry: `python export/run.py` writes a checkpoint as a model file beside it.

With `--install` it writes the bundled model of the recipe instead, which is tracked. With
`--published DIR` it writes a model file for each of the author's PNS networks. With `--measure
NAME` it measures a bundled model anew, which a change of the operator asks for.
"""

import sys
from pathlib import Path
from typing import Annotated

# Started as a file, Python looks for packages beside it and not in the checkout.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import typer
from rich.console import Console
from rich.markup import escape

from export.measure import measure_anew
from export.model_file import Exported, export_model
from export.published import export_published
from pns_common.errors import ParameterError, PnsError
from pns_common.model.file import write_manifest
from train.models.checkpoint import load_checkpoint
from train.models.recipe import Recipe
from train.models.recipes import RECIPES

MODELS = Path(__file__).resolve().parents[1] / "pns_common" / "models"
# The bundled file of a recipe with its own seed.
FILE_OF_RECIPE = {
    "paper": MODELS / "paper.onnx",
    "signed": MODELS / "signed.onnx",
    "general": MODELS / "general.onnx",
    "general-quad": MODELS / "general-quad.onnx",
}


def bundled_file(recipe: Recipe) -> Path | None:
    """Return where a recipe's bundled model lies; None for recipes and seeds without one."""
    bundled = recipe.name in FILE_OF_RECIPE and recipe == RECIPES[recipe.name](0)
    return FILE_OF_RECIPE[recipe.name] if bundled else None


PUBLISHED_MODELS = Path("build/checkpoints/published")

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def main(
    checkpoint: Annotated[Path, typer.Option(help="What `train/run.py` wrote.")] = Path(
        "build/checkpoints/paper.safetensors"
    ),
    published: Annotated[
        Path | None, typer.Option(help="The author's published data: export its networks.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            help="Model file to write; with --published the folder of the files. Default: beside "
            "the checkpoint."
        ),
    ] = None,
    install: Annotated[
        bool, typer.Option("--install", help="Replace the bundled model of the recipe.")
    ] = False,
    measure: Annotated[
        str | None, typer.Option(help="Bundled model whose card to write with new metrics.")
    ] = None,
) -> None:
    """Write model files, after checking that each says what its network says."""
    console = Console()
    written: dict[Path, Exported] = {}
    try:
        if measure is not None:
            measure_anew(MODELS / f"{measure}.onnx", lambda name: console.print(f"measured {name}"))
            write_manifest(MODELS)
        elif published is not None:
            written = export_published(published, output or PUBLISHED_MODELS)
        else:
            made = load_checkpoint(checkpoint)
            path = output or checkpoint.with_suffix(".onnx")
            if install:
                path = _installed(made.recipe, output)
            if path.is_dir():
                raise ParameterError("output", str(path), expected="a file, not a folder")
            written = {path: export_model(made, path)}
            if path.parent == MODELS:
                write_manifest(MODELS)
    except PnsError as error:
        console.print(escape(str(error)), style="red", soft_wrap=True)
        raise typer.Exit(1) from error
    for path, exported in written.items():
        console.print(f"parity with torch: {exported.parity.difference:.1e} of the budget")
        console.print(f"{escape(str(path))} written, sha256 {exported.sha256}", soft_wrap=True)


def _installed(recipe: Recipe, output: Path | None) -> Path:
    """Return the bundled file to replace.

    Raises:
        ParameterError: an output is named too, or no bundled file is made by this recipe and seed.
    """
    bundled = bundled_file(recipe)
    if output is not None or bundled is None:
        expected = "no --output, and a recipe with its own seed that has a bundled model"
        raise ParameterError("install", recipe.name, expected=expected)
    return bundled


if __name__ == "__main__":
    app()
