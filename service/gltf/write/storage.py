"""What is written otherwise than it was stored: sparse, quantised, strips and fans; what goes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from ...report import Change
from ..constants import FLOAT
from ..read.extensions import withdraw
from ..read.modes import FAN, STRIP
from ..read.plan import MeshPlan
from ..read.quantization import EXTENSION, is_dequantised, still_needed
from ..read.schema import Document, Mesh, Primitive
from ..read.spare import Spare
from .writer import Writer

_MODES = {STRIP: "triangle strip written as triangles", FAN: "triangle fan written as triangles"}


def storage_changes(document: Document, plans: Sequence[MeshPlan]) -> list[Change]:
    """Return one change for each primitive and way of storing that refinement gives up.

    Points and lines of a mesh that is refined stay where its surface was: that is told too.
    """
    return [
        change for plan in plans for change in _of_mesh(document.meshes[plan.mesh], plan, document)
    ]


def remove_replaced(writer: Writer, spare: Spare) -> list[Change]:
    """Let the geometry that was replaced leave the file, unless something may still point at it."""
    if not spare.unknown:
        writer.remove(spare)
        return []
    names = ", ".join(spare.unknown)
    return [Change("/bufferViews", f"replaced geometry kept: {names} may refer to it", 1)]


def withdraw_unused(tree: dict[str, Any]) -> None:
    """Take KHR_mesh_quantization off the lists where no primitive of the new file needs it."""
    if not still_needed(tree):
        withdraw(tree, EXTENSION)


def _of_mesh(mesh: Mesh, plan: MeshPlan, document: Document) -> Iterator[Change]:
    pointer = f"/meshes/{plan.mesh}"
    for number in plan.primitives:
        yield from _of_primitive(
            document, mesh.primitives[number], f"{pointer}/primitives/{number}"
        )
    if others := len(mesh.primitives) - len(plan.primitives):
        yield Change(
            pointer, "points and lines left where they were, beside what is refined", others
        )


def _of_primitive(document: Document, primitive: Primitive, pointer: str) -> Iterator[Change]:
    accessors = document.accessors
    if primitive.mode in _MODES:
        yield Change(f"{pointer}/mode", _MODES[primitive.mode], 1)
    indices = [] if primitive.indices is None else [primitive.indices]
    stored = [*indices, *(index for _, index in primitive.named)]
    # Those of morph targets stay sparse where that is smaller.
    dense = [*indices, *primitive.attributes.values()]
    sparse = sum(accessors[index].sparse is not None for index in dense)
    if sparse:
        yield Change(pointer, "sparse accessors written dense", sparse)
    quantised = sum(
        is_dequantised(name) and accessors[index].component_type != FLOAT
        for name, index in primitive.named
    )
    if quantised:
        yield Change(pointer, "quantised attributes written as float32", quantised)
    # What they say may hold for the elements that were replaced alone, or name their bytes.
    lost = sorted({name for index in stored for name in accessors[index].extensions})
    if lost:
        what = f"left out with the accessors that had them: {', '.join(lost)}"
        yield Change(pointer, what, sum(bool(accessors[index].extensions) for index in stored))
