"""Refined primitives as KHR_draco_mesh_compression: smaller, and no longer exact.

Positions are rounded to a grid that all primitives of a mesh share, so that seams between them do
not open; normals to an octahedral grid of 10 bits, texture coordinates to 14 bits of their range.
Everything else is stored exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import DracoPy
import numpy as np
from jaxtyping import Float, Int, Shaped

from pns_common.base.extent import extent

POSITION_BITS, NORMAL_BITS, TEXCOORD_BITS = 16, 10, 14
# 0 is the fastest, 10 the smallest; 7 is where Draco's own tools stand.
EFFORT = 7

# Draco may look at each pair of faces around a vertex. So many, around all vertices, take it up to
# a second; nothing could stop it.
MOST_PAIRS = 10**9

# Draco's own names of what an attribute is.
_POSITION, _NORMAL, _TEXCOORD = 0, 1, 3
_NAMED = {_POSITION: "POSITION", _NORMAL: "NORMAL", _TEXCOORD: "TEXCOORD_0"}
# Ids of further attributes begin here.
_FIRST_GENERIC = 1
_TYPES = tuple(np.dtype(kind) for kind in ("f4", "u1", "u2", "u4"))

# Draco hands its grid on as text of six decimals. Where cells are not wide beside that, the grid
# has such numbers itself: a position outside of it would turn the normals that are predicted from
# positions, or end the encoding.
_TEXT_STEP = 1e-6
_WIDE_CELL = 2 * _TEXT_STEP
# A mesh that is smaller would be rounded by far more than its bits allow.
_LEAST_SIZE = 10 * _TEXT_STEP


@dataclass(frozen=True, eq=False)
class Grid:
    """The cube whose corner and edge length positions are rounded in."""

    origin: Float[np.ndarray, " 3"]
    size: float

    @property
    def cell(self) -> float:
        """The distance of neighbouring positions along an axis."""
        return self.size / (2**POSITION_BITS - 1)


@dataclass(frozen=True, eq=False)
class Encoded:
    """A primitive in Draco's form, and what a decoder will make of it.

    Attributes:
        data: the bitstream.
        ids: by attribute its unique id.
        attributes, faces: decoded again: Draco reorders, and may split or join vertices.
    """

    data: bytes
    ids: dict[str, int]
    attributes: dict[str, Shaped[np.ndarray, "N K"]]
    faces: Int[np.ndarray, "F 3"]


def grid_of(positions: list[Float[np.ndarray, "N 3"]]) -> Grid | None:
    """Return the smallest grid over all positions of a mesh; None where Draco cannot tell it."""
    lows, highs = zip(*(extent(points) for points in positions), strict=True)
    low, high = np.min(lows, axis=0), np.max(highs, axis=0)
    size = float((high.astype(np.float64) - low).max())
    grid = Grid(low, size if size > 0 else 1.0)
    if grid.cell >= _WIDE_CELL:
        return grid
    if grid.size < _LEAST_SIZE:
        return None
    origin = (np.floor(low.astype(np.float64) / _TEXT_STEP - 1) * _TEXT_STEP).astype(np.float32)
    steps = np.ceil((high.astype(np.float64) - origin).max() / _TEXT_STEP + 1)
    return Grid(origin, float(steps * _TEXT_STEP))


def can_encode(attributes: dict[str, Shaped[np.ndarray, "N K"]]) -> bool:
    """Return whether Draco holds these types; what it reorders, it must hold as a whole."""
    return all(values.dtype in _TYPES for values in attributes.values())


def encode(
    attributes: dict[str, Shaped[np.ndarray, "N K"]], faces: Int[np.ndarray, "F 3"], grid: Grid
) -> Encoded | None:
    """Encode a primitive; None where Draco cannot, loses a face on the way, or takes too long."""
    around = np.bincount(faces.reshape(-1))
    if around @ around > MOST_PAIRS:
        return None
    others = [name for name in attributes if name not in _NAMED.values()]
    generic = {
        _FIRST_GENERIC + number: np.ascontiguousarray(attributes[name])
        for number, name in enumerate(others)
    }
    try:
        data = DracoPy.encode(
            attributes["POSITION"].astype(np.float64),
            faces.astype(np.uint32),
            quantization_bits=POSITION_BITS,
            compression_level=EFFORT,
            quantization_range=grid.size,
            quantization_origin=grid.origin,
            normals=_double(attributes.get("NORMAL")),
            normal_quantization_bits=NORMAL_BITS,
            tex_coord=_double(attributes.get("TEXCOORD_0")),
            tex_coord_quantization_bits=TEXCOORD_BITS,
            generic_attributes=generic or None,
        )
    except DracoPy.EncodingFailedException:
        return None
    mesh = DracoPy.decode(data)
    if getattr(mesh, "faces", None) is None or len(mesh.faces) != len(faces):
        return None
    names = {_FIRST_GENERIC + number: name for number, name in enumerate(others)}
    encoded = {
        names.get(part["unique_id"], _NAMED.get(part["attribute_type"], "")): part
        for part in mesh.attributes
    }
    if set(encoded) != set(attributes):
        return None
    return Encoded(
        data=data,
        ids={name: encoded[name]["unique_id"] for name in attributes},
        attributes={
            name: encoded[name]["data"].astype(values.dtype) for name, values in attributes.items()
        },
        faces=mesh.faces,
    )


def _double(values: Shaped[np.ndarray, "N K"] | None) -> Float[np.ndarray, "N K"] | None:
    """Return doubles, which DracoPy takes here; it stores float32."""
    return None if values is None else values.astype(np.float64)
