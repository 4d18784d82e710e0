"""Jobs that any replica of the service answers for, in Redis; results there, or in a bucket.

A job is a record, its body, and a lease that its replica renews while it works on it. Where a
lease ends, because its replica has died, another replica takes the job: it has no side effects.
"""

from __future__ import annotations

import asyncio
import json
import os
import secrets
import socket
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import StrEnum
from errno import ENOSPC
from typing import Any

from ...errors import BusyError
from ...settings import Settings, StartError
from ...workers.memory_file import PIECE, MemoryFile
from .room import Kept

PREFIX = "pns:"
# Ids of the jobs that have not ended; what is kept of those that have, by id; those of them that
# somebody has fetched.
OPEN, HELD, FETCHED = f"{PREFIX}open", f"{PREFIX}held", f"{PREFIX}fetched"
BODY, ANSWER, REPORT = "body", "answer", "report"
# How often a lease is renewed and its job's progress written, and how long it lasts.
BEAT_SECONDS = 1.0
LEASE_SECONDS = 10.0
# How long the store may be silent.
STORE_SECONDS = 5.0


# Each is atomic, so what comes late changes nothing that has ended, and nothing that is another's.
# They write little, so a store that is full takes it: the end of a job is never lost to others.
_OURS = """#!lua flags=allow-oom
local open, record, lease = KEYS[1], KEYS[2], KEYS[3]
local id, replica = ARGV[1], ARGV[2]
local holder = redis.call('GET', lease)
local ours = redis.call('SISMEMBER', open, id) == 1 and redis.call('EXISTS', record) == 1
    and (not holder or holder == replica)
"""
_BEAT = f"""{_OURS}
if not ours then return 'lost' end
if redis.call('HEXISTS', record, 'cancelled') == 1 then return 'cancelled' end
redis.call('SET', lease, replica, 'PX', ARGV[3])
redis.call('HSET', record, 'view', ARGV[4])
return 'held'
"""
_FINISH = f"""{_OURS}
if not ours then return 0 end
redis.call('HSET', record, 'view', ARGV[4])
redis.call('PEXPIRE', record, ARGV[3])
redis.call('SREM', open, id)
redis.call('DEL', lease)
redis.call('HSET', KEYS[4], id, ARGV[5])
redis.call('PEXPIRE', KEYS[4], ARGV[3])
return 1
"""
_RELEASE = f"""{_OURS}
if ours then redis.call('DEL', lease) end
"""


class StoreError(BusyError):
    """The store of jobs does not answer. What it said is for the log: it holds addresses."""

    code = "store-unavailable"
    title = "The store of jobs is not available"

    def __str__(self) -> str:
        return self.detail if self.__cause__ is None else f"{self.detail}: {self.__cause__}"


class StoreFullError(BusyError):
    """The store of jobs has no room."""

    code = "store-full"
    title = "The store of jobs is full"


class Lease(StrEnum):
    """State of a lease: this replica's, of a job that was cancelled, or no longer this one's."""

    HELD = "held"
    CANCELLED = "cancelled"
    LOST = "lost"


@dataclass(frozen=True, slots=True)
class Record:
    """A job in the store.

    Attributes:
        owner: whose it is; None for everybody who knows its id.
        asked: what its replica needs to do it, as JSON has it.
        view: the job as its client sees it.
        cancelled: whether its client has cancelled it.
        replica: whose it was last.
    """

    id: str
    owner: str | None
    asked: dict[str, Any]
    view: dict[str, Any]
    cancelled: bool
    replica: str


class RedisFiles:
    """Files as values of Redis, which deletes them in time.

    They go piece by piece: each piece has the store's time, however large the file is.
    """

    def __init__(self, redis: Any) -> None:
        self._redis = redis

    async def write(self, name: str, pieces: Iterable[bytes], seconds: float) -> None:
        """Keep a file; under its name it is whole."""
        key, lifetime, offset = f"{PREFIX}{name}", _milliseconds(seconds), 0
        draft = f"{key}:{secrets.token_hex(8)}"
        try:
            await self._redis.set(draft, b"", px=lifetime)
            for piece in pieces:
                await self._redis.setrange(draft, offset, piece)
                offset += len(piece)
            async with self._redis.pipeline() as steps:
                steps.pexpire(draft, lifetime)
                steps.rename(draft, key)
                await steps.execute()
        except BaseException:
            with suppress(Exception):
                await self._redis.delete(draft)
            raise

    async def read(self, name: str, into: MemoryFile) -> bool:
        """Append a file to another; return whether there is one, whole."""
        key, offset = f"{PREFIX}{name}", 0
        size = await self._redis.strlen(key)
        while offset < size:
            piece = await self._redis.getrange(key, offset, offset + PIECE - 1)
            if not piece:
                return False
            into.append(piece)
            offset += len(piece)
        return bool(size or await self._redis.exists(key))

    async def delete(self, *names: str) -> None:
        """Delete files; those that are not there are no error."""
        await self._redis.delete(*(f"{PREFIX}{name}" for name in names))


