"""State that the routes share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..settings import Settings
from ..workers.desk import Desk
from .admission import Admission
from .catalogue import ReadOnce
from .jobs.book import JobBook

if TYPE_CHECKING:
    from .jobs.shared import SharedJobs


@dataclass
class Service:
    """One service: its settings, its desk, who is inside, and what it keeps."""

    settings: Settings
    desk: Desk
    admission: Admission
    models: ReadOnce
    book: JobBook
    shared: SharedJobs | None = None
