"""A field's zero set as a closed mesh, by marching tetrahedra; and points laid onto it.

Every cube of a grid is cut into the six tetrahedra along its diagonal (Kuhn), which fit together
across cubes: so the mesh is a manifold for any field, with no ambiguous case (Payne and Toga 1990).
"""

from itertools import permutations

import numpy as np
from jaxtyping import Float, Int

from pns_common import Mesh
from train.surfaces.solids import Field, Points

# Values nearer to 0 are pushed away from it: no grid point lies on the surface.
NUDGE = 1e-9

# A vertex stays so far, as a share of its edge, from the edge's ends: no face has no area.
SPAN = 0.05

DIFFERENCE = 1e-4
# Of Newton's method towards the surface.
STEPS, LONGEST = 3, 0.03

# Below this squared slope of the field Newton's step is no longer lengthened.
FLATTEST = 0.05


def _tetrahedra() -> Int[np.ndarray, "6 4 3"]:
    """Return the corners of the six tetrahedra of a unit cube."""
    paths = []
    for axes in permutations(range(3)):
        corners = np.zeros((4, 3), dtype=np.int64)
        for step, axis in enumerate(axes, start=1):
            corners[step] = corners[step - 1]
            corners[step, axis] += 1
        paths.append(corners)
    return np.stack(paths)


TETRAHEDRA = _tetrahedra()

# Of a tetrahedron with its inside corners first, by how many there are: triangles, as grid edges.
CASES = {
    1: [((0, 1), (0, 2), (0, 3))],
    2: [((0, 2), (0, 3), (1, 3)), ((0, 2), (1, 3), (1, 2))],
    3: [((0, 3), (1, 3), (2, 3))],
}


# The corners of a tetrahedron in order, by which of them (bits 0 … 3) are inside.
INSIDE_FIRST = np.array(
    [sorted(range(4), key=lambda corner: not code >> corner & 1) for code in range(16)]
)


def marched(field: Field, side: int, extent: float) -> Mesh:
    """Return the zero set in [−extent, extent]³ on a grid of so many points a side.

    Faces look out of where the field is negative.

    Raises:
        MeshError: the field has no zero there.
    """
    axis = np.linspace(-extent, extent, side)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    value = field(grid)
    value = np.where(np.abs(value) < NUDGE, NUDGE, value)
    tetrahedra = _mixed_tetrahedra(value < 0, side)
    inside = value[tetrahedra] < 0
    count = inside.sum(axis=1)
    # Inside corners first.
    ordered = np.take_along_axis(tetrahedra, INSIDE_FIRST[inside @ [1, 2, 4, 8]], axis=1)
    triangles, outward = [], []
    for inner, shapes in CASES.items():
        these = ordered[count == inner]
        away = grid[these[:, inner:]].mean(axis=1) - grid[these[:, :inner]].mean(axis=1)
        for shape in shapes:
            triangles.append(these[:, np.array(shape)])
            outward.append(away)
    ends = np.sort(np.concatenate(triangles).reshape(-1, 2), axis=1)
    key, number = np.unique(ends[:, 0] * len(grid) + ends[:, 1], return_inverse=True)
    edges = np.stack(np.divmod(key, len(grid)), axis=1)
    share = value[edges[:, 0]] / (value[edges[:, 0]] - value[edges[:, 1]])
    share = np.clip(share, SPAN, 1 - SPAN)[:, None]
    points = grid[edges[:, 0]] * (1 - share) + grid[edges[:, 1]] * share
    faces = number.reshape(-1, 3)
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    inward = (np.cross(b - a, c - a) * np.concatenate(outward)).sum(axis=1) < 0
    return Mesh(points, np.where(inward[:, None], faces[:, ::-1], faces))


def gradient(field: Field, points: Points) -> Points:
    """Return the field's gradient by central differences."""
    steps = DIFFERENCE * np.eye(3)
    parts = [(field(points + step) - field(points - step)) / (2 * DIFFERENCE) for step in steps]
    return np.stack(parts, axis=1)


def laid_onto(field: Field, points: Points) -> Points:
    """Return points moved along the field's gradient to where it is 0."""
    for _ in range(STEPS):
        slope = gradient(field, points)
        square = np.maximum((slope**2).sum(axis=1), FLATTEST)
        step = (field(points) / square)[:, None] * slope
        length = np.linalg.norm(step, axis=1, keepdims=True)
        points = points - step * np.minimum(1, LONGEST / np.maximum(length, 1e-12))
    return points


def unit_gradient(field: Field, points: Points) -> Float[np.ndarray, "P 3"]:
    """Return the surface's outward normals."""
    slope = gradient(field, points)
    return slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9)


def _mixed_tetrahedra(inside: np.ndarray, side: int) -> Int[np.ndarray, "T 4"]:
    """Return the grid points of all tetrahedra of the cubes that the surface passes through."""
    cube, cells = inside.reshape(side, side, side), side - 1
    corners = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    count = sum(
        cube[i : i + cells, j : j + cells, k : k + cells].astype(np.int8) for i, j, k in corners
    )
    mixed = np.argwhere((count > 0) & (count < len(corners)))
    number = np.arange(side**3).reshape(side, side, side)
    kinds = [
        np.stack([number[tuple((mixed + corner).T)] for corner in tetrahedron], axis=1)
        for tetrahedron in TETRAHEDRA
    ]
    return np.concatenate(kinds)
