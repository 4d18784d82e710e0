"""Refine a glTF file: bytes and options in; a GLB, or refined primitives, and the report out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Any, Generic, TypeVar

from pns_common.model.session import Model
from pns_common.operator.scheme import Scheme, catmull_clark, named_scheme, pns

from ..bodies.sibling_files import ALONE, SiblingFiles
from ..changes import Change
from ..errors import InvalidParameter, NoModelError
from ..options import Limits, Options
from ..report import MeshResult, build_report
from ..stages import Stages
from .read.container import encode, write_glb
from .read.plan import BYTES_FOR_LIMIT, BYTES_FOR_NORMALS, check_cost
from .read.plan import BYTES_PER_FACE as BYTES_PER_FACE_OF_MESH
from .read.references import mesh_instances
from .read.upload import Media, Upload, read_upload
from .refine.attributes import RefinedPrimitive
from .refine.meshes import mostly_polygons, refined_meshes
from .write.compression import BYTES_PER_FACE, WRITERS
from .write.prune import VertexUse
from .write.storage import (
    Arrays,
    leave_out_ngons,
    parents_of_mesh,
    put_report,
    remove_replaced,
    replaces_extras,
    same_geometry,
    storage_changes,
    withdraw_unused,
)
from .write.writer import Writer

# Shares of a file's work: reading ends at the first, and writing the document begins at the second.
READ, PUT_TOGETHER = 0.03, 0.95


@dataclass(frozen=True)
class Subdivided:
    """A refined file.

    Attributes:
        glb: the file, with the report in it unless `diagnostics=none`.
        report: the report.
        timings: seconds by stage (read, weld, refine, attributes, write).
        faces_in: faces before refinement.
        parents: what each vertex is made of, as arrays of a file; none if not asked for.
    """

    glb: bytes
    report: dict[str, Any]
    timings: dict[str, float]
    faces_in: int
    parents: Arrays = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Gathered:
    """Refined primitives by mesh, for writers of other formats than glTF."""

    meshes: dict[int, Sequence[RefinedPrimitive]] = field(default_factory=dict)

    def replace_mesh(self, mesh: int, refined: Sequence[RefinedPrimitive], stages: Stages) -> int:
        """Keep the refined primitives of a mesh; return the number of their vertices."""
        self.meshes[mesh] = refined
        return sum(len(primitive.attributes["POSITION"]) for primitive in refined)

    def repeat_mesh(self, mesh: int, first: int, refined: Sequence[RefinedPrimitive]) -> None:
        """Keep the refined primitives of a mesh of the same geometry as an earlier one."""
        self.meshes[mesh] = refined


@dataclass(frozen=True, eq=False)
class RefinedScene:
    """A refined glTF that is not written.

    Attributes:
        upload: the file as it was read: nodes, materials, skins.
        meshes: its refined primitives by mesh.
        report: the report.
        faces_in: faces before refinement.
    """

    upload: Upload
    meshes: dict[int, Sequence[RefinedPrimitive]]
    report: dict[str, Any]
    faces_in: int


Into = TypeVar("Into", Writer, Gathered)


@dataclass(frozen=True, eq=False)
class _Refined(Generic[Into]):
    """A refined glTF before anything is written."""

    upload: Upload
    into: Into
    scheme: Scheme
    results: Sequence[MeshResult]
    unused: int
    changes: list[Change]
    parents: Arrays

    def report(self, levels: int, more: Sequence[Change] = ()) -> dict[str, Any]:
        changes = [*self.changes, *more]
        return build_report(self.scheme, levels, self.results, self.unused, changes)

    @property
    def faces_in(self) -> int:
        return sum(plan.faces for plan in self.upload.plans)


def subdivide_gltf(
    data: bytes,
    media: Media,
    options: Options,
    model: Model | None,
    limits: Limits,
    stages: Stages | None = None,
    siblings: SiblingFiles = ALONE,
    *,
    traced: bool = False,
) -> Subdivided:
    """Refine every triangle mesh of a glTF file.

    `stages` receives the progress. `siblings` are the files that the document may name. `traced`
    asks for the parents of vertices.

    Raises:
        ServiceError: the upload is unreadable, invalid, over a limit, or cannot be refined.
        pns_common.errors.ModelError: the model's answer is no correction.
    """
    stages = Stages() if stages is None else stages

    def start(upload: Upload) -> Writer:
        return WRITERS[options.compress].start(upload.tree, upload.buffers)

    asked = options, model, limits, stages, siblings
    made = _refined(data, media, *asked, start, traced=traced)
    upload, writer = made.upload, made.into
    with stages.stage("write", PUT_TOGETHER, 1.0):
        withdraw_unused(upload.tree)
        more = remove_replaced(writer, upload.spare) + writer.changes()
        report = made.report(options.levels, more)
        if options.diagnostics != "none":
            put_report(upload.tree, report)
        pieces = writer.finish()
        glb = write_glb(encode(upload.tree), pieces, upload.container.others)
    return Subdivided(glb, report, stages.seconds, made.faces_in, made.parents)


def refine_scene(
    data: bytes,
    media: Media,
    options: Options,
    model: Model | None,
    limits: Limits,
    stages: Stages,
    siblings: SiblingFiles,
    check: Callable[[Upload], object],
) -> RefinedScene:
    """Refine every triangle mesh of a glTF file for writers of other formats.

    `check` is called with what was read, before anything is refined; other arguments and errors
    are those of `subdivide_gltf`.
    """

    def start(upload: Upload) -> Gathered:
        check(upload)
        return Gathered()

    asked = options, model, limits, stages, siblings
    made = _refined(data, media, *asked, start, traced=False)
    report = made.report(options.levels)
    return RefinedScene(made.upload, made.into.meshes, report, made.faces_in)


def _refined(
    data: bytes,
    media: Media,
    options: Options,
    model: Model | None,
    limits: Limits,
    stages: Stages,
    siblings: SiblingFiles,
    start: Callable[[Upload], Into],
    *,
    traced: bool,
) -> _Refined[Into]:
    with stages.stage("read", 0.0, READ):
        scheme = make_scheme(options, model)
        packing = BYTES_PER_FACE[options.compress]
        if options.normals != "keep":
            packing += BYTES_FOR_NORMALS
        if options.limit:
            packing += BYTES_FOR_LIMIT
        upload = read_upload(data, media, options.faces_after, limits, siblings, packing)
        scheme = _for_polygons(upload, scheme, options)
        if scheme.base.polygons:
            # A triangle alone becomes six, where Loop's scheme makes four.
            more = packing + (BYTES_PER_FACE_OF_MESH + packing) // 2
            after = options.faces_after
            check_cost(upload.document, upload.plans, len(data), after, limits, more)
        instances = mesh_instances(upload.document)
        changes = _changes_of_container(upload, options)
        changes += upload.changes + storage_changes(upload.document, upload.plans)
        into = start(upload)

    outcomes: dict[int, tuple[MeshResult, list[Change]]] = {}
    vertices = VertexUse(upload.document)
    alike = same_geometry(upload.document, (plan.mesh for plan in upload.plans))
    if options.selects:
        alike = {plan.mesh: list[int]() for plan in upload.plans}
    firsts = [plan for plan in upload.plans if plan.mesh in alike]
    parents: Arrays = {}
    with stages.part(READ, PUT_TOGETHER):
        for first in refined_meshes(upload, firsts, scheme, options, stages, limits, traced=traced):
            with stages.stage("write"):
                written = into.replace_mesh(first.index, first.refined, stages)
                later = [first.of(mesh) for mesh in alike[first.index]]
                for mesh in later:
                    into.repeat_mesh(mesh.index, first.index, mesh.refined)
                for mesh in (first, *later):
                    vertices.add(mesh.index, mesh.primitives, mesh.kept)
                    if traced:
                        parents |= parents_of_mesh(upload.document, mesh)
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
                        name=_name_of(upload.tree["meshes"][mesh.index]),
                    )
                    refined = (primitive.source.number for primitive in mesh.refined)
                    left_out = leave_out_ngons(upload.tree, mesh.index, refined)
                    outcomes[mesh.index] = result, mesh.changes + left_out
    results, found = zip(*(outcomes[plan.mesh] for plan in upload.plans), strict=True)
    changes += chain.from_iterable(found)
    return _Refined(upload, into, scheme, results, vertices.unused(), changes, parents)


def _name_of(mesh: dict[str, Any]) -> str | None:
    name = mesh.get("name")
    return name if isinstance(name, str) and name else None


def make_scheme(options: Options, model: Model | None) -> Scheme:
    """Return the scheme that the options name for triangles.

    Raises:
        NoModelError: a model is asked for, and there is none.
    """
    if not options.learns:
        return named_scheme(options.scheme)
    if model is None:
        raise NoModelError("no model is loaded; scheme=loop needs none")
    return pns(model, options.budget)


def _for_polygons(upload: Upload, scheme: Scheme, options: Options) -> Scheme:
    """Return the scheme for a file: a companion for polygons if that is what its triangles are.

    Raises:
        InvalidParameter: a scheme of polygons is asked for some of the faces.
    """
    if options.selects:
        if scheme.base.polygons:
            message = f"{scheme.base.name} refines all faces of a glTF, or none"
            raise InvalidParameter("scheme", message)
        return scheme
    if options.polygons == "auto" and scheme.for_polygons is not None and mostly_polygons(upload):
        return scheme.for_polygons()
    return scheme


def polygon_scheme(options: Options, model: Model | None) -> Scheme | None:
    """Return the scheme that refines polygons as such; None: they are cut into triangles."""
    if options.goals:
        return None
    if not options.learns or model is not None:
        made = make_scheme(options, model)
        if made.base.polygons or made.for_polygons is not None:
            return made if made.for_polygons is None else made.for_polygons()
    return catmull_clark() if options.scheme == "auto" else None


def _changes_of_container(upload: Upload, options: Options) -> list[Change]:
    changes: list[Change] = []
    if options.diagnostics != "none" and replaces_extras(upload.tree):
        changes.append(Change("/asset/extras", "extras-moved", 1))
    return changes
