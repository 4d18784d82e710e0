"""One file of a batch, as a worker runs it: read, refined under its limits, written whole."""

from __future__ import annotations

import hashlib
import posixpath
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from ..bodies.media import ALIASES, KINDS, kind_of
from ..errors import LONGEST, InvalidParameter, NoModelError, ServiceError
from ..options import Limits, Options

if TYPE_CHECKING:
    from pns_common.model.session import Model

    from ..bodies.sibling_files import SiblingFiles
    from .places import Place

DONE, SKIPPED, FAILED, PLANNED = "done", "skipped", "failed", "planned"
# The code of a folder that cannot be listed: it is told, but is no file of the report.
UNREADABLE_FOLDER = "unreadable-folder"


class Known(NamedTuple):
    """The hashes of an input and of the result that was made of it."""

    input: str
    output: str


@dataclass(frozen=True, slots=True)
class Task:
    """Task of a worker: one file.

    Attributes:
        url, output: where it is read, where its result goes.
        kind, target: formats, by extension.
        model_hash: of the model that the run began with; None without one.
        known: what an earlier run of the same work has written at `output`; None: nothing.
        attempt: 1, then 2 where the first worker died or hung.
        dry: predict the cost, write nothing.
    """

    url: str
    output: str
    kind: str
    target: str
    options: Options
    model: str | None
    limits: Limits
    model_hash: str | None = None
    known: Known | None = None
    attempt: int = 1
    dry: bool = False


