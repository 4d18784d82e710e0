"""OBJ, PLY, STL and OFF: triangles in and out, with what each format can hold."""

from __future__ import annotations

import io
import logging
import re
import warnings
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from pns_common.rows import disjoint_faces

from ..bodies.media import GLTF_KINDS
from ..errors import UnreadableError, UnrefinableError
from . import unsupported
from .counted import is_binary_stl
from .indexed_triangles import NUMBER, IndexedTriangles
from .obj_text import usual_obj, with_line_feeds, written_anew
from .off import read_off, write_off
from .ply.polygons import of_triangles
from .single_precision import LARGEST
from .text_pieces import without

if TYPE_CHECKING:
    import trimesh

HOLDS_DOUBLE = frozenset({"obj", "off"})
HOLDS_UV = frozenset({"obj", "ply", *GLTF_KINDS})

_OBJ_PART = re.compile(rb"^[ \t]*(?:usemtl|o|g)(?:[ \t][^\n]*)?$", re.MULTILINE)
_STL_PART = re.compile(rb"(?im)^[ \t]*(?:endsolid|solid)(?:[ \t][^\n]*)?\r?$")
# trimesh gathers an OBJ's faces by material, the last first, and takes time in the square of the
# parts that materials and names divide a file into. They are lost in any case: an OBJ's are passed
# over before it reads, so that its faces stay in their order; an STL's beyond so many statements.
MOST_PARTS = 100


def load_readers() -> ModuleType:
    """Return trimesh. It is loaded when it is first needed: glTF files, and OFF, do without."""
    import trimesh

    # It logs a stack trace for a texture that it does not find; what is lost stands in the report.
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    return trimesh


def read(data: bytes, kind: str) -> IndexedTriangles:
    """Read a mesh file; its polygons are split into fans.

    Raises:
        UnreadableError: not a file of this kind, or one without faces, or without all of them.
        UnrefinableError: a face names a vertex that there is not.
    """
    triangles = read_off(data) if kind == "off" else _read_by_trimesh(data, kind)
    faces, count = triangles.faces, len(triangles.vertices)
    if len(faces) == 0:
        raise UnreadableError(f"the {kind.upper()} file has no faces of three vertices")
    if not (faces.min() >= 0 and faces.max() < count):
        worst = int(np.argmin(((faces >= 0) & (faces < count)).all(axis=1)))
        raise UnrefinableError(
            f"the {kind.upper()} file has a triangle of the vertices {faces[worst].tolist()}, "
            f"expected 0 … {count - 1}"
        )
    return triangles


def _read_by_trimesh(data: bytes, kind: str) -> IndexedTriangles:
    data, polygons = of_triangles(data) if kind == "ply" else (data, None)
    data = with_line_feeds(data) if kind == "obj" else data
    scene = _scene(data, kind)
    parts = [part for part in scene.geometry.values() if isinstance(part, load_readers().Trimesh)]
    if not parts:
        # A binary one that is cut off, or goes on, is taken for text.
        other = " as text up to endsolid, and is no whole binary STL" if kind == "stl" else ""
        raise UnreadableError(f"the {kind.upper()} file has no faces{other}")
    faces = disjoint_faces((np.asarray(part.faces), len(part.vertices)) for part in parts)
    uv = _uv(parts)
    count, unused, others = _beside_triangles(data, kind, parts, polygons, has_uv=uv is not None)
    if kind == "ply" and polygons is None and count is not None and len(faces) < count:
        # trimesh takes what is there of a text that was cut off.
        raise UnreadableError(f"the PLY file says {count} faces and ends after {len(faces)}")
    return IndexedTriangles(
        vertices=np.concatenate([np.asarray(part.vertices, dtype=np.float64) for part in parts]),
        faces=faces.astype(np.int64),
        uv=uv,
        unused=unused,
        split=0 if count is None else max(0, len(faces) - count),
        unsupported=others,
    )


def write(mesh_file: IndexedTriangles, kind: str) -> bytes:
    """Write the file's bytes: PLY and STL binary, OBJ and OFF text."""
    if kind == "obj":
        return _obj(mesh_file)
    if kind == "off":
        return write_off(mesh_file)
    mesh = load_readers().Trimesh(
        mesh_file.vertices, mesh_file.faces, process=False, validate=False
    )
    if kind == "ply" and mesh_file.uv is not None:
        # As Blender and MeshLab name them.
        mesh.vertex_attributes |= dict(zip("st", mesh_file.uv.astype(np.float32).T, strict=True))
    exported: Any = mesh.export(file_type=kind)  # bytes for these kinds
    return bytes(exported)


