"""The exporter's entry: `python export/run.py` makes the bundled model from its checkpoint."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from export.model_file import export_model
from pns_common.errors import PnsError
from train.checkpoint import load_checkpoint

BUNDLED = Path(__file__).resolve().parents[1] / "pns_common" / "models" / "paper.onnx"

app = typer.Typer(help="Turn a checkpoint into a model file.", pretty_exceptions_enable=False)


@app.command()
def main(
    checkpoint: Annotated[Path, typer.Option(help="What `train/run.py` wrote.")] = Path(
        "checkpoints/ridge.safetensors"
    ),
    output: Annotated[Path, typer.Option(help="Model file to write.")] = BUNDLED,
) -> None:
    """Write the model file, after checking that it says what the network says."""
    console = Console()
    try:
        exported = export_model(load_checkpoint(checkpoint), output)
    except PnsError as error:
        console.print(str(error), style="red", soft_wrap=True)
        raise typer.Exit(1) from error
    console.print(f"parity with torch: {exported.parity.difference:.1e} of the budget")
    console.print(f"{output} written, sha256 {exported.sha256}", soft_wrap=True)


if __name__ == "__main__":
    app()
