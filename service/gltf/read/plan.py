"""Plan a document: meshes to refine, their cost before it is paid, and data to remove."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

from ...errors import GltfError, UnrefinableError, check_limit
from ...options import BYTES_PER_INPUT_BYTE, Limits
from ..constants import SURFACES, TRIANGLES
from .accessors import element_size
from .container import encode
from .schema import Document, Primitive

# Peak bytes for each refined face: at least 1.15 times what was measured on generated meshes of
# 240,000 faces, at levels 1 to 6, smooth and with every corner a vertex.
BYTES_PER_FACE = 280
# In addition for new normals: three floats for each vertex.
BYTES_FOR_NORMALS = 36
# For each refined vertex with a skin or morph target: the connectivity of the levels again, a block
# of columns, and each set of joints and weights during rounding (257 measured).
BYTES_PER_FOLLOWING_VERTEX = 320
# Limit masks, exact normals and the shift of creases: 1.14 times what was measured in all on
# 180,000 faces, with every edge a crease or every corner a vertex.
BYTES_FOR_LIMIT = 480
# A refined face has at most 1.5 vertices, held when made, when cast to float32, and when written.
BYTES_PER_VERTEX_BYTE = 3
# Array headers, and accessors in the JSON (9 KiB measured over 20,000 primitives).
BYTES_PER_PRIMITIVE = 16 * 1024
# The same for a morph target (4 KiB measured over 100,000 targets of one face).
BYTES_PER_TARGET = 5 * 1024
BYTES_PER_POSITION = 12


@dataclass(frozen=True)
class MeshPlan:
    """A mesh to refine: its index, its triangle primitives, and their faces before refinement."""

    mesh: int
    primitives: tuple[int, ...]
    faces: int


@dataclass(frozen=True)
class Spare:
    """Data that may leave the file when refinement has replaced it.

    Attributes:
        accessors, views: those of surfaces in the file; all that were added later are spare too.
        accessor_count, view_count: the numbers in the file.
        ranges: (buffer, start, end) of compressed data that was decoded.
        unknown: extensions that may refer to any of it.
    """

    accessors: frozenset[int]
    views: frozenset[int]
    accessor_count: int
    view_count: int
    ranges: tuple[tuple[int, int, int], ...]
    unknown: tuple[str, ...]


def plan(document: Document) -> list[MeshPlan]:
    """Return the meshes that have triangles.

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


def triangle_count(corners: int, mode: int, pointer: str) -> int:
    """Return the number of triangles of a primitive.

    Raises:
        GltfError: the corners make no whole triangles.
    """
    if mode == TRIANGLES:
        if corners % 3:
            raise GltfError(f"{corners} corners are no whole triangles", pointer=pointer)
        return corners // 3
    if corners < 3:
        raise GltfError(f"{corners} corners make no triangle", pointer=pointer)
    return corners - 2


def check_cost(
    document: Document,
    plans: Sequence[MeshPlan],
    size: int,
    faces_after: Callable[[int], int],
    limits: Limits,
    bytes_per_face: int = 0,
) -> None:
    """Check the number of refined faces, as of `faces_after` triangles, and their memory.

    `size` is the upload's in bytes; writing takes `bytes_per_face` in addition.

    Raises:
        LimitError: over `max_faces` or `max_memory_bytes`.
    """
    triangles = sum(mesh.faces for mesh in plans)
    faces = faces_after(triangles)
    check_limit("faces", faces, limits.max_faces, f"the refined file would have {faces} faces")
    growth = faces / max(triangles, 1)
    memory = predicted_memory(document, plans, size, growth) + faces * bytes_per_face
    check_memory(memory, limits)


def check_decoded(decoded: int, size: int, limits: Limits) -> None:
    """Check the bytes that decoding will take, in addition to an upload of `size`.

    Raises:
        LimitError: over `max_memory_bytes`.
    """
    check_memory(decoded + BYTES_PER_INPUT_BYTE * size, limits)


def check_memory(needed: int, limits: Limits) -> None:
    """Check the bytes that work will take. Raises LimitError."""
    check_limit("memory", needed, limits.max_memory_bytes, f"the work would take {needed} bytes")


def repeated_text(tree: dict[str, Any], document: Document) -> int:
    """Return the bytes of JSON that sharing an accessor multiplies.

    Each primitive gets accessors of its own, with the name and extras of the shared one.
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


def predicted_memory(
    document: Document, plans: Sequence[MeshPlan], size: int, growth: float
) -> int:
    """Return an upper bound of the peak memory in bytes, where a face becomes ``growth`` faces."""
    total = BYTES_PER_INPUT_BYTE * size
    for mesh in plans:
        primitives = [document.meshes[mesh.mesh].primitives[number] for number in mesh.primitives]
        # A target of one primitive moves those of the others by 0.
        targets = max(len(primitive.targets) for primitive in primitives)
        sets = max(joint_sets(primitive.attributes) for primitive in primitives)
        for primitive in primitives:
            sizes = (element_size(document.accessors[index]) for _, index in primitive.named)
            # They are written at multiples of four bytes.
            width = sum(size + -size % 4 for size in sizes)
            still = targets - sum("POSITION" in target for target in primitive.targets)
            width += still * BYTES_PER_POSITION
            before = triangle_count(_corner_count(document, primitive), primitive.mode, "")
            faces = round(before * growth)
            total += BYTES_PER_PRIMITIVE + targets * BYTES_PER_TARGET
            total += faces * (BYTES_PER_FACE + BYTES_PER_VERTEX_BYTE * width)
            if targets or sets:
                count = document.accessors[primitive.attributes["POSITION"]].count
                following = _refined_vertices(before, min(count, 3 * before), growth)
                total += following * BYTES_PER_FOLLOWING_VERTEX * max(sets, 1)
    return total


def joint_sets(attributes: Iterable[str]) -> int:
    """Return the number of JOINTS_n among attributes."""
    return sum(name.startswith("JOINTS_") for name in attributes)


def _refined_vertices(faces: int, vertices: int, growth: float) -> int:
    """Return an upper bound of a mesh's vertices when it has grown, by Euler's formula.

    A closed mesh has 3/2 edges a face, and no mesh more than three.
    """
    inside = growth**0.5 - 1  # vertices on an edge
    edges = min(3 * faces, max(3 * faces // 2, vertices + faces))
    return round(vertices + inside * edges + inside * (inside - 1) / 2 * faces)


def _corner_count(document: Document, primitive: Primitive) -> int:
    index = primitive.indices
    if index is None:
        index = primitive.attributes["POSITION"]
    return document.accessors[index].count


def spare(
    document: Document,
    draco_views: Iterable[int],
    ranges: Iterable[tuple[int, int, int]],
    unknown: Iterable[str],
) -> Spare:
    """Return the data of a document's surfaces."""
    accessors: set[int] = set()
    for mesh in document.meshes:
        for primitive in mesh.primitives:
            if primitive.mode in SURFACES:
                accessors.update(index for _, index in primitive.named)
                others = {primitive.indices, primitive.outline}
                accessors.update(index for index in others if index is not None)
    views = set(draco_views)
    for index in accessors:
        if index < len(document.accessors):
            accessor = document.accessors[index]
            views |= set() if accessor.buffer_view is None else {accessor.buffer_view}
            if accessor.sparse is not None:
                views |= {accessor.sparse.indices.buffer_view, accessor.sparse.values.buffer_view}
    return Spare(
        frozenset(accessors),
        frozenset(views),
        len(document.accessors),
        len(document.buffer_views),
        tuple(ranges),
        tuple(unknown),
    )
