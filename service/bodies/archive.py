"""A .zip with one glTF in it, read without trusting a number that it holds.

Nothing is extracted to disk, only files that the document names are unpacked, and every byte that
comes out is counted.
"""

from __future__ import annotations

import io
import stat
import sys
import zipfile
import zlib
from dataclasses import dataclass

from ..errors import ServiceError, UnreadableError, check_limit
from .media import is_apple_double
from .sibling_files import File, SiblingFiles, relative_name

MAX_ENTRIES = 1024
# Bytes of the index: a name may be long, a thousand long ones are an attack.
MAX_INDEX_BYTES = 2**20
# Deflate reaches 1032; geometry and JSON seldom reach 20.
MAX_RATIO = 200
# Below this many bytes a ratio says nothing.
RATIO_FLOOR = 2**20

_INDEX_ENTRY = b"PK\x01\x02"
_PIECE = 2**18
_DOCUMENTS = (".glb", ".gltf")
_ENCRYPTED = 1


class ArchiveError(ServiceError):
    """A .zip that reads, but is not one glTF with the files beside it."""

    status = 422
    code = "invalid-archive"
    title = "The archive must hold one glTF and the files beside it"


def open_archive(data: bytes, max_bytes: int) -> tuple[File, SiblingFiles]:
    """Open the document in a .zip, and the files beside it: unpacked `max_bytes` at most.

    Raises:
        UnreadableError: no .zip.
        ArchiveError: not one document; a name that leads out of the archive, a link, encryption.
        LimitError: too many entries, or too much in them.
    """
    unpacker = unpacker_of(data, max_bytes)
    documents = [name for name in unpacker.entries if name.lower().endswith(_DOCUMENTS)]
    if len(documents) != 1:
        raise ArchiveError(f"the archive holds {len(documents)} glTF files")
    main = documents[0]
    folder = main.rpartition("/")[0]
    siblings = SiblingFiles(unpacker.find, frozenset(unpacker.entries) - {main}, folder)
    return unpacker.read(main), siblings


def unpacker_of(data: bytes, max_bytes: int = sys.maxsize) -> Unpacker:
    """Open any .zip, of which `max_bytes` at most are unpacked; errors are `open_archive`'s."""
    # Counted in the raw bytes before the library makes an object of each; chance adds hardly one.
    count = data.count(_INDEX_ENTRY)
    check_limit("archive-entries", count, MAX_ENTRIES, f"the archive has {count} entries")
    try:
        opened = zipfile.ZipFile(io.BytesIO(data))
    except (zipfile.BadZipFile, NotImplementedError, ValueError, EOFError) as error:
        raise UnreadableError(f"the archive cannot be read: {error}") from error
    allowed = min(max_bytes, max(RATIO_FLOOR, MAX_RATIO * len(data)))
    return Unpacker(opened, _entries(opened), allowed)


def _entries(opened: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """Return the files by name, each checked by what its entry says."""
    index_bytes = 0
    entries: dict[str, zipfile.ZipInfo] = {}
    for entry in opened.infolist():
        index_bytes += len(entry.orig_filename) + len(entry.extra) + len(entry.comment)
        # Archives made on Windows may have its separator, against the format's rule.
        path = entry.filename.replace("\\", "/")
        name = relative_name(path)
        if name is None:
            raise ArchiveError("a name leads out of the archive")
        if stat.S_IFMT(entry.external_attr >> 16) not in (0, stat.S_IFREG, stat.S_IFDIR):
            raise ArchiveError("the archive holds a link or a special file")
        if entry.flag_bits & _ENCRYPTED:
            raise ArchiveError("the archive is encrypted")
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ArchiveError("the archive uses a compression other than deflate")
        if path.endswith("/") or is_apple_double(name) or name.endswith(".DS_Store"):
            continue
        if name in entries:
            raise ArchiveError("two entries have the same name")
        entries[name] = entry
    text = f"the archive's index has {index_bytes} bytes"
    check_limit("archive-index", index_bytes, MAX_INDEX_BYTES, text)
    return entries


@dataclass
class Unpacker:
    """The files of an archive by name, and how many bytes of them may be unpacked."""

    opened: zipfile.ZipFile
    entries: dict[str, zipfile.ZipInfo]
    allowed: int
    unpacked: int = 0

    def find(self, name: str) -> File | None:
        """Unpack the file of that name; None where there is none."""
        return self.read(name) if name in self.entries else None

    def read(self, name: str) -> File:
        """Unpack one file piece by piece, until it ends or a limit does."""
        pieces: list[bytes] = []
        try:
            with self.opened.open(self.entries[name]) as file:
                while piece := file.read(_PIECE):
                    self.unpacked += len(piece)
                    text = f"the archive unpacks to {self.unpacked} bytes or more"
                    check_limit("archive-bytes", self.unpacked, self.allowed, text)
                    pieces.append(piece)
        except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, ValueError) as error:
            raise UnreadableError(f"the archive cannot be read: {error}") from error
        return File(name, b"".join(pieces))
