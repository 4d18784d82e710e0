"""All pictures of the documentation that Blender renders, by one command.

python -m addons.blender.gallery PYTHON PART     # `make blender-pictures`: docs/blender-*.png

PYTHON has bpy and the project's library; PART is the example part (`pns example`).
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MESHES = Path(__file__).with_name("meshes")
RENDER = Path(__file__).with_name("render.py")
PART = "part"
# What Blender's Python lacks of the library's needs.
SITE = ROOT / "build" / "blender-site"


@dataclass(frozen=True)
class Picture:
    """A picture's name, what is on it, and the arguments of ``render.py``."""

    name: str
    meshes: tuple[str, ...]
    looks: tuple[str, ...]
    turn: float
    more: tuple[str, ...] = field(default=())


PICTURES = (
    Picture("blender-hero.png", ("spot.obj",), ("clay", "zebra"), 150),
    Picture(
        "blender-sheet.png", ("fish.obj",), ("clay", "zebra", "wire", "distance", "ratio"), 125
    ),
    Picture(
        "blender-subsurf.png",
        ("suzanne", "cube", "cylinder", "cone", "spot.obj"),
        ("clay",),
        30,
        (
            "--variants",
            "control",
            "subsurf",
            "pns",
            "--levels",
            "2",
            "--cell",
            "240",
            "--samples",
            "16",
        ),
    ),
    Picture("blender-part.png", (PART,), ("clay", "zebra", "distance"), -20),
)


def main(python: str, part: str) -> None:
    """Render them one after another."""
    for picture in PICTURES:
        meshes = [name if "." not in name else str(MESHES / name) for name in picture.meshes]
        meshes = [part if name == PART else name for name in meshes]
        output = ROOT / "docs" / picture.name
        arguments = ["--looks", *picture.looks, "--turn", str(picture.turn), *picture.more]
        command = [python, str(RENDER), *meshes, "-o", str(output), *arguments]
        environment = os.environ | {"PYTHONPATH": str(SITE)}
        subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL)
        print(output)


if __name__ == "__main__":
    main(*sys.argv[1:])
