"""The job of a request, as a worker runs it: unpack the body, refine, leave the answer.

The heavy imports (the runtime, the pipeline) are made inside the functions: the server process
imports this module to name its jobs, and never runs them.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..bodies.media import IDENTITY, Kind, decoded
from ..memory_cap import memory_cap
from ..options import Limits, Options
from ..stages import Stages
from . import memory_file
from .models import Catalogue, Models, catalogue_of
from .progress import PROGRESS

if TYPE_CHECKING:
    from pns_common.model.session import Model

log = logging.getLogger("pns.service")

# Beside what is predicted for a job: threads' stacks, the allocator's arenas, the libraries' own.
MEMORY_SLACK = 1024**3


@dataclass(frozen=True, slots=True)
class Work:
    """One job, small enough for a pipe: its files go by their names.

    `answer` and `report` are what the worker fills, None what nobody wants. `model` is the name of
    one of the worker's models; None: the served one. `request_id` stands in what the worker logs. A
    body with an `encoding` unpacks to `body_bytes` at most. `target` is the kind of file to answer
    with.
    """

    body: str
    answer: str | None
    report: str | None
    content_type: str
    options: Options
    model: str | None
    limits: Limits
    target: Kind = "glb"
    request_id: str | None = None
    encoding: str = IDENTITY
    body_bytes: int = 64 * 1024**2


@dataclass(frozen=True, slots=True)
class Done:
    """Result of a job that was done.

    The seconds of each stage, the model, the faces that came and those that were made.
    """

    seconds: dict[str, float]
    model: str | None
    faces_in: int = 0
    faces: int = 0


def subdivide(work: Work) -> Done:
    """Write the file to `work.answer`, and the report as JSON to `work.report`.

    Raises:
        ServiceError: the upload is wrong or over a limit; JobStopped where nobody wants it.
    """
    import msgspec

    from ..bodies import uploads
    from ..meshfiles.convert import converted

    progress = PROGRESS.get()
    with job_memory(work.limits):
        body = decoded(Path(work.body).read_bytes(), work.encoding, work.body_bytes)
        sent = uploads.sent(body, work.content_type, work.limits)
        model = _MODELS.get(work.model) if work.options.learns else None
        stages = Stages(begins=progress.begin, moves=progress.reach)
        written = converted(
            sent.data,
            sent.kind,
            work.target,
            work.options,
            model,
            work.limits,
            stages,
            sent.siblings,
        )
        if work.report is not None:
            memory_file.write(work.report, msgspec.json.encode(written.report))
        if work.answer is not None:
            memory_file.write(work.answer, written.content)
    return Done(
        written.seconds,
        None if model is None else model.name,
        faces_in=written.faces_in,
        faces=written.report["totals"]["faces"],
    )


def job_memory(limits: Limits) -> AbstractContextManager[None]:
    """Hold the process to what one job may take, whatever was predicted. Raises LimitError."""
    most = limits.max_memory_bytes
    return memory_cap(most, f"the job took more memory than {most} bytes", MEMORY_SLACK)


_MODELS = Models()


def warm_up(model: Model | str | None, providers: Sequence[str] | None = None) -> None:
    """Import, load and run what first jobs would wait for, and then keep. Raises NoModelError."""
    from ..bodies import uploads  # noqa: F401
    from ..meshfiles.convert import converted

    hold_model(model, providers)
    for face in (b"f 1 2 3", b"f 1 2 3 4"):
        made = b"v 0 0 0\nv 1 0 0\nv 1 1 1\nv 0 1 0\n" + face
        converted(made, "obj", "glb", Options(levels=1), _MODELS.get(), Limits())


def hold_model(model: Model | str | None, providers: Sequence[str] | None = None) -> None:
    """Load the served model. Raises NoModelError."""
    _MODELS.hold(model, providers)
    _MODELS.get()


def catalogue() -> Catalogue:
    """Return what this worker's models say of themselves."""
    return catalogue_of(_MODELS)