def _scene(data: bytes, kind: str) -> trimesh.Scene:
    """Return what trimesh makes of the file."""
    # Before warnings become errors: what it imports may warn.
    readers = load_readers()
    text = _as_utf8(data) if kind == "obj" or (kind == "stl" and not is_binary_stl(data)) else data
    if kind == "obj":
        text = without(_OBJ_PART, usual_obj(text))
    if kind == "stl" and not is_binary_stl(data) and _parts(text) > MOST_PARTS:
        text = b"solid\n" + without(_STL_PART, text) + b"\nendsolid\n"
    try:
        with warnings.catch_warnings():
            # Where a number cannot be read, numpy warns and leaves out all that follows.
            warnings.simplefilter("error")
            # An STL's solids come apart; as they are listed, they make the file's triangles.
            scene = readers.load_scene(io.BytesIO(text), file_type=kind, process=False)
    except MemoryError:
        raise
    except Exception as error:
        if kind == "obj":
            # It names the line, if that is what is wrong.
            written_anew(text)
        # On a broken file these readers fail as it comes, with an UnboundLocalError for one.
        raise UnreadableError(f"this is not a readable {kind.upper()} file") from error
    if kind == "obj" and any(np.shape(part.vertices)[1] < 3 for part in scene.geometry.values()):
        # All are cut to the length of the shortest: here, too, it is the line that is told.
        written_anew(text)
    return scene


def _parts(text: bytes) -> int:
    """Count the lines of an STL that begin or end a solid, one at a time."""
    return sum(1 for _ in _STL_PART.finditer(text))


def _as_utf8(data: bytes) -> bytes:
    """Return the same text; names in old files are Latin-1, and geometry is ASCII in either."""
    try:
        data.decode()
    except UnicodeDecodeError:
        return data.decode("latin-1").encode()
    return data


def _uv(parts: list[trimesh.Trimesh]) -> Float[np.ndarray, "N 2"] | None:
    """Return all parts' texture coordinates, if all have them: half a seam is not interpolated.

    One number is none, nor is what float32 cannot hold.
    """
    of_parts = [getattr(part.visual, "uv", None) for part in parts]
    for uv, part in zip(of_parts, parts, strict=True):
        if uv is None or len(uv) != len(part.vertices) or np.shape(uv)[1:] < (2,):
            return None
        if not (np.abs(uv) <= LARGEST).all():
            return None
    return np.concatenate([uv for uv in of_parts if uv is not None])[:, :2].astype(np.float64)


def _beside_triangles(
    data: bytes, kind: str, parts: list[trimesh.Trimesh], polygons: int | None, *, has_uv: bool
) -> tuple[int | None, int, dict[str, int]]:
    """Count the faces that the file lists (None: triangles only), and what is beside them.

    That is vertices that no face names, where trimesh leaves them out, and, by name, all else.

    `polygons` are those of a PLY that were cut before it was read.
    """
    match kind:
        case "obj":
            others = unsupported.of_obj(data)
            coordinates = others.pop(unsupported.COORDINATES, 0)
            if coordinates and not has_uv:
                others["texture coordinates that not all faces have"] = coordinates
            faces = unsupported.faces_of_obj(data)
            if faces.sides:
                others[unsupported.SIDES] = faces.sides
            return faces.polygons, faces.unused, others
        case "ply":
            elements = parts[0].metadata["_ply_raw"]
            if polygons is not None:
                elements["face"]["length"] = polygons
            others = unsupported.of_ply(data, elements, has_uv=has_uv)
            return int(elements["face"]["length"]), 0, others
        case "stl" if is_binary_stl(data):
            return None, 0, unsupported.of_stl(data)
        case _:
            return None, 0, {}


def _obj(mesh_file: IndexedTriangles) -> bytes:
    text = io.StringIO()
    np.savetxt(text, mesh_file.vertices, fmt=f"v {NUMBER} {NUMBER} {NUMBER}")
    corner = mesh_file.faces + 1
    if mesh_file.uv is None:
        np.savetxt(text, corner, fmt="f %d %d %d")
    else:
        np.savetxt(text, mesh_file.uv, fmt=f"vt {NUMBER} {NUMBER}")
        np.savetxt(text, np.repeat(corner, 2, axis=1), fmt="f %d/%d %d/%d %d/%d")
    return text.getvalue().encode()
