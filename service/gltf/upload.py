"""From bytes to a document that has been checked from end to end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from service.gltf.buffers import resolve_buffers
from service.gltf.container import Container, read_glb
from service.gltf.draco import decode_primitives
from service.gltf.images import embed_images
from service.gltf.index_references import unknown_extensions
from service.gltf.json_text import decode_object
from service.gltf.meshopt import decode_views
from service.gltf.neighbours import ALONE, Neighbours, Opened
from service.gltf.nodes import check_nodes
from service.gltf.plan import MeshPlan, check_cost, plan
from service.gltf.prune import Spare, spare
from service.gltf.references import check_references
from service.gltf.refusals import refuse_features, refuse_version
from service.gltf.report import Change
from service.gltf.schema import Document, view
from service.options import Limits

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
    neighbours: Neighbours = ALONE,
    bytes_per_face: int = 0,
) -> Upload:
    """Check a file in the order in which its parts lean on each other; refine nothing yet.

    `bytes_per_face` is what writing takes for each refined face, beside refining.

    Raises:
        ServiceError: the file is unreadable, wrong, over a limit, or cannot be refined yet.
    """
    container = read_glb(data) if media == "glb" else Container(text=data)
    tree = decode_object(container.text, limits)
    document = view(tree)
    refuse_version(document)
    opened = Opened(neighbours)
    buffers = resolve_buffers(document, container.binary, opened)
    original = document
    stored, files = len(buffers), sum(len(buffer) > 0 for buffer in buffers)
    images = embed_images(tree, document, buffers, opened)
    size = len(data) + opened.size
    ranges = decode_views(tree, document, buffers, size, limits)
    if ranges or len(buffers) > stored:
        document = view(tree)
    check_references(document, buffers)
    draco_views = decode_primitives(tree, document, buffers, size, limits)
    if draco_views:
        document = view(tree)
        check_references(document, buffers)
    changes = [
        Change(pointer, what, count)
        for pointer, what, count in (
            ("/buffers", "joined into one", files if files > 1 else 0),
            ("/bufferViews", "meshopt compression decoded", len(ranges)),
            ("/meshes", "Draco compression decoded", len(draco_views)),
        )
        if count
    ]
    changes += images
    changes += [Change("", f"not used by the document: {name}", 1) for name in opened.unused]
    check_nodes(document)
    refuse_features(document)
    plans = plan(document)
    size += sum(len(buffer) for buffer in buffers[stored:])
    check_cost(document, plans, size, levels, limits, bytes_per_face)
    leavable = spare(original, draco_views, ranges, unknown_extensions(tree, container.text))
    return Upload(container, tree, document, buffers, plans, changes, leavable)
