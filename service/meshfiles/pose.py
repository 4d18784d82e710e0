"""Pose a skinned mesh as its joints' nodes stand (glTF 2.0 §3.7.3.3).

The node that shows a skinned mesh does not move it, whatever its transform says.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from ..errors import GltfError
from ..gltf.constants import FLOAT
from ..gltf.read.accessors import read
from ..gltf.read.upload import Upload
from ..gltf.refine.skin import Binding

# Of the largest coordinate: what products of float32 matrices are off by, and somewhat more.
ROUNDING = 1e-5


def joint_matrices(
    upload: Upload, node: int, worlds: Mapping[int, Float[np.ndarray, "4 4"]]
) -> Float[np.ndarray, "J 4 4"] | None:
    """Return what each joint of a node's skin does to positions; None without a skin.

    `worlds` are the world matrices of the scene's nodes; a skin with joints elsewhere is none.

    Raises:
        GltfError: inverse bind matrices that are none, or fewer than joints.
    """
    number = upload.document.nodes[node].skin
    if number is None:
        return None
    joints = upload.document.skins[number].joints
    if not worlds.keys() >= set(joints):
        return None
    matrices = np.stack([worlds[joint] for joint in joints])
    index = upload.document.skins[number].inverse_bind_matrices
    if index is not None:
        matrices = matrices @ _inverse_bind_matrices(upload, number, index)[: len(joints)]
    return matrices


def _inverse_bind_matrices(upload: Upload, skin: int, index: int) -> Float[np.ndarray, "N 4 4"]:
    accessor = upload.document.accessors[index]
    joints = len(upload.document.skins[skin].joints)
    columns = read(upload.document, upload.buffers, index)
    is_matrix = (accessor.type, accessor.component_type) == ("MAT4", FLOAT)
    if not is_matrix or len(columns) < joints or not np.isfinite(columns).all():
        raise GltfError(
            f"{joints} joints need as many MAT4 of finite floats",
            pointer=f"/skins/{skin}/inverseBindMatrices",
        )
    return columns.astype(np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)


def posed(
    positions: Float[np.ndarray, "N 3"],
    binding: Binding,
    joints: Float[np.ndarray, "J 4 4"],
    placed: Float[np.ndarray, "N 3"],
) -> Float[np.ndarray, "N 3"]:
    """Return where joints put positions.

    They stay where the node has `placed` them if no joint holds them, and all do where joints would
    do no more than round them: most files show a mesh as it was bound.

    Raises:
        GltfError: a vertex is bound to a joint that there is not.
    """
    worst = int(binding.joints.max())
    if worst >= len(joints):
        raise GltfError(f"a vertex is bound to joint {worst} of {len(joints)}", pointer="/skins")
    points = np.column_stack([positions, np.ones(len(positions))])
    moved = np.zeros_like(positions)
    for joint, weight in zip(binding.joints.T, binding.weights.T, strict=True):
        moved += weight[:, None] * np.einsum("nij,nj->ni", joints[joint, :3], points)
    moved = np.where((binding.weights > 0).any(axis=1, keepdims=True), moved, placed)
    stays = np.allclose(moved, placed, rtol=0, atol=ROUNDING * np.abs(placed).max())
    return placed if stays else moved
