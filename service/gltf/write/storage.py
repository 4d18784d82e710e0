"""Changes of storage to report, the report in the file, and meshes that share geometry."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Shaped

from pns_common.schemes.matrix import SubdivisionMatrix

from ...changes import Change, counted
from ..constants import FAN, FLOAT, NGONS, OUTLINE, STRIP, SURFACES
from ..read.accessors import QUANTIZATION, is_dequantised, still_needed
from ..read.extensions import drop, withdraw
from ..read.plan import MeshPlan, Spare
from ..read.schema import Document, Mesh, Primitive
from ..refine.batch import MeshOutcome
from .writer import Writer

# The report is `asset.extras.pns`. Extras may be any JSON value; one that is no object moves to
# `asset.extras.extras`.
REPORT_KEY, OLD_VALUE_KEY = "pns", "extras"

_MODES = {STRIP: "strip", FAN: "fan"}

Arrays = dict[str, Shaped[np.ndarray, "..."]]


def storage_changes(document: Document, plans: Sequence[MeshPlan]) -> list[Change]:
    """Return a change for each primitive and form of storage that refinement replaces.

    Points and lines of a refined mesh stay where they were, which is a change too.
    """
    return [
        change for plan in plans for change in _of_mesh(document.meshes[plan.mesh], plan, document)
    ]


def remove_replaced(writer: Writer, spare: Spare) -> list[Change]:
    """Remove replaced geometry, unless unknown extensions may refer to it; return the change."""
    if not spare.unknown:
        writer.remove(spare)
        return []
    names = ", ".join(spare.unknown)
    return [Change("/bufferViews", "geometry-kept", 1, (names,))]


def withdraw_unused(tree: dict[str, Any]) -> None:
    """Withdraw extensions that no primitive of the new file needs any more."""
    if not still_needed(tree):
        withdraw(tree, QUANTIZATION)
    primitives = (p for mesh in tree.get("meshes", []) for p in mesh.get("primitives", []))
    named = {name for primitive in primitives for name in primitive.get("extensions", {})}
    for name in {NGONS, OUTLINE} - named:
        withdraw(tree, name)


def leave_out_ngons(tree: dict[str, Any], mesh: int, numbers: Iterable[int]) -> list[Change]:
    """Leave FB_ngon_encoding out of primitives of a mesh whose triangles it no longer joins."""
    changes: list[Change] = []
    for number in numbers:
        primitive = tree["meshes"][mesh]["primitives"][number]
        if NGONS in primitive.get("extensions", {}):
            drop(primitive, NGONS)
            pointer = f"/meshes/{mesh}/primitives/{number}"
            changes.append(Change(pointer, "ngons-replaced", 1, (NGONS,)))
    return changes


def _of_mesh(mesh: Mesh, plan: MeshPlan, document: Document) -> Iterator[Change]:
    pointer = f"/meshes/{plan.mesh}"
    for number in plan.primitives:
        yield from _of_primitive(
            document, mesh.primitives[number], f"{pointer}/primitives/{number}"
        )
    yield from counted({"lines-left": len(mesh.primitives) - len(plan.primitives)}, pointer)


def _of_primitive(document: Document, primitive: Primitive, pointer: str) -> Iterator[Change]:
    accessors = document.accessors
    if primitive.mode in _MODES:
        yield Change(f"{pointer}/mode", _MODES[primitive.mode], 1)
    indices = [] if primitive.indices is None else [primitive.indices]
    stored = [*indices, *(index for _, index in primitive.named)]
    # Morph targets may stay sparse.
    dense = [*indices, *primitive.attributes.values()]
    sparse = sum(accessors[index].sparse is not None for index in dense)
    quantised = sum(
        is_dequantised(name) and accessors[index].component_type != FLOAT
        for name, index in primitive.named
    )
    yield from counted({"sparse": sparse, "quantised": quantised}, pointer)
    # Extensions of accessors may describe the replaced elements or name their bytes.
    lost = sorted({name for index in stored for name in accessors[index].extensions})
    if lost:
        count = sum(bool(accessors[index].extensions) for index in stored)
        yield Change(pointer, "accessors-extended", count, (", ".join(lost),))


def replaces_extras(tree: dict[str, Any]) -> bool:
    """Return whether `asset.extras` is no object, so that its value must move."""
    return not isinstance(tree["asset"].get("extras", {}), dict)


def put_report(tree: dict[str, Any], report: dict[str, Any]) -> None:
    """Write the report into the tree; other keys of `asset.extras` are kept."""
    asset = tree["asset"]
    if replaces_extras(tree):
        asset["extras"] = {OLD_VALUE_KEY: asset["extras"]}
    asset.setdefault("extras", {})[REPORT_KEY] = report


def same_geometry(document: Document, meshes: Iterable[int]) -> dict[int, list[int]]:
    """Group meshes with the same accessors, as copies in other materials have: first, others."""
    alike: defaultdict[Hashable, list[int]] = defaultdict(list)
    for mesh in meshes:
        primitives = document.meshes[mesh].primitives
        alike[tuple(_geometry(p) if p.mode in SURFACES else None for p in primitives)].append(mesh)
    return {first: later for first, *later in alike.values()}


def _geometry(primitive: Primitive) -> Hashable:
    targets = tuple(tuple(target.items()) for target in primitive.targets)
    attributes = tuple(primitive.attributes.items())
    return primitive.mode, primitive.indices, attributes, targets, primitive.outline


def matrix_arrays(parents: SubdivisionMatrix, under: str = "") -> Arrays:
    """Return a matrix as `scipy.sparse.load_npz` reads it, with `under` before each name."""
    parts = {
        "format": np.array(b"csr"),
        "shape": np.array(parents.shape),
        "data": parents.weights,
        "indices": parents.columns,
        "indptr": parents.starts,
    }
    return {f"{under}{name}": values for name, values in parts.items()}


def parents_of_mesh(document: Document, mesh: MeshOutcome) -> Arrays:
    """Return a matrix for each refined primitive of a mesh that was traced.

    A row is a vertex written. Columns are the elements of the POSITION accessors of all primitives
    of the mesh, one primitive after the other; `offsets` says where those of each begin.
    """
    counts = [
        document.accessors[primitive.attributes["POSITION"]].count
        if "POSITION" in primitive.attributes
        else 0
        for primitive in document.meshes[mesh.index].primitives
    ]
    offsets = np.cumsum([0, *counts])
    arrays = {f"meshes/{mesh.index}/offsets": offsets}
    if mesh.parents is None:
        return arrays
    elements = np.concatenate([own.rows + offsets[own.number] for own in mesh.primitives])
    for refined in mesh.refined:
        if refined.vertex is None:
            raise ValueError("a mesh of a union is not traced")
        own = mesh.parents.take(refined.vertex)
        own = replace(own, columns=elements[own.columns], shape=(own.shape[0], int(offsets[-1])))
        under = f"meshes/{mesh.index}/primitives/{refined.source.number}/"
        arrays |= matrix_arrays(own, under)
    return arrays
