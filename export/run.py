"""The exporter's entry: `python export/run.py` makes the bundled model from its checkpoint.

With `--published DIR` it makes one model file of each of the author's PNS networks instead.
"""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from export.model_file import Exported, export_model
from export.published import export_published
from pns_common.errors import PnsError
from train.checkpoint import load_checkpoint

BUNDLED = Path(__file__).resolve().parents[1] / "pns_common" / "models" / "paper.onnx"

PUBLISHED_MODELS = Path("checkpoints/published")

app = typer.Typer(help="Turn a checkpoint into a model file.", pretty_exceptions_enable=False)


@app.command()
def main(
    checkpoint: Annotated[Path, typer.Option(help="What `train/run.py` wrote.")] = Path(
        "checkpoints/ridge.safetensors"
    ),
    published: Annotated[
        Path | None, typer.Option(help="The author's published data: export its networks.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(help="Model file to write, or with --published the folder of the files."),
    ] = None,
) -> None:
    """Write model files, after checking that each says what its network says."""
    console = Console()
    written: dict[Path, Exported] = {}
    try:
        if published is not None:
            written = export_published(published, output or PUBLISHED_MODELS)
        else:
            path = output or BUNDLED
            written = {path: export_model(load_checkpoint(checkpoint), path)}
    except PnsError as error:
        console.print(str(error), style="red", soft_wrap=True)
        raise typer.Exit(1) from error
    for path, exported in written.items():
        console.print(f"parity with torch: {exported.parity.difference:.1e} of the budget")
        console.print(f"{path} written, sha256 {exported.sha256}", soft_wrap=True)


if __name__ == "__main__":
    app()
