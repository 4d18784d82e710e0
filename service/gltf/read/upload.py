"""From bytes to a document that has been checked from end to end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from ...bodies.sibling_files import ALONE, Opened, SiblingFiles
from ...options import BYTES_PER_INPUT_BYTE, Limits
from ...report import Change
from .buffers import resolve_buffers
from .checks.breaches import breaches
from .checks.nodes import check_nodes
from .checks.references import check_references
from .checks.refusals import refuse_features, refuse_version
from .compressed.draco import decode_primitives
from .compressed.meshopt import decode_views
from .container import Container, read_container
from .images import embed_images
from .index_references import unknown_extensions
from .json_text import decode_object, decoded_size
from .plan import MeshPlan, check_cost, plan, repeated_text
from .schema import Document, view
from .spare import Spare, spare
from .vertex_numbers import leave_out_vertex_numbers
from .whole_numbers import lenient_view

Media = Literal["glb", "gltf"]


@dataclass(frozen=True, eq=False)
class Upload:
    """A file that may be refined.

    Attributes:
        container: the GLB's chunks; of a .gltf the text alone.
        tree: the JSON, which may be edited.
        document: a typed view of the JSON as it came.
        buffers: the bytes of each buffer.
        plans: the meshes to refine.
        changes: what was joined and decoded on the way.
        spare: what may leave the file once the meshes have been refined.
    """

    container: Container
    tree: dict[str, Any]
    document: Document
    buffers: list[memoryview]
    plans: list[MeshPlan]
    changes: list[Change]
    spare: Spare


def read_upload(
    data: bytes,
    media: Media,
    levels: int,
    limits: Limits,
    siblings: SiblingFiles = ALONE,
    bytes_per_face: int = 0,
) -> Upload:
    """Check a file in the order in which its parts lean on each other; refine nothing yet.

    `bytes_per_face` is what writing takes for each refined face, beside refining.

    Raises:
        ServiceError: the file is unreadable, wrong, over a limit, or cannot be refined yet.
    """
    container = read_container(data, media)
    tree = decode_object(container.text, limits)
    refuse_version(tree)
    document, changes = lenient_view(tree)
    opened = Opened(siblings)
    buffers = resolve_buffers(document, container.binary, opened)
    original = document
    stored, files = len(buffers), sum(len(buffer) > 0 for buffer in buffers)
    images = embed_images(tree, document, buffers, opened)
    size = len(data) + opened.size
    ranges = decode_views(tree, document, buffers, size, limits)
    if ranges or len(buffers) > stored:
        document = view(tree)
    check_references(document, buffers)
    repeated = repeated_text(tree, document)
    draco_views = decode_primitives(tree, document, buffers, size, limits)
    if draco_views:
        document = view(tree)
        check_references(document, buffers)
    numbered = leave_out_vertex_numbers(tree)
    unknown = unknown_extensions(tree, container.text)
    changes += _changes_of_buffers(tree.get("buffers", [])[:stored], files, unknown)
    changes += numbered
    changes += [
        Change(pointer, what, count)
        for pointer, what, count in (
            ("/bufferViews", "meshopt compression decoded", len(ranges)),
            ("/meshes", "Draco compression decoded", len(draco_views)),
        )
        if count
    ]
    changes += images
    if container.tail:
        changes.append(Change("", "bytes behind the GLB left out", container.tail))
    changes += [Change("", f"not used by the document: {name}", 1) for name in opened.unused]
    changes += check_nodes(document)
    changes += breaches(document)
    refuse_features(document)
    plans = plan(document)
    size += sum(len(buffer) for buffer in buffers[stored:])
    size += repeated + decoded_size(container.text) // BYTES_PER_INPUT_BYTE
    check_cost(document, plans, size, levels, limits, bytes_per_face)
    leavable = spare(original, draco_views, ranges, unknown)
    return Upload(container, tree, document, buffers, plans, changes, leavable)


def _changes_of_buffers(
    entries: Sequence[dict[str, Any]], files: int, unknown: Sequence[str]
) -> list[Change]:
    """Return that so many buffers become the first, and what goes with the others."""
    changes = [Change("/buffers", "joined into one", files)] if files > 1 else []
    if changes and unknown:
        names = ", ".join(unknown)
        changes.append(Change("/buffers", f"joined: {names} may name them by number", files))
    for number, entry in enumerate(entries[1:], 1):
        lost = sorted(entry.keys() - {"uri", "byteLength"})
        if lost:
            what = f"left out, since buffers are one: {', '.join(lost)}"
            changes.append(Change(f"/buffers/{number}", what, 1))
    return changes
