"""Read an upload: bytes become a fully checked document; or the names of the files it needs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from ...bodies.media import GLTF_KINDS
from ...bodies.sibling_files import ALONE, Opened, SiblingFiles, has_scheme
from ...changes import Change, counted
from ...errors import ServiceError
from ...options import BYTES_PER_INPUT_BYTE, Limits
from .checks import breaches, refuse_features, refuse_version
from .compressed import decode_primitives, decode_views
from .container import Container, decode_object, decoded_size, read_container
from .extensions import leave_out_vertex_numbers, unknown_extensions
from .plan import MeshPlan, Spare, check_cost, plan, repeated_text, spare
from .references import check_nodes, check_references
from .resources import embed_images, resolve_buffers
from .schema import Document, lenient_view, view

Media = Literal["glb", "gltf"]


@dataclass(frozen=True, eq=False)
class Upload:
    """A checked file.

    Attributes:
        container: the chunks of a GLB, or the text of a .gltf.
        tree: the JSON, to be edited.
        document: a typed view of the JSON before edits.
        buffers: the bytes of each buffer.
        plans: the meshes to refine.
        changes: data that was joined, decoded or left out.
        spare: data that may leave the file after refinement.
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
    faces_after: Callable[[int], int],
    limits: Limits,
    siblings: SiblingFiles = ALONE,
    bytes_per_face: int = 0,
) -> Upload:
    """Read and check a file, each part after those that it depends on.

    `faces_after` returns how many faces triangles become. Writing takes `bytes_per_face` for each
    of them, in addition to refining.

    Raises:
        ServiceError: the file is unreadable, invalid, over a limit, or cannot be refined.
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
    changes += counted({"meshopt-decoded": len(ranges)}, "/bufferViews")
    changes += counted({"draco-decoded": len(draco_views)}, "/meshes")
    changes += images
    told = {("unused-file", name): 1 for name in opened.unused}
    changes += counted({"bytes-behind": container.tail, **told})
    changes += check_nodes(document)
    changes += breaches(document)
    refuse_features(document)
    plans = plan(document)
    size += sum(len(buffer) for buffer in buffers[stored:])
    size += repeated + decoded_size(container.text) // BYTES_PER_INPUT_BYTE
    check_cost(document, plans, size, faces_after, limits, bytes_per_face)
    leavable = spare(original, draco_views, ranges, unknown)
    return Upload(container, tree, document, buffers, plans, changes, leavable)


def _changes_of_buffers(
    entries: Sequence[dict[str, Any]], files: int, unknown: Sequence[str]
) -> list[Change]:
    """Return the changes of joining buffers into one."""
    changes = [Change("/buffers", "buffers-joined", files)] if files > 1 else []
    if changes and unknown:
        names = ", ".join(unknown)
        changes.append(Change("/buffers", "buffers-numbered", files, (names,)))
    for number, entry in enumerate(entries[1:], 1):
        lost = sorted(entry.keys() - {"uri", "byteLength"})
        if lost:
            names = ", ".join(lost)
            changes.append(Change(f"/buffers/{number}", "buffer-properties", 1, (names,)))
    return changes


def named_files(data: bytes, kind: str, limits: Limits) -> list[str]:
    """Return the relative URIs of a document's buffers and images; none if it cannot be read."""
    if kind not in GLTF_KINDS:
        return []
    try:
        text = read_container(data, kind).text
        # Most documents name no file; an escape could spell the word.
        if b'"uri"' not in text and b"\\u" not in text:
            return []
        tree = decode_object(text, limits)
    except ServiceError:
        # Refining it will report the error.
        return []
    uris = (_uri(entry) for key in ("buffers", "images") for entry in _entries(tree.get(key)))
    return list(dict.fromkeys(uri for uri in uris if uri is not None and not has_scheme(uri)))


def _entries(values: Any) -> list[Any]:
    return values if isinstance(values, list) else []


def _uri(entry: Any) -> str | None:
    uri = entry.get("uri") if isinstance(entry, dict) else None
    return uri if isinstance(uri, str) else None
