"""Blender's attributes as layers of arrays: what each type holds, and how it is refined."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy
import numpy as np

from pns_common.carry import rules
from pns_common.carry.rules import Rule

from .refining.snapshot import Layer


@dataclass(frozen=True)
class Kind:
    """Layout of an attribute of one type: the field, its width and its type."""

    field: str
    width: int
    dtype: type
    rule: Rule
    unit: bool = False


KINDS = {
    "FLOAT": Kind("value", 1, np.float32, rules.smooth),
    "FLOAT2": Kind("vector", 2, np.float32, rules.smooth),
    "FLOAT_VECTOR": Kind("vector", 3, np.float32, rules.smooth),
    "FLOAT_COLOR": Kind("color", 4, np.float32, rules.smooth),
    "BYTE_COLOR": Kind("color", 4, np.float32, rules.smooth),
    "QUATERNION": Kind("value", 4, np.float32, rules.smooth, unit=True),
    "FLOAT4X4": Kind("value", 16, np.float32, rules.smooth),
    "INT": Kind("value", 1, np.int32, rules.vote),
    "INT8": Kind("value", 1, np.int32, rules.vote),
    "INT16_2D": Kind("value", 2, np.int32, rules.vote),
    "INT32_2D": Kind("value", 2, np.int32, rules.vote),
    "BOOLEAN": Kind("value", 1, np.bool_, rules.vote),
    "STRING": Kind("value", 1, np.int64, rules.vote),
}
# What the mesh is made of, and what is read and written in other ways.
STRUCTURE = {
    "position",
    ".edge_verts",
    ".corner_vert",
    ".corner_edge",
    "crease_edge",
    "crease_vert",
    "custom_normal",
    "pns_ratio",
    "pns_gate",
    "pns_distance",
}
# What is selected: of no use on other elements.
PASSING = (".select_", ".vs.", ".es.", ".uv_select")
# Weights of single vertices, which must not spread to those around them.
OF_ONE_VERTEX = {"bevel_weight_vert"}
ROWS = 20_000


def read_layers(mesh: bpy.types.Mesh) -> Iterator[Layer | None]:
    """Yield all attributes of a mesh, and None between pieces of long work."""
    names = [a.name for a in mesh.attributes if is_carried(a.name) and a.data_type in KINDS]
    for name in names:
        attribute = mesh.attributes[name]
        kind, domain = KINDS[attribute.data_type], attribute.domain
        texts: tuple[str | bytes, ...] = ()
        if attribute.data_type == "STRING":
            strings = []
            for start in range(0, len(attribute.data), ROWS):
                strings += [row.value for row in attribute.data[start : start + ROWS]]
                yield None
            texts, values = _numbered(strings)
        else:
            values = np.zeros(len(attribute.data) * kind.width, kind.dtype)
            attribute.data.foreach_get(kind.field, values)
        one = domain in ("EDGE", "FACE") or name in OF_ONE_VERTEX
        rule = rules.old if one else kind.rule
        values = values.reshape(-1, kind.width)
        if rule is rules.smooth:
            values = values.astype(np.float64)
        yield Layer(
            values,
            rule,
            unit=kind.unit,
            name=name,
            kind=attribute.data_type,
            domain=domain,
            texts=texts,
        )


def write_layer(mesh: bpy.types.Mesh, layer: Layer) -> Iterator[None]:
    """Add an attribute to a mesh, in pieces.

    Raises:
        RuntimeError: Blender refuses it.
    """
    kind = KINDS[layer.kind]
    attribute = mesh.attributes.get(layer.name)
    if attribute is None:
        attribute = mesh.attributes.new(layer.name, layer.kind, layer.domain)
    if (attribute.name, attribute.data_type) != (layer.name, layer.kind):
        raise RuntimeError("Blender has something else of this name")
    if layer.kind == "STRING":
        for start in range(0, len(layer.values), ROWS):
            rows = layer.values[start : start + ROWS, 0]
            for row, code in zip(mesh.attributes[layer.name].data[start:], rows, strict=False):
                row.value = layer.texts[code]
            yield
        return
    # Blender copies whole buffers where the types agree, and reads number by number where not.
    attribute.data.foreach_set(kind.field, np.ascontiguousarray(layer.values, kind.dtype).ravel())


def is_carried(name: str) -> bool:
    """Return whether an attribute is one that goes through refinement as such."""
    return name not in STRUCTURE and not name.startswith(PASSING)


def _numbered(texts: list[str | bytes]) -> tuple[tuple[str | bytes, ...], np.ndarray]:
    """Return the different texts, and which is in each row; the first is that of new elements."""
    places: dict[str | bytes, int] = {type(texts[0])(): 0} if texts else {}
    rows = np.array([places.setdefault(text, len(places)) for text in texts], dtype=np.int64)
    return tuple(places), rows
