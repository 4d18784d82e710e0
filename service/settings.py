"""What a deployment may set, by environment (`PNS_…`) or by the constructor."""

from __future__ import annotations

import os

from pydantic import ByteSize, Field
from pydantic_settings import BaseSettings, SettingsConfigDict

from service.options import MAX_LEVELS, Limits

MIB = 1024**2


def _worker_default() -> int:
    """Two refinements side by side at most: each may take `memory`."""
    return min(2, os.cpu_count() or 1)


class Settings(BaseSettings):
    """The service's settings; sizes read as `64MiB`, durations are seconds.

    Raises pydantic.ValidationError where a value is out of range.
    """

    model_config = SettingsConfigDict(env_prefix="PNS_", frozen=True, extra="forbid")

    host: str = "127.0.0.1"
    port: int = Field(default=8000, ge=0, le=65535)
    model: str | None = Field(
        default=None, description="bundled name or model file; none: the default bundled one"
    )

    body: ByteSize = Field(default=ByteSize(64 * MIB), gt=0, description="largest request body")
    faces: int = Field(default=5_000_000, gt=0, description="most faces predicted in an answer")
    levels: int = Field(default=MAX_LEVELS, ge=1, le=MAX_LEVELS, description="deepest level")
    memory: ByteSize = Field(
        default=ByteSize(4096 * MIB), gt=0, description="most memory predicted for one job"
    )
    json_items: int = Field(
        default=2_000_000, gt=0, description="most structural characters in a glTF's JSON"
    )

    workers: int = Field(default_factory=_worker_default, ge=1, description="worker processes")
    queue: int = Field(default=8, ge=0, description="requests that may wait beside those that run")
    uploads: int = Field(default=64, gt=0, description="bodies that may arrive at the same time")

    job_seconds: float = Field(default=60, gt=0, description="longest job")
    upload_seconds: float = Field(default=120, gt=0, description="longest upload of one body")
    idle_seconds: float = Field(
        default=10, gt=0, description="longest wait for the next piece of a body"
    )
    stall_seconds: float = Field(
        default=30, gt=0, description="longest wait for a client to take one piece of its answer"
    )
    drain_seconds: float = Field(
        default=75, gt=0, description="longest wait for running requests after SIGTERM"
    )

    @property
    def places(self) -> int:
        """Requests that run or wait."""
        return self.workers + self.queue

    def job_limits(self) -> Limits:
        """What one job may cost, as the pipeline checks it."""
        return Limits(
            max_faces=self.faces,
            max_memory_bytes=int(self.memory),
            max_json_items=self.json_items,
        )
