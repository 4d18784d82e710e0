"""Closed parts as computer-aided design makes them, dense: grids on surfaces with exact formulas.

Every vertex lies on its surface. Faces are anticlockwise from outside; lengths are in a unit in
which a part is about 2 across. A fineness of n cuts every side of the grid into n.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from jaxtyping import Float, Int

from pns_common import Mesh

# Points (radius, height) of a lathe's profile, from the lower end of the axis to the upper.
Profile = Float[np.ndarray, "N 2"]


def torus(fineness: int = 1) -> Mesh:
    """Return a torus: a tube of radius 0.35 round a circle of radius 0.65."""
    around, across = 144 * fineness, 56 * fineness
    u, v = _angles(around)[:, None], _angles(across)[None, :]
    radius = 0.65 + 0.35 * np.cos(v)
    height = np.broadcast_to(0.35 * np.sin(v), np.broadcast_shapes(u.shape, v.shape))
    points = np.stack([radius * np.cos(u), radius * np.sin(u), height], axis=-1)
    return Mesh(points.reshape(-1, 3), closed_grid_faces(around, across))


def pipe(fineness: int = 1) -> Mesh:
    """Return a trefoil of pipe, radius 0.13, round (sin t + 2 sin 2t, cos t − 2 cos 2t, −sin 3t)/3.

    The pipe's cross-section stands in the curve's Frenet frame; this curve has curvature
    everywhere.
    """
    around, across = 320 * fineness, 24 * fineness
    t, v = _angles(around), _angles(across)[None, :, None]
    curve, first, second = (
        np.stack(parts, axis=-1) / 3
        for parts in (
            (np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)),
            (np.cos(t) + 4 * np.cos(2 * t), -np.sin(t) + 4 * np.sin(2 * t), -3 * np.cos(3 * t)),
            (-np.sin(t) - 8 * np.sin(2 * t), -np.cos(t) + 8 * np.cos(2 * t), 9 * np.sin(3 * t)),
        )
    )
    binormal = np.cross(first, second)
    binormal /= np.linalg.norm(binormal, axis=1, keepdims=True)
    normal = np.cross(binormal, first)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    ring = np.cos(v) * normal[:, None] - np.sin(v) * binormal[:, None]
    points = curve[:, None] + 0.13 * ring
    return Mesh(points.reshape(-1, 3), closed_grid_faces(around, across))


def rounded_cylinder(fineness: int = 1, around: int = 112) -> Mesh:
    """Return a cylinder of radius 0.7 and height 1.4 whose rims are rounded with radius 0.2."""
    return lathe(
        _joined(
            _line((0, -0.7), (0.5, -0.7), 12 * fineness),
            _arc((0.5, -0.5), 0.2, -90, 0, 10 * fineness),
            _line((0.7, -0.5), (0.7, 0.5), 20 * fineness),
            _arc((0.5, 0.5), 0.2, 0, 90, 10 * fineness),
            _line((0.5, 0.7), (0, 0.7), 12 * fineness),
        ),
        around * fineness,
    )


def stepped_shaft(fineness: int = 1) -> Mesh:
    """Return a shaft with one step, filleted (concave) with radius 0.15, its rims rounded."""
    return lathe(
        _joined(
            _line((0, -0.8), (0.58, -0.8), 12 * fineness),
            _arc((0.58, -0.68), 0.12, -90, 0, 8 * fineness),
            _line((0.7, -0.68), (0.7, -0.22), 10 * fineness),
            _arc((0.58, -0.22), 0.12, 0, 90, 8 * fineness),
            _line((0.58, -0.1), (0.5, -0.1), 3 * fineness),
            _arc((0.5, 0.05), 0.15, 270, 180, 8 * fineness),
            _line((0.35, 0.05), (0.35, 0.8), 16 * fineness),
            _arc((0.25, 0.8), 0.1, 0, 90, 8 * fineness),
            _line((0.25, 0.9), (0, 0.9), 6 * fineness),
        ),
        112 * fineness,
    )


def pulley(fineness: int = 1) -> Mesh:
    """Return a disc of radius 0.9 with a round groove of radius 0.25; its edges are rounded.

    The groove's circle touches those of the rounded edges, radius 0.1, from outside.
    """
    edge, groove, height = 0.1, 0.25, 0.32
    reach = np.sqrt((edge + groove) ** 2 - height**2)
    contact = np.degrees(np.arctan2(height, reach))
    return lathe(
        _joined(
            _line((0, -height - edge), (0.8, -height - edge), 16 * fineness),
            _arc((0.8, -height), edge, -90, contact, 12 * fineness),
            _arc((0.8 + reach, 0), groove, 180 + contact, 180 - contact, 16 * fineness),
            _arc((0.8, height), edge, -contact, 90, 12 * fineness),
            _line((0.8, height + edge), (0, height + edge), 16 * fineness),
        ),
        112 * fineness,
    )


def knob(fineness: int = 1) -> Mesh:
    """Return a rounded cylinder whose radius is waved eight times round it by a tenth."""
    part = rounded_cylinder(fineness, around=160)
    angle = np.arctan2(part.vertices[:, 1], part.vertices[:, 0])
    waved = part.vertices * np.array([1.0, 1.0, 0.8])
    waved[:, :2] *= (1 + 0.1 * np.cos(8 * angle))[:, None]
    return Mesh(waved, part.faces)


def rounded_box(fineness: int = 1) -> Mesh:
    """Return a box of 2 × 1.4 × 0.8 whose edges and corners are rounded with radius 0.2.

    It is a grid on the cube, moved onto the sphere of radius 0.2 round the nearest point of the
    inner box; in the rounded zones the grid's lines stand at equal angles.
    """
    radius, flat, bent = 0.2, 20 * fineness, 7 * fineness
    grid, faces = cube_faces(flat + 2 * bent)
    inner = np.array([1.0, 0.7, 0.4]) - radius
    rim = radius * np.tan(np.linspace(0, np.pi / 4, bent + 1))
    points = np.empty(grid.shape)
    for axis, half in enumerate(inner):
        lines = np.concatenate(
            [-half - rim[:0:-1], np.linspace(-half, half, flat + 1), half + rim[1:]]
        )
        points[:, axis] = lines[grid[:, axis]]
    core = np.clip(points, -inner, inner)
    outward = points - core
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    return Mesh(core + radius * outward, faces)


def lathe(profile: Profile, around: int) -> Mesh:
    """Return the surface of revolution of a profile round the z axis, which it starts and ends on.

    Each end is one vertex.
    """
    inner, u = profile[1:-1], _angles(around)
    rings = np.stack(
        [
            np.outer(inner[:, 0], np.cos(u)),
            np.outer(inner[:, 0], np.sin(u)),
            np.repeat(inner[:, 1:], around, axis=1),
        ],
        axis=-1,
    )
    ends = np.array([[0, 0, profile[0, 1]], [0, 0, profile[-1, 1]]])
    count = rings.shape[0] * around
    i = np.arange(around)
    following = (i + 1) % around
    top = count - around
    low = np.stack([np.full(around, count), following, i], axis=1)
    high = np.stack([np.full(around, count + 1), top + i, top + following], axis=1)
    # Rows go up, columns round: turned over, they look outwards.
    walls = closed_grid_faces(len(inner), around, closed_rows=False)[:, ::-1]
    points = np.concatenate([rings.reshape(-1, 3), ends])
    return Mesh(points, np.concatenate([low, walls, high]))


def closed_grid_faces(
    rows: int, columns: int, *, closed_rows: bool = True
) -> Int[np.ndarray, "F 3"]:
    """Return the faces of a grid that closes on itself; vertex i · columns + j is at row i.

    Diagonals turn from quad to quad like a draughts-board's fields.
    """
    i, j = (axis.ravel() for axis in np.mgrid[: rows if closed_rows else rows - 1, :columns])
    v00, v10 = i * columns + j, (i + 1) % rows * columns + j
    v01 = i * columns + (j + 1) % columns
    v11 = (i + 1) % rows * columns + (j + 1) % columns
    even = (i + j) % 2 == 0
    first = np.where(even, [v00, v10, v11], [v00, v10, v01])
    second = np.where(even, [v00, v11, v01], [v10, v11, v01])
    return np.stack([first.T, second.T], axis=1).reshape(-1, 3)


def cube_faces(cells: int) -> tuple[Int[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]:
    """Return the surface of a cube of cells³ cells: points in 0 … cells, and triangles."""
    i, j = (axis.ravel() for axis in np.mgrid[:cells, :cells])
    corners = np.stack([i, j, i + 1, j, i + 1, j + 1, i, j + 1], axis=1).reshape(-1, 4, 2)
    even = ((i + j) % 2 == 0)[:, None, None]
    # Both halves of a quad, its diagonal turned from quad to quad.
    rising, falling = corners[:, [0, 1, 2, 0, 2, 3]], corners[:, [0, 1, 3, 1, 2, 3]]
    flat = np.where(even, rising, falling).reshape(-1, 3, 2)
    sides = []
    for axis in range(3):
        # The other two axes in turn: their cross product points along this one.
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for end, triangles in ((cells, flat), (0, flat[:, ::-1])):
            side = np.full((len(flat), 3, 3), end)
            side[..., u], side[..., v] = triangles[..., 0], triangles[..., 1]
            sides.append(side)
    grid, number = np.unique(np.concatenate(sides).reshape(-1, 3), axis=0, return_inverse=True)
    return grid, number.reshape(-1, 3)


def _angles(count: int) -> Float[np.ndarray, " N"]:
    return 2 * np.pi * np.arange(count) / count


def _line(start: tuple[float, float], end: tuple[float, float], pieces: int) -> Profile:
    return np.linspace(start, end, pieces + 1)


def _arc(
    centre: tuple[float, float], radius: float, start: float, end: float, pieces: int
) -> Profile:
    """Return points of a circle between two angles in degrees, from the radius's axis upwards."""
    angle = np.radians(np.linspace(start, end, pieces + 1))
    return np.array(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _joined(*pieces: Profile) -> Profile:
    """Return pieces one after another; each starts where the one before it ends."""
    return np.concatenate([pieces[0], *(piece[1:] for piece in pieces[1:])])


# Every part of a fineness, by its name in tables.
CAD_PARTS: Mapping[str, Callable[[int], Mesh]] = MappingProxyType(
    {
        "torus": torus,
        "pipe": pipe,
        "rounded box": rounded_box,
        "rounded cylinder": rounded_cylinder,
        "stepped shaft": stepped_shaft,
        "pulley": pulley,
        "knob": knob,
    }
)
