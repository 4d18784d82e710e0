"""A mesh with data on its vertices, corners and faces, refined with them.

The surface is refined as one: vertices at the same position are joined for it, so that the seam of
a texture is no boundary. The refined mesh has the seams of the given one, and its data are
interpolated linearly along each edge, which leaves them as they were at old vertices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, SupportsIndex

import numpy as np
from jaxtyping import Float, Integer

from pns_common.adaptive.corners import Blend, join_corners
from pns_common.adaptive.polygon_refinement import PolygonRefinement
from pns_common.adaptive.refine import AdaptiveRefinement
from pns_common.carry.carried import Carried, Column, Columns, in_type_of, rule_for
from pns_common.carry.carried import refine_carried as refine_columns
from pns_common.carry.rules import linear
from pns_common.errors import ParameterError
from pns_common.mesh.creases import Creases, one_of_creases
from pns_common.mesh.mesh import Mesh
from pns_common.mesh.rows import distinct_rows, number_by_first_appearance
from pns_common.mesh.topology import Topology, check_vertices
from pns_common.operator.scheme import Scheme
from pns_common.parallel import Blocks
from pns_common.refined import Refinement
from pns_common.refinement import refine

Data = Mapping[str, np.ndarray]
NO_LINES = np.zeros((0, 2), dtype=np.int64)


def _nothing() -> Data:
    return {}


@dataclass(frozen=True, eq=False)
class CarriedMesh:
    """A mesh of another library.

    Attributes:
        vertices: (V, 3) positions; several may be equal where other data differ.
        faces: vertices of each face, as ``Mesh`` takes them: (F, 3), (F, 4), (corners, offsets).
        points: data of vertices by name, (V, …) each.
        corners: data of face corners by name, (F, N, …) each; (H, …) where degrees differ.
        cells: data of faces by name, (F, …) each.
        lines: (L, 2) vertices that are lines of their own; those on edges follow these.
        line_parents: (L,) of a refined mesh, the line that each is a part of.
    """

    vertices: Float[np.ndarray, "V 3"]
    faces: Integer[np.ndarray, "F N"] | tuple[Integer[np.ndarray, " H"], Integer[np.ndarray, " F1"]]
    points: Data = field(default_factory=_nothing)
    corners: Data = field(default_factory=_nothing)
    cells: Data = field(default_factory=_nothing)
    lines: Integer[np.ndarray, "L 2"] = field(default_factory=lambda: NO_LINES)
    line_parents: Integer[np.ndarray, " L"] = field(default_factory=lambda: NO_LINES[:, 0])


def refine_carried(
    mesh: CarriedMesh,
    scheme: Scheme | str,
    levels: SupportsIndex | None,
    options: Mapping[str, Any],
) -> tuple[CarriedMesh, Refinement]:
    """Return the refined mesh with its data, and the refinement of the joined surface.

    ``options`` are further arguments of ``refine``, and ``weld``: "position" joins vertices in one
    place, "index" none, so that poses keep one numbering. Creases name vertices of ``mesh``. Raises
    what ``refine`` and ``Mesh`` raise.
    """
    given = Mesh(mesh.vertices, mesh.faces)
    options = dict(options)
    weld = options.pop("weld", "position")
    if weld not in ("position", "index"):
        raise ParameterError("weld", weld, expected="position or index")
    if options.get("faces") is not None:
        raise ParameterError("faces", "given", expected="a Mesh or two arrays, which have no data")
    joined = first = np.arange(len(given.vertices))
    if weld == "position":
        joined, first = join_by_position(given.vertices)
    creases = one_of_creases(options.get("creases", "auto"), options.pop("crease", "auto"))
    named = creases is not None and not isinstance(creases, str)
    options["creases"] = _renamed(creases, joined) if named else creases
    surface_faces = joined[given.corners], given.offsets
    refinement = refine(Mesh(given.vertices[first], surface_faces), scheme, levels, **options)
    if isinstance(refinement, PolygonRefinement):
        expected = "triangles, or a Mesh: polygons of several levels carry no data of libraries yet"
        raise ParameterError("mesh", "polygons", expected=expected)
    if isinstance(refinement, AdaptiveRefinement):
        return _at_faces(mesh, given, joined, refinement), refinement

    blocks, base = Blocks(), refinement.scheme.base
    topologies = [given.topology()]
    for _ in refinement.steps[1:]:
        topologies.append(base.split(topologies[-1], blocks))
    # Corners of faces of one degree are a row of each face.
    flat = {name: _flat(values, given) for name, values in mesh.corners.items()}
    columns = Carried(*map(_columns, (mesh.points, flat, mesh.cells)))
    made = refine_columns(columns, topologies, base, blocks=blocks)
    faces = base.faces(topologies[-1], blocks, np.int64)
    points, corners, cells = map(_values, (made.vertices, made.corners, made.faces))
    corners = {name: own.reshape(*faces.shape, *own.shape[1:]) for name, own in corners.items()}

    # Both meshes have their faces in one order, so their corners correspond.
    last = topologies[-1]
    count = last.vertex_count + len(last.edges) + (last.face_count if base.polygons else 0)
    surface = np.zeros(count, dtype=np.int64)
    surface[: len(joined)] = joined
    surface[faces.reshape(-1)] = refinement.mesh.faces.reshape(-1)
    positions = refinement.mesh.vertices[surface]
    lines = _refined_lines(mesh.lines, topologies)
    return CarriedMesh(positions, faces, points, corners, cells, *lines), refinement


def _refined_lines(
    lines: Integer[np.ndarray, "N 2"], topologies: Sequence[Topology]
) -> tuple[Integer[np.ndarray, "M 2"], Integer[np.ndarray, " M"]]:
    """Return the parts of lines, in order and direction, and which line each is of."""
    parents = np.arange(len(lines))
    if not len(lines):
        return lines, parents
    # Edges are refined, and what is none stays.
    keys = [max(int(lines.max()) + 1, topologies[0].vertex_count), 1]
    edges = topologies[0].edges.astype(np.int64) @ keys
    known = np.isin(np.sort(lines, axis=1) @ keys, edges)
    parts, of_part = lines[known], parents[known]
    for topology in topologies:
        middle = topology.vertex_count + topology.rows_of(parts)
        parts = np.stack([parts[:, 0], middle, middle, parts[:, 1]], axis=1).reshape(-1, 2)
        of_part = np.repeat(of_part, 2)
    made = np.concatenate([parts, lines[~known]])
    of_line = np.concatenate([of_part, parents[~known]])
    order = np.argsort(of_line, kind="stable")
    return made[order], of_line[order]


def _at_faces(
    mesh: CarriedMesh,
    given: Mesh,
    joined: Integer[np.ndarray, " V"],
    made: AdaptiveRefinement,
) -> CarriedMesh:
    """Return faces of several levels with their data. Old vertices keep their numbers."""
    parents, count = made.face_parents, len(given.vertices)
    split = join_corners(made.mesh.faces, given.faces[parents], made.weights)
    rows = split.blend.rows
    old = np.maximum.reduce(split.blend.weights, axis=1) == 1
    number = np.where(
        old,
        np.take_along_axis(rows, split.blend.weights.argmax(axis=1)[:, None], axis=1)[:, 0],
        count + np.cumsum(~old) - 1,
    )
    every = np.arange(count)
    kept = Blend(
        np.concatenate([every[:, None].repeat(3, axis=1), rows[~old]]),
        np.concatenate([np.eye(3)[[0] * count], split.blend.weights[~old]]),
    )
    at_corners = Blend(
        (3 * parents[:, None] + np.arange(3)).repeat(3, axis=0), made.weights.reshape(-1, 3)
    )
    corners = dict[str, np.ndarray]()
    for name, values in mesh.corners.items():
        own = _blended(at_corners, _flat(values, given))
        corners[name] = own.reshape(-1, 3, *own.shape[1:])
    vertices = np.concatenate([joined, split.vertex[~old]])
    return CarriedMesh(
        made.mesh.vertices[vertices],
        number[split.faces],
        {name: _blended(kept, values) for name, values in mesh.points.items()},
        corners,
        {name: values[parents] for name, values in mesh.cells.items()},
    )


def _blended(blend: Blend, values: np.ndarray) -> np.ndarray:
    rows = values.reshape(len(values), -1)
    if rule_for(values) is linear:
        made = in_type_of(values, blend.linear(rows))
    else:
        made = blend.nearest(rows)
    return made.reshape(len(made), *values.shape[1:])


def _columns(data: Data) -> Columns:
    return {name: Column(values, rule_for(values)) for name, values in data.items()}


def _values(columns: Columns) -> dict[str, np.ndarray]:
    return {name: column.values for name, column in columns.items()}


def _flat(corners: np.ndarray, mesh: Mesh) -> np.ndarray:
    is_flat = len(corners) == len(mesh.corners)
    return corners if is_flat else corners.reshape(-1, *corners.shape[2:])


def _renamed(creases: Any, joined: Integer[np.ndarray, " V"]) -> Creases:
    """Return creases by the joined vertices.

    Raises:
        ParameterError: they are not pairs of the mesh's vertices, or name others as corners.
    """
    made, count = creases if isinstance(creases, Creases) else Creases(creases), len(joined)
    if made.vertices is not None:
        check_vertices("vertices", made.vertices, count)
        made = replace(made, vertices=joined[made.vertices])
    if made.named is None:
        return made
    check_vertices("creases", made.named, count)
    return replace(made, named=joined[made.named])


def join_by_position(
    vertices: Float[np.ndarray, "V 3"],
) -> tuple[Integer[np.ndarray, " V"], Integer[np.ndarray, " W"]]:
    """Return the joined vertex of each vertex, and the first vertex of each joined one.

    They are numbered by first appearance: a mesh without equal positions keeps its numbers.
    """
    # Adding 0 makes −0 the 0 that it equals.
    return number_by_first_appearance(distinct_rows(vertices + 0.0))
