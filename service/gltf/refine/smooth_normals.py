"""New normals for a control mesh, whatever its file had: smooth everywhere but across creases."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.blocks import Blocks, available_threads
from pns_common.base.distinct import number_by_first_appearance
from pns_common.connectivity.topology import build_topology, next_corner
from pns_common.fused.corner_normals import angle_weighted_normals
from pns_common.mesh import Cleaned

from ..constants import FLOAT
from ..read.primitives import TrianglePrimitive
from ..read.schema import Accessor
from .control_mesh import ControlMesh
from .normals import safe_unit


def with_smooth_normals(
    control: ControlMesh, cleaned: Cleaned, creases: Int[np.ndarray, "N 2"] | None
) -> list[TrianglePrimitive]:
    """Give the primitives a normal for each vertex and each side of the creases (N, 2) there.

    A vertex is split where creases part its faces. Copies of a face take its normals, turned over
    where they are; faces that will be dropped keep what they had.
    """
    fans = _fans(cleaned, creases)
    values = _normals(cleaned, fans)
    fan, turned = _of_all_faces(control, cleaned, fans)
    primitives: list[TrianglePrimitive] = []
    start = 0
    for primitive, keep in zip(control.primitives, control.kept, strict=True):
        stop = start + int(keep.sum())
        primitives.append(
            _with_normals(primitive, keep, fan[start:stop], turned[start:stop], values)
        )
        start = stop
    return primitives


def with_normal_accessor(accessors: dict[str, Accessor], count: int) -> dict[str, Accessor]:
    """Return the accessors of a primitive that has normals now, whether it had any or not."""
    plain = Accessor(component_type=FLOAT, count=count, type="VEC3")
    return {"NORMAL": plain} | accessors


def _fans(cleaned: Cleaned, creases: Int[np.ndarray, "N 2"] | None) -> Int[np.ndarray, "F 3"]:
    """Return a number for each corner that the corners of one smooth fan of faces share."""
    faces = cleaned.mesh.faces
    topology = build_topology(faces, len(cleaned.mesh.vertices))
    smooth = np.ones(len(topology.interior), dtype=bool)
    if creases is not None and len(creases):
        count = len(cleaned.mesh.vertices)
        code = np.sort(topology.edges[topology.interior], axis=1) @ [count, 1]
        smooth = ~np.isin(code, np.sort(creases, axis=1) @ [count, 1])
    there, back = topology.half_edges[topology.interior[smooth]].T
    # Both ends of an edge join the corners of its two faces.
    corners = np.concatenate([there, next_corner(there)])
    facing = np.concatenate([next_corner(back), back])
    label = np.arange(3 * len(faces))
    while True:
        least = np.minimum(label[corners], label[facing])
        new = label.copy()
        np.minimum.at(new, corners, least)
        np.minimum.at(new, facing, least)
        # A label names a corner of the same fan, whose own label may be less by now.
        new = new[new]
        if np.array_equal(new, label):
            break
        label = new
    return number_by_first_appearance(label)[0].reshape(-1, 3)


def _normals(cleaned: Cleaned, fans: Int[np.ndarray, "F 3"]) -> Float[np.ndarray, "G 3"]:
    mesh = cleaned.mesh
    blocks = Blocks(threads=available_threads())
    count = int(fans.max()) + 1
    return safe_unit(angle_weighted_normals(mesh.vertices, mesh.faces, fans, count, blocks))


def _of_all_faces(
    control: ControlMesh, cleaned: Cleaned, fans: Int[np.ndarray, "F 3"]
) -> tuple[Int[np.ndarray, "P 3"], Int[np.ndarray, " P"]]:
    """Return the fans of all proper faces' corners, and which faces are copies turned over."""
    proper = np.concatenate(control.kept)
    leader = cleaned.representative[proper]
    own = cleaned.vertex_map[control.weld.faces[proper]]
    place = (own[:, :, None] == cleaned.mesh.faces[leader][:, None, :]).argmax(axis=2)
    turned = (place[:, 1] - place[:, 0]) % 3 != 1
    return np.take_along_axis(fans[leader], place, axis=1), turned


def _with_normals(
    primitive: TrianglePrimitive,
    keep: np.ndarray,
    fan: Int[np.ndarray, "P 3"],
    turned: np.ndarray,
    values: Float[np.ndarray, "G 3"],
) -> TrianglePrimitive:
    """Return rows of their own for each vertex, fan and side that the corners name."""
    side = np.full(primitive.corners.shape, -1)
    side[keep] = 2 * fan + turned[:, None]
    # Pairs of row and side as one number each: numpy sorts pairs ten times as slowly.
    sides = int(side.max()) + 2
    code = primitive.corners.reshape(-1) * sides + (side.reshape(-1) + 1)
    distinct, corners = np.unique(code, return_inverse=True)
    row, of_fan = distinct // sides, distinct % sides - 1
    old = primitive.attributes.get("NORMAL")
    normals = np.zeros((len(row), 3)) if old is None else old[row].astype(np.float64)
    known = of_fan >= 0
    sign = np.where(of_fan % 2 == 1, -1.0, 1.0)[known, None]
    normals[known] = sign * values[of_fan[known] // 2]
    # Beside the position, where readers look for it; the order is the file's otherwise.
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
