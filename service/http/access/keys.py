"""Keys: how one is made, the file of those that are right, and `Authorization: Bearer`."""

from __future__ import annotations

import hashlib
import re
import secrets
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.types import Scope

from ...errors import UnauthorizedError
from .clients import Client

NAME = r"[a-z0-9][a-z0-9-]{0,62}"


class KeysError(Exception):
    """A file of keys that cannot be used."""


class Entry(BaseModel):
    """Entry of one key in a file: a name, a hash, and what its bearer may ask for."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: Annotated[str, Field(pattern=f"^{NAME}$")]
    hash: Annotated[str, Field(pattern="^sha256:[0-9a-f]{64}$")]
    faces_per_minute: Annotated[float, Field(gt=0)] | None = None


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid")

    # Without one nobody could ask for anything.
    key: Annotated[list[Entry], Field(min_length=1)]


def new_key(name: str) -> str:
    """Make a fresh key of that name. Raises KeysError where it cannot be one."""
    if not re.fullmatch(NAME, name):
        raise KeysError(f"{name!r}: a name is 1 to 63 of a-z, 0-9 and -, not - first")
    return f"pns_{name}_{secrets.token_urlsafe(32)}"


def hash_of(key: str) -> str:
    """Return what a file keeps of a key.

    A key is 256 random bits, which nobody guesses: a slow or salted hash would keep it no better,
    and to check slowly means to count wrong keys, and to refuse right ones sooner or later.
    """
    return f"sha256:{hashlib.sha256(key.encode()).hexdigest()}"


def read_keys(path: Path) -> list[Entry]:
    """Read the entries of a file. Raises KeysError.

    Entries of one name are keys of one client: while a key is replaced there are two.
    """
    said = f"PNS_KEYS_FILE: {path}"
    try:
        entries = _File.model_validate(tomllib.loads(path.read_text(encoding="utf-8"))).key
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        text = error.strerror if isinstance(error, OSError) else error
        raise KeysError(f"{said}: {text}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part + 1) if isinstance(part, int) else part for part in first["loc"])
        hint = "it holds [[key]] tables with name and hash, one at least"
        raise KeysError(f"{said}: {where}: {first['msg']}; {hint}") from error
    if len({entry.hash for entry in entries}) < len(entries):
        raise KeysError(f"{said}: two entries have one hash")
    return entries


def toml_entry(entry: Entry) -> str:
    """Return an entry as the file holds it."""
    lines = ["[[key]]", f'name = "{entry.name}"', f'hash = "{entry.hash}"']
    if entry.faces_per_minute is not None:
        lines.append(f"faces_per_minute = {entry.faces_per_minute}")
    return "\n".join(lines)


_BEARER = re.compile(r"(?i:bearer) +([!-~]+)")
# Routes that anybody may ask: they cost nothing and say nothing of anyone. A key that is sent to
# them is checked all the same.
OPEN = ("/", "/healthz", "/readyz", "/models", "/limits", "/docs", "/openapi.json")
OPEN_FOLDERS = ("/assets/", "/docs/")


class Bearer:
    """Finds the client behind a key."""

    def __init__(self, keys: Iterable[Entry]) -> None:
        self._keys = {entry.hash: entry for entry in keys}

    def check(self, scope: Scope) -> None:
        """Note whose request it is. Raises UnauthorizedError."""
        sent = [value for name, value in scope["headers"] if name == b"authorization"]
        if not sent:
            path = scope["path"].removeprefix(scope.get("root_path", ""))
            if path in OPEN or path.startswith(OPEN_FOLDERS):
                return
            raise UnauthorizedError("send a key: Authorization: Bearer pns_…")
        token = _BEARER.fullmatch(sent[0].decode("latin-1").strip()) if len(sent) == 1 else None
        if token is None:
            raise UnauthorizedError("the Authorization header holds no key: Bearer pns_…")
        # How long this takes tells of the hash alone, and nobody finds a key by its hash.
        entry = self._keys.get(hash_of(token[1]))
        if entry is None:
            raise UnauthorizedError("the key is not known")
        client = Client(f"key:{entry.name}", entry.faces_per_minute)
        scope.setdefault("state", {})["client"] = client