@dataclass(frozen=True, slots=True)
class Row:
    """Outcome of one file: a row of the report.

    `code`, `detail` and `pointer` are those of the service's problems, and empty for what went
    well; `changes` says what was changed or lost on the way, a line each; `limit_distance` is the
    certificate, in the mesh's own units (of several meshes, the largest).
    """

    path: str
    output: str
    status: str
    code: str = ""
    detail: str = ""
    pointer: str = ""
    changes: str = ""
    attempts: int = 1
    faces_in: int = 0
    faces_out: int = 0
    bytes_in: int = 0
    bytes_out: int = 0
    input_sha256: str = ""
    output_sha256: str = ""
    model: str = ""
    model_sha256: str = ""
    limit_distance: float | None = None
    flipped_faces: int = 0
    seconds: float = 0.0
    stages: dict[str, float] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Return the columns of the report; the seconds of each stage are columns of their own."""
        values = {name: getattr(self, name) for name in COLUMNS}
        return values | {f"seconds_{name}": self.stages.get(name, 0.0) for name in STAGES}


STAGES = ("read", "weld", "refine", "attributes", "write")
COLUMNS = tuple(column.name for column in fields(Row) if column.name != "stages")


def read_libraries() -> None:
    """Import what a file needs, from whose time it would be taken else."""
    from ..meshfiles import convert  # noqa: F401


def run(task: Task) -> Row:
    """Refine one file. What goes wrong with it is its row's, and nobody else's."""
    began = time.perf_counter()
    try:
        row = _plan(task) if task.dry else _refine(task)
    except (ServiceError, OSError) as error:
        row = failed(task.url, task.output, error)
    except Exception as error:
        # A fault of ours: the file's neighbours are refined all the same, and the row tells it.
        text = "".join(traceback.format_exception(error))
        row = Row(task.url, task.output, FAILED, "internal-error", text)
    return replace(row, attempts=task.attempt, seconds=time.perf_counter() - began)


def failed(path: str, output: str, error: Exception) -> Row:
    """Return the row of a file that could not be refined."""
    code = error.code if isinstance(error, ServiceError) else "cannot-be-read-or-written"
    pointer = getattr(error, "pointer", None) or ""
    detail = error.detail if isinstance(error, ServiceError) else str(error)
    return Row(path, output, FAILED, code, detail, pointer)


def _refine(task: Task) -> Row:
    from ..bodies.sibling_files import Opened
    from ..changes import lines_of, with_changes
    from ..meshfiles.companions import companions, copied
    from ..meshfiles.convert import converted
    from .places import place_of

    source, output = place_of(task.url), place_of(task.output)
    data, siblings = source.read(), source.siblings()
    digest = input_hash(data, task.kind, siblings, task.limits)
    if _is_done(task.known, digest, output):
        return Row(task.url, task.output, SKIPPED, input_sha256=digest, bytes_in=len(data))
    with _refining(task) as model:
        asked = task.options, model, task.limits
        written = converted(data, task.kind, task.target, *asked, siblings=siblings)
    report = written.report
    if task.kind == task.target:
        folder = output.folder
        files = companions(data, task.kind, Opened(siblings)) if folder != source.folder else []
        read, write = folder.content_of, lambda name, content: folder.below(name).write(content)
        changes = copied(files, read, write, force=task.known is not None)
        report = with_changes(report, changes)
    output.write(written.content)
    return Row(
        task.url,
        task.output,
        DONE,
        changes="\n".join(lines_of(report))[:LONGEST],
        faces_in=written.faces_in,
        faces_out=written.faces,
        bytes_in=len(data),
        bytes_out=len(written.content),
        input_sha256=digest,
        output_sha256=hashlib.sha256(written.content).hexdigest(),
        model="" if model is None else model.name,
        model_sha256="" if model is None else model.hash,
        limit_distance=_limit_distance(written.report),
        flipped_faces=_flipped(written.report),
        stages=written.seconds,
    )


def _plan(task: Task) -> Row:
    """Return how many faces the refined file will have; nothing is written."""
    from ..meshfiles.convert import predicted_faces
    from .places import place_of

    source = place_of(task.url)
    data, siblings = source.read(), source.siblings()
    digest = input_hash(data, task.kind, siblings, task.limits)
    if _is_done(task.known, digest, place_of(task.output)):
        return Row(task.url, task.output, SKIPPED, input_sha256=digest, bytes_in=len(data))
    with _refining(task) as model:
        asked = task.options, model, task.limits, siblings
        faces_in, faces = predicted_faces(data, task.kind, task.target, *asked)
    return Row(
        task.url,
        task.output,
        PLANNED,
        faces_in=faces_in,
        faces_out=faces,
        bytes_in=len(data),
        input_sha256=digest,
    )


@contextmanager
def _refining(task: Task) -> Iterator[Model | None]:
    """Yield the model of a task, and hold what is done with it to its memory.

    Raises:
        NoModelError: it is not the model that the run began with.
        ServiceError: the file cannot be refined.
    """
    from pns_common.errors import PnsError

    from ..memory_cap import memory_cap

    model = _model(task.model) if task.options.learns else None
    if (None if model is None else model.hash) != task.model_hash:
        raise NoModelError(
            f"{task.model or 'the default model'}: it is not the model that this run began with; "
            "it was replaced, or is another one on a worker's machine"
        )
    most = task.limits.max_memory_bytes
    try:
        with memory_cap(most, f"refining took more than {most} bytes"):
            yield model
    except PnsError as error:
        raise ServiceError(str(error), code="unrefinable") from error


def _is_done(known: Known | None, input_hash: str, output: Place) -> bool:
    """Return whether a result is there, byte for byte: another run may have replaced it."""
    if known is None or known.input != input_hash or not output.is_file():
        return False
    return hashlib.sha256(output.read()).hexdigest() == known.output


def input_hash(data: bytes, kind: str, siblings: SiblingFiles, limits: Limits) -> str:
    """Return the SHA-256 of a file and then of the names and bytes of the files that it names."""
    from ..bodies.sibling_files import Opened
    from ..gltf.read.upload import named_files
    from ..meshfiles.companions import companions

    digest, opened = hashlib.sha256(data), Opened(siblings)
    files = [(file.name, file) for file in companions(data, kind, opened)]
    files += [(uri, opened.open(uri)) for uri in named_files(data, kind, limits)]
    for name, file in files:
        if file is not None:
            digest.update(f"\0{name}\0{len(file.content)}\0".encode())
            digest.update(file.content)
    return digest.hexdigest()


@cache
def _model(name: str | None) -> Model:
    """Load a model, once a worker."""
    from pns_common import ModelError, load_model

    try:
        return load_model(name)
    except ModelError as error:
        raise NoModelError(str(error)) from error


def _limit_distance(report: dict[str, Any]) -> float | None:
    meshes = report.get("meshes", [report])
    values = [mesh["limit_distance"] for mesh in meshes if mesh.get("limit_distance") is not None]
    return max(values, default=None)


def _flipped(report: dict[str, Any]) -> int:
    return sum(int(level.get("flipped_faces", 0)) for level in report.get("levels", []))


def target_of(relative: str, to: str | None) -> tuple[str, str, str]:
    """Return the kind of a file, that of its result, and the result's relative path.

    Raises:
        InvalidParameter: an extension that is of no kind.
    """
    stem = posixpath.splitext(relative)[0]
    kind = kind_of(relative)
    if kind is None:
        raise InvalidParameter(
            "SOURCE", f"{relative}: the extension must be one of {', '.join((*KINDS, *ALIASES))}"
        )
    target = kind if to is None else to
    return kind, target, relative if target == kind else f"{stem}.{target}"