class BucketFiles:
    """Bodies and results in a bucket or a folder, by fsspec; a rule of it is to delete old ones."""

    def __init__(self, url: str) -> None:
        import fsspec

        self._system, self._root = fsspec.url_to_fs(url)
        self._system.makedirs(self._root, exist_ok=True)

    def _path(self, name: str) -> str:
        return f"{self._root}/{name.replace(':', '-')}"

    async def write(self, name: str, pieces: Iterable[bytes], seconds: float) -> None:
        """Keep a file."""
        content = b"".join(pieces)
        await asyncio.to_thread(self._system.pipe_file, self._path(name), content)

    async def read(self, name: str, into: MemoryFile) -> bool:
        """Append a file to another; return whether there is one."""
        try:
            into.append(await asyncio.to_thread(self._system.cat_file, self._path(name)))
        except FileNotFoundError:
            return False
        return True

    async def delete(self, *names: str) -> None:
        """Delete files; those that are not there are no error."""
        for name in names:
            try:
                await asyncio.to_thread(self._system.rm_file, self._path(name))
            except FileNotFoundError:
                continue


class JobStore:
    """The jobs of all replicas.

    Every call raises StoreError where the store does not answer, StoreFullError where it is full.
    """

    def __init__(self, settings: Settings) -> None:
        try:
            from redis.asyncio import Redis
            from redis.exceptions import OutOfMemoryError, RedisError
        except ImportError as error:
            raise StartError(
                "PNS_STORE is set and redis is not installed: pip install 'pns-subdivision[store]'"
            ) from error
        self._errors, self._full = (RedisError, OSError), OutOfMemoryError
        # Its types leave open whether it answers with bytes.
        self._redis: Any = Redis.from_url(
            str(settings.store), socket_timeout=STORE_SECONDS, socket_connect_timeout=STORE_SECONDS
        )
        register = self._redis.register_script
        self._beat, self._finish = register(_BEAT), register(_FINISH)
        self._release = register(_RELEASE)
        self.replica = f"{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(4)}"
        self._seconds = settings.queue_seconds + settings.job_seconds + settings.result_seconds
        self._result_seconds = settings.result_seconds
        self._promised_seconds = min(settings.promised_seconds, settings.result_seconds)
        self._files = (
            RedisFiles(self._redis)
            if settings.store_files is None
            else BucketFiles(settings.store_files)
        )

    async def close(self) -> None:
        """Close the connections."""
        await self._redis.aclose()

    async def answers(self) -> bool:
        """Return whether the store is there."""
        try:
            return bool(await self._redis.ping())
        except self._errors:
            return False

    async def create(
        self,
        job_id: str,
        owner: str | None,
        asked: dict[str, Any],
        view: dict[str, Any],
        body: Iterable[bytes],
    ) -> None:
        """Write a new job down, and lease it."""
        fields = {"owner": json.dumps(owner), "asked": json.dumps(asked), "view": json.dumps(view)}
        fields["replica"] = self.replica
        with self._reached():
            await self._files.write(f"{BODY}:{job_id}", body, self._seconds)
            try:
                async with self._redis.pipeline() as steps:
                    steps.hset(_record(job_id), mapping=fields)
                    steps.pexpire(_record(job_id), _milliseconds(self._seconds))
                    steps.set(_lease(job_id), self.replica, px=_milliseconds(LEASE_SECONDS))
                    steps.sadd(OPEN, job_id)
                    await steps.execute()
            except BaseException:
                with suppress(Exception):
                    await self._files.delete(f"{BODY}:{job_id}")
                raise

    async def beat(self, job_id: str, view: dict[str, Any]) -> Lease:
        """Renew the lease of a job, and write how far it is."""
        arguments = [job_id, self.replica, _milliseconds(LEASE_SECONDS), json.dumps(view)]
        with self._reached():
            return Lease((await self._beat(_keys(job_id), arguments)).decode())

    async def finish(
        self,
        job_id: str,
        view: dict[str, Any],
        results: Mapping[str, Iterable[bytes]],
        networks: tuple[str, ...],
    ) -> None:
        """Keep the end of a job and its results, unless the job is no longer this replica's."""
        size = 0

        def counted(pieces: Iterable[bytes]) -> Iterable[bytes]:
            nonlocal size
            for piece in pieces:
                size += len(piece)
                yield piece

        with self._reached():
            for name, pieces in results.items():
                await self._files.write(f"{name}:{job_id}", counted(pieces), self._result_seconds)
            now = time.time()
            held = {
                "networks": networks,
                "size": size,
                "done": bool(results),
                "promised_until": now + self._promised_seconds,
                "until": now + self._result_seconds,
            }
            arguments = [job_id, self.replica, _milliseconds(self._result_seconds)]
            arguments += [json.dumps(view), json.dumps(held)]
            if await self._finish([*_keys(job_id), HELD], arguments):
                await self._files.delete(f"{BODY}:{job_id}")

    async def release(self, job_id: str) -> None:
        """End the lease of a job that another replica is to do."""
        with self._reached():
            await self._release(_keys(job_id), [job_id, self.replica])

    async def kept(self) -> dict[str, Kept]:
        """Return what is kept of the jobs of all replicas that have ended, the oldest first."""
        with self._reached():
            async with self._redis.pipeline() as steps:
                steps.hgetall(HELD)
                steps.smembers(FETCHED)
                held, fetched = await steps.execute()
            now = time.time()
            every = {name: json.loads(text) for name, text in held.items()}
            entries = {name: entry for name, entry in every.items() if entry["until"] >= now}
            if over := every.keys() - entries.keys():
                await self._redis.hdel(HELD, *over)
        kept = {}
        for name, entry in sorted(entries.items(), key=lambda item: item[1]["until"]):
            done, taken = entry["done"], name in fetched
            promised = done and not taken and now < entry["promised_until"]
            networks = tuple(entry["networks"])
            kept[name.decode()] = Kept(networks, entry["size"], done, taken, promised)
        return kept

    async def fetched(self, job_id: str) -> None:
        """Note that somebody has the result of a job."""
        with self._reached():
            async with self._redis.pipeline() as steps:
                steps.sadd(FETCHED, job_id)
                steps.pexpire(FETCHED, _milliseconds(self._result_seconds))
                await steps.execute()

    async def find(self, job_id: str) -> Record | None:
        """Return the record of a job; None where there is none."""
        with self._reached():
            fields = await self._redis.hgetall(_record(job_id))
        if b"view" not in fields or b"asked" not in fields:
            return None
        return Record(
            id=job_id,
            owner=json.loads(fields[b"owner"]),
            asked=json.loads(fields[b"asked"]),
            view=json.loads(fields[b"view"]),
            cancelled=b"cancelled" in fields,
            replica=fields.get(b"replica", b"unknown").decode(),
        )

    async def file(self, name: str, job_id: str, into: MemoryFile) -> bool:
        """Append a file of a job to another; return whether it is still kept."""
        with self._reached():
            return await self._files.read(f"{name}:{job_id}", into)

    async def cancel(self, job_id: str) -> None:
        """Tell the replica that works on a job to end it."""
        with self._reached():
            await self._redis.hset(_record(job_id), "cancelled", "1")

    async def delete(self, job_id: str) -> None:
        """Forget a job."""
        with self._reached():
            async with self._redis.pipeline() as steps:
                steps.srem(OPEN, job_id)
                steps.srem(FETCHED, job_id)
                steps.hdel(HELD, job_id)
                steps.delete(_record(job_id), _lease(job_id))
                await steps.execute()
            await self._files.delete(*(f"{name}:{job_id}" for name in (BODY, ANSWER, REPORT)))

    async def take_orphan(self, has: Callable[[str], bool]) -> Record | None:
        """Lease a job whose replica has died, and return it; None where there is none.

        `has` says of an id whether this replica has the job: it takes none from itself.
        """
        with self._reached():
            for name in await self._redis.smembers(OPEN):
                job_id = name.decode()
                if has(job_id) or await self._redis.exists(_lease(job_id)):
                    continue
                leased = await self._redis.set(
                    _lease(job_id), self.replica, nx=True, px=_milliseconds(LEASE_SECONDS)
                )
                if not leased:
                    continue
                if not await self._redis.sismember(OPEN, job_id):
                    # It has ended since they were listed.
                    await self._redis.delete(_lease(job_id))
                    continue
                record = await self.find(job_id)
                if record is not None and not record.cancelled:
                    await self._redis.hset(_record(job_id), "replica", self.replica)
                    return record
                # Its time is over, or nobody wants it.
                await self.delete(job_id)
        return None

    @contextmanager
    def _reached(self) -> Iterator[None]:
        """Turn the errors of the store into StoreError and StoreFullError."""
        try:
            yield
        except self._errors as error:
            if isinstance(error, self._full) or getattr(error, "errno", None) == ENOSPC:
                raise StoreFullError("the store of jobs has no room", retry_after=60) from error
            raise StoreError("the store of jobs does not answer", retry_after=5) from error


def _keys(job_id: str) -> list[str]:
    return [OPEN, _record(job_id), _lease(job_id)]


def _record(job_id: str) -> str:
    return f"{PREFIX}job:{job_id}"


def _lease(job_id: str) -> str:
    return f"{PREFIX}lease:{job_id}"


def _milliseconds(seconds: float) -> int:
    return max(1, round(1000 * seconds))
