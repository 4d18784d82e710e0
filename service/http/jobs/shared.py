"""Jobs that replicas share: published while they are worked on, taken over where a replica dies."""

from __future__ import annotations

import asyncio
import logging
from contextlib import AsyncExitStack, ExitStack, suppress
from dataclasses import asdict
from typing import Any

from ...errors import BusyError, ServiceError, WorkerDied
from ...options import Options
from ...workers.job import Job, State
from ...workers.memory_file import MemoryFile
from .. import problems
from ..intake import Wanted, made_of
from ..room import result_folder
from ..service import Service
from .book import Entry, NoSuchJobError
from .room import Room
from .store import (
    ANSWER,
    BEAT_SECONDS,
    BODY,
    LEASE_SECONDS,
    REPORT,
    JobStore,
    Lease,
    Record,
    StoreError,
)
from .work import begin_shared, job_json, shown

# Of a job's work what a request names, beside its options.
ASKED = ("model", "target", "content_type", "encoding", "request_id")

# How long to wait before the end of a job is told again to a store that did not answer. After that
# the job is left to whichever replica finds the store first.
AGAIN_SECONDS = (1.0, 2.0, 4.0, 8.0)

log = logging.getLogger("pns.service")


class SharedJobs:
    """Jobs of all replicas, as one of them sees them."""

    def __init__(self, service: Service, store: JobStore) -> None:
        self.store = store
        self.reached = True
        """True while the store answers, as of the last look."""
        self._service = service
        settings = service.settings
        self._room = Room(int(settings.result_bytes), settings.results)
        self._notes: set[asyncio.Task[None]] = set()

    async def check_room(self, networks: tuple[str, ...]) -> None:
        """Raise BusyError where a result of this client would find no place now, StoreError."""
        self._room.check((await self.store.kept()).values(), networks)

    async def publish(self, job: Job, owner: str | None) -> None:
        """Make a job known to other replicas, with its body. Raises StoreError, StoreFullError."""
        asked = {name: getattr(job.work, name) for name in ASKED}
        asked |= {"client": job.client, "options": asdict(job.work.options)}
        view = job_json(self._service, job)
        await self.store.create(job.id, owner, asked, view, job.body.pieces())

    async def beat(self, entry: Entry) -> None:
        """Keep a job leased until its end is stored; end it where its client wants that."""
        while True:
            await asyncio.sleep(BEAT_SECONDS)
            # The lease outlasts a store that is away for a moment.
            with suppress(StoreError):
                view = shown(self._service, entry.job)
                lease = await self.store.beat(entry.job.id, view)
                if lease is Lease.HELD:
                    continue
                entry.cancelled = lease is Lease.CANCELLED
                if entry.task is not None:
                    entry.task.cancel()
                return

    async def end(self, entry: Entry) -> None:
        """Keep the end of a job for all replicas; leave one that only this replica has ended.

        A job whose result finds no room has failed.
        """
        job = entry.job
        busy = isinstance(job.error, BusyError) and not isinstance(job.error, WorkerDied)
        left = job.state is State.CANCELLED and not entry.cancelled
        if left or (busy and entry.adopted):
            # Without its word the lease ends a little later.
            with suppress(StoreError):
                await self.store.release(job.id)
            return
        for seconds in (*AGAIN_SECONDS, None):
            try:
                await self._keep(entry)
            except StoreError as error:
                log.warning("the end of a job is not stored yet: %s", error)
            else:
                return
            if seconds is not None:
                await asyncio.sleep(seconds)
        log.error("a job is left to the replica that finds the store first")

    async def _keep(self, entry: Entry) -> None:
        """Store the end of a job. Raises StoreError."""
        job = entry.job
        files = (job.answer, job.report) if job.state is State.DONE else (None, None)
        sizes = [0 if file is None else file.size for file in files]
        try:
            for name in self._room.leaving(await self.store.kept(), entry.networks, sum(sizes)):
                await self.store.delete(name)
            results = {
                name: file.pieces()
                for name, file in zip((ANSWER, REPORT), files, strict=True)
                if file is not None
            }
            view = job_json(self._service, job)
            await self.store.finish(job.id, view, results, entry.networks)
        except StoreError:
            raise
        except BusyError as error:
            job.state, job.error = State.FAILED, error
            view = job_json(self._service, job)
            await self.store.finish(job.id, view, {}, entry.networks)

    def fetched(self, job_id: str) -> None:
        """Note that somebody has the result of a job."""

        async def note() -> None:
            with suppress(BusyError):
                await self.store.fetched(job_id)

        task = asyncio.create_task(note())
        self._notes.add(task)
        task.add_done_callback(self._notes.discard)

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
        """Return a file of a job, in memory. Raises NoSuchJobError, StoreError, NoStorageError."""
        with ExitStack() as held:
            file = held.enter_context(MemoryFile())
            if not await self.store.file(name, job_id, file):
                raise NoSuchJobError("no job has this id, or its result is no longer kept")
            held.pop_all()
        return file

    async def adopt_for_ever(self) -> None:
        """Take the jobs of replicas that have died, one after the other."""
        while True:
            await asyncio.sleep(LEASE_SECONDS / 4)
            try:
                self.reached = await self.store.answers()
                while not self._service.admission.draining and await self._adopt():
                    pass
            except StoreError as error:
                log.warning("jobs of other replicas are not looked at: %s", error)
            except BusyError:
                # There is no room yet.
                continue
            except Exception:
                # A record that this release cannot read, say. Its lease ends; others have a turn.
                log.exception("a job of another replica is not taken")

    async def _adopt(self) -> bool:
        """Take one job, where there is one and room for it. Raises StoreError, BusyError."""
        service = self._service
        service.desk.turns.check_room("")
        record = await self.store.take_orphan(service.book.has)
        if record is None:
            return False
        log.warning(
            "a job is taken from replica %s, whose lease on it has ended",
            record.replica,
            extra={"request_id": record.asked["request_id"]},
        )
        settings = service.settings
        patience = settings.queue_seconds + settings.job_seconds
        wanted = Wanted(True, True, result_folder(settings), patience)
        async with AsyncExitStack() as held:
            counted = held.enter_context(service.admission.body(record.asked["client"]))
            with ExitStack() as files:
                body = files.enter_context(MemoryFile())
                if not await self.store.file(BODY, record.id, body):
                    error = StoreError("the file is no longer kept: send it again")
                    await self._fail(record, error)
                    return True
                counted.grow(body.size)
                options = Options(**record.asked["options"])
                asked: dict[str, Any] = record.asked | {"options": options}
                job = made_of(settings, body, wanted, **asked)
                files.pop_all()
            held.callback(job.close)
            job.id = record.id
            entry = service.book.add(job, record.owner)
            entry.adopted = True
            begin_shared(service, entry, held.pop_all())
        return True

    async def _fail(self, record: Record, error: ServiceError) -> None:
        """End a job that no replica can do. Raises StoreError."""
        problem = problems.of_job_view(error, record.asked["request_id"])
        end = {"state": str(State.FAILED), "queue_place": None, "stage": None, "problem": problem}
        networks = (record.asked["client"],)
        await self.store.finish(record.id, record.view | end, {}, networks)
