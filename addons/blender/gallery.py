"""All pictures of the documentation that Blender renders, by one command.

python -m addons.blender.gallery PYTHON PART     # `make blender-pictures`: docs/blender-*.png

PYTHON has bpy and the project's library; PART is the example part (`pns example`).
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDER = Path(__file__).parent
# The arguments of ``render.py`` for each docs/blender-NAME.png; `part` is the example part.
PICTURES = {
    "hero": "meshes/spot.obj --looks clay zebra --turn 150",
    "sheet": "meshes/fish.obj --looks clay zebra wire distance ratio --turn 125",
    "subsurf": "suzanne cube cylinder cone meshes/spot.obj --looks clay --turn 30 "
    "--variants control subsurf pns --levels 2 --cell 240 --samples 16",
    "part": "part --looks clay zebra distance --turn -20",
}


def main(python: str, part: str) -> None:
    """Render them one after another."""
    part = str(Path(part).resolve())
    # What Blender's Python lacks of the library's needs.
    environment = os.environ | {"PYTHONPATH": str(ROOT / "build" / "blender-site")}
    for name, arguments in PICTURES.items():
        output = ROOT / "docs" / f"blender-{name}.png"
        words = [part if word == "part" else word for word in arguments.split()]
        command = [str(Path(python).absolute()), "render.py", *words, "-o", str(output)]
        subprocess.run(command, check=True, env=environment, cwd=FOLDER, stdout=subprocess.DEVNULL)
        print(output)


if __name__ == "__main__":
    main(*sys.argv[1:])
