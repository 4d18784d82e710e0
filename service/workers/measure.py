"""A glance at a document: how many faces it asks for, in how many primitives, and what they carry.

It reads counts and builds nothing else. The limits are checked by the job itself, on the document
as it really is.
"""

from __future__ import annotations

from itertools import chain

import msgspec

from ..bodies.media import Kind
from ..errors import ServiceError
from ..gltf.constants import SURFACES, TRIANGLES
from ..gltf.read.container import BOM, check_size, json_items, read_container
from ..gltf.read.plan import joint_sets
from ..meshfiles.counted import count_triangles
from ..options import Limits
from .costs import Cost, cost_of

# Position, normal, tangent, texture coordinates: what a face costs was measured with them.
USUAL_ATTRIBUTES = 4

# An array of values costs as many of them before the first.
LEAST_VALUES = 1_000
# A further set of joints costs as many other attributes: each vertex mixes all of its neighbours'.
VALUES_PER_FURTHER_SET = 100
# One that another primitive of its mesh has, and that is of zeros here.
VALUES_PER_EMPTY_SET = 4
# Of a sparse accessor all places are gone through each time it is read: forty cost as a value.
PLACES_PER_VALUE = 40
# Larger counts cost as this one: no file that is read has more of anything.
LARGEST_COUNT = 2**40


class _Sparse(msgspec.Struct):
    count: int = 0


class _Accessor(msgspec.Struct):
    count: int = 0
    sparse: _Sparse | None = None


class _Primitive(msgspec.Struct):
    attributes: dict[str, int] = {}
    indices: int | None = None
    mode: int = TRIANGLES
    targets: list[dict[str, int]] = []


class _Mesh(msgspec.Struct):
    primitives: list[_Primitive] = []


class _Counts(msgspec.Struct):
    """The few things of a document that say how large it is."""

    accessors: list[_Accessor] = []
    meshes: list[_Mesh] = []


def cost_of_gltf(
    data: bytes, kind: Kind, levels: int, limits: Limits, learned_levels: int = 0
) -> Cost:
    """Return the cost of a .glb or .gltf; a model acts at the first `learned_levels`.

    One that cannot be read, or is over a limit, is refused as soon as a worker looks at it: it
    costs no more than its bytes.
    """
    try:
        text = read_container(data, kind).text
        check_size(text, limits)
        # Not strictly: integers that are written with a fraction are read (whole_numbers.py).
        counts = msgspec.json.decode(text.removeprefix(BOM), type=_Counts, strict=False)
    except (ServiceError, msgspec.DecodeError, ValueError):
        return cost_of(0, 0, len(data))
    faces, primitives, values = 0, 0, 0
    for mesh in counts.meshes:
        # What moves the vertices of one primitive moves all of a mesh's, those of others by 0.
        targets = max((len(primitive.targets) for primitive in mesh.primitives), default=0)
        sets = max((joint_sets(primitive.attributes) for primitive in mesh.primitives), default=0)
        for primitive in mesh.primitives:
            triangles = _triangles(primitive, counts.accessors)
            faces += triangles
            primitives += triangles > 0
            unusual = _unusual(primitive, targets, sets)
            values += max(triangles * 4**levels, LEAST_VALUES) * unusual
            values += _places(primitive, counts.accessors) // PLACES_PER_VALUE
    refined = faces * 4**levels
    if refined > limits.max_faces:
        return cost_of(0, 0, len(data))
    learned = _learned(faces, levels, learned_levels)
    return cost_of(refined, primitives, len(data), learned, values, json_items(text))


def cost_of_other(
    data: bytes, kind: str, levels: int, limits: Limits, learned_levels: int = 0
) -> Cost:
    """Return the cost of a file of another kind, as if it were within the limits."""
    before = min(count_triangles(data, kind), limits.max_faces // 4**levels)
    return cost_of(before * 4**levels, 1, len(data), _learned(before, levels, learned_levels))


def _learned(faces: int, levels: int, learned_levels: int) -> int:
    return faces * 4 ** min(levels, learned_levels) if learned_levels else 0


def _unusual(primitive: _Primitive, targets: int, sets: int) -> int:
    """Count the attributes beside the usual ones that follow its vertices.

    Morph targets' too: each has positions, of zeros where it names none.
    """
    own = joint_sets(primitive.attributes)
    further = max(len(primitive.attributes) - USUAL_ATTRIBUTES, 0)
    further += max(own - 1, 0) * VALUES_PER_FURTHER_SET + (sets - own) * VALUES_PER_EMPTY_SET
    further += sum(len(target.keys() - {"POSITION"}) for target in primitive.targets)
    return further + targets


def _places(primitive: _Primitive, accessors: list[_Accessor]) -> int:
    """Count the places of the sparse accessors that it names, as often as it does."""
    named = chain(primitive.attributes.values(), *(t.values() for t in primitive.targets))
    sparse = (accessors[index].sparse for index in named if 0 <= index < len(accessors))
    return sum(_bounded(part.count) for part in sparse if part is not None)


def _bounded(count: int) -> int:
    """Clamp a count from a document, which may have thousands of digits."""
    return min(max(count, 0), LARGEST_COUNT)


def _triangles(primitive: _Primitive, accessors: list[_Accessor]) -> int:
    """Return the triangles that a primitive says it has; 0 where it makes no sense."""
    index = primitive.indices
    if index is None:
        index = primitive.attributes.get("POSITION", -1)
    if not 0 <= index < len(accessors):
        return 0
    corners = _bounded(accessors[index].count)
    if primitive.mode == TRIANGLES:
        return corners // 3
    return max(corners - 2, 0) if primitive.mode in SURFACES else 0
