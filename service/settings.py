"""Settings of a deployment, by environment (`PNS_…`) or by the constructor."""

from __future__ import annotations

import os
import re
from difflib import get_close_matches
from ipaddress import IPv4Network, IPv6Network, ip_network
from pathlib import Path
from typing import Annotated, Self

from pydantic import (
    BeforeValidator,
    ByteSize,
    Field,
    model_validator,
)
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from .options import MAX_LEVELS, PREFIX, Limits

MIB = 1024**2
LIMITS = Limits()
# Two names of settings are a misspelling apart from this ratio of equal letters on (difflib).
ALIKE = 0.7


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


Size = Annotated[ByteSize, BeforeValidator(_whole_size), Field(gt=0, le=_MOST_BYTES)]
Seconds = Annotated[float, Field(gt=0)]
Name = Annotated[str, BeforeValidator(_not_empty)]
Place = Annotated[Path, BeforeValidator(_not_empty)]
Networks = Annotated[tuple[Network, ...], NoDecode, BeforeValidator(_networks)]
Hosts = Annotated[
    tuple[Annotated[str, BeforeValidator(_host)], ...],
    NoDecode,
    BeforeValidator(_listed),
    BeforeValidator(_not_empty),
]
Words = Annotated[tuple[Name, ...], Field(min_length=1), NoDecode, BeforeValidator(_listed)]
Origins = Annotated[
    tuple[Annotated[str, BeforeValidator(_origin)], ...], NoDecode, BeforeValidator(_listed)
]


def _worker_default() -> int:
    """Return how many refine side by side: two at most, since each may take `memory`."""
    return min(2, os.cpu_count() or 1)


class StartError(Exception):
    """A setting that this machine cannot fulfil."""


class Settings(BaseSettings):
    """The service's settings; sizes read as `64MiB`, durations are seconds.

    Raises pydantic.ValidationError where a value is out of range, or where the environment holds a
    `PNS_…` that is none of them: a limit that is misspelt would be lost without a word. Only names
    that resemble none of ours pass, and only with `ignore_unknown`.
    """

    model_config = SettingsConfigDict(
        env_prefix=PREFIX, frozen=True, extra="forbid", allow_inf_nan=False
    )

    @model_validator(mode="after")
    def _refuse_unknown(self) -> Self:
        known = {name.upper() for name in type(self).model_fields}
        words = {name.split("_")[0] for name in known}
        for name in os.environ:
            if not name.upper().startswith(PREFIX):
                continue
            own = name.upper().removeprefix(PREFIX)
            if own in known:
                continue
            if near := get_close_matches(own, known, n=1, cutoff=ALIKE):
                raise ValueError(f"there is no setting {name}; is it {PREFIX}{near[0]}?")
            if own.split("_")[0] in words:
                raise ValueError(f"there is no setting {name}: unset it")
            if not self.ignore_unknown:
                raise ValueError(
                    f"there is no setting {name}: unset it, or set {PREFIX}IGNORE_UNKNOWN=1 if it "
                    "belongs to another program"
                )
        return self

    ignore_unknown: bool = Field(
        default=False, description="pass over PNS_… variables that resemble no setting"
    )
    host: Name = "127.0.0.1"
    port: int = Field(default=8000, ge=0, le=65535)
    prefix: str = Field(
        default="",
        pattern=r"^(/[A-Za-z0-9._~-]+)*$",
        description="path under which a proxy shows the service, and which it takes away",
    )
    model: Name | None = Field(
        default=None, description="bundled name or model file; none: the default bundled one"
    )
    providers: Words = Field(
        default=("CPUExecutionProvider",),
        description="execution providers of onnxruntime for every model, preferred first",
    )

    body: Size = Field(default=ByteSize(64 * MIB), description="largest request body")
    faces: int = Field(
        default=LIMITS.max_faces, gt=0, description="most faces predicted in an answer"
    )
    levels: int = Field(default=MAX_LEVELS, ge=1, le=MAX_LEVELS, description="deepest level")
    memory: Size = Field(
        default=ByteSize(LIMITS.max_memory_bytes), description="most memory predicted for one job"
    )
    json_items: int = Field(
        default=LIMITS.max_json_items,
        gt=0,
        description="most structural characters in a glTF's JSON",
    )

    workers: int = Field(default_factory=_worker_default, ge=1, description="worker processes")
    queue: int = Field(
        default=8,
        ge=0,
        description="requests that may be here beside those that run: that send, wait, or take "
        "their answer",
    )
    client_requests: int = Field(
        default=6, gt=0, description="requests that one client may have here"
    )
    faces_per_minute: float | None = Field(
        default=20_000_000,
        gt=0,
        description="refined faces that one client may ask for in a minute",
    )
    connections: int = Field(default=512, gt=1, description="open connections; beyond those 503")
    proxies: Networks = Field(
        default=(),
        description="addresses and networks whose Forwarded headers are believed, with commas",
    )

    keys_file: Place | None = Field(
        default=None, description="who may ask: a file of keys' hashes; none: everybody"
    )
    hosts: Hosts = Field(
        default=(),
        description="names under which the service is asked, with commas, `*.a.example` for any "
        "below, `*` for any; addresses and localhost always are",
    )
    cors_origins: Origins = Field(
        default=(), description="origins whose pages may ask, with commas; `*`: any"
    )
    metrics_host: Name = "127.0.0.1"
    metrics_port: int | None = Field(
        default=None, ge=0, le=65535, description="where /metrics is served; none: nowhere"
    )

    job_seconds: Seconds = Field(default=60, description="longest job")
    upload_seconds: Seconds = Field(default=120, description="longest upload of one body")
    idle_seconds: Seconds = Field(
        default=10, description="longest wait for the next piece of a body"
    )
    keep_alive_seconds: int = Field(
        default=5, gt=0, description="how long a connection may rest between requests"
    )
    stall_seconds: Seconds = Field(
        default=30, description="longest wait for a client to take more of its answer"
    )
    drain_seconds: int = Field(
        default=75, gt=0, description="longest wait for running requests after SIGTERM"
    )

    def job_limits(self) -> Limits:
        """Return what one job may cost, as the pipeline checks it."""
        return Limits(
            max_faces=self.faces,
            max_memory_bytes=int(self.memory),
            max_json_items=self.json_items,
        )
