"""A glTF file in, a refined GLB and its report out: a function of bytes and options alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

from pns_common.schemes import Model, Scheme, loop, pns

from ..bodies.sibling_files import ALONE, SiblingFiles
from ..course import Course
from ..errors import InvalidParameter, NoModelError
from ..options import Limits, Options
from ..report import Change, MeshResult, build_report
from .read.checks.nodes import mesh_instances
from .read.container import write_glb
from .read.extras import put_report, replaces_extras
from .read.json_text import encode
from .read.plan import BYTES_FOR_LIMIT, BYTES_FOR_NORMALS
from .read.upload import Media, Upload, read_upload
from .refine.meshes import refined_meshes
from .stage_shares import PUT_TOGETHER, READ
from .write.packing import BYTES_PER_FACE, WRITERS
from .write.same_geometry import same_geometry
from .write.storage import remove_replaced, storage_changes, withdraw_unused
from .write.unused import VertexUse


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
    course: Course | None = None,
    siblings: SiblingFiles = ALONE,
    losses: Sequence[Change] = (),
) -> Subdivided:
    """Refine every triangle mesh of a glTF file.

    `course` is told how far it is. `siblings` are the files that the document may name; `losses` is
    what it had already lost on its way to glTF, for the report.

    Raises:
        ServiceError: the upload is unreadable, wrong, over a limit, or cannot be refined yet.
        pns_common.errors.ModelError: the model answered with something that is no correction.
    """
    course = Course() if course is None else course
    with course.stage("read", 0.0, READ):
        scheme = make_scheme(options, model)
        packing = BYTES_PER_FACE[options.compress]
        if options.normals != "keep":
            packing += BYTES_FOR_NORMALS
        if options.limit:
            packing += BYTES_FOR_LIMIT
        upload = read_upload(data, media, options.levels, limits, siblings, packing)
        instances = mesh_instances(upload.document)
        changes = [*losses, *_changes_of_container(upload, options)]
        changes += upload.changes + storage_changes(upload.document, upload.plans)
        writer = WRITERS[options.compress].start(upload.tree, upload.buffers)

    outcomes: dict[int, tuple[MeshResult, list[Change]]] = {}
    vertices = VertexUse(upload.document)
    alike = same_geometry(upload.document, (plan.mesh for plan in upload.plans))
    firsts = [plan for plan in upload.plans if plan.mesh in alike]
    with course.part(READ, PUT_TOGETHER):
        for first in refined_meshes(upload, firsts, scheme, options, course):
            with course.stage("write"):
                written = writer.replace_mesh(first.index, first.refined, course)
                later = [first.of(mesh) for mesh in alike[first.index]]
                for mesh in later:
                    writer.repeat_mesh(mesh.index, first.index, mesh.refined)
                for mesh in (first, *later):
                    vertices.add(mesh.index, mesh.primitives, mesh.kept)
                    result = MeshResult(
                        index=mesh.index,
                        instances=instances[mesh.index],
                        primitives=len(mesh.refined),
                        vertices=written,
                        faces=sum(len(p.faces) for p in mesh.refined),
                        degenerate=mesh.degenerate,
                        copies=mesh.copies,
                        report=mesh.report,
                        bends=mesh.bends,
                    )
                    outcomes[mesh.index] = result, mesh.changes
    results, found = zip(*(outcomes[plan.mesh] for plan in upload.plans), strict=True)
    changes += chain.from_iterable(found)

    with course.stage("write", PUT_TOGETHER, 1.0):
        withdraw_unused(upload.tree)
        changes += remove_replaced(writer, upload.spare) + writer.changes()
        report = build_report(scheme, options.levels, results, vertices.unused(), changes)
        if options.diagnostics != "none":
            put_report(upload.tree, report)
        pieces = writer.finish()
        glb = write_glb(encode(upload.tree), pieces, upload.container.others)
    return Subdivided(glb=glb, report=report, timings=course.seconds)


def make_scheme(options: Options, model: Model | None) -> Scheme:
    """Make the scheme that the options name.

    Raises:
        NoModelError: the learned scheme without a model.
        InvalidParameter: a strength for the prior of a model that has none.
    """
    if options.scheme == "loop":
        return loop()
    if model is None:
        raise NoModelError("no model is loaded; scheme=loop needs none")
    strength = options.prior_strength
    if strength is not None and model.card.prior_strength is None:
        raise InvalidParameter(
            "prior_strength", f"the model {model.name} has no prior: leave prior_strength out"
        )
    return pns(model, options.budget, strength)


def _changes_of_container(upload: Upload, options: Options) -> list[Change]:
    changes: list[Change] = []
    if options.diagnostics != "none" and replaces_extras(upload.tree):
        changes.append(Change("/asset/extras", "moved to /asset/extras/extras", 1))
    return changes
