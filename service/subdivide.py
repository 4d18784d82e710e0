"""A glTF file in, a refined GLB and its report out: a function of bytes and options alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from pns_common.schemes import Model, Scheme, loop, pns
from service.errors import NoModelError
from service.gltf.charts import uv_blend
from service.gltf.container import write_glb
from service.gltf.control_mesh import control_mesh
from service.gltf.extras import put_report, replaces_extras
from service.gltf.json_text import encode
from service.gltf.lattice import lattice
from service.gltf.neighbours import ALONE, Neighbours
from service.gltf.nodes import mesh_instances
from service.gltf.packing import BYTES_PER_FACE, WRITERS
from service.gltf.plan import MeshPlan
from service.gltf.primitives import read_primitive
from service.gltf.refinement import changes_of_mesh, refine_control_mesh
from service.gltf.report import Change, MeshResult, build_report
from service.gltf.share import RefinedPrimitive, share
from service.gltf.storage import remove_replaced, storage_changes, withdraw_unused
from service.gltf.unused import VertexUse
from service.gltf.upload import Media, Upload, read_upload
from service.options import Limits, Options
from service.stopwatch import Stopwatch

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Subdivided:
    """A refined file.

    Attributes:
        glb: the file, with the report in it unless diagnostics were not wanted.
        report: the report.
        timings: seconds by stage (read, weld, refine, attributes, write).
    """

    glb: bytes
    report: dict[str, Any]
    timings: dict[str, float]


def subdivide_gltf(
    data: bytes,
    media: Media,
    options: Options,
    model: Model | None,
    limits: Limits,
    progress: Progress | None = None,
    clock: Stopwatch | None = None,
    neighbours: Neighbours = ALONE,
) -> Subdivided:
    """Refine every triangle mesh of a glTF file.

    `progress` is called with (faces made so far, faces made in the end); `clock` is told where
    each stage ends. `neighbours` are the files that the document may name.

    Raises:
        ServiceError: the upload is unreadable, wrong, over a limit, or cannot be refined yet.
        pns_common.errors.ModelError: the model answered with something that is no correction.
    """
    clock = Stopwatch() if clock is None else clock
    scheme = make_scheme(options, model)
    packing = BYTES_PER_FACE[options.compress]
    upload = read_upload(data, media, options.levels, limits, neighbours, packing)
    instances = mesh_instances(upload.document)
    changes = _changes_of_container(upload, options)
    changes += upload.changes + storage_changes(upload.document, upload.plans)
    writer = WRITERS[options.compress].start(upload.tree, upload.buffers)
    clock.lap("read")

    results: list[MeshResult] = []
    vertices = VertexUse(upload.document)
    for mesh, mesh_progress in zip(upload.plans, _by_mesh(upload.plans, progress), strict=True):
        primitives = [
            read_primitive(upload.document, upload.buffers, mesh.mesh, number)
            for number in mesh.primitives
        ]
        clock.lap("read")
        control = control_mesh(primitives, options.weld_tolerance, options.weld_unit)
        clock.lap("weld")
        pointer = f"/meshes/{mesh.mesh}"
        made = refine_control_mesh(control, scheme, options, pointer, mesh_progress)
        clock.lap("refine")
        refined: list[RefinedPrimitive] = []
        if made is not None and control.cleaned is not None:
            refined = share(
                control, control.cleaned, made, lattice(options.levels), uv_blend(options)
            )
        clock.lap("attributes")
        writer.replace_mesh(mesh.mesh, refined)
        vertices.add(mesh.mesh, control)
        clock.lap("write")
        changes += changes_of_mesh(control, made, pointer)
        results.append(
            MeshResult(
                index=mesh.mesh,
                instances=instances[mesh.mesh],
                primitives=len(refined),
                vertices=sum(len(p.attributes["POSITION"]) for p in refined),
                faces=sum(len(p.faces) for p in refined),
                degenerate=control.degenerate,
                copies=control.copies,
                report=None if made is None else made.refinement.report,
            )
        )

    withdraw_unused(upload.tree)
    changes += remove_replaced(writer, upload.spare) + writer.changes()
    report = build_report(scheme, options.levels, results, vertices.unused(), changes)
    if options.diagnostics != "none":
        put_report(upload.tree, report)
    pieces = writer.finish()
    glb = write_glb(encode(upload.tree), pieces, upload.container.others)
    clock.lap("write")
    return Subdivided(glb=glb, report=report, timings=clock.seconds)


def make_scheme(options: Options, model: Model | None) -> Scheme:
    """The scheme that the options name.

    Raises:
        NoModelError: the learned scheme without a model.
    """
    if options.scheme == "loop":
        return loop()
    if model is None:
        raise NoModelError("no model is loaded; scheme=loop needs none")
    return pns(model, options.budget)


def _changes_of_container(upload: Upload, options: Options) -> list[Change]:
    changes: list[Change] = []
    if options.diagnostics != "none" and replaces_extras(upload.tree):
        changes.append(Change("/asset/extras", "moved to /asset/extras/extras", 1))
    return changes


def _by_mesh(plans: list[MeshPlan], progress: Progress | None) -> list[Progress | None]:
    """One callback for each mesh, that adds what the meshes before it have made."""
    if progress is None:
        return [None] * len(plans)
    faces = [mesh.faces for mesh in plans]
    return [
        partial(_report_progress, progress, sum(faces[:number]) / sum(faces), count / sum(faces))
        for number, count in enumerate(faces)
    ]


def _report_progress(
    progress: Progress, before: float, share_of_all: float, done: int, total: int
) -> None:
    progress(round(total * (before / share_of_all) + done), round(total / share_of_all))
