"""Refine meshes of any library; the result is of the given kind."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, SupportsIndex, TypeVar, cast

import numpy as np

from pns_common.errors import ParameterError
from pns_common.interop.carried import CarriedMesh, refine_carried
from pns_common.interop.of_meshio import read_meshio, write_meshio
from pns_common.interop.of_open3d import read_open3d, write_open3d
from pns_common.interop.of_pyvista import read_pyvista, write_pyvista
from pns_common.interop.of_trimesh import read_trimesh, write_trimesh
from pns_common.mesh import Mesh
from pns_common.model.file import load_model
from pns_common.refinement import DEFAULT_LEVELS, refine
from pns_common.schemes import Scheme, pns

AnyMesh = TypeVar("AnyMesh")


@dataclass(frozen=True)
class Adapter:
    """Functions that read a library's mesh, and make one like it."""

    read: Callable[[Any], CarriedMesh]
    write: Callable[[CarriedMesh, Any], Any]


# By package and class, so that a mesh is recognised without importing its library.
ADAPTERS = MappingProxyType(
    {
        ("trimesh", "Trimesh"): Adapter(read_trimesh, write_trimesh),
        ("pyvista", "PolyData"): Adapter(read_pyvista, write_pyvista),
        ("meshio", "Mesh"): Adapter(read_meshio, write_meshio),
        ("open3d", "TriangleMesh"): Adapter(read_open3d, write_open3d),
    }
)


def subdivide(
    mesh: AnyMesh,
    levels: SupportsIndex = DEFAULT_LEVELS,
    scheme: Scheme | None = None,
    **options: Any,
) -> AnyMesh:
    """Refine a mesh and return one of the same kind.

    Args:
        mesh: a ``Mesh``; a pair (vertices (V, 3), faces (F, 3)) of arrays; a trimesh ``Trimesh``, a
            pyvista ``PolyData``, a meshio ``Mesh`` or an open3d ``TriangleMesh``, of triangles.
            Meshes of a library keep texture coordinates, colours and other data, interpolated
            linearly; their vertices at the same position are one vertex of the surface, unless
            ``weld="index"`` is among the options. A pair and a ``Mesh`` are refined as they are.
        levels: number of steps, 1 … 16.
        scheme: None for ``pns(load_model())``.
        options: further arguments of ``refine``: ``reference_length``, ``creases``, …

    Raises:
        ParameterError: it is a mesh of none of these kinds; and as ``refine``.
        MeshError: it has other cells than triangles; and as ``refine`` and ``Mesh``.
    """
    given: Any = mesh
    is_pair = isinstance(given, (tuple, list)) and len(cast(Sequence[Any], given)) == 2
    adapter = None if is_pair or isinstance(mesh, Mesh) else _adapter(mesh)
    scheme = pns(load_model()) if scheme is None else scheme
    if isinstance(mesh, Mesh):
        return cast(AnyMesh, refine(mesh, scheme, levels, **options).mesh)
    if adapter is None:
        vertices, faces = cast(tuple[Any, Any], given)
        refined = refine(Mesh(vertices, faces), scheme, levels, **options).mesh
        # A tuple with names takes its values one by one, but for this.
        make: Any = getattr(type(mesh), "_make", type(mesh))
        return make((np.array(refined.vertices), np.array(refined.faces)))
    carried, _ = refine_carried(adapter.read(mesh), scheme, levels, options)
    return adapter.write(carried, mesh)


def _adapter(mesh: object) -> Adapter:
    """Return the adapter of a mesh's class, or of one that it is derived from."""
    for base in type(mesh).__mro__:
        known = ADAPTERS.get((base.__module__.partition(".")[0], base.__name__))
        if known is not None:
            return known
    kinds = ", ".join(f"{package}.{name}" for package, name in ADAPTERS)
    # trimesh loads a GLB as a scene.
    others = "of a scene or a file, its meshes one by one"
    expected = f"a Mesh, a pair of arrays, or {kinds}; {others}"
    raise ParameterError("mesh", type(mesh), expected=expected)
