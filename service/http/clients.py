"""Who asks: the one that turns and budgets are counted for."""

from __future__ import annotations

from dataclasses import dataclass

from fastapi import Request

from ..settings import Settings
from .addresses import site


@dataclass(frozen=True, slots=True)
class Client:
    """A client.

    Attributes:
        id: the same for all its requests; `key:NAME` or `address:…`.
        faces_per_minute: its budget of refined faces; None: no limit.
        named: whether it has proved who it is. What a named client makes is for it alone.
    """

    id: str
    faces_per_minute: float | None
    named: bool = False


def client_of(request: Request, settings: Settings) -> Client:
    """Return the client that an authentication layer has found, else the address that asks."""
    identified = getattr(request.state, "client", None)
    if isinstance(identified, Client):
        return identified
    host = "" if request.client is None else request.client.host
    return Client(f"address:{site(host)}", settings.faces_per_minute)
