"""Refined polygons as a GLB: triangles that FB_ngon_encoding says how to join again."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np
from jaxtyping import Int

from ..bodies.sibling_files import SiblingFiles
from ..course import Course
from ..gltf.read.container import write_glb
from ..gltf.read.json_text import encode
from ..gltf.read.primitives import read_primitive
from ..gltf.read.upload import read_upload
from ..gltf.refine.attributes import RefinedPrimitive
from ..gltf.write.compression import WRITERS
from ..gltf.write.storage import (
    leave_out_ngons,
    put_report,
    remove_replaced,
    withdraw_unused,
)
from ..options import Limits, Options
from .mesh_file import MATERIAL, Labels, Layer, MeshFile
from .to_gltf import as_gltf
from .triangulate import triangulated

# Which corners of a quad its two triangles have, by the corner that both begin with.
FANS = np.array([[k, (k + 1) % 4, (k + 2) % 4, k, (k + 2) % 4, (k + 3) % 4] for k in range(4)])


def polygons_glb(
    mesh: MeshFile,
    report: dict[str, Any],
    options: Options,
    limits: Limits,
    siblings: SiblingFiles,
) -> tuple[bytes, dict[str, Any]]:
    """Write refined polygons; return also the report, with what is lost.

    Quads are marked as such. Where others are among them, all are cut into triangles.

    Raises:
        UnrefinableError: a position that float32 cannot hold.
    """
    alike = bool((mesh.sizes == 4).all())
    triangles = _as_triangles(mesh) if alike else triangulated(mesh)
    every = replace(options, material=None, group=None)
    sent = as_gltf(triangles, siblings, every, ngons=alike)
    upload = read_upload(sent.data, "glb", 0, limits, sent.siblings)
    writer = WRITERS[options.compress].start(upload.tree, upload.buffers)
    # The first corner of a triangle counts.
    writer.in_order = True
    if options.compress != "none":
        (plan,) = upload.plans
        parts = [read_primitive(upload.document, upload.buffers, 0, n) for n in plan.primitives]
        made = [RefinedPrimitive(p, p.corners, p.attributes, []) for p in parts]
        writer.replace_mesh(0, made, Course())
    changes = [*sent.losses, *upload.changes, *remove_replaced(writer, upload.spare)]
    changes += writer.changes()
    primitives = upload.tree["meshes"][0]["primitives"]
    if options.compress == "draco" and alike:
        # It orders triangles anew.
        changes += leave_out_ngons(upload.tree, 0, range(len(primitives)))
        withdraw_unused(upload.tree)
    totals = report["totals"] | {"primitives": len(primitives)}
    report = report | {
        "totals": totals,
        "changes": [*report["changes"], *(asdict(change) for change in changes)],
    }
    if options.diagnostics != "none":
        put_report(upload.tree, report)
    pieces = writer.finish()
    return write_glb(encode(upload.tree), pieces, upload.container.others), report


def _as_triangles(mesh: MeshFile) -> MeshFile:
    """Return quads as triangles, those of a material together, as FB_ngon_encoding asks for.

    Triangles of one quad begin with one vertex, and those of the next with another.
    """
    materials = mesh.labels.get(MATERIAL)
    order = np.arange(len(mesh.sizes))
    if materials is not None:
        order = np.argsort(materials.of_face, kind="stable")
    begin = _beginnings(mesh.corners.reshape(-1, 4)[order])
    places = (4 * order[:, None] + FANS[begin]).reshape(-1)
    faces = np.repeat(order, 2)
    return replace(
        mesh,
        offsets=np.arange(0, len(places) + 1, 3),
        corners=mesh.corners[places],
        layers={name: Layer(own.values, own.rows[places]) for name, own in mesh.layers.items()},
        face_values={name: values[faces] for name, values in mesh.face_values.items()},
        labels={kind: Labels(own.names, own.of_face[faces]) for kind, own in mesh.labels.items()},
    )


def _beginnings(quads: Int[np.ndarray, "F 4"]) -> Int[np.ndarray, " F"]:
    """Return a corner of each quad, none at the vertex of the one before it."""
    begin = np.zeros(len(quads), dtype=np.int64)
    rows = np.arange(len(quads))
    while True:
        first = quads[rows, begin]
        alike = np.flatnonzero(first[1:] == first[:-1]) + 1
        if not len(alike):
            return begin
        # Every second of a run: those beside it stay.
        turned = alike[np.append(True, np.diff(alike) > 1)]
        begin[turned] = (begin[turned] + 1) % 4
