"""Materials of an OBJ as those of a glTF: MTL files that lie beside it or came with it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from ..bodies.sibling_files import File, Opened, SiblingFiles
from .text import is_number, name_of, plain_text

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
_MAPS = (b"map_kd", b"map_ke", b"norm")
_NUMBERS = frozenset({b"-o", b"-s", b"-t", b"-mm"})


@dataclass
class Materials:
    """Materials in glTF's words, and the images that their textures name by URI."""

    entries: list[dict[str, Any]] = field(default_factory=list)
    images: list[str] = field(default_factory=list)

    def texture(self, uri: str) -> dict[str, int]:
        """Return a reference to the texture of an image, one for each image."""
        if uri not in self.images:
            self.images.append(uri)
        return {"index": self.images.index(uri)}


def materials_of(names: Iterable[str], libraries: Iterable[str], opened: Opened) -> Materials:
    """Return a glTF material for each name, as the first library that has it defines it."""
    defined: dict[str, dict[bytes, bytes]] = {}
    for library in libraries:
        for file in library_files(library, opened):
            for name, properties in _definitions(bytes(file.content)):
                defined.setdefault(name, properties)
    made = Materials()
    made.entries = [_material(name, defined.get(name, {}), made) for name in names]
    return made


def named_files(data: bytes, siblings: SiblingFiles) -> list[str]:
    """Return the libraries that an OBJ names, and the images that these name."""
    opened, names = Opened(siblings), list[str]()
    for found in _LIBRARY.findall(plain_text(data)) if b"mtllib" in data else ():
        for file in library_files(name_of(found), opened):
            names.append(file.name)
            for _, properties in _definitions(bytes(file.content)):
                maps = (_image(properties.get(keyword)) for keyword in _MAPS)
                names += [name for name in maps if name is not None]
    return list(dict.fromkeys(names))


def library_files(library: str, opened: Opened) -> list[File]:
    """Open what a `mtllib` statement names: one file whose name may have blanks, or several."""
    whole = opened.open(library) or opened.open(library.strip('"'))
    found = [whole] if whole is not None else [opened.open(name) for name in library.split()]
    return [file for file in found if file is not None]


def _definitions(data: bytes) -> Iterator[tuple[str, dict[bytes, bytes]]]:
    """Yield each material's name and its statements by keyword."""
    name, properties = None, dict[bytes, bytes]()
    for line in plain_text(data).split(b"\n"):
        keyword, _, rest = line.strip().replace(b"\t", b" ").partition(b" ")
        if keyword.lower() == b"newmtl":
            if name is not None:
                yield name, properties
            name, properties = name_of(rest), {}
        elif keyword:
            properties[keyword.lower()] = rest.strip()
    if name is not None:
        yield name, properties


def _material(name: str, given: dict[bytes, bytes], made: Materials) -> dict[str, Any]:
    surface: dict[str, Any] = dict(PLAIN)
    material: dict[str, Any] = {"name": name, "pbrMetallicRoughness": surface}
    colour = _numbers(given.get(b"kd"), 3)
    opacity = (
        _numbers(given.get(b"d"), 1) or [1 - t for t in _numbers(given.get(b"tr"), 1)] or [1.0]
    )
    if colour or b"map_kd" in given:
        surface["baseColorFactor"] = [*(colour or WHITE[:3]), 1.0]
    if image := _image(given.get(b"map_kd")):
        surface["baseColorTexture"] = made.texture(image)
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
    if image := _image(given.get(b"map_ke")):
        material["emissiveTexture"] = made.texture(image)
        material.setdefault("emissiveFactor", WHITE[:3])
    if image := _image(given.get(b"norm")):
        material["normalTexture"] = made.texture(image)
    return material


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
    return name_of(b" ".join(words)).strip('"').replace("\\", "/") or None
