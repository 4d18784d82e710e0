"""Keys: how one is made, what is kept of it, and how one that is sent is checked."""

from __future__ import annotations

import base64
import hashlib
import hmac
import re
import secrets
import tomllib
from collections import Counter
from collections.abc import Iterable
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
    """Entry of one key in a file: a name, a hash, and what its bearer may ask for."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: Annotated[str, Field(pattern=f"^{NAME}$")]
    hash: Annotated[str, Field(pattern=f"^{_HASH.pattern}$")]
    faces_per_minute: Annotated[float, Field(gt=0)] | None = None


def new_key(name: str) -> str:
    """Make a fresh key of that name. Raises KeysError where it cannot be one."""
    if not re.fullmatch(NAME, name):
        raise KeysError(f"{name!r}: a name is 1 to 63 of a-z, 0-9 and -, not - first")
    return f"{PREFIX}_{name}_{secrets.token_urlsafe(32)}"


def hash_of(key: str, *, salt: bytes | None = None) -> str:
    """Return what a file keeps of a key: scrypt's parameters, the salt, and the digest."""
    salt = secrets.token_bytes(16) if salt is None else salt
    return _written(LOG_N, R, P, salt, _scrypt(key, salt, LOG_N, R, P))


def matches(key: str, hashed: str) -> bool:
    """Return whether `hashed` was made of `key`; the comparison takes as long whatever differs."""
    fields = _HASH.fullmatch(hashed)
    if fields is None:
        return False
    salt, digest = (_decode(text) for text in fields.group(4, 5))
    return hmac.compare_digest(_scrypt(key, salt, *_cost(hashed)), digest)


class Keyring:
    """The entries of a file, and the check of a key, which costs the same whoever it names.

    Entries may be hashed more or less strongly than others. So that the time of a check tells
    neither which names there are nor how theirs are hashed, scrypt is run once with each choice of
    parameters in the file as often as any name needs it: for the named entries, or for nobody.
    """

    def __init__(self, entries: Iterable[Entry]) -> None:
        self._entries: dict[str, list[Entry]] = {}
        for entry in entries:
            self._entries.setdefault(entry.name, []).append(entry)
        # For each choice of parameters, the most hashes that any name has of it.
        self._checks: Counter[tuple[int, int, int]] = Counter()
        for own in self._entries.values():
            self._checks |= Counter(_cost(entry.hash) for entry in own)

    def find(self, key: str, name: str) -> Entry | None:
        """Return the entry of that name whose key it is."""
        own = self._entries.get(name, [])
        right = [entry for entry in own if matches(key, entry.hash)]
        for cost in (self._checks - Counter(_cost(entry.hash) for entry in own)).elements():
            matches(key, _hash_of_nobody(cost))
        return right[0] if right else None


def read_keys(path: Path) -> list[Entry]:
    """Read the entries of a file. Raises KeysError.

    Entries of one name are keys of one client: while a key is replaced there are two.
    """
    said = f"PNS_KEYS_FILE: {path}"
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
        entries = _ENTRIES.validate_python(data.get("key", []))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        text = error.strerror if isinstance(error, OSError) else error
        raise KeysError(f"{said}: {text}") from error
    except ValidationError as error:
        first = error.errors()[0]
        number, *fields = first["loc"] or ("",)
        if not fields:
            raise KeysError(f"{said}: entries are [[key]] tables with name and hash") from error
        where = ".".join(map(str, fields))
        raise KeysError(f"{said}: entry {int(number) + 1}: {where}: {first['msg']}") from error
    if unknown := sorted(set(data) - {"key"}):
        raise KeysError(f"{said}: {unknown[0]} is not known; entries are [[key]] tables")
    if len({entry.hash for entry in entries}) < len(entries):
        raise KeysError(f"{said}: two entries have one hash")
    if not entries:
        raise KeysError(f"{said}: there is no [[key]] in it, so nobody could ask for anything")
    for entry in entries:
        try:
            matches("", entry.hash)
        except (ValueError, MemoryError) as error:
            raise KeysError(f"{said}: {entry.name}: the hash asks for too much: {error}") from error
    return entries


def toml_entry(entry: Entry) -> str:
    """Return an entry as the file holds it."""
    lines = ["[[key]]", f'name = "{entry.name}"', f'hash = "{entry.hash}"']
    if entry.faces_per_minute is not None:
        lines.append(f"faces_per_minute = {entry.faces_per_minute}")
    return "\n".join(lines)


_ENTRIES = TypeAdapter(list[Entry])


def _cost(hashed: str) -> tuple[int, int, int]:
    """Read scrypt's log n, r and p from a hash."""
    log_n, r, p = map(int, hashed.split("$")[1:4])
    return log_n, r, p


def _hash_of_nobody(cost: tuple[int, int, int]) -> str:
    """Make a hash of that cost, which is no key's."""
    return _written(*cost, secrets.token_bytes(16), secrets.token_bytes(32))


def _written(log_n: int, r: int, p: int, salt: bytes, digest: bytes) -> str:
    return f"scrypt${log_n}${r}${p}${_encode(salt)}${_encode(digest)}"


def _scrypt(key: str, salt: bytes, log_n: int, r: int, p: int) -> bytes:
    return hashlib.scrypt(
        key.encode(), salt=salt, n=2**log_n, r=r, p=p, maxmem=MOST_MEMORY, dklen=32
    )


def _encode(data: bytes) -> str:
    return base64.urlsafe_b64encode(data).decode().rstrip("=")


def _decode(text: str) -> bytes:
    return base64.urlsafe_b64decode(text + "=" * (-len(text) % 4))
