"""Files by path or URL, on any file system that fsspec knows: read, listed, written whole."""

from __future__ import annotations

import errno
import os
import posixpath
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import fsspec
from fsspec.implementations.local import LocalFileSystem

from pns_common.files import replace_file

from ..bodies.sibling_files import File, SiblingFiles
from ..errors import InvalidParameter

READ_ONLY = ("http", "https")
THIS_MACHINE = LocalFileSystem()


@dataclass(frozen=True)
class Place:
    """A file or a folder: its file system, and its path there."""

    system: Any
    path: str

    @property
    def local(self) -> bool:
        """True where it lies on this machine's own disks."""
        return isinstance(self.system, LocalFileSystem)

    @property
    def url(self) -> str:
        """Name outside: a plain path where it is local."""
        return self.path if self.local else str(self.system.unstrip_protocol(self.path))

    @property
    def read_only(self) -> bool:
        """True where nothing can be written there."""
        protocols = self.system.protocol
        named = (protocols,) if isinstance(protocols, str) else protocols
        return any(name in READ_ONLY for name in named)

    def below(self, relative: str) -> Place:
        """Return what lies at a relative path below a folder."""
        return Place(self.system, posixpath.join(self.path, relative))

    @property
    def folder(self) -> Place:
        """The folder that it lies in."""
        return Place(self.system, posixpath.dirname(self.path))

    def content_of(self, relative: str) -> bytes | None:
        """Return the bytes of a file below a folder; None where there is none. Raises OSError."""
        place = self.below(relative)
        return place.read() if place.is_file() else None

    def path_to(self, other: Place) -> str | None:
        """Return the way to what lies below a folder, "." to itself; None to anything else."""
        if self.system != other.system:
            return None
        # A link is where it leads.
        here, there = (os.path.realpath(p.path) if self.local else p.path for p in (self, other))
        way = posixpath.relpath(there, here)
        return None if way.split("/")[0] == ".." else way

    def read(self) -> bytes:
        """Read the whole file. Raises OSError."""
        if self.local:
            return Path(self.path).read_bytes()
        with self._foreign():
            return bytes(self.system.cat_file(self.path))

    def is_gone(self) -> bool:
        """Return whether it is certain that nothing is there."""
        try:
            with self._foreign():
                self.system.info(self.path)
        except FileNotFoundError:
            return True
        except OSError:
            return False
        return False

    def is_file(self) -> bool:
        """Return whether there is a file. Raises OSError: nobody can say."""
        with self._foreign():
            return bool(self.system.isfile(self.path))

    def is_folder(self) -> bool:
        """Return whether there is a folder. Raises OSError: nobody can say."""
        with self._foreign():
            return bool(self.system.isdir(self.path))

    def matches(self) -> list[str]:
        """Return the paths that its path matches as a glob, in order. Raises OSError."""
        with self._foreign():
            return sorted(str(path) for path in self.system.glob(self.path))

    def write(self, data: bytes) -> None:
        """Write a file whole or not at all: renamed into place, or one put. Raises OSError."""
        if self.local:
            path = Path(self.path)
            try:
                replace_file(path, data)
            except FileNotFoundError:
                path.parent.mkdir(parents=True, exist_ok=True)
                replace_file(path, data)
        else:
            # Object stores show an object only when its put has ended.
            with self._foreign():
                self.system.pipe_file(self.path, data)

    def check_writable(self) -> None:
        """Make a folder of this machine and a file in it, which goes again. Raises OSError.

        A store elsewhere is not asked: it may let results be put there, and nothing else.
        """
        if self.read_only:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), self.url)
        if self.local:
            Path(self.path).mkdir(parents=True, exist_ok=True)
            with TemporaryFile(dir=self.path):
                pass

    def files(self, unreadable: Callable[[OSError], None]) -> Iterator[str]:
        """Yield the relative paths of all files below a folder, each folder in order of name.

        ``unreadable`` is told of folders that cannot be listed.
        """
        with self._foreign():
            for folder, folders, names in self._walk(unreadable):
                folders.sort()
                inside = posixpath.relpath(folder, self.path)
                for name in sorted(names):
                    # A single file is what `walk` says of itself on some systems.
                    if name and posixpath.join(folder, name) != self.path:
                        yield name if inside == "." else f"{inside}/{name}"

    def _walk(
        self, unreadable: Callable[[OSError], None]
    ) -> Iterator[tuple[str, list[str], list[str]]]:
        if self.local:
            # A local folder of a million files is names alone, not what fsspec tells of each.
            return os.walk(self.path, onerror=unreadable)
        return self.system.walk(self.path, on_error=unreadable)

    @contextmanager
    def _foreign(self) -> Iterator[None]:
        """Turn errors of a file system elsewhere, each library's own, into OSErrors naming it."""
        try:
            yield
        except FileNotFoundError:
            raise
        except Exception as error:
            if self.local:
                raise
            number = getattr(error, "errno", None) or errno.EIO
            raise OSError(number, f"{type(error).__name__}: {error}", self.url) from error

    def siblings(self) -> SiblingFiles:
        """Return the files in the same folder and below it, opened when a document names them."""
        folder = self.folder

        def find(name: str) -> File | None:
            if folder.local:
                path = Path(folder.below(name).path).resolve()
                if not path.is_relative_to(Path(folder.path).resolve()):
                    return None
            content = folder.content_of(name)
            return None if content is None else File(name, content)

        # What an input's hash was made of is what is refined.
        return SiblingFiles(cache(find))


def place_of(text: str) -> Place:
    """Return the place of a path or URL.

    Raises:
        InvalidParameter: no file system takes it, or what that needs is not installed.
    """
    # No URL begins with a slash, and what does may have either in its name.
    if posixpath.isabs(text) or ("://" not in text and "::" not in text):
        return Place(THIS_MACHINE, str(LocalFileSystem._strip_protocol(text)))
    try:
        system, path = fsspec.core.url_to_fs(text)
    except (ValueError, ImportError) as error:
        raise InvalidParameter("path", f"{text}: {error}") from error
    return Place(system, path)
