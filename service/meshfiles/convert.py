"""`pns subdivide`: from one file to another, by way of what both formats can hold."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from pns_common import load_model
from pns_common.base.whole_file import replace_file
from pns_common.schemes import Model

from ..bodies.folder import folder_of
from ..bodies.media import GLTF_KINDS, KINDS
from ..bodies.sibling_files import ALONE, SiblingFiles
from ..bodies.uploads import Sent
from ..course import Course
from ..errors import InvalidParameter
from ..gltf.read.upload import read_upload
from ..gltf.subdivide import make_scheme, subdivide_gltf
from ..options import Limits, Options
from ..printable import printable
from ..report import Change
from .flatten import flatten
from .formats import FORMATS, held
from .refine_mesh_file import check_cost, refine_mesh_file
from .to_gltf import as_gltf, read_within
from .triangles_glb import as_gltf_json

if TYPE_CHECKING:
    from rich.console import Console


def convert(
    source: Path,
    output: Path,
    options: Options,
    model: str | None,
    report_file: Path | None,
    limits: Limits,
) -> None:
    """Refine `source` into `output`; what was changed or lost goes to stderr and the report.

    `model` is a bundled name or a file; None: the default one.

    Raises:
        ServiceError, PnsError: the file, the model or a parameter cannot be used.
        OSError: a file cannot be read or written.
    """
    # What only a terminal sees, workers do not load.
    from rich.console import Console

    kind, target = _kind("IN", source), _kind("OUT", output)
    if report_file is not None and report_file.resolve() in (source.resolve(), output.resolve()):
        raise InvalidParameter("report", f"{report_file}: the report would replace a model")
    # Before the work, which may be long.
    for name, file in (("OUT", output), ("report", report_file)):
        if file is not None and not file.parent.is_dir():
            raise InvalidParameter(name, f"{file}: there is no folder {file.parent}")
    began = time.perf_counter()
    console = Console(stderr=True, soft_wrap=True, highlight=False)
    data = source.read_bytes()
    # Loop needs none, but one that is named and does not exist is a mistake to be told.
    loaded = load_model(model) if options.scheme == "pns" or model is not None else None
    with _progress(console) as course:
        written = converted(data, kind, target, options, loaded, limits, course, folder_of(source))
    replace_file(output, written.content)
    if report_file is not None:
        text = msgspec.json.format(msgspec.json.encode(written.report), indent=2)
        replace_file(report_file, text + b"\n")
    for line in lines_of(written.report):
        console.print(printable(line), markup=False)
    seconds = time.perf_counter() - began
    console.print(f"{output}: {written.faces:,} faces in {seconds:.1f} s", markup=False)


def converted(
    data: bytes,
    kind: str,
    target: str,
    options: Options,
    model: Model | None,
    limits: Limits,
    course: Course | None = None,
    siblings: SiblingFiles = ALONE,
) -> Written:
    """Refine the bytes of a file of `kind` into those of one of `target`; no file is touched.

    Raises:
        ServiceError, PnsError: the file or a parameter cannot be used.
    """
    if kind in GLTF_KINDS:
        done = subdivide_gltf(data, kind, options, model, limits, course, siblings=siblings)
        return replace(_of_gltf(done.glb, done.report, target, limits), seconds=done.timings)
    course = Course() if course is None else course
    if target in GLTF_KINDS:
        with course.stage("read", 0.0, 0.1):
            sent = as_gltf(Sent(data, kind, siblings), limits)
        with course.part(0.1, 1.0):
            done = subdivide_gltf(
                sent.data, "glb", options, model, limits, course, sent.siblings, sent.losses
            )
        return replace(_of_gltf(done.glb, done.report, target, limits), seconds=done.timings)
    with course.stage("read", 0.0, 0.1):
        mesh = read_within(data, kind, limits)
    with course.part(0.1, 0.8):
        refined, report = refine_mesh_file(mesh, make_scheme(options, model), options, limits, course)
    with course.stage("write", 0.8, 1.0):
        kept, changes = held(refined, target)
        if options.compress != "none":
            changes.append(Change("", "not compressed: only a glTF is", 1))
        written = Written(
            FORMATS[target].write(kept), _with_changes(report, changes), len(kept.faces)
        )
    return replace(written, seconds=course.seconds)


def predicted_faces(
    data: bytes, kind: str, options: Options, limits: Limits, siblings: SiblingFiles
) -> int:
    """Return how many faces the refined file will have, found without refining.

    Raises:
        ServiceError: the file cannot be used, or would be over a limit.
    """
    if kind in GLTF_KINDS:
        upload = read_upload(data, kind, options.levels, limits, siblings)
        return sum(mesh.faces for mesh in upload.plans) * 4**options.levels
    mesh = read_within(data, kind, limits)
    check_cost(mesh, options, limits)
    return len(mesh.faces) * 4**options.levels


def lines_of(report: dict[str, Any]) -> Iterator[str]:
    """Yield what was changed or lost, each thing once: how often, and where first."""
    said: Counter[str] = Counter()
    places: defaultdict[str, list[str]] = defaultdict(list)
    for change in report["changes"]:
        said[change["what"]] += change["count"]
        places[change["what"]] += [change["pointer"]] if change["pointer"] else []
    for what, count in said.items():
        first, *others = places[what] or [""]
        where = f"{first} and {len(others)} more places" if others else first
        yield f"{count} × {what} ({where})" if where else f"{count} × {what}"
    for name, count in report["dropped"].items():
        what = f"{name.replace('_', ' ')} dropped"
        if count and what not in said:
            yield f"{count} × {what}"


def _kind(name: str, path: Path) -> str:
    kind = path.suffix.lower().removeprefix(".")
    if kind not in KINDS:
        raise InvalidParameter(name, f"{path}: the extension must be one of {', '.join(KINDS)}")
    return kind


@dataclass(frozen=True)
class Written:
    """An output file: its bytes, its report, its faces; the seconds that each stage took."""

    content: bytes
    report: dict[str, Any]
    faces: int
    seconds: dict[str, float] = field(default_factory=dict)


def _of_gltf(glb: bytes, report: dict[str, Any], target: str, limits: Limits) -> Written:
    faces = report["totals"]["faces"]
    if target == "glb":
        return Written(glb, report, faces)
    if target == "gltf":
        return Written(as_gltf_json(glb, limits), report, faces)
    mesh, changes = flatten(glb, target, limits)
    kept, lost = held(mesh, target)
    # A mesh that several nodes show is there several times.
    report = _with_changes(report, [*changes, *lost])
    return Written(FORMATS[target].write(kept), report, len(kept.faces))


def _with_changes(report: dict[str, Any], changes: list[Change]) -> dict[str, Any]:
    return report | {"changes": [*report["changes"], *(asdict(change) for change in changes)]}


@contextmanager
def _progress(console: Console) -> Iterator[Course]:
    """Show a bar on a terminal while the work goes on, and leave nothing behind."""
    from rich.progress import Progress

    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("refining", total=1.0)
        yield Course(moves=lambda share: bar.update(task, completed=share))
