"""trimesh.Trimesh: texture coordinates, material, colours, attributes, density, metadata stay."""

from __future__ import annotations

import copy
from typing import Any, cast

import numpy as np

from pns_common.interop.carried import CarriedMesh


def read_trimesh(mesh: Any) -> CarriedMesh:
    """Return the arrays of a Trimesh."""
    points, cells = dict(mesh.vertex_attributes), dict(mesh.face_attributes)
    points = {f"attribute {name}": np.asarray(values) for name, values in points.items()}
    cells = {f"attribute {name}": np.asarray(values) for name, values in cells.items()}
    match mesh.visual.kind:
        case "texture" if mesh.visual.uv is not None:
            points["uv"] = np.asarray(mesh.visual.uv)
        case "vertex":
            points["colour"] = np.asarray(mesh.visual.vertex_colors)
        case "face":
            cells["colour"] = np.asarray(mesh.visual.face_colors)
        case _:
            pass
    return CarriedMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), points, cells=cells)


def write_trimesh(refined: CarriedMesh, given: Any) -> Any:
    """Return a mesh of the class of ``given``, with its material and metadata.

    Of a primitive (``Box``, ``Sphere``, …), which is made of its parameters: a ``Trimesh``.
    """
    kind = cast(Any, type(given.to_mesh() if hasattr(given, "to_mesh") else given))
    made = kind(
        vertices=refined.vertices,
        faces=refined.faces,
        vertex_colors=refined.points.get("colour"),
        face_colors=refined.cells.get("colour"),
        vertex_attributes=_attributes(refined.points),
        face_attributes=_attributes(refined.cells),
        metadata=copy.deepcopy(given.metadata),
        process=False,
    )
    # Asking for a density that was not given would measure the mesh.
    if "density" in given._data:
        made.density = given.density
    if "uv" in refined.points:
        made.visual = type(given.visual)(uv=refined.points["uv"], material=given.visual.material)
    return made


def _attributes(data: Any) -> dict[str, np.ndarray]:
    named = ((name.partition("attribute "), values) for name, values in data.items())
    return {name: values for (_, present, name), values in named if present}
