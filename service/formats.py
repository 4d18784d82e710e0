"""OBJ, PLY, STL and OFF: triangles in and out, with what each format can hold."""

from __future__ import annotations

import io
import re
import warnings

import numpy as np
import trimesh
from jaxtyping import Float

from service import left_out
from service.errors import UnreadableError
from service.off import read_off, write_off
from service.soup import NUMBER, TriangleSoup

GLTF_KINDS = ("glb", "gltf")
MESH_KINDS = ("obj", "ply", "stl", "off")
HOLDS_DOUBLE = frozenset({"obj", "off"})
HOLDS_UV = frozenset({"obj", *GLTF_KINDS})

_OBJ_UV = re.compile(rb"^[ \t]*vt[ \t]", re.MULTILINE)
_OBJ_FACE = re.compile(rb"^[ \t]*f[ \t]", re.MULTILINE)


def read(data: bytes, kind: str) -> TriangleSoup:
    """Read a mesh file; its polygons are split into fans.

    Raises:
        UnreadableError: not a file of this kind, or one without faces.
    """
    if kind == "off":
        return read_off(data)
    scene = _scene(data, kind)
    parts = [part for part in scene.geometry.values() if isinstance(part, trimesh.Trimesh)]
    if not parts:
        raise UnreadableError(f"the {kind.upper()} file has no faces")
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = np.concatenate(
        [np.asarray(part.faces) + start for part, start in zip(parts, starts, strict=False)]
    )
    uv = _uv(parts)
    count, others = _beside_triangles(data, kind, parts, has_uv=uv is not None)
    return TriangleSoup(
        vertices=np.concatenate([np.asarray(part.vertices, dtype=np.float64) for part in parts]),
        faces=faces.astype(np.int64),
        uv=uv,
        unused=left_out.unused_in_obj(data) if kind == "obj" else 0,
        split=0 if count is None else max(0, len(faces) - count),
        left_out=others,
    )


def write(soup: TriangleSoup, kind: str) -> bytes:
    """The file's bytes: PLY and STL binary, OBJ and OFF text."""
    if kind == "obj":
        return _obj(soup)
    if kind == "off":
        return write_off(soup)
    mesh = trimesh.Trimesh(soup.vertices, soup.faces, process=False, validate=False)
    return bytes(mesh.export(file_type=kind))


def _scene(data: bytes, kind: str) -> trimesh.Scene:
    """What trimesh makes of the file."""
    text = _as_utf8(data) if kind == "obj" or (kind == "stl" and not _is_binary_stl(data)) else data
    try:
        with warnings.catch_warnings():
            # Where a number cannot be read, numpy warns and leaves out all that follows.
            warnings.simplefilter("error")
            # Each part comes apart by material; as they are listed, they make the file's triangles.
            return trimesh.load_scene(io.BytesIO(text), file_type=kind, process=False)
    except MemoryError:
        raise
    except Exception as error:
        # On a broken file these readers fail as it comes, with an UnboundLocalError for one.
        raise UnreadableError(f"this is not a readable {kind.upper()} file") from error


def _as_utf8(data: bytes) -> bytes:
    """The same text; names in old files are Latin-1, and geometry is ASCII in either."""
    try:
        data.decode()
    except UnicodeDecodeError:
        return data.decode("latin-1").encode()
    return data


def _is_binary_stl(data: bytes) -> bool:
    """Whether the count of faces agrees with the length: text may begin in any way."""
    return len(data) >= 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little")


def _uv(parts: list[trimesh.Trimesh]) -> Float[np.ndarray, "N 2"] | None:
    """Texture coordinates of all parts, if all have them: half of a seam cannot be interpolated."""
    found = [getattr(part.visual, "uv", None) for part in parts]
    if any(uv is None or len(uv) != len(p.vertices) for uv, p in zip(found, parts, strict=True)):
        return None
    return np.concatenate(found)[:, :2].astype(np.float64)


def _beside_triangles(
    data: bytes, kind: str, parts: list[trimesh.Trimesh], *, has_uv: bool
) -> tuple[int | None, dict[str, int]]:
    """How many faces the file lists (None: triangles only), and what it held beside them."""
    match kind:
        case "obj":
            others = left_out.of_obj(data)
            coordinates = 0 if has_uv else len(_OBJ_UV.findall(data))
            if coordinates:
                others["texture coordinates that not all faces have"] = coordinates
            return len(_OBJ_FACE.findall(data)), others
        case "ply":
            elements = parts[0].metadata["_ply_raw"]
            return int(elements["face"]["length"]), left_out.of_ply(elements, has_uv=has_uv)
        case _:
            return None, {}


def _obj(soup: TriangleSoup) -> bytes:
    text = io.StringIO()
    np.savetxt(text, soup.vertices, fmt=f"v {NUMBER} {NUMBER} {NUMBER}")
    corner = soup.faces + 1
    if soup.uv is None:
        np.savetxt(text, corner, fmt="f %d %d %d")
    else:
        np.savetxt(text, soup.uv, fmt=f"vt {NUMBER} {NUMBER}")
        np.savetxt(text, np.repeat(corner, 2, axis=1), fmt="f %d/%d %d/%d %d/%d")
    return text.getvalue().encode()
