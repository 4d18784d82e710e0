"""Typed, checked views of the parts of a glTF 2.0 document that the reader uses.

The document stays a plain JSON tree, which is edited in place; the types are read-only views.
Properties without a type here (factors, names, extras, extensions) are ignored and kept.
"""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal, TypeVar

import msgspec
from msgspec import Meta

from ...changes import Change
from ...errors import GltfError
from ..constants import OUTLINE

# Above every size of a file, and the range in which doubles tell integers apart.
_MOST = 2**53
Index = Annotated[int, Meta(ge=0, le=_MOST)]
Size = Annotated[int, Meta(ge=1, le=_MOST)]
Shape = TypeVar("Shape", bound="Part")


class Part(msgspec.Struct, frozen=True, rename="camel", gc=False):
    """A JSON object with checked properties.

    Views are never part of a cycle, so the garbage collector need not track thousands of them.
    """


class Asset(Part, frozen=True):
    """`asset`."""

    version: str
    min_version: str | None = None


class Buffer(Part, frozen=True):
    """`buffers[]`; without `uri` it is the GLB's BIN chunk."""

    byte_length: Size
    uri: str | None = None
    extensions: dict[str, Any] = {}


class BufferView(Part, frozen=True):
    """`bufferViews[]`."""

    buffer: Index
    byte_length: Size
    byte_offset: Index = 0
    byte_stride: Annotated[int, Meta(ge=0, le=_MOST)] | None = None
    extensions: dict[str, Any] = {}


class SparseIndices(Part, frozen=True):
    """`sparse.indices`."""

    buffer_view: Index
    component_type: Literal[5121, 5123, 5125]
    byte_offset: Index = 0


class SparseValues(Part, frozen=True):
    """`sparse.values`."""

    buffer_view: Index
    byte_offset: Index = 0


class Sparse(Part, frozen=True):
    """`accessors[].sparse`."""

    count: Size
    indices: SparseIndices
    values: SparseValues


class Accessor(Part, frozen=True):
    """`accessors[]`."""

    component_type: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    count: Size
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    buffer_view: Index | None = None
    byte_offset: Index = 0
    normalized: bool = False
    sparse: Sparse | None = None
    name: str | None = None
    extensions: dict[str, Any] = {}
    extras: Any = None


class Primitive(Part, frozen=True):
    """`meshes[].primitives[]`; mode 4 is triangles."""

    attributes: Annotated[dict[str, Index], Meta(min_length=1)]
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Meta(ge=0, le=6)] = 4
    targets: list[dict[str, Index]] = []
    extensions: dict[str, Any] = {}

    @property
    def outline(self) -> int | None:
        """The accessor of pairs of vertices between which lines are drawn; None without one."""
        entry = self.extensions.get(OUTLINE)
        index = entry.get("indices") if isinstance(entry, dict) else None
        return index if isinstance(index, int) else None

    @property
    def named(self) -> list[tuple[str, int]]:
        """Names and accessors of the attributes, and of those of the morph targets."""
        return [
            entry for attributes in (self.attributes, *self.targets) for entry in attributes.items()
        ]


class Mesh(Part, frozen=True):
    """`meshes[]`."""

    primitives: list[Primitive] = []
    weights: list[float] = []


class Node(Part, frozen=True):
    """`nodes[]`."""

    children: list[Index] = []
    mesh: Index | None = None
    skin: Index | None = None
    camera: Index | None = None
    weights: list[float] | None = None
    extensions: dict[str, Any] = {}


class Scene(Part, frozen=True):
    """`scenes[]`."""

    nodes: list[Index] = []


class Skin(Part, frozen=True):
    """`skins[]`."""

    joints: Annotated[list[Index], Meta(min_length=1)]
    inverse_bind_matrices: Index | None = None
    skeleton: Index | None = None


class Image(Part, frozen=True):
    """`images[]`."""

    buffer_view: Index | None = None
    uri: str | None = None


class Texture(Part, frozen=True):
    """`textures[]`."""

    source: Index | None = None
    sampler: Index | None = None


class TextureInfo(Part, frozen=True):
    """A material's reference to a texture."""

    index: Index


class PbrMetallicRoughness(Part, frozen=True):
    """`materials[].pbrMetallicRoughness`."""

    base_color_texture: TextureInfo | None = None
    metallic_roughness_texture: TextureInfo | None = None


class Material(Part, frozen=True):
    """`materials[]`."""

    pbr_metallic_roughness: PbrMetallicRoughness | None = None
    normal_texture: TextureInfo | None = None
    occlusion_texture: TextureInfo | None = None
    emissive_texture: TextureInfo | None = None


class AnimationSampler(Part, frozen=True):
    """`animations[].samplers[]`."""

    input: Index
    output: Index


class Target(Part, frozen=True):
    """`animations[].channels[].target`."""

    node: Index | None = None


class Channel(Part, frozen=True):
    """`animations[].channels[]`."""

    sampler: Index
    target: Target


class Animation(Part, frozen=True):
    """`animations[]`."""

    channels: list[Channel]
    samplers: list[AnimationSampler]


class Document(Part, frozen=True):
    """The whole file."""

    asset: Asset
    accessors: list[Accessor] = []
    animations: list[Animation] = []
    buffer_views: list[BufferView] = []
    buffers: list[Buffer] = []
    cameras: list[dict[str, Any]] = []
    extensions_required: list[str] = []
    extensions_used: list[str] = []
    images: list[Image] = []
    materials: list[Material] = []
    meshes: list[Mesh] = []
    nodes: list[Node] = []
    samplers: list[dict[str, Any]] = []
    scene: Index | None = None
    scenes: list[Scene] = []
    skins: list[Skin] = []
    textures: list[Texture] = []


def lenient_view(tree: dict[str, Any]) -> tuple[Document, list[Change]]:
    """Return the typed view of a tree in which some exporters write integers as `3.0`.

    Where one does, all whole floats outside `extras` become integers: JSON has one type of number.

    Raises:
        GltfError: a property is missing, of another type or outside its range.
    """
    try:
        return view(tree), []
    except GltfError as error:
        first = error
    if not _floats_made_whole(tree):
        raise first
    return view(tree), [Change(first.pointer or "", "whole-floats", 1)]


def view(tree: dict[str, Any]) -> Document:
    """Return the typed view of a glTF JSON tree.

    Raises:
        GltfError: a property is missing, of another type or outside its range.
    """
    return checked(tree, Document, "")


def checked(value: Any, kind: type[Shape], pointer: str) -> Shape:
    """Return the typed view of a JSON value that lies at `pointer`, such as an extension's.

    Raises:
        GltfError: a property is missing, of another type or outside its range.
    """
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        message, _, path = str(error).partition(" - at ")
        raise GltfError(message, pointer=pointer + _pointer(path)) from error


def _pointer(path: str) -> str:
    """Return a path like `$.accessors[3].count` as a JSON pointer, up to an unknown step."""
    known = path.strip("`$").partition("[...]")[0]
    return "".join(f"/{step}" for step in re.findall(r"\w+", known))


def _floats_made_whole(tree: dict[str, Any]) -> bool:
    """Turn whole floats into integers, in place; return whether there were any."""
    found = False
    pending: list[Any] = [tree]
    while pending:
        part = pending.pop()
        for key, value in list(part.items() if isinstance(part, dict) else enumerate(part)):
            if isinstance(value, dict | list):
                if key != "extras":
                    pending.append(value)
            elif isinstance(value, float) and value.is_integer() and abs(value) <= _MOST:
                part[key] = int(value)
                found = True
    return found
