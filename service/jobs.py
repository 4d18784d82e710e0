"""The job of a request, as a worker runs it: unpack the body, refine, leave the answer.

The heavy imports (the runtime, the pipeline) are made inside the functions: the server process
imports this module to name its jobs, and never runs them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from service import memory_file
from service.errors import NoModelError
from service.options import Limits, Options

if TYPE_CHECKING:
    from pns_common.schemes import Model


@dataclass(frozen=True, slots=True)
class Work:
    """One request, small enough for a pipe: body and answer are the paths of memory files."""

    body: str
    answer: str
    content_type: str
    report_only: bool
    options: Options
    limits: Limits


def subdivide(work: Work) -> dict[str, float]:
    """Write the GLB, or the report as JSON, to `work.answer`; returns the seconds of each stage.

    Raises ServiceError.
    """
    import msgspec

    from service import upload_body
    from service.subdivide import subdivide_gltf

    sent = upload_body.sent(Path(work.body).read_bytes(), work.content_type, work.limits)
    model = _MODEL.get() if work.options.scheme == "pns" else None
    done = subdivide_gltf(
        sent.data, sent.kind, work.options, model, work.limits, neighbours=sent.neighbours
    )
    memory_file.write(
        work.answer, msgspec.json.encode(done.report) if work.report_only else done.glb
    )
    return done.timings


class WorkersModel:
    """The model of a worker process, handed over once, when the process starts.

    A model may weigh megabytes and take long to build: requests do not carry it.
    """

    def __init__(self) -> None:
        self._source: Model | str | None = None

    def hold(self, source: Model | str | None) -> None:
        """Keep a model, or the name or file of one; None stands for the bundled model."""
        self._source = source

    def get(self) -> Model:
        """The model, loaded where it has not been yet. Raises NoModelError."""
        from pns_common import ModelError, load_model

        if self._source is None or isinstance(self._source, str):
            try:
                self._source = load_model(self._source)
            except ModelError as error:
                raise NoModelError(str(error)) from error
        return self._source


_MODEL = WorkersModel()


def warm_up(model: Model | str | None) -> None:
    """Import and load what the first request would otherwise wait for. Raises NoModelError."""
    import service.subdivide  # noqa: F401

    _MODEL.hold(model)
    _MODEL.get()
