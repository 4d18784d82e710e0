"""Keys: how one is made, what is kept of it, and how one that is sent is checked."""

from __future__ import annotations

import base64
import hashlib
import hmac
import re
import secrets
import tomllib
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

PREFIX = "pns"
NAME = r"[a-z0-9][a-z0-9-]{0,62}"
# A key is 256 random bits, so the cost of a guess hardly matters; that of an honest client's first
# request does: about 50 ms and 16 MiB.
LOG_N, R, P = 14, 8, 1
# hashlib refuses what takes more; a file may ask for stronger hashes than ours, within reason.
MOST_MEMORY = 256 * 1024**2
_HASH = re.compile(r"scrypt\$(\d{1,2})\$(\d{1,2})\$(\d{1,2})\$([\w-]{22,86})\$([\w-]{43,86})", re.A)


class KeysError(Exception):
    """A file of keys that cannot be used."""


class Entry(BaseModel):
    """What a file holds of one key: a name, a hash, and what its bearer may ask for."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: Annotated[str, Field(pattern=f"^{NAME}$")]
    hash: Annotated[str, Field(pattern=f"^{_HASH.pattern}$")]
    faces_per_minute: Annotated[float, Field(gt=0)] | None = None


def new_key(name: str) -> str:
    """A fresh key of that name. Raises KeysError where it cannot be one."""
    if not re.fullmatch(NAME, name):
        raise KeysError(f"{name!r}: a name is 1 to 63 of a-z, 0-9 and -, not - first")
    return f"{PREFIX}_{name}_{secrets.token_urlsafe(32)}"


def hash_of(key: str, *, salt: bytes | None = None) -> str:
    """What a file keeps of a key: scrypt's parameters, the salt, and the digest."""
    salt = secrets.token_bytes(16) if salt is None else salt
    digest = _scrypt(key, salt, LOG_N, R, P)
    return f"scrypt${LOG_N}${R}${P}${_encode(salt)}${_encode(digest)}"


def matches(key: str, hashed: str) -> bool:
    """Whether `hashed` was made of `key`; the comparison takes as long whatever differs."""
    fields = _HASH.fullmatch(hashed)
    if fields is None:
        return False
    log_n, r, p = (int(text) for text in fields.group(1, 2, 3))
    salt, digest = (_decode(text) for text in fields.group(4, 5))
    return hmac.compare_digest(_scrypt(key, salt, log_n, r, p), digest)


def read_keys(path: Path) -> dict[str, Entry]:
    """The entries of a file, by name. Raises KeysError."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
        entries = _ENTRIES.validate_python(data.get("key", []))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise KeysError(f"{path}: {error}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise KeysError(f"{path}: key.{where}: {first['msg']}") from error
    if unknown := sorted(set(data) - {"key"}):
        raise KeysError(f"{path}: {unknown[0]} is not known; entries are [[key]] tables")
    by_name = {entry.name: entry for entry in entries}
    if len(by_name) < len(entries):
        raise KeysError(f"{path}: two entries have one name")
    if not entries:
        raise KeysError(f"{path}: there is no [[key]] in it, so nobody could ask for anything")
    for entry in entries:
        try:
            matches("", entry.hash)
        except (ValueError, MemoryError) as error:
            raise KeysError(f"{path}: {entry.name}: the hash asks for too much: {error}") from error
    return by_name


def toml_entry(entry: Entry) -> str:
    """An entry as the file holds it."""
    lines = ["[[key]]", f'name = "{entry.name}"', f'hash = "{entry.hash}"']
    if entry.faces_per_minute is not None:
        lines.append(f"faces_per_minute = {entry.faces_per_minute:g}")
    return "\n".join(lines)


_ENTRIES = TypeAdapter(list[Entry])


def _scrypt(key: str, salt: bytes, log_n: int, r: int, p: int) -> bytes:
    return hashlib.scrypt(
        key.encode(), salt=salt, n=2**log_n, r=r, p=p, maxmem=MOST_MEMORY, dklen=32
    )


def _encode(data: bytes) -> str:
    return base64.urlsafe_b64encode(data).decode().rstrip("=")


def _decode(text: str) -> bytes:
    return base64.urlsafe_b64decode(text + "=" * (-len(text) % 4))
