"""A mesh file as the GLB that says the same, for the one pipeline that refines glTF."""

from __future__ import annotations

import numpy as np

from ..bodies.media import GLTF_KINDS
from ..bodies.uploads import Sent
from ..errors import InvalidParameter, UnrefinableError
from ..gltf.read.plan import check_memory
from ..options import Limits, Options
from ..report import Change
from . import formats
from .indexed_triangles import IndexedTriangles
from .single_precision import LARGEST, rounding_changes
from .triangles_glb import triangles_glb

# glTF's own default is a bare metal, which is black where nothing surrounds it.
PLAIN = {
    "pbrMetallicRoughness": {
        "baseColorFactor": [0.7, 0.7, 0.7, 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": 0.6,
    },
}

# What reading takes for each byte of a file, measured on the shortest lines that a format allows.
BYTES_PER_BYTE = {"obj": 32, "off": 32, "ply": 60, "stl": 12}


def as_gltf(sent: Sent, options: Options, limits: Limits) -> Sent:
    """Return the same upload if it is a glTF; a converted GLB, and what that lost, if not.

    Raises:
        UnreadableError: not a file of its kind, or one without faces.
        UnrefinableError: a position that float32 cannot hold.
        InvalidParameter: creases by normals, which these formats do not hand on.
        LimitError: reading would take more than `max_memory_bytes`.
    """
    if sent.kind in GLTF_KINDS:
        return sent
    if options.crease == "normals":
        raise InvalidParameter("crease", "crease=normals needs a glTF; use angle:DEGREES here")
    check_memory(BYTES_PER_BYTE[sent.kind] * len(sent.data), limits)
    triangles = formats.read(sent.data, sent.kind)
    if not np.isfinite(triangles.vertices).all() or np.abs(triangles.vertices).max() > LARGEST:
        raise UnrefinableError("a position is no number, or beyond the range of float32")
    losses = _losses(triangles, sorted(sent.siblings.names))
    return Sent(triangles_glb(triangles, material=PLAIN), "glb", losses=tuple(losses))


def _losses(triangles: IndexedTriangles, unused_files: list[str]) -> list[Change]:
    losses = [Change("", f"{name} dropped", count) for name, count in triangles.unsupported.items()]
    if triangles.split:
        losses.append(Change("", "triangles added by splitting polygons", triangles.split))
    if triangles.unused:
        losses.append(Change("", "vertices dropped that no face uses", triangles.unused))
    losses += [Change("", f"not used by the document: {name}", 1) for name in unused_files]
    return losses + rounding_changes(triangles)
