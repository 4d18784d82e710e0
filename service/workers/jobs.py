"""The job of a request, as a worker runs it: unpack the body, refine, leave the answer.

The heavy imports (the runtime, the pipeline) are made inside the functions: the server process
imports this module to name its jobs, and never runs them.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ..bodies.media import IDENTITY, Kind, decoded
from ..course import Course
from ..errors import LimitError, NoModelError, check_limit
from ..memory_cap import memory_cap
from ..options import Limits, Options
from . import memory_file
from .costs import Cost
from .memory_file import FileName
from .models import Models
from .progress import Reporter

if TYPE_CHECKING:
    from pns_common.model.session import Model

    from .catalogue import Catalogue

log = logging.getLogger("pns.service")

# What an archive may take to be measured; others wait meanwhile.
GLANCE_BYTES = 128 * 1024**2
# Beside what is predicted for a job: threads' stacks, the allocator's arenas, the libraries' own.
MEMORY_SLACK = 1024**3


@dataclass(frozen=True, slots=True)
class Work:
    """One job, small enough for a pipe: its files go by their names.

    `answer` and `report` are what the worker fills, None what nobody wants; together they may hold
    `answer_bytes`. `page` is where it tells how far it is. `model` is the name of one of the
    worker's models; None: the served one. `request_id` stands in what the worker logs. A body with
    an `encoding` unpacks to `body_bytes` at most. `target` is the kind of file to answer with.
    """

    body: FileName
    answer: FileName | None
    report: FileName | None
    page: FileName
    content_type: str
    options: Options
    model: str | None
    limits: Limits
    target: Kind = "glb"
    answer_bytes: int | None = None
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

    with Reporter(work.page) as reporter, job_memory(work.limits):
        sent = uploads.sent(_body_of(work), work.content_type, work.limits)
        model = _MODELS.get(work.model) if work.options.learns else None
        course = Course(begins=reporter.stage, moves=reporter.reach)
        written = converted(
            sent.data,
            sent.kind,
            work.target,
            work.options,
            model,
            work.limits,
            course,
            sent.siblings,
        )
        report = msgspec.json.encode(written.report)
        _check_answer(work, report, written.content)
        if work.report is not None:
            memory_file.write(work.report, report)
        if work.answer is not None:
            memory_file.write(work.answer, written.content)
    return Done(
        written.seconds,
        None if model is None else model.name,
        faces_in=written.faces_in,
        faces=written.report["totals"]["faces"],
    )


def measure(work: Work) -> Cost:
    """Measure what a job will cost. Raises ServiceError where a body is not what its type says."""
    from ..bodies import uploads
    from .costs import cost_of
    from .measure import cost_of_gltf, cost_of_other

    glance = replace(work.limits, max_memory_bytes=min(work.limits.max_memory_bytes, GLANCE_BYTES))
    with job_memory(work.limits):
        body = _body_of(work)
        try:
            sent = uploads.sent(body, work.content_type, glance)
            levels, learned = work.options.levels, _learned_levels(work)
            of_kind = cost_of_gltf if sent.kind in ("glb", "gltf") else cost_of_other
            return of_kind(sent.data, sent.kind, levels, work.limits, learned)
        except LimitError as error:
            # An archive may be too large to be unpacked for a glance.
            if error.limit != "archive-bytes":
                raise
        except ArithmeticError:
            # Counts that no number holds.
            pass
        return replace(cost_of(work.limits.max_faces, 1, len(body)), most=True)


def _body_of(work: Work) -> bytes:
    return decoded(memory_file.read(work.body), work.encoding, work.body_bytes)


def _learned_levels(work: Work) -> int:
    """Return at how many levels a model acts: all in format 1, one in format 4."""
    from pns_common.model.card import PAPER_FORMAT

    if not work.options.learns:
        return 0
    try:
        card = _MODELS.get(work.model).card
    except NoModelError:
        # The job will say so, at once.
        return 0
    return work.options.levels if card.format == PAPER_FORMAT else 1


def job_memory(limits: Limits) -> AbstractContextManager[None]:
    """Hold the process to what one job may take, whatever was predicted. Raises LimitError."""
    most = limits.max_memory_bytes
    return memory_cap(most, f"the job took more memory than {most} bytes", MEMORY_SLACK)


def _check_answer(work: Work, report: bytes, glb: bytes) -> None:
    if work.answer_bytes is not None:
        size = len(report) + len(glb)
        text = f"the result would take {size} bytes"
        check_limit("result-bytes", size, work.answer_bytes, text)


_MODELS = Models()


def warm_up(model: Model | str | None, providers: Sequence[str] | None = None) -> None:
    """Import and load what the first request would otherwise wait for. Raises NoModelError."""
    from ..meshfiles import convert  # noqa: F401

    hold_model(model, providers)


def hold_model(model: Model | str | None, providers: Sequence[str] | None = None) -> None:
    """Load the served model. Raises NoModelError."""
    _MODELS.hold(model, providers)
    _MODELS.get()


def catalogue() -> Catalogue:
    """Return what this worker's models say of themselves."""
    from .catalogue import catalogue_of

    return catalogue_of(_MODELS)
