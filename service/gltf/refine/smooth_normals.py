"""New normals for a control mesh, whatever its file had: smooth everywhere but across creases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.blocks import Blocks, available_threads
from pns_common.connectivity.topology import stable_sort
from pns_common.fused.where_loaded.corner_normals import angle_weighted_normals
from pns_common.fused.where_loaded.smooth_fans import smooth_fans
from pns_common.mesh import Cleaned

from ...options import Options
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
    fans = smooth_fans(cleaned.mesh.faces, len(cleaned.mesh.vertices), creases)
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


def with_normal_rule(options: Options, primitives: Sequence[TrianglePrimitive]) -> Options:
    """Return the options with `normals=auto` decided: smooth for a mesh without any normals."""
    if options.normals != "auto":
        return options
    given = any("NORMAL" in primitive.attributes for primitive in primitives)
    return replace(options, normals="keep" if given else "smooth")


def with_normal_accessor(accessors: dict[str, Accessor], count: int) -> dict[str, Accessor]:
    """Return the accessors of a primitive that has normals now, whether it had any or not."""
    plain = Accessor(component_type=FLOAT, count=count, type="VEC3")
    return {"NORMAL": plain} | accessors


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
    if np.array_equal(leader, np.arange(len(fans))):
        return fans, np.zeros(len(fans), dtype=bool)
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
    code, order = stable_sort(primitive.corners.reshape(-1) * sides + (side.reshape(-1) + 1))
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
