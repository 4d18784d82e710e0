"""A job as the routes hand it in, without a request."""

from __future__ import annotations

import time

from service.options import Limits, Options
from service.workers.job import Job
from service.workers.jobs import Work
from service.workers.memory_file import MemoryFile
from service.workers.progress import ProgressPage


def work_of(body: MemoryFile, answer: MemoryFile, page: ProgressPage) -> Work:
    """Return the work that a worker is told of for a GLB, with the usual options."""
    return Work(
        body=body.name,
        answer=answer.name,
        report=None,
        page=page.file.name,
        content_type="model/gltf-binary",
        options=Options(),
        model=None,
        limits=Limits(),
    )


def job_of(content: bytes, answer: MemoryFile, client: str = "a", seconds: float = 60) -> Job:
    """A job of these bytes, to be done within so many seconds; whoever runs it lets go of them."""
    body, page = MemoryFile(), ProgressPage()
    body.append(content)
    work = work_of(body, answer, page)
    return Job(
        client=client,
        faces_per_minute=None,
        work=work,
        body=body,
        answer=answer,
        report=None,
        page=page,
        upload_seconds=0.0,
        must_end=time.monotonic() + seconds,
    )
