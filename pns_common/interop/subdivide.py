"""Refine meshes of any library; the result is of the given kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from inspect import signature
from operator import methodcaller
from types import MappingProxyType
from typing import Any, SupportsIndex, TypeVar, cast

import numpy as np

from pns_common.errors import ParameterError
from pns_common.interop.carried import CarriedMesh, refine_carried
from pns_common.interop.of_meshio import read_meshio, triangulated_meshio, write_meshio
from pns_common.interop.of_open3d import read_open3d, write_open3d
from pns_common.interop.of_pyvista import read_pyvista, write_pyvista
from pns_common.interop.of_trimesh import read_trimesh, write_trimesh
from pns_common.mesh.mesh import Mesh
from pns_common.model.file import load_model
from pns_common.operator.scheme import Scheme, pns
from pns_common.refinement import refine, scheme_for

AnyMesh = TypeVar("AnyMesh")
Kind = TypeVar("Kind")


@dataclass(frozen=True)
class Adapter:
    """Functions that read a library's mesh, make one like it, and cut its polygons, if any.

    ``count`` returns the number of its faces.
    """

    read: Callable[[Any], CarriedMesh]
    write: Callable[[CarriedMesh, Any], Any]
    count: Callable[[Any], int]
    polygons: bool = False
    triangulated: Callable[[Any], Any] | None = None


# By package and class, so that a mesh is recognised without importing its library.
ADAPTERS = MappingProxyType(
    {
        ("trimesh", "Trimesh"): Adapter(read_trimesh, write_trimesh, lambda mesh: len(mesh.faces)),
        ("pyvista", "PolyData"): Adapter(
            read_pyvista,
            write_pyvista,
            lambda mesh: len(mesh.faces) + mesh.n_strips,
            True,
            methodcaller("triangulate"),
        ),
        ("meshio", "Mesh"): Adapter(
            read_meshio, write_meshio, lambda mesh: len(mesh.cells), True, triangulated_meshio
        ),
        ("open3d", "TriangleMesh"): Adapter(
            read_open3d, write_open3d, lambda mesh: len(mesh.triangles)
        ),
    }
)


def _refined_scene(scene: Any, refined: Callable[[Any], Any]) -> Any:
    made = scene.copy()
    for name, part in scene.geometry.items():
        made.geometry[name] = refined(part)
    return made


def _refined_blocks(blocks: Any, refined: Callable[[Any], Any]) -> Any:
    made = blocks.copy(deep=False)
    for index, block in enumerate(blocks):
        made.replace(index, refined(block))
    return made


# Return a copy of a collection with each part refined.
COLLECTIONS = MappingProxyType(
    {("trimesh", "Scene"): _refined_scene, ("pyvista", "MultiBlock"): _refined_blocks}
)


def subdivide(
    mesh: AnyMesh,
    levels: SupportsIndex | None = None,
    scheme: Scheme | str | None = None,
    *,
    triangulate: bool = False,
    **options: Any,
) -> AnyMesh:
    """Refine a mesh and return one of the same kind.

    Args:
        mesh: a ``Mesh``; a pair (vertices (V, 3), faces (F, 3)) of arrays; a trimesh ``Trimesh``, a
            pyvista ``PolyData``, a meshio ``Mesh`` or an open3d ``TriangleMesh``; or
            a trimesh ``Scene`` or pyvista ``MultiBlock`` of such and other parts, which stay.
            Meshes of a library keep texture coordinates, colours and other data, interpolated
            linearly; their vertices at the same position are one vertex of the surface, unless
            ``weld="index"`` is among the options. A pair and a ``Mesh`` are refined as they are.
        levels: number of steps, 1 … 16; None: 2, or 6 at most with a tolerance or the like.
        scheme: as for ``refine``; None for ``pns(load_model())``, which takes polygons too.
        triangulate: cut polygons into triangles first, which is right for convex ones.
        options: further arguments of ``refine``: ``reference_length``, ``crease`` (or ``creases``:
            "auto", "off", "angle:40", pairs of vertices), …

    Raises:
        ParameterError: it is a mesh of none of these kinds, or of a library that holds triangles
            alone and the scheme makes quads; and as ``refine``.
        MeshError: it has cells that are no faces; and as ``refine`` and ``Mesh``.
        TypeError: an option of another name, with the nearest one.

    Example:
        >>> vertices, faces = subdivide((np.eye(3), np.array([[0, 1, 2]])), levels=1)
        >>> faces.shape
        (4, 3)
    """
    _check_names(options)
    given: Any = mesh
    scheme = pns(load_model()) if scheme is None else scheme
    if collection := _of_class(mesh, COLLECTIONS):

        def refined(part: Any) -> Any:
            adapter = _of_class(part, ADAPTERS)
            if _of_class(part, COLLECTIONS) is None and not (adapter and adapter.count(part)):
                return part
            return subdivide(part, levels, scheme, triangulate=triangulate, **options)

        return cast(AnyMesh, collection(mesh, refined))
    is_pair = isinstance(given, (tuple, list)) and len(cast(Sequence[Any], given)) == 2
    if is_pair or isinstance(mesh, Mesh):
        control = mesh if isinstance(mesh, Mesh) else Mesh(*given)
        control = control.triangulated() if triangulate else control
        made = refine(control, scheme, levels, **options).mesh
        if isinstance(mesh, Mesh):
            return cast(AnyMesh, made)
        # A tuple with names takes its values one by one, but for this.
        make: Any = getattr(type(mesh), "_make", type(mesh))
        alike = len({*np.diff(made.offsets).tolist()}) == 1
        return make((np.array(made.vertices), np.array(made.faces) if alike else made.polygons))
    adapter = _adapter(mesh)
    if triangulate and adapter.triangulated is not None:
        mesh = adapter.triangulated(mesh)
    read = adapter.read(mesh)
    chosen = scheme_for(Mesh(read.vertices, read.faces), scheme)
    if chosen.base.polygons and not adapter.polygons:
        expected = f"a scheme of triangles: {type(mesh).__name__} holds no quads"
        raise ParameterError("scheme", chosen.name, expected=expected)
    carried, _ = refine_carried(read, chosen, levels, options)
    return adapter.write(carried, mesh)


def _check_names(options: Mapping[str, Any]) -> None:
    """Raise TypeError for an option that is none, with the one that is meant."""
    known = ("weld", *tuple(signature(refine).parameters)[3:])
    for name in options.keys() - set(known):
        near = get_close_matches(name, (*known, "levels", "scheme", "triangulate"), 1, 0.5)
        meant = f": {near[0]} is meant?" if near else f"; there are {', '.join(known)}"
        raise TypeError(f"subdivide() has no option {name!r}{meant}")


def _adapter(mesh: object) -> Adapter:
    """Return the adapter of a mesh's class, or of one that it is derived from."""
    if (known := _of_class(mesh, ADAPTERS)) is not None:
        return known
    kinds = ", ".join(f"{package}.{name}" for package, name in (*ADAPTERS, *COLLECTIONS))
    expected = f"a Mesh, a pair of arrays, or {kinds}"
    raise ParameterError("mesh", type(mesh), expected=expected)


def _of_class(thing: object, table: Mapping[tuple[str, str], Kind]) -> Kind | None:
    """Return the entry of an object's class, or of one that it is derived from."""
    names = ((base.__module__.partition(".")[0], base.__name__) for base in type(thing).__mro__)
    return next((table[name] for name in names if name in table), None)
