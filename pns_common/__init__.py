"""Proximity-Preserving Neural Subdivision: the operator and its models.

    from pns_common import Mesh, load_model, pns, refine

    refined = refine(Mesh(vertices, faces), pns(load_model()), levels=2)
    refined.mesh.vertices, refined.mesh.faces, refined.report

Where to read:

    operator/       formula, top to bottom: start here; what ``pns`` makes of a model
    schemes/        base schemes, one file each: masks, limit masks, split
    mesh/           faces of any degree; edges, classes, creases, normals, selections
    carry/          what vertices and corners carry, refined with the mesh
    kernels/        compiled loops over elements
    model/          card, file, session: what a model is, and onnxruntime, which runs it
    refinement      all levels; refined: what comes out, and its report
    interop/        meshes of other libraries

Names are imported when they are first used: ``import pns_common`` loads no compiler.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pns_common.errors import MeshError, ModelError, ParameterError, PnsError
    from pns_common.interop.subdivide import subdivide
    from pns_common.mesh.creases import Creases
    from pns_common.mesh.cutting import cut_concave
    from pns_common.mesh.mesh import Mesh, clean
    from pns_common.model.file import load_model
    from pns_common.operator.scheme import Scheme, catmull_clark, loop, pns
    from pns_common.operator.sharpness import sharp_edges
    from pns_common.refined import Refinement
    from pns_common.refinement import refine, refine_many
    from pns_common.version import VERSION as __version__  # noqa: N811

_HOMES = {
    "Creases": "mesh.creases",
    "Mesh": "mesh.mesh",
    "MeshError": "errors",
    "ModelError": "errors",
    "ParameterError": "errors",
    "PnsError": "errors",
    "Refinement": "refined",
    "Scheme": "operator.scheme",
    "catmull_clark": "operator.scheme",
    "clean": "mesh.mesh",
    "cut_concave": "mesh.cutting",
    "load_model": "model.file",
    "loop": "operator.scheme",
    "pns": "operator.scheme",
    "refine": "refinement",
    "refine_many": "refinement",
    "sharp_edges": "operator.sharpness",
    "subdivide": "interop.subdivide",
}

__all__ = [
    "Creases",
    "Mesh",
    "MeshError",
    "ModelError",
    "ParameterError",
    "PnsError",
    "Refinement",
    "Scheme",
    "__version__",
    "catmull_clark",
    "clean",
    "cut_concave",
    "load_model",
    "loop",
    "pns",
    "refine",
    "refine_many",
    "sharp_edges",
    "subdivide",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return import_module("pns_common.version").VERSION
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
