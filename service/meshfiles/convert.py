"""`pns subdivide`: from one file to another, by way of what both formats can hold."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import msgspec
import numpy as np

from pns_common import load_model
from pns_common.errors import PnsError
from pns_common.files import replace_file
from pns_common.model.session import Model
from pns_common.operator.scheme import Scheme

from ..bodies.media import ALIASES, GLTF_KINDS, KINDS, kind_of
from ..bodies.sibling_files import ALONE, Opened, SiblingFiles, folder_of
from ..changes import Advice, Change, lines_of, with_changes, with_flags
from ..errors import InvalidParameter, ServiceError, printable
from ..gltf.read.upload import Media, Upload, read_upload
from ..gltf.subdivide import make_scheme, polygon_scheme, refine_scene, subdivide_gltf
from ..gltf.write.storage import Arrays, matrix_arrays
from ..options import MAX_LEVELS, Limits, Options
from ..stages import Stages
from .companions import companions, copied
from .flatten import Surface, check_copies, flatten
from .formats import FORMATS, OF_TRIANGLES, held, read_within
from .glb import as_glb, as_gltf_json
from .mesh_file import NORMAL, MeshFile
from .mtl import nearby
from .parts import with_group_normals
from .refine_mesh_file import check_cost, check_faces, faces_after, refine_mesh_file
from .triangulate import in_star_shaped_pieces, triangulated

if TYPE_CHECKING:
    from rich.console import Console


# Stdin, or stdout.
STREAM = Path("-")
NOT_COMPRESSED = Change("", "not-compressed", 1)


@dataclass(frozen=True)
class Jobs:
    """Arguments of `pns subdivide`.

    Attributes:
        sources: files to read; `-` is stdin.
        output: a file, a folder for files with the names of their sources, or `-` for stdout.
        report, map: where the report of one source goes, and the parents of its new vertices.
        target: the format of all results; None: as `output` ends, or as read.
        kind: the format of stdin; None: glTF.
        force: whether a result may replace its source.
    """

    sources: Sequence[Path]
    output: Path
    report: Path | None = None
    map: Path | None = None
    target: str | None = None
    kind: str | None = None
    force: bool = False


@dataclass(frozen=True)
class _Job:
    source: Path
    kind: str
    output: Path
    target: str


def convert(jobs: Jobs, options: Options, model: str | None, limits: Limits) -> Iterator[Exception]:
    """Refine files; what was changed or lost goes to stderr and the report.

    `model` is a bundled name or a file; None: the default one. Yields why a file could not be
    refined, with a note that names it, and goes on with the next.

    Raises:
        InvalidParameter: the files, or a parameter, do not go together.
        PnsError: the model cannot be used.
    """
    # What only a terminal sees, workers do not load.
    from rich.console import Console

    planned = _planned(jobs, options)
    # Loop needs none, but one that is named and does not exist is a mistake to be told.
    loaded = load_model(model) if options.learns or model is not None else None
    console = Console(stderr=True, soft_wrap=True, highlight=False)
    for job in planned:
        try:
            _convert_one(job, jobs, options, loaded, limits, console)
        except InvalidParameter as error:
            yield error
        except (ServiceError, PnsError) as error:
            error.add_note("stdin" if job.source == STREAM else str(job.source))
            yield error
        except OSError as error:
            yield error


def _convert_one(
    job: _Job,
    jobs: Jobs,
    options: Options,
    model: Model | None,
    limits: Limits,
    console: Console,
) -> None:
    began = time.perf_counter()
    if job.source == STREAM:
        data, siblings = sys.stdin.buffer.read(), ALONE
    else:
        data, siblings = job.source.read_bytes(), folder_of(job.source)
    with _progress(console) as stages:
        written = converted(
            data,
            job.kind,
            job.target,
            options,
            model,
            limits,
            stages,
            siblings,
            traced=jobs.map is not None,
        )
    if job.output == STREAM:
        sys.stdout.buffer.write(written.content)
        sys.stdout.buffer.flush()
    else:
        replace_file(job.output, written.content)
        copies = _copies(job, data, siblings, force=jobs.force)
        written = replace(written, report=with_changes(written.report, copies))
    if jobs.map is not None:
        file = BytesIO()
        np.savez_compressed(file, allow_pickle=False, **written.parents)
        replace_file(jobs.map, file.getvalue())
    if jobs.report is not None:
        text = msgspec.json.format(msgspec.json.encode(written.report), indent=2)
        replace_file(jobs.report, text + b"\n")
    for line in (
        *lines_of(written.report),
        *(with_flags(Advice(**each)) for each in written.report["advice"]),
    ):
        console.print(printable(line), markup=False)
    seconds = time.perf_counter() - began
    name = "stdout" if job.output == STREAM else job.output
    # What formats of triangles hold; a file of quads alone is counted in its faces.
    polygons = written.triangles != written.faces and job.target not in (*GLTF_KINDS, *OF_TRIANGLES)
    count, what = (written.faces, "faces") if polygons else (written.triangles, "triangles")
    more = ""
    if options.levels < MAX_LEVELS and not (options.selects or options.goals):
        more = f"; --levels {options.levels + 1} would give {4 * count:,}"
    console.print(f"{name}: {count:,} {what} in {seconds:.1f} s{more}", markup=False)


def _copies(job: _Job, data: bytes, siblings: SiblingFiles, *, force: bool) -> list[Change]:
    """Copy the materials and textures of a mesh file beside its result in another folder."""
    folder = job.output.parent
    alone = job.source == STREAM or job.kind != job.target
    if alone or folder.resolve() == job.source.parent.resolve():
        return []

    def read(name: str) -> bytes | None:
        return (folder / name).read_bytes() if (folder / name).is_file() else None

    def write(name: str, content: bytes) -> None:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        replace_file(folder / name, content)

    return copied(companions(data, job.kind, Opened(siblings)), read, write, force=force)


def _planned(jobs: Jobs, options: Options) -> list[_Job]:
    """Plan what becomes of each file, before any work. Raises InvalidParameter."""
    several = len(jobs.sources) > 1
    into = jobs.output.is_dir() or (several and jobs.output != STREAM)
    if several and not jobs.output.is_dir():
        raise InvalidParameter("OUT", f"{jobs.output}: several files need a folder that is there")
    for name, file in (("report", jobs.report), ("map", jobs.map)):
        if several and file is not None:
            raise InvalidParameter(name, f"{file}: several files have several {name}s")
    planned: list[_Job] = []
    for source in jobs.sources:
        kind = jobs.kind or "glb" if source == STREAM else _kind("IN", source)
        _check_kind("from", kind)
        target = jobs.target or (kind if into else None)
        if target is None:
            target = "glb" if jobs.output == STREAM else _kind("OUT", jobs.output)
        _check_kind("to", target)
        output = jobs.output
        if into:
            stem = "stdin" if source == STREAM else source.stem
            ending = source.suffix if target == kind and source != STREAM else f".{target}"
            output = jobs.output / f"{stem}{ending}"
        _check_output(jobs, source, output)
        if jobs.map is not None:
            _check_map(source, kind, target, options)
        if any(output == job.output for job in planned):
            raise InvalidParameter("OUT", f"{output}: two files would be written to it")
        planned.append(_Job(source, kind, output, target))
    return planned


def _check_map(source: Path, kind: str, target: str, options: Options) -> None:
    if (kind in GLTF_KINDS) != (target in GLTF_KINDS):
        raise InvalidParameter("map", f"{source}: a map needs glTF in and out, or neither")
    if target in GLTF_KINDS and options.compress == "draco":
        raise InvalidParameter("map", f"{source}: Draco orders vertices anew, and a map names them")


def _check_output(jobs: Jobs, source: Path, output: Path) -> None:
    beside = (("report", jobs.report), ("map", jobs.map))
    for name, file in (("OUT", output), *beside):
        if file is not None and file != STREAM and not file.parent.is_dir():
            raise InvalidParameter(name, f"{file}: there is no folder {file.parent}")
    for name, file in beside:
        if file is not None and file.resolve() in (source.resolve(), output.resolve()):
            raise InvalidParameter(name, f"{file}: the {name} would replace a model")
    if source != STREAM and output.resolve() == source.resolve() and not jobs.force:
        raise InvalidParameter("OUT", f"{output}: it is the input; --force replaces it")


def converted(
    data: bytes,
    kind: str,
    target: str,
    options: Options,
    model: Model | None,
    limits: Limits,
    stages: Stages | None = None,
    siblings: SiblingFiles = ALONE,
    *,
    traced: bool = False,
) -> Written:
    """Refine the bytes of a file of `kind` into those of one of `target`; no file is touched.

    `traced` asks for the parents of vertices; none of a glTF and another format.

    Raises:
        ServiceError, PnsError: the file or a parameter cannot be used.
    """
    stages = Stages() if stages is None else stages
    if kind in GLTF_KINDS:
        # Kinds are checked where they come from.
        media = cast(Media, kind)
        if target not in GLTF_KINDS:
            return _flattened(data, media, target, options, model, limits, stages, siblings)
        done = subdivide_gltf(data, media, options, model, limits, stages, siblings, traced=traced)
        written = _of_gltf(done.glb, done.report, target, limits)
        return replace(written, seconds=done.timings, faces_in=done.faces_in, parents=done.parents)
    with stages.stage("read", 0.0, 0.1):
        mesh, scheme = _taken(read_within(data, kind, limits), target, options, model, limits)
    if target in GLTF_KINDS:
        mesh = with_group_normals(mesh)
        if NORMAL not in mesh.layers and options.normals == "auto":
            options = replace(options, normals="smooth")
    elif options.compress != "none":
        mesh = mesh.with_changes([NOT_COMPRESSED])
        options = replace(options, compress="none")
    with stages.part(0.1, 0.8):
        refined, report = refine_mesh_file(mesh, scheme, options, limits, stages, traced=traced)
    if model is not None and options.learns and scheme.rule is None:
        text = (
            f"the model {model.name} has no rules for polygons, so this is {scheme.name} without "
            "it: use scheme=pns to cut them into triangles for it"
        )
        without = Advice(text, ("scheme=pns",)).as_entry()
        report = {**report, "advice": [without, *report["advice"]]}
    with stages.stage("write", 0.8, 1.0):
        if target in GLTF_KINDS:
            glb, report = as_glb(refined, report, options, siblings, stages)
            written = _of_gltf(glb, report, target, limits)
            written = replace(written, triangles=_triangles_of(refined))
        else:
            near = nearby(refined.libraries, Opened(siblings))
            written = _of_mesh(replace(refined, libraries=near), report, [], target)
    return replace(written, seconds=stages.seconds, faces_in=len(mesh.sizes))


def _triangles_of(mesh: MeshFile) -> int:
    return len(mesh.corners) - 2 * len(mesh.sizes)


def _of_mesh(
    mesh: MeshFile, report: dict[str, Any], changes: Sequence[Change], target: str
) -> Written:
    """Write what a format can hold of a refined mesh; report what it cannot."""
    kept, lost = held(mesh, target)
    report = with_changes(report, [*changes, *lost])
    parents: Arrays = {}
    if kept.parents is not None:
        parents = matrix_arrays(kept.parents.take(FORMATS[target].order(kept)))
    content, faces = FORMATS[target].write(kept), len(kept.sizes)
    return Written(content, report, faces, _triangles_of(kept), parents=parents)


def _taken(
    mesh: MeshFile, target: str, options: Options, model: Model | None, limits: Limits
) -> tuple[MeshFile, Scheme]:
    """Return the mesh to refine, of triangles or of polygons, and the scheme for it.

    What is written as triangles has so many of them as are asked for.
    """
    # Cutting leaves no fewer.
    check_faces(mesh, options, limits)
    counted = options.max_faces is not None and target in (*GLTF_KINDS, *OF_TRIANGLES)
    quads = options.scheme == "catmull-clark"
    if quads or (not counted and (not options.learns or (mesh.sizes != 3).any())):
        scheme = polygon_scheme(options, model)
        if scheme is not None:
            return in_star_shaped_pieces(mesh), scheme
    return triangulated(mesh), make_scheme(options, model)


def predicted_faces(
    data: bytes,
    kind: str,
    target: str,
    options: Options,
    model: Model | None,
    limits: Limits,
    siblings: SiblingFiles,
) -> tuple[int, int]:
    """Return how many faces a file has, and how many the refined one will have.

    With a goal they are refined and counted, and nothing is written; else they are known before.

    Raises:
        ServiceError, PnsError: the file cannot be used, or would be over a limit.
    """
    if kind in GLTF_KINDS:
        if options.goals:
            asked = options, model, limits, Stages(), siblings
            scene = refine_scene(data, kind, *asked, check=lambda upload: None)
            return scene.faces_in, scene.report["totals"]["faces"]
        upload = read_upload(data, kind, options.faces_after, limits, siblings)
        faces = sum(mesh.faces for mesh in upload.plans)
        return faces, options.faces_after(faces)
    mesh = read_within(data, kind, limits)
    if options.goals:
        taken, scheme = _taken(mesh, target, options, model, limits)
        _, report = refine_mesh_file(taken, scheme, options, limits)
        return len(mesh.sizes), report["totals"]["faces"]
    check_cost(mesh, options, limits)
    return len(mesh.sizes), faces_after(mesh, options)


def _kind(name: str, path: Path) -> str:
    kind = kind_of(path.name)
    if kind is None:
        choices = ", ".join((*KINDS, *ALIASES))
        raise InvalidParameter(name, f"{path}: the extension must be one of {choices}")
    return kind


def _check_kind(name: str, kind: str) -> None:
    if kind not in KINDS:
        raise InvalidParameter(name, f"{kind}: it must be one of {', '.join(KINDS)}")


@dataclass(frozen=True)
class Written:
    """An output file.

    Attributes:
        content, report, faces: its bytes, its report, how many faces it has.
        triangles: how many these make.
        faces_in: how many the input has.
        seconds: what each stage took.
        parents: the arrays of a map of its vertices, if asked for.
    """

    content: bytes
    report: dict[str, Any]
    faces: int
    triangles: int
    seconds: dict[str, float] = field(default_factory=dict)
    faces_in: int = 0
    parents: Arrays = field(default_factory=dict)


def _of_gltf(glb: bytes, report: dict[str, Any], target: str, limits: Limits) -> Written:
    faces = report["totals"]["faces"]
    content = as_gltf_json(glb, limits) if target == "gltf" else glb
    return Written(content, report, faces, faces)


def _flattened(
    data: bytes,
    media: Media,
    target: str,
    options: Options,
    model: Model | None,
    limits: Limits,
    stages: Stages,
    siblings: SiblingFiles,
) -> Written:
    """Refine a glTF and write its scene as one mesh."""
    changes = [NOT_COMPRESSED] if options.compress != "none" else []
    # How many faces a goal makes of one is not known yet.
    each = 1 if options.goals else 4**options.levels

    def check(upload: Upload) -> None:
        check_copies(upload, {plan.mesh: each * plan.faces for plan in upload.plans}, limits)

    scene = refine_scene(data, media, options, model, limits, stages, siblings, check)
    with stages.stage("write", 0.95, 1.0):
        surfaces = {
            mesh: [Surface.of(primitive) for primitive in refined]
            for mesh, refined in scene.meshes.items()
        }
        mesh, lost = flatten(scene.upload, surfaces, target, limits)
        # A mesh that several nodes show is there several times.
        written = _of_mesh(mesh, scene.report, [*changes, *lost], target)
    return replace(written, seconds=stages.seconds, faces_in=scene.faces_in)


@contextmanager
def _progress(console: Console) -> Iterator[Stages]:
    """Show a bar on a terminal while the work goes on, and leave nothing behind."""
    if not console.is_terminal:
        yield Stages()
        return
    from rich.progress import Progress

    with Progress(console=console, transient=True) as bar:
        task = bar.add_task("refining", total=1.0)
        yield Stages(moves=lambda share: bar.update(task, completed=share))
