"""Render a mesh as a sheet: control, Loop, an untrained control and PNS, in several looks.

PYTHON addons/blender/render.py MESH… -o SHEET.png [--looks clay zebra] [--levels 3]

MESH is a file, or suzanne, cube, cylinder or cone. PYTHON has bpy and the project's library.
Several meshes make several rows of each look. The camera, the light and the scale of a row are
fixed, so its cells can be compared.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from addons.blender.pictures import files, sheet, stage
from addons.blender.pictures.looks import LOOKS
from addons.blender.pictures.variants import VARIANTS

SHEET = ["control", "loop", "n1", "pns"]


def main(arguments: list[str] | None = None) -> None:
    """Read, refine, set the stage, and render."""
    asked = parser().parse_args(arguments)
    stage.clear()
    rows = []
    for path in asked.meshes:
        mesh = files.read(path)
        for look in asked.looks:
            # The last level's edges are too many to be seen.
            levels = max(1, asked.levels - 1) if look == "wire" else asked.levels
            shapes = [VARIANTS[name](mesh, levels, asked.model) for name in asked.variants]
            rows.append(sheet.Row(look, shapes))
    width, height = sheet.build(rows, asked.turn)
    stage.picture(
        asked.output, round(asked.cell * width), round(asked.cell * height), asked.samples
    )


def parser() -> argparse.ArgumentParser:
    """Make the parser of the command's arguments."""
    made = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    made.add_argument("meshes", nargs="+", type=Path, metavar="MESH")
    made.add_argument("-o", "--output", type=Path, required=True)
    made.add_argument("--variants", nargs="+", choices=VARIANTS, default=SHEET)
    made.add_argument(
        "--looks", nargs="+", choices=[*LOOKS, *sheet.FIELDS], default=[*LOOKS, *sheet.FIELDS]
    )
    made.add_argument("--levels", type=int, default=3)
    made.add_argument("--model", help="a bundled model or a file; the default if left out")
    made.add_argument("--turn", type=float, default=0.0, help="degrees about the vertical axis")
    made.add_argument("--cell", type=int, default=320, help="pixels of a cell's width")
    made.add_argument("--samples", type=int, default=32)
    return made


if __name__ == "__main__":
    main()
