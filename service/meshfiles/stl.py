"""STL, binary or text: triangles with positions of their own."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int, UInt16

from pns_common.mesh.rows import cross, norm

from ..changes import Change, counted
from ..errors import UnreadableError, quoted
from .mesh_file import MeshFile, offsets_of
from .text import cut_text, plain_text

HEADER = 84
# A facet as text: a normal, three vertices, and the words that name and enclose them.
WORDS_PER_FACET = 21
# The two bytes behind the numbers of each facet are its colour to some programs.
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
# How far text is told from a binary file whose header begins as a text does.
_START = 2**10


def read_stl(data: bytes) -> MeshFile:
    """Read an STL: its facets in order, whatever it says of their number or of its end.

    Raises:
        UnreadableError: a file that ends within a facet.
    """
    if is_text(data):
        points, sizes, changes = _of_text(plain_text(data))
    else:
        points, changes = _of_binary(data)
        sizes = np.full(len(points) // 3, 3)
    return MeshFile(points, offsets_of(sizes), np.arange(len(points)), changes=changes)


def is_text(data: bytes) -> bool:
    """Return whether a file is text: a binary one may begin with `solid` too."""
    if len(data) >= HEADER and len(data) == HEADER + FACET.itemsize * _said(data):
        return False
    start = plain_text(data[:_START]).lower()
    # Between a header and the facets of a binary file there are bytes that no text has.
    return start.lstrip().startswith((b"solid", b"facet")) and b"\0" not in start


def count_facets(data: bytes) -> int:
    """Return how many facets a binary file holds whole."""
    whole, rest = divmod(max(len(data) - HEADER, 0), FACET.itemsize)
    said = _said(data)
    return said if rest and 0 < said <= whole else whole


def _said(data: bytes) -> int:
    return int.from_bytes(data[HEADER - 4 : HEADER], "little")


def _of_binary(data: bytes) -> tuple[Float[np.ndarray, "N 3"], tuple[Change, ...]]:
    if len(data) < HEADER:
        raise UnreadableError(f"this is not an STL file: it begins with {quoted(data)}")
    said, count = _said(data), count_facets(data)
    left = len(data) - HEADER - count * FACET.itemsize
    if left and said != count:
        raise UnreadableError(
            f"the STL file is cut off, or is none: it says {said:,} facets and has room for "
            f"{count:,}; it begins with {quoted(data)}"
        )
    facet = FACET
    if said != count == int.from_bytes(data[HEADER - 4 : HEADER], "big"):
        said, facet = count, FACET.newbyteorder(">")
    facets = np.frombuffer(data, facet, count, HEADER)
    told = {
        "facet-tail": left,
        ("dropped", "colours of faces"): _count_colours(data[: HEADER - 4], facets["attribute"]),
        ("facet-count", str(said)): int(said != count),
    }
    return facets["corners"].reshape(-1, 3).astype(np.float64), tuple(counted(told))


def _count_colours(header: bytes, attributes: UInt16[np.ndarray, " F"]) -> int:
    """Return how many facets have a colour of their own.

    Their highest bit says so: set as VisCAM writes it, clear where Magics' header begins with a
    colour of the part. Bytes that are alike throughout are what a program leaves there.
    """
    if not len(attributes) or (attributes == attributes[0]).all():
        return 0
    own = (attributes >> 15) == (0 if b"COLOR=" in header else 1)
    return int(np.count_nonzero(own))


def _of_text(
    data: bytes,
) -> tuple[Float[np.ndarray, "N 3"], Int[np.ndarray, " F"], tuple[Change, ...]]:
    """Read the vertices of each loop, on whatever lines they stand; all else is passed over."""
    text = cut_text(data, "STL")
    lengths = text.ends - text.begins
    places = np.flatnonzero(lengths == len("vertex"))
    vertex = places[text.is_word(b"vertex", places)]
    places = np.flatnonzero(lengths == len("endloop"))
    ends = places[text.is_word(b"endloop", places)]
    names = (text.keyword(b"solid") | text.keyword(b"endsolid")) & (text.counts < WORDS_PER_FACET)
    if names.any():
        # A name may have any words.
        begin, behind = text.first[names], text.first[names] + text.counts[names]
        line = np.searchsorted(begin, vertex, "right") - 1
        vertex = vertex[(line < 0) | (vertex >= behind[line])]
    words = vertex[:, None] + np.arange(1, 4)
    if len(vertex) and words[-1, -1] >= len(text.begins):
        raise UnreadableError("the STL file is cut off: it ends within a facet")
    points = text.numbers(words.reshape(-1)).reshape(-1, 3)
    sizes = np.diff(np.searchsorted(vertex, ends), prepend=0)
    rest = data[text.ends[ends[-1]] if len(ends) else 0 :].lower()
    whole = b"solid" in rest
    if sizes.sum() < len(vertex) or (not whole and b"facet" in rest.replace(b"endfacet", b"")):
        raise UnreadableError("the STL file is cut off: it ends within a facet")
    return points, sizes, tuple(counted({"solid-open": int(not whole)}))


def write_stl(mesh: MeshFile) -> bytes:
    """Write a binary STL of triangles, with a unit normal for each."""
    rounded = mesh.vertices.astype("<f4")
    facets = np.zeros(len(mesh.faces), dtype=FACET)
    facets["corners"] = np.take(rounded, mesh.faces, axis=0)
    points = rounded.astype(np.float64)
    a, b, c = (np.take(points, column, axis=0) for column in mesh.faces.T)
    normals = cross(b - a, c - a)
    lengths = norm(normals)[:, None]
    facets["normal"] = normals / np.where(lengths > 0, lengths, 1.0)
    return b"\0" * (HEADER - 4) + np.uint32(len(facets)).tobytes() + facets.tobytes()
