"""OBJ, PLY, STL and OFF: triangles in and out, with what each format can hold."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float, Int

from service.errors import UnreadableError

GLTF_KINDS = ("glb", "gltf")
MESH_KINDS = ("obj", "ply", "stl", "off")
HOLDS_UV = frozenset({"obj", *GLTF_KINDS})

_OBJ_FACE = re.compile(rb"^[ \t]*f[ \t]", re.MULTILINE)
_OFF_COUNTS = re.compile(rb"^(?:[A-Z]*OFF)?\s*\d+[ \t]+(\d+)", re.MULTILINE)
# Twelve digits keep micrometres in coordinates of kilometres.
_NUMBER = "%.12g"


@dataclass(frozen=True, eq=False)
class TriangleSoup:
    """Triangles as a file has them: seams are open, vertices repeat.

    Attributes:
        vertices: (N, 3) positions.
        faces: (F, 3) rows of `vertices`.
        uv: (N, 2) texture coordinates, v upwards; None where there are none.
        split: triangles more than the file had faces, made by splitting its polygons.
    """

    vertices: Float[np.ndarray, "N 3"]
    faces: Int[np.ndarray, "F 3"]
    uv: Float[np.ndarray, "N 2"] | None = None
    split: int = 0


def read(data: bytes, kind: str) -> TriangleSoup:
    """Read a mesh file; its polygons are split into fans.

    Raises:
        UnreadableError: not a file of this kind, or one without faces.
    """
    try:
        # Each part comes apart by material; as they are listed, they make the file's triangles.
        scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False)
    except (ValueError, IndexError, KeyError, TypeError, UnicodeDecodeError) as error:
        raise UnreadableError(f"this is not a readable {kind.upper()} file: {error}") from error
    parts = [part for part in scene.geometry.values() if isinstance(part, trimesh.Trimesh)]
    if not parts:
        raise UnreadableError(f"the {kind.upper()} file has no faces")
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = np.concatenate(
        [np.asarray(part.faces) + start for part, start in zip(parts, starts, strict=False)]
    )
    return TriangleSoup(
        vertices=np.concatenate([np.asarray(part.vertices, dtype=np.float64) for part in parts]),
        faces=faces.astype(np.int64),
        uv=_uv(parts),
        split=max(0, len(faces) - _faces_in_file(data, kind, parts, len(faces))),
    )


def write(soup: TriangleSoup, kind: str) -> bytes:
    """The file's bytes: PLY and STL binary, OBJ and OFF text."""
    if kind == "obj":
        return _obj(soup)
    if kind == "off":
        return _off(soup)
    mesh = trimesh.Trimesh(soup.vertices, soup.faces, process=False, validate=False)
    return bytes(mesh.export(file_type=kind))


def _uv(parts: list[trimesh.Trimesh]) -> Float[np.ndarray, "N 2"] | None:
    """Texture coordinates of all parts, if all have them: half of a seam cannot be interpolated."""
    found = [getattr(part.visual, "uv", None) for part in parts]
    if any(uv is None or len(uv) != len(p.vertices) for uv, p in zip(found, parts, strict=True)):
        return None
    return np.concatenate(found)[:, :2].astype(np.float64)


def _faces_in_file(data: bytes, kind: str, parts: list[trimesh.Trimesh], triangles: int) -> int:
    match kind:
        case "obj":
            return len(_OBJ_FACE.findall(data))
        case "ply":
            return int(parts[0].metadata["_ply_raw"]["face"]["length"])
        case "off":
            counts = _OFF_COUNTS.search(data)
            return int(counts[1]) if counts else triangles
        case _:
            return triangles


def _obj(soup: TriangleSoup) -> bytes:
    text = io.StringIO()
    np.savetxt(text, soup.vertices, fmt=f"v {_NUMBER} {_NUMBER} {_NUMBER}")
    corner = soup.faces + 1
    if soup.uv is None:
        np.savetxt(text, corner, fmt="f %d %d %d")
    else:
        np.savetxt(text, soup.uv, fmt=f"vt {_NUMBER} {_NUMBER}")
        np.savetxt(text, np.repeat(corner, 2, axis=1), fmt="f %d/%d %d/%d %d/%d")
    return text.getvalue().encode()


def _off(soup: TriangleSoup) -> bytes:
    text = io.StringIO()
    text.write(f"OFF\n{len(soup.vertices)} {len(soup.faces)} 0\n")
    np.savetxt(text, soup.vertices, fmt=f"{_NUMBER} {_NUMBER} {_NUMBER}")
    np.savetxt(text, soup.faces, fmt="3 %d %d %d")
    return text.getvalue().encode()
