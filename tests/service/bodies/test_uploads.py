"""Bodies of requests: the files that they hold, and those that are refused."""

import io
import zipfile

import pytest

from service.bodies.archive import ArchiveError
from service.bodies.uploads import sent
from service.errors import MediaTypeError
from service.meshfiles.example import part_glb
from service.options import Limits


def archive(**contents):
    """A .zip of files; dots are written as double underscores."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as opened:
        for name, content in contents.items():
            opened.writestr(name.replace("__", "."), content)
    return made.getvalue()


def multipart(**files):
    """A body of one part a file."""
    parts = [
        f'--X\r\nContent-Disposition: form-data; name="{name}"; filename="{name}"\r\n\r\n'.encode()
        + content
        + b"\r\n"
        for name, content in files.items()
    ]
    return b"".join(parts) + b"--X--\r\n"


FORM = "multipart/form-data; boundary=X"


def test_an_archive_in_an_archive_is_refused():
    nested = archive(a__glb=archive(b__glb=part_glb()))
    with pytest.raises(MediaTypeError, match="is an archive"):
        sent(nested, "application/zip", Limits())


def test_files_beside_an_archive_are_refused():
    body = multipart(file=archive(a__glb=part_glb()), other=b"beside it")
    with pytest.raises(MediaTypeError, match="comes alone"):
        sent(body, FORM, Limits())


def test_an_encrypted_archive_is_refused():
    plain = bytearray(archive(a__glb=part_glb()))
    # The flag stands in the entry's own header and in the index.
    for signature, offset in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        plain[plain.index(signature) + offset] |= 1
    with pytest.raises(ArchiveError, match="encrypted"):
        sent(bytes(plain), "application/zip", Limits())
