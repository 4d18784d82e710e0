"""The job of a request, as a worker runs it: unpack the body, refine, leave the answer.

The heavy imports (the runtime, the pipeline) are made inside the functions: the server process
imports this module to name its jobs, and never runs them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from service import memory_file
from service.errors import NoModelError
from service.options import Limits, Options

if TYPE_CHECKING:
    from pns_common.schemes import Model


@dataclass(frozen=True, slots=True)
class Work:
    """One request, small enough for a pipe: body and answer are the paths of memory files.

    `model` is a model, or the name or file of one, or None for the bundled model.
    """

    body: str
    answer: str
    content_type: str
    report_only: bool
    options: Options
    limits: Limits
    model: Model | str | None


def subdivide(work: Work) -> dict[str, float]:
    """Write the GLB, or the report as JSON, to `work.answer`; returns the seconds of each stage.

    Raises ServiceError.
    """
    import msgspec

    from service import upload_body
    from service.subdivide import subdivide_gltf

    sent = upload_body.sent(Path(work.body).read_bytes(), work.content_type, work.limits)
    model = _model(work.model) if work.options.scheme == "pns" else None
    done = subdivide_gltf(
        sent.data, sent.kind, work.options, model, work.limits, neighbours=sent.neighbours
    )
    memory_file.write(
        work.answer, msgspec.json.encode(done.report) if work.report_only else done.glb
    )
    return done.timings


def warm_up(model: Model | str | None) -> None:
    """Import and load what the first request would otherwise wait for. Raises NoModelError."""
    import service.subdivide  # noqa: F401

    _model(model)


def _model(source: Model | str | None) -> Model:
    return _load(source) if source is None or isinstance(source, str) else source


@lru_cache(maxsize=1)
def _load(source: str | None) -> Model:
    from pns_common import ModelError, load_model

    try:
        return load_model(source)
    except ModelError as error:
        raise NoModelError(str(error)) from error
