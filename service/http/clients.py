"""Identify the client for which turns and budgets are counted."""

from __future__ import annotations

from dataclasses import dataclass, field
from ipaddress import IPv6Address, ip_address, ip_network

from fastapi import Request

from ..settings import Settings

# One subscriber of IPv6 is given a /64 at least, often a /56, and a site a /48.
IPV6_NETWORKS = (64, 56, 48)


@dataclass(frozen=True, slots=True)
class Client:
    """A client.

    Attributes:
        id: the same for all its requests; `key:NAME` or `address:…`.
        faces_per_minute: its budget of refined faces; None: no limit.
        named: whether it has proved who it is. What a named client makes is for it alone.
        networks: what it counts for: its id, and the wider networks of its address.
    """

    id: str
    faces_per_minute: float | None
    named: bool = False
    networks: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        if not self.networks:
            object.__setattr__(self, "networks", (self.id,))


def client_of(request: Request, settings: Settings) -> Client:
    """Return the client that an authentication layer has found, else the address that asks."""
    identified = getattr(request.state, "client", None)
    if isinstance(identified, Client):
        return identified
    host = "" if request.client is None else request.client.host
    networks = tuple(f"address:{network}" for network in sites(host))
    return Client(networks[0], settings.faces_per_minute, networks=networks)


def sites(address: str) -> tuple[str, ...]:
    """Return the networks whose shares an address counts for, the narrowest first."""
    try:
        parsed = ip_address(address)
    except ValueError:
        return (address,)
    if not isinstance(parsed, IPv6Address):
        return (address,)
    if parsed.ipv4_mapped:
        return (str(parsed.ipv4_mapped),)
    return tuple(str(ip_network((int(parsed), length), strict=False)) for length in IPV6_NETWORKS)
