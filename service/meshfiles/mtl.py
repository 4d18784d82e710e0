"""Materials of an OBJ as those of a glTF: MTL files that lie beside it or came with it."""

from __future__ import annotations

import posixpath
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import quote

from ..bodies.sibling_files import File, Opened
from .text import is_number, name_of, named, plain_text

# glTF's own default is a bare metal, which is black where nothing surrounds it.
PLAIN = {
    "baseColorFactor": [0.7, 0.7, 0.7, 1.0],
    "metallicFactor": 0.0,
    "roughnessFactor": 0.6,
}
WHITE = [1.0, 1.0, 1.0, 1.0]
# How many words follow each option of a map before its file's name; at most, of numbers.
_OPTIONS = {
    b"-blendu": 1, b"-blendv": 1, b"-boost": 1, b"-mm": 2, b"-o": 3, b"-s": 3, b"-t": 3,
    b"-texres": 1, b"-clamp": 1, b"-bm": 1, b"-imfchan": 1, b"-type": 1,
}  # fmt: skip
_LIBRARY = re.compile(rb"(?m)^[ \t]*mtllib[ \t]+([^\n]*)")
_MAP = re.compile(rb"map_\w+|norm|bump|disp|decal|refl")
_WRITTEN = frozenset({b"map_kd", b"map_ke", b"norm"})
_NUMBERS = frozenset({b"-o", b"-s", b"-t", b"-mm"})
_ABSOLUTE = re.compile(r"[A-Za-z]:|/")


@dataclass
class Materials:
    """Materials in glTF's words, the images that their textures name by URI, and what is lost."""

    entries: list[dict[str, Any]] = field(default_factory=list)
    images: list[str] = field(default_factory=list)
    lost: Counter[str] = field(default_factory=Counter)

    def texture(self, uri: str) -> dict[str, int]:
        """Return a reference to the texture of an image, one for each image."""
        if uri not in self.images:
            self.images.append(uri)
        return {"index": self.images.index(uri)}


@dataclass(frozen=True)
class _Definition:
    """The statements of a material by keyword, and the folder of its library."""

    properties: dict[bytes, bytes]
    folder: str


def found(path: str, folders: Sequence[str], opened: Opened) -> File | None:
    """Open a file that a document names: from one of some folders, else by its name alone there.

    The paths of other machines, and the folders of Windows, lead to what came along.
    """
    path = path.replace("\\", "/")
    ways = [posixpath.basename(path)]
    if _ABSOLUTE.match(path) is None:
        ways.insert(0, path)
    for way in ways:
        for folder in folders:
            place = posixpath.normpath(posixpath.join(folder, way))
            # As it is spelled, and as a URI.
            for uri in dict.fromkeys((quote(place), place)):
                if (file := opened.open(uri)) is not None:
                    return file
    return None


def materials_of(
    names: Iterable[str], libraries: Iterable[str], encoding: str, opened: Opened
) -> Materials:
    """Return a glTF material for each name, as the first library that has it defines it."""
    by_bytes, by_name = dict[bytes, _Definition](), dict[str, _Definition]()
    for file in (file for library in libraries for file in library_files(library, opened)):
        folder = posixpath.dirname(file.name)
        for name, properties in _definitions(bytes(file.content)):
            by_bytes.setdefault(name, _Definition(properties, folder))
            by_name.setdefault(name_of(name), by_bytes[name])
    made, none = Materials(), _Definition({}, "")
    for name in names:
        own = by_bytes.get(name.encode(encoding)) or by_name.get(name, none)
        made.entries.append(_material(name, own, made, opened))
        made.lost.update(
            keyword.decode("latin-1")
            for keyword in own.properties
            if _MAP.fullmatch(keyword) and keyword not in _WRITTEN
        )
    return made


def textured(images: Iterable[str], opened: Opened) -> Materials:
    """Return a material for each image, which shows it as it is."""
    made = Materials()
    for name in images:
        texture = {"baseColorTexture": made.texture(_uri(name, ("",), opened))}
        surface = PLAIN | {"baseColorFactor": WHITE} | texture
        made.entries.append({"name": name, "pbrMetallicRoughness": surface})
    return made


def files_of_obj(data: bytes, opened: Opened) -> list[File]:
    """Return the libraries that an OBJ names, and the images that these name, of what came."""
    files: list[File | None] = []
    for name in _LIBRARY.findall(plain_text(data)) if b"mtllib" in data else ():
        for library in library_files(name_of(name), opened):
            folder = posixpath.dirname(library.name)
            files.append(library)
            for _, properties in _definitions(bytes(library.content)):
                files += [
                    found(image, (folder, ""), opened)
                    for keyword, text in properties.items()
                    if _MAP.fullmatch(keyword) and (image := _image(text))
                ]
    return list({file.name: file for file in files if file is not None}.values())


