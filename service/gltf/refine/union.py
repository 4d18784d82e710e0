"""The disjoint union of meshes of one kind: as many primitives as one of them has, with all rows.

Primitive s of the union holds the rows and faces of primitive s of each mesh, in the order of the
meshes. So a mesh's own rows and faces keep the order among themselves that they have alone.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
from jaxtyping import Int, Shaped

from pns_common.connectivity.disjoint_union import disjoint_faces

from ..read.primitives import TrianglePrimitive
from ..read.schema import Accessor
from .parts import Parts
from .refined_primitives import RefinedPrimitive
from .skins import COLUMNS, skin_sets


def kind_of(primitives: Sequence[TrianglePrimitive]) -> Hashable | None:
    """Return what meshes have in common that may be joined; None for one that may not."""
    joints = {
        values.dtype
        for primitive in primitives
        for name, values in primitive.attributes.items()
        if name.startswith("JOINTS_")
    }
    # A joint of wide primitives may reach into narrow ones, and make those wide: in its mesh alone.
    if len(joints) > 1:
        return None
    return (
        _joint_blocks(primitives),
        *(
            (
                _signature(primitive.attributes, primitive.accessors),
                *map(_signature, primitive.targets, primitive.target_accessors),
            )
            for primitive in primitives
        ),
    )


def joined(meshes: Sequence[Sequence[TrianglePrimitive]]) -> tuple[list[TrianglePrimitive], Parts]:
    """Join the primitives; return also which rows and faces are whose."""
    numbers = np.arange(len(meshes))
    alike = list(zip(*meshes, strict=True))
    rows = [[len(p.attributes["POSITION"]) for p in own] for own in alike]
    faces = [[len(p.corners) for p in own] for own in alike]
    parts = Parts(
        of_row=np.concatenate([np.repeat(numbers, lengths) for lengths in rows]),
        of_face=np.concatenate([np.repeat(numbers, lengths) for lengths in faces]),
        count=len(meshes),
    )
    return [_joined(place, own) for place, own in enumerate(alike)], parts


def divided(
    refined: RefinedPrimitive, counts: Int[np.ndarray, " P"], sources: Sequence[TrianglePrimitive]
) -> list[RefinedPrimitive]:
    """Cut a refined primitive of the union into those of its parts, as each has them alone.

    `counts` are the refined faces of each part, `sources` its primitives before.
    """
    parts = np.arange(len(counts))
    part_of = np.empty(len(refined.attributes["POSITION"]), dtype=np.int64)
    part_of[refined.faces] = np.repeat(parts, counts)[:, None]
    order = np.argsort(part_of, kind="stable")
    starts = np.searchsorted(part_of[order], np.arange(len(counts) + 1))
    place = np.empty_like(order)
    place[order] = np.arange(len(order)) - starts[part_of[order]]
    faces = place[refined.faces]
    attributes, *targets = (
        {name: values[order] for name, values in columns.items()}
        for columns in (refined.attributes, *refined.targets)
    )
    ends = np.cumsum([0, *counts])
    return [
        RefinedPrimitive(
            source=source,
            faces=faces[ends[part] : ends[part + 1]],
            attributes=_rows(attributes, own),
            targets=[_rows(target, own) for target in targets],
        )
        for part, source in enumerate(sources)
        for own in [slice(starts[part], starts[part + 1])]
    ]


def _joined(place: int, primitives: Sequence[TrianglePrimitive]) -> TrianglePrimitive:
    first = primitives[0]
    counts = [len(primitive.attributes["POSITION"]) for primitive in primitives]
    faces = [primitive.corners for primitive in primitives]
    return TrianglePrimitive(
        number=place,
        rows=np.arange(sum(counts)),
        corners=disjoint_faces(zip(faces, counts, strict=True)),
        attributes=_concatenated([primitive.attributes for primitive in primitives]),
        accessors=first.accessors,
        targets=tuple(
            _concatenated(alike)
            for alike in zip(*(primitive.targets for primitive in primitives), strict=True)
        ),
        target_accessors=first.target_accessors,
    )


def _concatenated(
    columns: Sequence[dict[str, Shaped[np.ndarray, "N K"]]],
) -> dict[str, Shaped[np.ndarray, "M K"]]:
    return {name: np.concatenate([values[name] for values in columns]) for name in columns[0]}


def _rows(
    columns: dict[str, Shaped[np.ndarray, "N K"]], rows: slice
) -> dict[str, Shaped[np.ndarray, "M K"]]:
    return {name: values[rows] for name, values in columns.items()}


def _signature(
    attributes: dict[str, Shaped[np.ndarray, "N K"]], accessors: dict[str, Accessor]
) -> Hashable:
    return tuple(
        (name, values.dtype.str, values.shape[1], accessors[name].normalized)
        for name, values in attributes.items()
    )


def _joint_blocks(primitives: Sequence[TrianglePrimitive]) -> int:
    """Return how many blocks of joints a mesh is refined in, to a factor of two: 0 without a skin.

    Meshes of few joints do not wait for the blocks of one that has many.
    """
    named = [
        primitive.attributes[f"JOINTS_{number}"].reshape(-1)
        for primitive in primitives
        for number in skin_sets(primitive)
    ]
    return (-(-len(np.unique(np.concatenate(named))) // COLUMNS)).bit_length() if named else 0
