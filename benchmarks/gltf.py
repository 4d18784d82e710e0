"""`python -m benchmarks.gltf FOLDER`: each glTF of a folder by stage, at level 2.

The promise: for files over 5,000 faces, reading, welding and writing together cost no more than the
refinement itself. Making the attributes of refined vertices is named apart.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from benchmarks.files import MeasuredFile, measure_file
from benchmarks.stages import file_table
from pns_common.model.file import DEFAULT_MODEL

LARGE = 5000
BESIDE = ("read", "weld", "write")


def main(
    folder: Annotated[Path, typer.Argument(help="folder of .glb and .gltf files")],
    levels: Annotated[int, typer.Option(help="depth")] = 2,
    model: Annotated[
        str, typer.Option(metavar="NAME|FILE", help="bundled model, or model file")
    ] = DEFAULT_MODEL,
) -> None:
    """Measure every file, each in a process of its own; name the large ones and their ratio."""
    paths = [p for p in sorted(folder.rglob("*")) if p.suffix in (".glb", ".gltf")]
    measured = {path.name: measure_file(path, levels, model) for path in paths}
    console = Console()
    # A file has no width of its own.
    console = console if console.is_terminal else Console(width=160)
    console.print(f"model: {model}")
    console.print(file_table(measured, levels))
    for name, file in measured.items():
        if file.faces // 4**levels > LARGE:
            beside, made = _share(file, BESIDE), _share(file, ("attributes",))
            word = "within" if beside <= 1 else "above"
            text = f"{name}: read, weld and write take {beside:.2f} of refining ({word} 1)"
            console.print(f"{text}, attributes {made:.2f}")


def _share(file: MeasuredFile, stages: tuple[str, ...]) -> float:
    """Return the seconds of stages over those of the refinement."""
    return sum(file.seconds.get(stage, 0.0) for stage in stages) / file.seconds["refine"]


if __name__ == "__main__":
    typer.run(main)