def library_files(library: str, opened: Opened) -> list[File]:
    """Open what a `mtllib` statement names: one file whose name may have blanks, or several."""
    whole = found(library.strip('"'), ("",), opened)
    several = [whole] if whole else [found(name, ("",), opened) for name in library.split()]
    return [file for file in several if file is not None]


def nearby(libraries: Iterable[str], opened: Opened) -> tuple[str, ...]:
    """Return names of libraries, those that came along as paths that lead to them here."""
    names: list[str] = []
    for library in libraries:
        path = library.strip('"').replace("\\", "/")
        there = found(path, ("",), opened)
        if there is not None and posixpath.normpath(path) != there.name:
            path = posixpath.basename(path)
        names.append(library if there is None else path)
    return tuple(names)


def _definitions(data: bytes) -> Iterator[tuple[bytes, dict[bytes, bytes]]]:
    """Yield each material's name and its statements by keyword."""
    name, properties = None, dict[bytes, bytes]()
    for line in plain_text(data).split(b"\n"):
        keyword, _, rest = line.strip().replace(b"\t", b" ").partition(b" ")
        if keyword.lower() == b"newmtl":
            if name is not None:
                yield name, properties
            name, properties = named(rest), {}
        elif keyword:
            properties[keyword.lower()] = rest.strip()
    if name is not None:
        yield name, properties


def _material(name: str, own: _Definition, made: Materials, opened: Opened) -> dict[str, Any]:
    surface: dict[str, Any] = dict(PLAIN)
    material: dict[str, Any] = {"name": name, "pbrMetallicRoughness": surface}
    given = own.properties
    textures = {
        keyword: made.texture(_uri(image, (own.folder, ""), opened))
        for keyword in (b"map_kd", b"map_ke", b"norm")
        if (image := _image(given.get(keyword)))
    }
    colour = _numbers(given.get(b"kd"), 3)
    opacity = (
        _numbers(given.get(b"d"), 1) or [1 - t for t in _numbers(given.get(b"tr"), 1)] or [1.0]
    )
    if colour or b"map_kd" in given:
        surface["baseColorFactor"] = [*(colour or WHITE[:3]), 1.0]
    if b"map_kd" in textures:
        surface["baseColorTexture"] = textures[b"map_kd"]
    if opacity[0] < 1:
        surface["baseColorFactor"] = [*surface["baseColorFactor"][:3], opacity[0]]
        material["alphaMode"] = "BLEND"
    if shine := _numbers(given.get(b"ns"), 1):
        # Blinn's exponent as the roughness of the same highlight.
        surface["roughnessFactor"] = (2 / (max(shine[0], 0.0) + 2)) ** 0.25
    for keyword, factor in ((b"pr", "roughnessFactor"), (b"pm", "metallicFactor")):
        if value := _numbers(given.get(keyword), 1):
            surface[factor] = value[0]
    if glow := _numbers(given.get(b"ke"), 3):
        material["emissiveFactor"] = glow
    if b"map_ke" in textures:
        material["emissiveTexture"] = textures[b"map_ke"]
        material.setdefault("emissiveFactor", WHITE[:3])
    if b"norm" in textures:
        material["normalTexture"] = textures[b"norm"]
    return material


def _uri(image: str, folders: Sequence[str], opened: Opened) -> str:
    """Return the URI of an image that came along; of one of another machine its name alone."""
    path = image.replace("\\", "/")
    if (file := found(path, folders, opened)) is not None:
        path = file.name
    return quote(path if _ABSOLUTE.match(path) is None else posixpath.basename(path))


def _numbers(text: bytes | None, count: int) -> list[float]:
    """Return so many numbers within 0 and 1, or an exponent; none where they are not there."""
    words = (text or b"").split()[:count]
    if len(words) < count or not all(is_number(word) for word in words):
        return []
    values = [float(word) for word in words]
    # Beyond 1 glTF has no colour; one number alone may be an exponent.
    return [min(max(value, 0.0), 1.0) for value in values] if count == 3 else values


def _image(text: bytes | None) -> str | None:
    """Return the file that a map names, behind its options."""
    words = (text or b"").split()
    while words and words[0] in _OPTIONS:
        option = words.pop(0)
        for _ in range(_OPTIONS[option]):
            if words and (option not in _NUMBERS or is_number(words[0])):
                words.pop(0)
    return name_of(b" ".join(words)).strip('"') or None
