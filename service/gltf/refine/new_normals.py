"""Normals before refinement: edges that a file's normals make hard, and new, smooth normals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.mesh.creases import edge_cosines
from pns_common.mesh.normals import smooth_fans
from pns_common.mesh.topology import build_topology

from ...meshes.creases import hard_edges as hard_between
from ...options import Options
from ..constants import FLOAT
from ..read.primitives import TrianglePrimitive
from ..read.schema import Accessor
from .control_mesh import NO_NORMAL, ControlMesh
from .normals import corner_normals, safe_unit
from .polygons import triangles_of

# An edge whose faces' normals have a cosine this far below 1 is bent: a twelfth of a degree.
BENT = 1e-6
# Normals that differ by less are one: exporters round them face by face.
SAME = 1e-3
# From this share of faces with one normal on, a mesh is shaded flat.
MOST = 0.5


def hard_edges(control: ControlMesh) -> Int[np.ndarray, "N 2"]:
    """Return the edges that normals make hard, as pairs of vertices of the mesh to refine.

    A corner without a normal, or with one of length 0, makes no edge hard.
    """
    label = control.of_cleaned(_labels_of_faces(control)).reshape(-1)
    return hard_between(build_topology(control.mesh.faces, len(control.mesh.vertices)), label)


def marked_edges(control: ControlMesh) -> Int[np.ndarray, "N 2"]:
    """Return the hard edges that end where another bent edge is smooth.

    A mesh that is shaded flat has no smooth bent edge, and marks none.
    """
    hard = hard_edges(control)
    if len(hard) == 0:
        return hard
    mesh = control.mesh
    topology = build_topology(mesh.faces, len(mesh.vertices))
    bent = edge_cosines(mesh.vertices, topology) < 1 - BENT
    bent[topology.rows_of(hard)] = False
    beside_smooth = np.zeros(len(mesh.vertices), dtype=bool)
    beside_smooth[topology.edges[bent]] = True
    return hard[beside_smooth[hard].any(axis=1)]


def _labels_of_faces(control: ControlMesh) -> Int[np.ndarray, "P 3"]:
    """Label the corners of each kept face: equal normals at one vertex share a number."""
    labels = control.normal_labels.copy()
    shares = list(zip(control.primitives, control.kept, control.rows, strict=True))
    for primitive, _, part in shares:
        if "NORMAL" in primitive.attributes:
            labels[part][~primitive.attributes["NORMAL"].any(axis=1)] = NO_NORMAL
    return np.concatenate([labels[p.corners[keep] + part.start] for p, keep, part in shares])


def with_normal_rule(options: Options, primitives: Sequence[TrianglePrimitive]) -> Options:
    """Return the options with `normals=auto` decided.

    Smooth for a mesh without any normals, and where no edge is to stay sharp for one of which most
    faces are shaded flat: its normals would show the faces that it had.
    """
    if options.normals != "auto":
        return options
    given = [p for p in primitives if "NORMAL" in p.attributes]
    if given and options.crease != "off":
        return replace(options, normals="keep")
    flat = (are_one(p.attributes["NORMAL"][p.corners]) for p in given)
    smooth = not given or np.concatenate([*flat]).mean() > MOST
    return replace(options, normals="smooth" if smooth else "keep")


def are_one(normals: Float[np.ndarray, "F T 3"]) -> Bool[np.ndarray, " F"]:
    """Return which faces have one normal at all of their corners."""
    same: Bool[np.ndarray, " F"] = np.all(np.abs(normals - normals[:, :1]) < SAME, axis=(1, 2))
    return same


def with_smooth_normals(
    control: ControlMesh, creases: Int[np.ndarray, "N 2"] | None
) -> list[TrianglePrimitive]:
    """Return the primitives with new normals, smooth everywhere but across creases.

    Vertices between creases are split. Copies of a face take its normals, reversed if the copy is.
    Faces that will be dropped keep theirs.
    """
    fans = smooth_fans(control.mesh.faces, len(control.mesh.vertices), creases)
    count = int(fans.max()) + 1
    values = safe_unit(corner_normals(control.mesh.vertices, control.mesh.faces, fans, count))
    kept = triangles_of(control.weld.faces, control.cleaned)
    fan, turned = fans.reshape(-1)[kept.source].reshape(-1, 3), kept.turned
    primitives: list[TrianglePrimitive] = []
    start = 0
    for primitive, keep in zip(control.primitives, control.kept, strict=True):
        own = slice(start, start + int(keep.sum()))
        primitives.append(_with_normals(primitive, keep, fan[own], turned[own], values))
        start = own.stop
    return primitives


def with_normal_accessor(accessors: dict[str, Accessor], count: int) -> dict[str, Accessor]:
    """Return the accessors of a primitive with normals; a new one if it had none."""
    plain = Accessor(component_type=FLOAT, count=count, type="VEC3")
    return {"NORMAL": plain} | accessors


def _with_normals(
    primitive: TrianglePrimitive,
    keep: Bool[np.ndarray, " F"],
    fan: Int[np.ndarray, "P 3"],
    turned: Bool[np.ndarray, " P"],
    values: Float[np.ndarray, "G 3"],
) -> TrianglePrimitive:
    """Return the primitive with a row for each vertex, fan and side of its corners."""
    side = np.full(primitive.corners.shape, -1)
    side[keep] = 2 * fan + turned[:, None]
    # One number for each pair of row and side: sorting pairs takes ten times as long.
    sides = int(side.max()) + 2
    codes = primitive.corners.reshape(-1) * sides + (side.reshape(-1) + 1)
    order = np.argsort(codes)
    code = codes[order]
    opens = np.diff(code, prepend=-1) > 0
    corners = np.empty_like(order)
    corners[order] = np.cumsum(opens) - 1
    row, of_fan = np.divmod(code[opens], sides)
    of_fan -= 1
    old = primitive.attributes.get("NORMAL")
    normals = np.zeros((len(row), 3)) if old is None else old[row].astype(np.float64)
    known = of_fan >= 0
    sign = np.where(of_fan % 2 == 1, -1.0, 1.0)[known, None]
    normals[known] = sign * values[of_fan[known] // 2]
    # Readers expect NORMAL beside POSITION; the others keep their order.
    attributes = {"POSITION": primitive.attributes["POSITION"][row]}
    attributes["NORMAL"] = safe_unit(normals).astype(np.float32)
    attributes |= {
        name: array[row] for name, array in primitive.attributes.items() if name not in attributes
    }
    return replace(
        primitive,
        rows=primitive.rows[row],
        corners=corners.reshape(-1, 3),
        attributes=attributes,
        accessors=with_normal_accessor(primitive.accessors, len(row)),
        targets=tuple({n: a[row] for n, a in target.items()} for target in primitive.targets),
    )
