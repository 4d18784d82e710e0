"""The hero figure's panels as files, for whatever renders them.

python -m train.experiments.paper.hero_panels FOLDER [--checkpoints DIR]
"""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from pns_common.files import replacing
from train.experiments.harness.laboratory import FULL, Laboratory
from train.experiments.harness.style import TITLES
from train.experiments.paper.hero import Panel, panels_of
from train.experiments.paper.methods import hard_instance


def main(
    folder: Annotated[Path, typer.Argument(help="Folder to write: ROW-COLUMN.npz for each panel.")],
    checkpoints: Annotated[
        Path | None, typer.Option(help="Networks to take by recipe name instead of training.")
    ] = None,
    networks: Annotated[
        Path, typer.Option(help="Folder where trained networks are kept between runs.")
    ] = Path("results/cache/networks"),
) -> None:
    """Train what is not there yet, refine, and write the control mesh and six panels."""
    write_panels(Laboratory(FULL, networks, checkpoints, None), folder)


def write_panels(laboratory: Laboratory, folder: Path) -> None:
    """Write the control mesh at 1-1, and a column for each method: one step, and all steps."""
    folder.mkdir(parents=True, exist_ok=True)
    control = hard_instance().mesh
    save(folder / "1-1.npz", vertices=control.vertices, faces=control.faces, title="Control mesh")
    columns: dict[str, int] = {}
    for panel in panels_of(laboratory):
        column = columns.setdefault(panel.name, 2 + len(columns))
        row = 1 if panel.level == 1 else 2
        save(folder / f"{row}-{column}.npz", **arrays_of(panel))


def arrays_of(panel: Panel) -> dict[str, np.ndarray | str]:
    """Return a panel's mesh, its distance, its title, and what its box says."""
    steps = "one step" if panel.level == 1 else f"{panel.level} steps"
    ratio, jump = panel.errors.figures.ratio, panel.errors.figures.normal_jump
    largest = f"{ratio:,.0f}" if ratio >= 100 else f"{ratio:.2f}"
    return {
        "vertices": panel.mesh.vertices,
        "faces": panel.mesh.faces,
        "distance": panel.distance,
        "title": TITLES[panel.name],
        "note": f"{steps}: ratio {largest}, jump {jump:.2f}",
    }


def save(path: Path, **panel: Any) -> None:
    """Write a panel's arrays and words, whole or not at all."""
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **panel)


if __name__ == "__main__":
    typer.run(main)
