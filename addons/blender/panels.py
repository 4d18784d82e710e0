"""Render finished meshes in rows and columns, coloured by a field on one scale.

PYTHON addons/blender/panels.py FOLDER -o PICTURE.png --field NAME --highest VALUE --label WORDS

FOLDER holds ROW-COLUMN.npz, each with `vertices`, `faces` and `title`, and where it is coloured
with the field and a `note`; the legend stands in a place that no mesh takes. `python -m
train.experiments.paper.hero_panels` writes the paper's first figure so. PYTHON has bpy and the
project's library.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from addons.blender.pictures import sheet, stage
from addons.blender.pictures.looks import clay, heat
from addons.blender.pictures.variants import Shape

# Of a cell's width: a row of text over the columns, and one under each mesh.
TITLE, NOTE, MARGIN = 0.11, 0.12, 0.06


def main(arguments: list[str] | None = None) -> None:
    """Read the panels, set the stage, and render."""
    asked = parser().parse_args(arguments)
    stage.clear()
    panels = read(asked.folder, asked.field)
    sides = build(panels, asked.turn, asked.field, asked.highest, asked.label)
    stage.picture(asked.output, *(round(asked.cell * side) for side in sides), asked.samples)


Panels = dict[tuple[int, int], tuple[Shape, str]]


def read(folder: Path, field: str) -> Panels:
    """Read the shape and the note of each row and column.

    Raises:
        SystemExit: there is no panel in the folder.
    """
    panels: Panels = {}
    for path in sorted(folder.glob("*-*.npz")):
        row, column = map(int, path.stem.split("-"))
        with np.load(path) as arrays:
            fields = {field: arrays[field]} if field in arrays else {}
            note = str(arrays["note"]) if "note" in arrays else ""
            title, smooth = str(arrays["title"]), bool(fields)
            shape = Shape(title, arrays["vertices"], arrays["faces"], smooth, fields)
            panels[row, column] = shape, note
    if not panels:
        raise SystemExit(f"{folder}: no ROW-COLUMN.npz in it")
    return panels


def build(
    panels: Panels, turn: float, field: str, highest: float, label: str
) -> tuple[float, float]:
    """Put everything on stage; the picture's width and height in cells' widths."""
    rows, columns = (max(place[axis] for place in panels) for axis in (0, 1))
    shapes = [shape for shape, _ in panels.values()]
    wide, high = sheet.extent(shapes, turn)
    scale = (1 - 2 * MARGIN) / wide
    height = high / wide + NOTE
    total = rows * height + TITLE
    left, top = -columns / 2, total / 2
    colours, plain = heat(field, highest), clay()
    for (row, column), (shape, note) in panels.items():
        across = left + column - 0.5
        along = top - TITLE - (row - 1) * height
        if row == 1:
            sheet.text(shape.title, across, top - 0.6 * TITLE, 0.07)
        sheet.text(note, across, along - height + 0.6 * NOTE, 0.055)
        material = colours if shape.fields else plain
        sheet.place(shape, material, stage.at(across, along - (height - NOTE) / 2), scale, turn)
    places = ((r, c) for c in range(1, columns + 1) for r in range(1, rows + 1))
    free = next((place for place in places if place not in panels), (1, 1))
    sheet.legend(label, highest, left + free[1] - 0.5, top - TITLE - (free[0] - 0.5) * height)
    stage.camera(columns, total)
    stage.light()
    return columns, total


def parser() -> argparse.ArgumentParser:
    """Make the parser of the command's arguments."""
    made = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    made.add_argument("folder", type=Path)
    made.add_argument("-o", "--output", type=Path, required=True)
    made.add_argument("--field", required=True, help="what the meshes are coloured by")
    made.add_argument("--highest", type=float, required=True, help="the upper end of the colours")
    made.add_argument("--label", required=True, help="what the legend says")
    made.add_argument("--turn", type=float, default=0.0, help="degrees about the vertical axis")
    made.add_argument("--cell", type=int, default=320, help="pixels of a cell's width")
    made.add_argument("--samples", type=int, default=32)
    return made


if __name__ == "__main__":
    main()
