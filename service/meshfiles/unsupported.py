"""What a mesh file holds beside positions, faces and UVs: it is lost, so it is named."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from .counted import STL_HEADER
from .ply.header import LONGEST
from .ply.textured_text import CORNER_UV
from .text_pieces import COMMENT, without

# A line's end to begin with is looked for at once, its beginning at each letter.
_OBJ_STATEMENT = re.compile(rb"\n[ \t]*(vt|vn|usemtl|g|o|s|l|p|vp|curv|surf)[ \t]")
_OBJ_COLOUR = re.compile(rb"\n[ \t]*v(?:[ \t]+[^\s]+){6,}[ \t]*\r?$", re.MULTILINE)
_OBJ_VERTEX = re.compile(rb"^[ \t]*v[ \t]", re.MULTILINE)
_OBJ_FACE = re.compile(rb"^[ \t]*f[ \t]([^\n#]*)", re.MULTILINE)
# The first number of each corner, and the ends of lines.
_OBJ_REFERENCE = re.compile(rb"(?<![^\s])-?\d{1,18}|\n")
_OBJ_CONTINUED = re.compile(rb"\\\r?\n")
COORDINATES = "texture coordinates"
_OBJ_NAMES = {
    b"vt": COORDINATES,
    b"vn": "vertex normals",
    b"usemtl": "materials",
    b"g": "groups",
    b"o": "object names",
    b"s": "smoothing groups",
    b"l": "lines",
    b"p": "points",
    b"vp": "free-form curves",
    b"curv": "free-form curves",
    b"surf": "free-form surfaces",
}
_PLY_KEPT = frozenset({"x", "y", "z", "vertex_index", "vertex_indices"})
_PLY_UV = frozenset({"u", "v", "s", "t", "texture_u", "texture_v"})
# As MeshLab writes it, in the header.
_PLY_TEXTURE = re.compile(rb"^comment TextureFile[ \t]", re.MULTILINE)
# Behind the twelve numbers of each face: by no standard its colour.
_STL_FACE = np.dtype([("numbers", "V48"), ("attribute", "<u2")])
SIDES = "faces of fewer than three vertices"


def of_obj(data: bytes) -> dict[str, int]:
    """Count, by name, the statements that are passed over where a mesh is positions and faces."""
    lines = b"\n" + data
    counts = Counter(_OBJ_NAMES[name] for name in _OBJ_STATEMENT.findall(lines))
    if colours := len(_OBJ_COLOUR.findall(lines)):
        counts["vertex colours"] = colours
    return dict(counts)


class ObjFaces(NamedTuple):
    """What an OBJ's faces name, of which trimesh leaves out without a word what makes none.

    Attributes:
        polygons: faces of three vertices or more.
        sides: those of fewer.
        unused: vertices that no face names.
    """

    polygons: int
    sides: int
    unused: int


def faces_of_obj(data: bytes) -> ObjFaces:
    """Count the faces that an OBJ lists, and the vertices that none of them names."""
    text = _OBJ_CONTINUED.sub(b" ", without(COMMENT, data))
    starts = np.array([match.start() for match in _OBJ_VERTEX.finditer(text)], dtype=np.int64)
    lines = list(_OBJ_FACE.finditer(text))
    words = np.array(_OBJ_REFERENCE.findall(b"\n".join(line[1] for line in lines)), dtype=bytes)
    ends = words == b"\n"
    number, line = words[~ends].astype(np.int64), np.cumsum(ends)[~ends]
    sides = int((np.bincount(line, minlength=len(lines)) < 3).sum())
    # A negative index counts back from its own line.
    before = starts.searchsorted([match.start() for match in lines])
    index = np.where(number < 0, before[line] + number, number - 1)
    used = np.unique(index[(index >= 0) & (index < len(starts))])
    return ObjFaces(len(lines) - sides, sides, len(starts) - len(used))


def of_stl(data: bytes) -> dict[str, int]:
    """Count the faces of a binary STL with a colour."""
    faces = np.frombuffer(data, _STL_FACE, offset=STL_HEADER)
    coloured = int(np.count_nonzero(faces["attribute"]))
    return {"colours of faces": coloured} if coloured else {}


def of_ply(data: bytes, elements: dict[str, Any], *, has_uv: bool) -> dict[str, int]:
    """Count, by name, the properties and elements that are passed over."""
    kept = _PLY_KEPT
    if has_uv:
        # Where there are such, those at vertices are passed over.
        at_corners = CORNER_UV in elements["face"]["properties"]
        kept |= {CORNER_UV} if at_corners else _PLY_UV
    counts: dict[str, int] = {}
    for element, content in elements.items():
        if element not in ("vertex", "face"):
            counts[f"element {element}"] = int(content["length"])
            continue
        for name in content["properties"]:
            if name not in kept:
                counts[f"{element} property {name}"] = int(content["length"])
    if textures := len(_PLY_TEXTURE.findall(data[:LONGEST].partition(b"\nend_header")[0])):
        counts["names of textures"] = textures
    # Some programs declare elements that they have none of.
    return {name: count for name, count in counts.items() if count}
