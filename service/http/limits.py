"""GET /limits: what a request may ask for, so that clients need not guess."""

from __future__ import annotations

from pydantic import BaseModel, Field

from ..bodies import media
from ..settings import Settings
from .clients import Client


class Range(BaseModel):
    """From the least to the largest value, both allowed."""

    min: int
    max: int


class LimitsEntry(BaseModel):
    """The limits of this service."""

    body_bytes: int = Field(description="largest body")
    faces: int = Field(description="most faces predicted in an answer")
    faces_per_minute: float | None = Field(
        description="most faces that the client may ask for in a minute; null: no such limit"
    )
    levels: Range
    memory_bytes: int = Field(description="most memory predicted for one job")
    seconds: float = Field(description="longest job, and longest wait for `POST /subdivide`")
    queue_seconds: float = Field(description="longest wait of a job from `POST /jobs`")
    result_seconds: float = Field(description="how long the result of a job is kept")
    result_bytes: int = Field(description="what all results may take, and so each")
    formats: list[str] = Field(description="media types of bodies")


def limits_of(settings: Settings, client: Client) -> LimitsEntry:
    """Return the limits that the settings set, and the budget of who asks."""
    return LimitsEntry(
        body_bytes=int(settings.body),
        faces=settings.faces,
        faces_per_minute=client.faces_per_minute,
        levels=Range(min=1, max=settings.levels),
        memory_bytes=int(settings.memory),
        seconds=settings.job_seconds,
        queue_seconds=settings.queue_seconds,
        result_seconds=settings.result_seconds,
        result_bytes=int(settings.result_bytes),
        formats=list(media.ACCEPTED),
    )
