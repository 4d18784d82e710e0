"""Jobs that replicas share: published while they are worked on, taken over where a replica dies."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from contextlib import AsyncExitStack, ExitStack, suppress
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from ...errors import BusyError, ServiceError, WorkerDied
from ...options import Options
from ...workers.job import Job, State
from ...workers.memory_file import MemoryFile
from .. import problems
from ..intake import Wanted, made_of
from ..room import result_folder
from .book import Entry, NoSuchJobError
from .store import (
    ANSWER,
    BEAT_SECONDS,
    BODY,
    LEASE_SECONDS,
    REPORT,
    JobStore,
    Record,
    StoreError,
)

if TYPE_CHECKING:
    from ..service import Service

# Of a job's work what a request names, beside its options.
ASKED = ("model", "target", "content_type", "encoding", "request_id")

View = Callable[[Job], dict[str, Any]]

log = logging.getLogger("pns.service")


class SharedJobs:
    """Jobs of all replicas, as one of them sees them.

    `begin` is called to work on a job that another replica has left: it is in the book, and what
    it holds is given back when its work ends.
    """

    def __init__(
        self, store: JobStore, view: View, begin: Callable[[Entry, AsyncExitStack], None]
    ) -> None:
        self.store = store
        self._view = view
        self._begin = begin

    async def publish(self, job: Job, owner: str | None) -> None:
        """Make a job known to other replicas, with its body. Raises StoreError."""
        body = b"".join(job.body.pieces())
        asked = {name: getattr(job.work, name) for name in ASKED}
        asked |= {"client": job.client, "options": asdict(job.work.options)}
        await self.store.create(job.id, owner, asked, self._view(job), body)

    async def beat(self, entry: Entry) -> None:
        """Keep a job leased while it is worked on; cancel it where its client wants that."""
        while True:
            await asyncio.sleep(BEAT_SECONDS)
            # The lease outlasts a store that is away for a moment.
            with suppress(StoreError):
                if not await self.store.beat(entry.job.id, self._view(entry.job)):
                    entry.cancelled = True
                    if entry.task is not None:
                        entry.task.cancel()
                    return

    async def end(self, entry: Entry) -> bool:
        """Keep the end of a job for all replicas; leave one that only this replica has ended.

        Returns whether the store has it.
        """
        job = entry.job
        busy = isinstance(job.error, BusyError) and not isinstance(job.error, WorkerDied)
        left = job.state is State.CANCELLED and not entry.cancelled
        try:
            if left or (busy and entry.adopted):
                await self.store.release(job.id)
                return True
            results = {}
            if job.state is State.DONE:
                for name, file in ((ANSWER, job.answer), (REPORT, job.report)):
                    results[name] = b"" if file is None else b"".join(file.pieces())
            await self.store.finish(job.id, self._view(job), results)
        except StoreError as error:
            log.warning("the end of a job is not shared: %s", error)
            return False
        return True

    async def find(self, job_id: str, client: str) -> Record:
        """Return the record of a job that this client may see.

        Raises:
            NoSuchJobError: there is none; StoreError: the store does not answer.
        """
        record = await self.store.find(job_id)
        if record is None or record.owner not in (None, client):
            raise NoSuchJobError("no job has this id, or its result is no longer kept")
        return record

    async def file(self, name: str, job_id: str) -> MemoryFile:
        """Return a result, in memory. Raises NoSuchJobError, StoreError, NoStorageError."""
        content = await self.store.file(name, job_id)
        if content is None:
            raise NoSuchJobError("no job has this id, or its result is no longer kept")
        with ExitStack() as held:
            file = held.enter_context(MemoryFile())
            file.append(content)
            held.pop_all()
        return file

    async def adopt_for_ever(self, service: Service) -> None:
        """Take the jobs of replicas that have died, one after the other."""
        while True:
            await asyncio.sleep(LEASE_SECONDS / 4)
            try:
                while not service.admission.draining and await self._adopt(service):
                    pass
            except StoreError as error:
                log.warning("jobs of other replicas are not looked at: %s", error)
            except BusyError:
                # There is no room yet.
                continue
            except Exception:
                # A record that this release cannot read, say. Its lease ends; others have a turn.
                log.exception("a job of another replica is not taken")

    async def _adopt(self, service: Service) -> bool:
        """Take one job, where there is one and room for it. Raises StoreError, BusyError."""
        service.desk.turns.check_room("")
        record = await self.store.take_orphan()
        if record is None:
            return False
        content = await self.store.file(BODY, record.id)
        if content is None:
            await self._fail(record, StoreError("the file is no longer kept: send it again"))
            return True
        settings = service.settings
        options = Options(**record.asked["options"])
        asked: dict[str, Any] = record.asked | {"options": options}
        patience = settings.queue_seconds + settings.job_seconds
        async with AsyncExitStack() as held:
            counted = held.enter_context(service.admission.body(asked["client"]))
            counted.grow(len(content))
            wanted = Wanted(True, True, result_folder(settings), patience)
            with ExitStack() as files:
                body = files.enter_context(MemoryFile())
                body.append(content)
                job = made_of(settings, body, wanted, **asked)
                files.pop_all()
            held.callback(job.close)
            job.id = record.id
            entry = service.book.add(job, record.owner)
            entry.adopted = True
            log.info("a job is taken from a replica that has died")
            self._begin(entry, held.pop_all())
        return True

    async def _fail(self, record: Record, error: ServiceError) -> None:
        """End a job that no replica can do. Raises StoreError."""
        problem = problems.of_job_view(error, record.asked["request_id"])
        end = {"state": str(State.FAILED), "queue_place": None, "stage": None, "problem": problem}
        await self.store.finish(record.id, record.view | end, {})
