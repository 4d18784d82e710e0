"""The job of a request, as a worker runs it: unpack the body, refine, leave the answer.

The heavy imports (the runtime, the pipeline) are made inside the functions: the server process
imports this module to name its jobs, and never runs them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from service import memory_file
from service.models import Models
from service.options import Limits, Options

if TYPE_CHECKING:
    from pns_common.schemes import Model
    from service.catalogue import Catalogue


@dataclass(frozen=True, slots=True)
class Work:
    """One request, small enough for a pipe: body and answer are the paths of memory files.

    `model` is the name of one of the worker's models; None: the served one.
    """

    body: str
    answer: str
    content_type: str
    report_only: bool
    options: Options
    model: str | None
    limits: Limits


@dataclass(frozen=True, slots=True)
class Done:
    """What is known of a request that was answered: the seconds of each stage, and the model."""

    seconds: dict[str, float]
    model: str | None


def subdivide(work: Work) -> Done:
    """Write the GLB, or the report as JSON, to `work.answer`. Raises ServiceError."""
    import msgspec

    from service import upload_body
    from service.subdivide import subdivide_gltf

    sent = upload_body.sent(Path(work.body).read_bytes(), work.content_type, work.limits)
    model = _MODELS.get(work.model) if work.options.scheme == "pns" else None
    done = subdivide_gltf(
        sent.data, sent.kind, work.options, model, work.limits, neighbours=sent.neighbours
    )
    memory_file.write(
        work.answer, msgspec.json.encode(done.report) if work.report_only else done.glb
    )
    return Done(done.timings, None if model is None else model.name)


_MODELS = Models()


def warm_up(model: Model | str | None) -> None:
    """Import and load what the first request would otherwise wait for. Raises NoModelError."""
    import service.subdivide  # noqa: F401

    _MODELS.hold(model)
    _MODELS.get()


def catalogue() -> Catalogue:
    """What this worker's models say of themselves."""
    from service.catalogue import catalogue_of

    return catalogue_of(_MODELS)
