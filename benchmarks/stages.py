"""`python -m benchmarks.stages`: seconds and peak memory of glTF files by stage.

python -m benchmarks.stages                         # generated meshes, 20k to 320k faces
python -m benchmarks.stages --assets FOLDER         # also every glTF file in a folder
python -m benchmarks.stages --model paper           # another model than the default
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from benchmarks.files import SHADINGS, STAGES, MeasuredFile, measure_file, measure_generated
from pns_common.model.file import DEFAULT_MODEL

# In a file or a pipe tables are not squeezed.
FILE_WIDTH = 150
# A file's output is held as bytes too: these are input faces.
FILE_SIZES = (20_000, 60_000, 320_000)


def main(
    assets: Annotated[Path | None, typer.Option(help="folder of .glb and .gltf files")] = None,
    levels: Annotated[int, typer.Option(help="levels for files")] = 1,
    largest: Annotated[int, typer.Option(help="leave out generated meshes above this")] = 320_000,
    model: Annotated[
        str, typer.Option(metavar="NAME|FILE", help="bundled model, or model file")
    ] = DEFAULT_MODEL,
) -> None:
    """Measure the whole path of a file, each case in a process of its own."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=FILE_WIDTH)
    console.print(f"model: {model}")
    named = {
        f"torus, {size:,} faces{shading and ', '}{shading}": measure_generated(
            size, levels, model, shading=shading
        )
        for size in FILE_SIZES
        if size <= largest
        for shading in SHADINGS
    }
    for path in sorted(assets.glob("*.gl*")) if assets else []:
        named[path.name] = measure_file(path, levels, model)
    console.print(file_table(named, levels))
    for name, file in named.items():
        if file.refused is not None:
            console.print(f"{name} was refused: {file.refused}")


def file_table(measured: dict[str, MeasuredFile], levels: int) -> Table:
    """Measure files by stage: milliseconds, MiB, and what all but refining costs beside it."""
    table = Table(title=f"Files, levels = {levels}: milliseconds, and peak MiB, by stage")
    table.add_column("file", no_wrap=True)
    table.add_column("faces out", justify="right")
    for stage in STAGES:
        table.add_column(f"{stage} ms", justify="right")
        table.add_column("MiB", justify="right")
    table.add_column("others / refine", justify="right")
    for name, file in measured.items():
        if file.refused is not None:
            continue
        cells = [
            cell
            for stage in STAGES
            for cell in (
                f"{1000 * file.seconds.get(stage, 0):.0f}",
                f"{file.mib.get(stage, 0):.0f}",
            )
        ]
        total, refining = sum(file.seconds.values()), file.seconds.get("refine", 0.0)
        ratio = f"{(total - refining) / refining:.2f}" if refining else "–"
        table.add_row(name, f"{file.faces:,}", *cells, ratio)
    return table


if __name__ == "__main__":
    typer.run(main)
