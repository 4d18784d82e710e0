"""What a document asks to be refined, and what that will cost, before anything is allocated."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

from ...errors import UnrefinableError, check_limit
from ...options import BYTES_PER_INPUT_BYTE, Limits
from .accessors import element_size
from .json_text import encode
from .modes import SURFACES, triangle_count
from .schema import Document, Primitive

# Peak bytes for each refined face: at least 1.15 times what was measured on generated meshes of
# 240,000 faces, levels 1 to 6, smooth ones and ones where every corner is a vertex, by models with
# and without a vertex rule, with compiled kernels and without them.
BYTES_PER_FACE = 280
# Three floats of each vertex, beside that, where a primitive gets normals on the way.
BYTES_FOR_NORMALS = 36
# For each refined vertex of a skin or morph target: the levels' connectivity again, a block of
# columns, and each set of joints and weights while they are rounded (257 measured).
BYTES_PER_FOLLOWING_VERTEX = 320
# The limit masks, exact normals, and how far creases hold back what they reach: with the rest 1.14
# times what was measured on 180,000 faces, where every edge is a crease or every corner a vertex.
BYTES_FOR_LIMIT = 480
# A refined face has at most 1.5 vertices: made, cast to float32, written.
BYTES_PER_VERTEX_BYTE = 3
# Its arrays' headers, and its accessors in the JSON (9 KiB measured over 20,000 primitives).
BYTES_PER_PRIMITIVE = 16 * 1024
# The same of each of its morph targets (4 KiB measured over 100,000 targets of one face).
BYTES_PER_TARGET = 5 * 1024
BYTES_PER_POSITION = 12


@dataclass(frozen=True)
class MeshPlan:
    """A mesh with triangles: its index, its triangle primitives, their faces before refinement."""

    mesh: int
    primitives: tuple[int, ...]
    faces: int


def plan(document: Document) -> list[MeshPlan]:
    """Return the meshes to refine; others have only points or lines and stay as they are.

    Raises:
        GltfError: a primitive whose corners make no whole triangles.
        UnrefinableError: no mesh has triangles.
    """
    plans: list[MeshPlan] = []
    for number, mesh in enumerate(document.meshes):
        triangles = [p for p, primitive in enumerate(mesh.primitives) if primitive.mode in SURFACES]
        faces = [
            triangle_count(
                _corner_count(document, mesh.primitives[p]),
                mesh.primitives[p].mode,
                f"/meshes/{number}/primitives/{p}",
            )
            for p in triangles
        ]
        if triangles:
            plans.append(MeshPlan(number, tuple(triangles), sum(faces)))
    if not plans:
        raise UnrefinableError("the file has no triangles", pointer="/meshes")
    return plans


def check_cost(
    document: Document,
    plans: Sequence[MeshPlan],
    size: int,
    levels: int,
    limits: Limits,
    bytes_per_face: int = 0,
) -> None:
    """Check the refined faces and the memory that they will take against the limits.

    `size` is the upload's, in bytes; `bytes_per_face` what a refined face takes beside the rest.

    Raises:
        LimitError: over `max_faces` or `max_memory_bytes`.
    """
    faces = sum(mesh.faces for mesh in plans) * 4**levels
    check_limit("faces", faces, limits.max_faces, f"the refined file would have {faces} faces")
    memory = predicted_memory(document, plans, size, levels) + faces * bytes_per_face
    check_memory(memory, limits)


def check_decoded(decoded: int, size: int, limits: Limits) -> None:
    """Check bytes that compressed data will take, beside an upload of `size`, before decoding.

    Raises:
        LimitError: over `max_memory_bytes`.
    """
    check_memory(decoded + BYTES_PER_INPUT_BYTE * size, limits)


def check_memory(needed: int, limits: Limits) -> None:
    """Check bytes that work will take, before it takes them. Raises LimitError."""
    check_limit("memory", needed, limits.max_memory_bytes, f"the work would take {needed} bytes")


def repeated_text(tree: dict[str, Any], document: Document) -> int:
    """Return the bytes of JSON that are written again for each primitive that shares an accessor.

    Each gets accessors of its own, and these the name and the extras of the shared one.
    """
    uses = Counter(
        chain.from_iterable(
            (primitive.indices, *(index for _, index in primitive.named))
            for mesh in document.meshes
            for primitive in mesh.primitives
        )
    )
    return sum(
        (count - 1) * len(encode(tree["accessors"][index]))
        for index, count in uses.items()
        if count > 1 and index is not None
    )


def predicted_memory(document: Document, plans: Sequence[MeshPlan], size: int, levels: int) -> int:
    """Predict the bytes at the peak, erring upwards."""
    total = BYTES_PER_INPUT_BYTE * size
    for mesh in plans:
        primitives = [document.meshes[mesh.mesh].primitives[number] for number in mesh.primitives]
        # What moves the vertices of one moves all of a mesh's, those of others by 0.
        targets = max(len(primitive.targets) for primitive in primitives)
        sets = max(joint_sets(primitive.attributes) for primitive in primitives)
        for primitive in primitives:
            sizes = (element_size(document.accessors[index]) for _, index in primitive.named)
            # As they are written: at multiples of four bytes.
            width = sum(size + -size % 4 for size in sizes)
            still = targets - sum("POSITION" in target for target in primitive.targets)
            width += still * BYTES_PER_POSITION
            before = triangle_count(_corner_count(document, primitive), primitive.mode, "")
            faces = before * 4**levels
            total += BYTES_PER_PRIMITIVE + targets * BYTES_PER_TARGET
            total += faces * (BYTES_PER_FACE + BYTES_PER_VERTEX_BYTE * width)
            if targets or sets:
                count = document.accessors[primitive.attributes["POSITION"]].count
                following = _refined_vertices(before, min(count, 3 * before), levels)
                total += following * BYTES_PER_FOLLOWING_VERTEX * max(sets, 1)
    return total


def joint_sets(attributes: Iterable[str]) -> int:
    """Return how many sets of joints are among a primitive's attributes."""
    return sum(name.startswith("JOINTS_") for name in attributes)


def _refined_vertices(faces: int, vertices: int, levels: int) -> int:
    """Return how many vertices a mesh has after some levels, as Euler counts its edges.

    A closed mesh has 3/2 edges a face; none has more than three.
    """
    inside = 2**levels - 1  # vertices on an edge
    edges = min(3 * faces, max(3 * faces // 2, vertices + faces))
    return vertices + inside * edges + inside * (inside - 1) // 2 * faces


def _corner_count(document: Document, primitive: Primitive) -> int:
    index = primitive.indices
    if index is None:
        index = primitive.attributes["POSITION"]
    return document.accessors[index].count
