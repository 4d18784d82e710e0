"""A GLB's one mesh, block by block: checked as any document is, its bytes left in the file."""

from __future__ import annotations

import mmap
from pathlib import Path
from typing import Any

import numpy as np

from ...bodies.sibling_files import ALONE, Opened
from ...errors import ServiceError, UnreadableError
from ...gltf.constants import FLOAT
from ...gltf.read import container
from ...gltf.read.accessors import read
from ...gltf.read.buffers import resolve_buffers
from ...gltf.read.checks.references import check_references
from ...gltf.read.checks.refusals import refuse_version
from ...gltf.read.json_text import decode_object
from ...gltf.read.modes import TRIANGLES
from ...gltf.read.schema import Accessor, Document, Primitive
from ...gltf.read.whole_numbers import lenient_view
from ...options import Limits
from .arrays import blocks_of
from .sink import Sink

# Where a node puts its mesh, and its children, if it says nothing else.
_UNMOVED: dict[str, list[float]] = {
    "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
    "translation": [0, 0, 0],
    "rotation": [0, 0, 0, 1],
    "scale": [1, 1, 1],
}


def read_glb(path: Path, sink: Sink) -> None:
    """Read the triangles of a GLB's one mesh, in its own coordinates, uncompressed.

    Raises:
        UnreadableError: another file, one that breaks its own promises, or whose mesh is kept in
            another way.
    """
    try:
        tree, document, buffers = _checked(path)
    except ServiceError as error:
        raise UnreadableError(f"{path}: {error.detail}", pointer=error.pointer) from error
    if len(document.meshes) != 1:
        raise UnreadableError(f"{path}: it has {len(document.meshes)} meshes; only one is read")
    placed = sum(
        any(node.get(key, unmoved) != unmoved for key, unmoved in _UNMOVED.items())
        for node in tree.get("nodes", [])
    )
    if placed:
        sink.passed_over["transforms of nodes"] += placed
    for primitive in document.meshes[0].primitives:
        names = primitive.attributes.keys() - {"POSITION"}
        sink.passed_over.update(f"attribute {name}" for name in sorted(names))
        if primitive.targets:
            sink.passed_over["morph targets"] += len(primitive.targets)
        _read_primitive(path, document, buffers, primitive, sink)


def _checked(path: Path) -> tuple[dict[str, Any], Document, list[memoryview]]:
    """Return a document, its view and its buffers, which are pages of the file.

    Raises ServiceError.
    """
    with path.open("rb") as file:
        try:
            memory = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except ValueError as error:
            raise UnreadableError("the file is empty") from error
    chunks = container.read_glb(memoryview(memory))
    tree = decode_object(chunks.text, Limits())
    refuse_version(tree)
    document, _ = lenient_view(tree)
    if any(part.extensions for part in document.buffer_views):
        raise UnreadableError("compressed buffer views are not read", pointer="/bufferViews")
    buffers = resolve_buffers(document, chunks.binary, Opened(ALONE))
    check_references(document, buffers)
    return tree, document, buffers


def _read_primitive(
    path: Path,
    document: Document,
    buffers: list[memoryview],
    primitive: Primitive,
    sink: Sink,
) -> None:
    position, indices = primitive.attributes.get("POSITION"), primitive.indices
    stored = [document.accessors[number] for number in (position, indices) if number is not None]
    if primitive.mode != TRIANGLES or position is None or not all(map(_is_plain, stored)):
        raise UnreadableError(f"{path}: only plain, uncompressed triangles are read")
    if (stored[0].component_type, stored[0].type) != (FLOAT, "VEC3"):
        raise UnreadableError(f"{path}: only positions in float32 are read")
    if stored[-1].count % 3:
        raise UnreadableError(f"{path}: {stored[-1].count} corners are no whole triangles")
    first, points = sink.vertices, read(document, buffers, position)
    for rows in blocks_of(len(points)):
        sink.add_vertices(points[rows])
    flat = np.arange(len(points)) if indices is None else read(document, buffers, indices)
    faces = flat.reshape(-1, 3)
    for rows in blocks_of(len(faces)):
        sink.add_faces(first + faces[rows].astype(np.int64))


def _is_plain(accessor: Accessor) -> bool:
    """Return whether all elements lie in a buffer, as they are."""
    return accessor.buffer_view is not None and accessor.sparse is None
