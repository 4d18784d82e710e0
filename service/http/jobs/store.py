"""Jobs that any replica of the service answers for, in Redis; results there, or in a bucket.

A job is a record, its body, and a lease that its replica renews while it works on it. Where a
lease ends, because its replica has died, another replica takes the job: it has no side effects.
"""

from __future__ import annotations

import asyncio
import json
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from ...errors import ServiceError
from ...settings import Settings, StartError

PREFIX = "pns:"
OPEN = f"{PREFIX}open"
BODY, ANSWER, REPORT = "body", "answer", "report"
# How often a lease is renewed and its job's progress written, and how long it lasts.
BEAT_SECONDS = 1.0
LEASE_SECONDS = 10.0
# How long the store may be silent.
STORE_SECONDS = 5.0


class StoreError(ServiceError):
    """The store of jobs cannot be reached, or has no room."""

    status = 503
    code = "store-unavailable"
    title = "The store of jobs is not available"


@dataclass(frozen=True, slots=True)
class Record:
    """A job in the store.

    Attributes:
        owner: whose it is; None for everybody who knows its id.
        asked: what its replica needs to do it, as JSON has it.
        view: the job as its client sees it.
        cancelled: whether its client has cancelled it.
    """

    id: str
    owner: str | None
    asked: dict[str, Any]
    view: dict[str, Any]
    cancelled: bool


class RedisFiles:
    """Bodies and results as values of Redis, which deletes them in time."""

    def __init__(self, redis: Any) -> None:
        self._redis = redis

    async def write(self, name: str, content: bytes, seconds: float) -> None:
        """Keep a file, for so many seconds."""
        await self._redis.set(f"{PREFIX}{name}", content, px=_milliseconds(seconds))

    async def read(self, name: str) -> bytes | None:
        """Return a file; None where there is none."""
        return await self._redis.get(f"{PREFIX}{name}")

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

    async def write(self, name: str, content: bytes, seconds: float) -> None:
        """Keep a file; how long is for the rule to say."""
        await asyncio.to_thread(self._system.pipe_file, self._path(name), content)

    async def read(self, name: str) -> bytes | None:
        """Return a file; None where there is none."""
        try:
            return await asyncio.to_thread(self._system.cat_file, self._path(name))
        except FileNotFoundError:
            return None

    async def delete(self, *names: str) -> None:
        """Delete files; those that are not there are no error."""
        for name in names:
            try:
                await asyncio.to_thread(self._system.rm_file, self._path(name))
            except FileNotFoundError:
                continue


class JobStore:
    """The jobs of all replicas. Every call raises StoreError where the store does not answer."""

    def __init__(self, settings: Settings) -> None:
        try:
            from redis.asyncio import Redis
            from redis.exceptions import RedisError
        except ImportError as error:
            raise StartError(
                "PNS_STORE is set and redis is not installed: pip install 'pns-subdivision[store]'"
            ) from error
        self._errors = (RedisError, OSError)
        # Its types leave open whether it answers with bytes.
        self._redis: Any = Redis.from_url(
            str(settings.store), socket_timeout=STORE_SECONDS, socket_connect_timeout=STORE_SECONDS
        )
        self._replica = secrets.token_hex(8)
        self._seconds = settings.queue_seconds + settings.job_seconds + settings.result_seconds
        self._result_seconds = settings.result_seconds
        self._files = (
            RedisFiles(self._redis)
            if settings.store_files is None
            else BucketFiles(settings.store_files)
        )

    async def close(self) -> None:
        """Close the connections."""
        await self._redis.aclose()

    async def create(
        self,
        job_id: str,
        owner: str | None,
        asked: dict[str, Any],
        view: dict[str, Any],
        body: bytes,
    ) -> None:
        """Write a new job down, and lease it."""
        fields = {"owner": json.dumps(owner), "asked": json.dumps(asked), "view": json.dumps(view)}
        with self._reached():
            await self._files.write(f"{BODY}:{job_id}", body, self._seconds)
            async with self._redis.pipeline() as steps:
                steps.hset(_record(job_id), mapping=fields)
                steps.pexpire(_record(job_id), _milliseconds(self._seconds))
                steps.set(_lease(job_id), self._replica, px=_milliseconds(LEASE_SECONDS))
                steps.sadd(OPEN, job_id)
                await steps.execute()

    async def beat(self, job_id: str, view: dict[str, Any]) -> bool:
        """Renew the lease of a job, and write how far it is; False where nobody wants it."""
        with self._reached():
            async with self._redis.pipeline() as steps:
                steps.hget(_record(job_id), "cancelled")
                steps.exists(_record(job_id))
                steps.set(_lease(job_id), self._replica, px=_milliseconds(LEASE_SECONDS))
                cancelled, exists, _ = await steps.execute()
            if exists:
                await self._redis.hset(_record(job_id), "view", json.dumps(view))
            return bool(exists) and not cancelled

    async def finish(self, job_id: str, view: dict[str, Any], results: dict[str, bytes]) -> None:
        """Keep the end of a job, and its results."""
        with self._reached():
            for name, content in results.items():
                await self._files.write(f"{name}:{job_id}", content, self._result_seconds)
            async with self._redis.pipeline() as steps:
                steps.hset(_record(job_id), "view", json.dumps(view))
                steps.pexpire(_record(job_id), _milliseconds(self._result_seconds))
                steps.srem(OPEN, job_id)
                steps.delete(_lease(job_id))
                await steps.execute()
            await self._files.delete(f"{BODY}:{job_id}")

    async def release(self, job_id: str) -> None:
        """End the lease of a job that another replica is to do."""
        with self._reached():
            await self._redis.delete(_lease(job_id))

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
        )

    async def file(self, name: str, job_id: str) -> bytes | None:
        """Return a file of a job; None where it is no longer kept."""
        with self._reached():
            return await self._files.read(f"{name}:{job_id}")

    async def cancel(self, job_id: str) -> None:
        """Tell the replica that works on a job to end it."""
        with self._reached():
            await self._redis.hset(_record(job_id), "cancelled", "1")

    async def delete(self, job_id: str) -> None:
        """Forget a job."""
        with self._reached():
            async with self._redis.pipeline() as steps:
                steps.srem(OPEN, job_id)
                steps.delete(_record(job_id), _lease(job_id))
                await steps.execute()
            await self._files.delete(*(f"{name}:{job_id}" for name in (BODY, ANSWER, REPORT)))

    async def take_orphan(self) -> Record | None:
        """Lease a job whose replica has died, and return it; None where there is none."""
        with self._reached():
            for name in await self._redis.smembers(OPEN):
                job_id = name.decode()
                leased = await self._redis.set(
                    _lease(job_id), self._replica, nx=True, px=_milliseconds(LEASE_SECONDS)
                )
                if not leased:
                    continue
                if not await self._redis.sismember(OPEN, job_id):
                    # It has ended since they were listed.
                    await self._redis.delete(_lease(job_id))
                    continue
                record = await self.find(job_id)
                if record is not None and not record.cancelled:
                    return record
                # Its time is over, or nobody wants it.
                await self.delete(job_id)
        return None

    @contextmanager
    def _reached(self) -> Iterator[None]:
        """Turn the errors of the store into StoreError."""
        try:
            yield
        except self._errors as error:
            raise StoreError(f"the store of jobs does not answer: {error}") from error


def _record(job_id: str) -> str:
    return f"{PREFIX}job:{job_id}"


def _lease(job_id: str) -> str:
    return f"{PREFIX}lease:{job_id}"


def _milliseconds(seconds: float) -> int:
    return max(1, round(1000 * seconds))
