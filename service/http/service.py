"""State that the routes share."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..errors import check_choice
from ..settings import Settings
from ..workers.catalogue import Catalogue
from ..workers.desk import Desk
from ..workers.pool import Workers
from .admission import Admission
from .jobs.book import JobBook

if TYPE_CHECKING:
    from .jobs.shared import SharedJobs


class ReadOnce:
    """The catalogue as the server has it: read in a worker when it is first wanted, then kept.

    `heard` is called with it once.
    """

    def __init__(
        self,
        workers: Workers,
        admission: Admission,
        read: Callable[[], Catalogue],
        heard: Callable[[Catalogue], None] = lambda catalogue: None,
    ) -> None:
        self._workers = workers
        self._admission = admission
        self._read = read
        self._heard = heard
        self._catalogue: Catalogue | None = None
        self._reading = asyncio.Lock()

    async def get(self) -> Catalogue:
        """Return the catalogue. Raises ServiceError where no worker can read it now."""
        # One reads, however many ask: it takes the worker that measures every job.
        async with self._reading:
            if self._catalogue is None:
                async with self._admission.working():
                    self._catalogue = await self._workers.run(self._read)
                self._heard(self._catalogue)
            return self._catalogue

    async def check(self, name: str | None) -> None:
        """Check that there is a model of that name; None always is. Raises InvalidParameter."""
        if name is not None:
            check_choice("model", name, (await self.get()).names)


@dataclass
class Service:
    """One service: its settings, its desk, who is inside, and what it keeps."""

    settings: Settings
    desk: Desk
    admission: Admission
    models: ReadOnce
    book: JobBook
    shared: SharedJobs | None = None
