"""From bytes to a document that has been checked from end to end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from service.gltf.buffers import resolve_buffers
from service.gltf.container import Container, read_glb
from service.gltf.json_text import decode_object
from service.gltf.nodes import check_nodes
from service.gltf.plan import MeshPlan, check_cost, plan
from service.gltf.references import check_references
from service.gltf.refusals import refuse_compression, refuse_features
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
    """

    container: Container
    tree: dict[str, Any]
    document: Document
    buffers: list[memoryview]
    plans: list[MeshPlan]


def read_upload(data: bytes, media: Media, levels: int, limits: Limits) -> Upload:
    """Check a file in the order in which its parts lean on each other; decode no geometry yet.

    Raises:
        ServiceError: the file is unreadable, wrong, over a limit, or cannot be refined yet.
    """
    container = read_glb(data) if media == "glb" else Container(text=data)
    tree = decode_object(container.text, limits)
    document = view(tree)
    refuse_compression(document)
    buffers = resolve_buffers(document, container.binary)
    check_references(document, buffers)
    check_nodes(document)
    refuse_features(document)
    plans = plan(document)
    check_cost(document, plans, len(data), levels, limits)
    return Upload(container, tree, document, buffers, plans)
