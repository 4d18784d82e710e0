"""A tileset of GLBs, one a part, whose borders meet in bits: 3D Tiles 1.1.

Positions are rounded to float32 once, relative to one point for all parts, so that a vertex that
several parts have is the same in each. A glTF's y points up and a tileset's z: tiles turn (x, y, z)
into (x, −z, y), and so are boxes and the transform written.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pns_common.base.extent import extent
from pns_common.base.whole_file import replace_file
from pns_common.pieces import RefinedPiece

from ...errors import UnrefinableError
from ...meshfiles.mesh_file import of_triangles
from ...meshfiles.parts import LARGEST
from ...meshfiles.triangles_glb import triangles_glb
from .arrays import sync
from .cutout import Cutout
from .survey import Survey

TILESET = "tileset.json"


@dataclass(frozen=True)
class Tiles:
    """A folder to write tiles into, and the point that they are relative to."""

    folder: str
    centre: tuple[float, float, float]


def new_tiles(folder: Path, about: Survey) -> Tiles:
    """Create the folder of a tileset without tiles."""
    folder.mkdir(exist_ok=True)
    x, y, z = (low / 2 + high / 2 for low, high in zip(about.low, about.high, strict=True))
    return Tiles(str(folder), (x, y, z))


def tile_name(part: int) -> str:
    """Return the file of a part."""
    return f"part-{part:05}.glb"


def write_tile(tiles: Tiles, part: int, cut: Cutout, made: RefinedPiece, levels: int) -> Any:
    """Write a part's own faces; return the corners of the box around them, as float32.

    Raises:
        UnrefinableError: a position leaves the range of float32.
    """
    faces = made.faces.reshape(-1, 4**levels, 3)[cut.piece.own].reshape(-1, 3)
    used, local = np.unique(faces, return_inverse=True)
    points = made.points[used] - np.array(tiles.centre)
    if np.abs(points).max() > LARGEST:
        raise UnrefinableError("positions leave the range of float32")
    points = points.astype(np.float32)
    glb = triangles_glb(of_triangles(points, local.reshape(-1, 3)))
    file = Path(tiles.folder) / tile_name(part)
    replace_file(file, glb)
    sync(file)
    return [bound.tolist() for bound in extent(points)]


def write_tileset(tiles: Tiles, boxes: list[Any], report: dict[str, Any]) -> None:
    """Write the tileset of all parts, by their boxes."""
    corners = np.array(boxes, dtype=np.float64)
    low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
    x, y, z = tiles.centre
    children = [
        {
            "boundingVolume": {"box": _box(*box)},
            "geometricError": 0,
            "content": {"uri": tile_name(part)},
        }
        for part, box in enumerate(corners)
    ]
    error = float(np.linalg.norm(high - low))
    tree = {
        "asset": {"version": "1.1", "extras": {"pns": report}},
        "geometricError": error,
        "root": {
            "boundingVolume": {"box": _box(low, high)},
            "geometricError": error,
            "refine": "ADD",
            "transform": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, -z, y, 1],
            "children": children,
        },
    }
    replace_file(Path(tiles.folder) / TILESET, json.dumps(tree).encode())


def _box(low: np.ndarray, high: np.ndarray) -> list[float]:
    """Return a box as a tileset has it: its centre, then its three half axes, with z up."""
    x, y, z = ((low + high) / 2).tolist()
    half = (high - low) / 2
    dx, dy, dz = half.tolist()
    return [x, -z, y, dx, 0, 0, 0, dz, 0, 0, 0, dy]
