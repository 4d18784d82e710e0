"""A mesh with data on its vertices, corners and faces, refined with them.

The surface is refined as one: vertices at the same position are joined for it, so that the seam of
a texture is no boundary. The refined mesh has the seams of the given one, and its data are
interpolated linearly along each edge, which leaves them as they were at old vertices.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, SupportsIndex

import numpy as np
from jaxtyping import Float, Integer, Shaped

from pns_common.errors import ParameterError
from pns_common.mesh.creases import Creases
from pns_common.mesh.mesh import Mesh
from pns_common.mesh.rows import distinct_rows, number_by_first_appearance
from pns_common.mesh.topology import Topology, check_vertices
from pns_common.operator.scheme import Scheme
from pns_common.parallel import Blocks
from pns_common.refinement import Refinement, refine

# The children of a face, by its corners a, b, c (0, 1, 2) and edge vertices ab, bc, ca (3, 4, 5).
CHILDREN = np.array([(0, 3, 5), (1, 4, 3), (2, 5, 4), (3, 4, 5)])

Data = Mapping[str, np.ndarray]


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
    """

    vertices: Float[np.ndarray, "V 3"]
    faces: Integer[np.ndarray, "F N"] | tuple[Integer[np.ndarray, " H"], Integer[np.ndarray, " F1"]]
    points: Data = field(default_factory=_nothing)
    corners: Data = field(default_factory=_nothing)
    cells: Data = field(default_factory=_nothing)


def refine_carried(
    mesh: CarriedMesh, scheme: Scheme | str, levels: SupportsIndex, options: Mapping[str, Any]
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
    creases = options.get("creases", "auto")
    if creases is not None and not isinstance(creases, str):
        options["creases"] = _renamed(creases, joined)
    surface_faces = joined[given.corners], given.offsets
    refinement = refine(Mesh(given.vertices[first], surface_faces), scheme, levels, **options)

    blocks, topology, base = Blocks(), given.topology(), refinement.scheme.base
    points, corners, cells = dict(mesh.points), dict(mesh.corners), dict(mesh.cells)
    for depth in range(len(refinement.steps)):
        topology = base.split(topology, blocks) if depth else topology
        degrees = np.diff(topology.offsets) if base.polygons else 4
        for name, values in points.items():
            ends = (values[topology.edges[:, side]] for side in (0, 1))
            parts = [values, between(*ends)]
            if base.polygons:
                parts.append(mean_of_faces(values[topology.corners], topology))
            points[name] = np.concatenate(parts)
        corners = {
            name: quad_corners(values, topology) if base.polygons else corner_children(values)
            for name, values in corners.items()
        }
        cells = {name: np.repeat(values, degrees, axis=0) for name, values in cells.items()}
    faces = base.faces(topology, blocks, np.int64)

    # Both meshes have their faces in one order, so their corners correspond.
    count = topology.vertex_count + len(topology.edges)
    count += topology.face_count if base.polygons else 0
    surface = np.zeros(count, dtype=np.int64)
    surface[: len(joined)] = joined
    surface[faces.reshape(-1)] = refinement.mesh.faces.reshape(-1)
    positions = refinement.mesh.vertices[surface]
    return CarriedMesh(positions, faces, points, corners, cells), refinement


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


def corner_children(corners: Shaped[np.ndarray, " F 3 *K"]) -> Shaped[np.ndarray, " G 3 *K"]:
    """Return the corners' data of the four children of each face."""
    edges = between(corners, np.roll(corners, -1, axis=1))
    six = np.concatenate([corners, edges], axis=1)
    return six[:, CHILDREN].reshape(-1, *corners.shape[1:])


def quad_corners(
    corners: Shaped[np.ndarray, " H *K"] | Shaped[np.ndarray, " F N *K"], topology: Topology
) -> Shaped[np.ndarray, " H 4 *K"]:
    """Return the corners' data of the quads that a mesh of polygons is split into."""
    is_flat = len(corners) == len(topology.corners)
    flat = corners if is_flat else corners.reshape(-1, *corners.shape[2:])
    before = np.arange(-1, len(flat) - 1)
    before[topology.offsets[:-1]] = topology.offsets[1:] - 1
    entering = between(flat[before], flat)
    leaving = np.empty_like(entering)
    leaving[before] = entering
    centres = mean_of_faces(flat, topology)[topology.face_of(np.arange(len(flat)))]
    return np.stack([flat, leaving, centres, entering], axis=1)


def mean_of_faces(
    corners: Shaped[np.ndarray, " H *K"], topology: Topology
) -> Shaped[np.ndarray, " F *K"]:
    """Return the mean of the data at each face's corners; of labels the first."""
    kind = corners.dtype.kind
    if kind not in "fc" and corners.dtype != np.uint8:
        return corners[topology.offsets[:-1]]
    # Shares first: the sum of all may be more than the type holds.
    degrees = np.diff(topology.offsets).reshape(-1, *[1] * (corners.ndim - 1))
    shares = corners / np.repeat(degrees, degrees.reshape(-1), axis=0)
    means = np.add.reduceat(shares, topology.offsets[:-1])
    return (means if kind in "fc" else np.rint(means)).astype(corners.dtype)


def between(
    a: Shaped[np.ndarray, " N *K"], b: Shaped[np.ndarray, " N *K"]
) -> Shaped[np.ndarray, " N *K"]:
    """Return the data halfway: the mean of numbers and colours (uint8), the first of labels."""
    if a.dtype.kind in "fc":
        # Halves first: the sum of two may be more than the type holds.
        return (a / 2 + b / 2).astype(a.dtype)
    if a.dtype == np.uint8:
        return ((a.astype(np.uint16) + b + 1) // 2).astype(np.uint8)
    return a
