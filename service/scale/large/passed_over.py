"""What a mesh file holds beside positions and triangles: a large one loses it, so it is named."""

from __future__ import annotations

import re
from collections import Counter

from ...meshfiles.ply import POLYGON, PlyHeader

# A line's end to begin with is looked for at once, its beginning at each letter.
_OBJ_STATEMENT = re.compile(rb"\n[ \t]*(vt|vn|usemtl|g|o|s|l|p|vp|curv|surf)[ \t]")
_OBJ_COLOUR = re.compile(rb"\n[ \t]*v(?:[ \t]+[^\s]+){6,}[ \t]*\r?$", re.MULTILINE)
_OBJ_NAMES = {
    b"vt": "texture coordinates",
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
_PLY_KEPT = frozenset({"x", "y", "z", *POLYGON})


def of_obj(text: bytes) -> dict[str, int]:
    """Count, by name, the statements that are passed over."""
    lines = b"\n" + text
    counts = Counter(_OBJ_NAMES[name] for name in _OBJ_STATEMENT.findall(lines))
    if colours := len(_OBJ_COLOUR.findall(lines)):
        counts["vertex colours"] = colours
    return dict(counts)


def of_ply(header: PlyHeader) -> dict[str, int]:
    """Count, by name, the properties and elements that are passed over."""
    counts = {"names of textures": header.textures}
    for element in header.elements:
        if element.name not in ("vertex", "face"):
            counts[f"element {element.name}"] = element.rows
            continue
        for one in element.properties:
            if one.name not in _PLY_KEPT:
                counts[f"{element.name} property {one.name}"] = element.rows
    # Some programs declare elements that they have none of.
    return {name: count for name, count in counts.items() if count}
