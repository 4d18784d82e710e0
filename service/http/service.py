"""What the routes share."""

from __future__ import annotations

from dataclasses import dataclass

from ..settings import Settings
from ..workers.desk import Desk
from ..workers.pool import Workers
from .admission import Admission
from .catalogue import ReadOnce
from .job_book import JobBook


@dataclass(frozen=True)
class Service:
    """One service: its settings, its workers, who is inside, and what it keeps."""

    settings: Settings
    workers: Workers
    desk: Desk
    admission: Admission
    models: ReadOnce
    book: JobBook
