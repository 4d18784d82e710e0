"""Types of settings: how their text is read, and errors."""

from __future__ import annotations

import re
from ipaddress import IPv4Network, IPv6Network, ip_network
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, ByteSize, Field
from pydantic_settings import NoDecode

Network = IPv4Network | IPv6Network

_SIZE = re.compile(r"\s*\d*\.?\d+\s*[A-Za-z]*\s*")
# The kernel counts the bytes of a process in 63 bits, and a job may take a little more than these.
_MOST_BYTES = 2**60
# Scheme, host and perhaps port, as browsers send it.
_ORIGIN = re.compile(r"\*|https?://[a-z0-9.-]+(:[0-9]{1,5})?|https?://\[[0-9a-f:]+\](:[0-9]{1,5})?")

# A name or an address, without a port; a star stands for any label, alone for any name.
_HOST = re.compile(r"\*|(\*\.)?[A-Za-z0-9.-]+|[0-9A-Fa-f:]+")


def _whole_size(value: object) -> object:
    """Refuse a size that has more to it: pydantic reads a beginning, and 1,5GiB is a byte to it."""
    if isinstance(value, str) and not _SIZE.fullmatch(value):
        raise ValueError(f"{value!r} is no size, such as 1.5GiB")
    return value


def _not_empty(value: object) -> object:
    """Refuse what is empty: as a host it means every address, and as a path the folder here."""
    if value == "":
        raise ValueError("it is empty: leave it out, or name something")
    return value


def _listed(value: object) -> object:
    """Read a list as an environment variable holds it; blanks around names are no part."""
    if isinstance(value, str):
        return tuple(name.strip() for name in value.split(",") if name.strip())
    return value


def _networks(value: object) -> object:
    listed = _listed(value)
    # By its one reader: pydantic tells of each kind of network that a text is not.
    return tuple(map(ip_network, listed)) if isinstance(listed, (tuple, list)) else listed


def _origin(text: str) -> str:
    if not _ORIGIN.fullmatch(text):
        raise ValueError(f"{text!r} is no origin, such as https://a.example:8443, and no more")
    return text


def _host(text: str) -> str:
    if not _HOST.fullmatch(text):
        raise ValueError(f"{text!r} is no host name, such as pns.example or *.pns.example")
    return text.lower()


def _store(text: str) -> str:
    if not text.startswith(("redis://", "rediss://", "unix://")):
        # Not what it is: it may hold a password.
        raise ValueError("it is no address of a Redis, such as redis://HOST:6379/0")
    return text


Size = Annotated[ByteSize, BeforeValidator(_whole_size), Field(gt=0, le=_MOST_BYTES)]
Seconds = Annotated[float, Field(gt=0)]
Store = Annotated[str, AfterValidator(_store)]
Name = Annotated[str, BeforeValidator(_not_empty)]
Place = Annotated[Path, BeforeValidator(_not_empty)]
Networks = Annotated[tuple[Network, ...], NoDecode, BeforeValidator(_networks)]
Hosts = Annotated[
    tuple[Annotated[str, BeforeValidator(_host)], ...], NoDecode, BeforeValidator(_listed)
]
Words = Annotated[tuple[Name, ...], Field(min_length=1), NoDecode, BeforeValidator(_listed)]
Origins = Annotated[
    tuple[Annotated[str, BeforeValidator(_origin)], ...], NoDecode, BeforeValidator(_listed)
]
