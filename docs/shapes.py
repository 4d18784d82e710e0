"""Shapes of the pictures, made by code: each dense, to be simplified and refined back.

A body is a field of signed distances, joined by smooth minima; VTK's contour is its surface.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import fast_simplification
import numpy as np
import pyvista
from jaxtyping import Float
from matplotlib.path import Path as Outline
from matplotlib.textpath import TextPath

from pns_common import Mesh, clean
from train.surfaces.brep import Solid, cut, cylinder, fused, laid_over, prism, tessellated

Points = Float[np.ndarray, "N 3"]
Field = Callable[[Points], Float[np.ndarray, " N"]]


def ball(centre: Sequence[float], radii: Sequence[float], points: Points) -> np.ndarray:
    """Return about the distances from an ellipsoid."""
    at, r = points - centre, np.asarray(radii)
    inner, outer = np.linalg.norm(at / r, axis=1), np.linalg.norm(at / r**2, axis=1)
    return inner * (inner - 1) / np.maximum(outer, 1e-9)


def rod(a: Sequence[float], b: Sequence[float], ra: float, rb: float, points: Points) -> np.ndarray:
    """Return the distances from a rod that goes from radius ``ra`` to ``rb``."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return np.linalg.norm(points - a - share[:, None] * (b - a), axis=1) - (ra + (rb - ra) * share)


def joined(bodies: Sequence[Field], width: float, points: Points) -> np.ndarray:
    """Return the distances from bodies that flow into each other over a width."""
    made = bodies[0](points)
    for body in bodies[1:]:
        other = body(points)
        h = np.clip(0.5 + 0.5 * (other - made) / width, 0, 1)
        made = other * (1 - h) + made * h - width * h * (1 - h)
    return made


def carved(body: Field, tool: Field, width: float, points: Points) -> np.ndarray:
    """Return the distances from a body without another."""
    return -joined([lambda p: -body(p), tool], width, points)


def surface(field: Field, low: Sequence[float], high: Sequence[float], cells: int = 90) -> Mesh:
    """Return the surface of a field within a box."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    step = (high - low).max() / cells
    size = np.ceil((high - low) / step).astype(int) + 1
    grid = pyvista.ImageData(dimensions=size, spacing=(step,) * 3, origin=low)
    made = grid.contour([0.0], scalars=field(np.asarray(grid.points)), method="flying_edges")
    return clean(Mesh(np.asarray(made.points, float), made.regular_faces)).mesh


def coarse(mesh: Mesh, faces: int) -> Mesh:
    """Return a mesh simplified by quadrics to so many faces."""
    points, kept = fast_simplification.simplify(
        mesh.vertices.astype(np.float32), mesh.faces.astype(np.int32), target_count=faces
    )
    return clean(Mesh(points.astype(float), kept)).mesh


def head() -> Mesh:
    """Return a stone head with a brow, a long nose, lips and ears."""
    parts: list[Field] = [
        partial(ball, (0, 0.1, 0), (0.62, 1.15, 0.58)),
        partial(rod, (-0.38, 0.52, 0.42), (0.38, 0.52, 0.42), 0.17, 0.17),
        partial(rod, (0, 0.5, 0.5), (0, -0.12, 0.74), 0.11, 0.17),
        partial(rod, (-0.17, -0.42, 0.5), (0.17, -0.42, 0.5), 0.1, 0.1),
        partial(rod, (-0.14, -0.58, 0.5), (0.14, -0.58, 0.5), 0.09, 0.09),
        partial(ball, (0, -0.92, 0.34), (0.3, 0.2, 0.26)),
        partial(rod, (0.62, 0.4, -0.05), (0.6, -0.45, -0.02), 0.1, 0.08),
        partial(rod, (-0.62, 0.4, -0.05), (-0.6, -0.45, -0.02), 0.1, 0.08),
        partial(rod, (0, -0.8, -0.1), (0, -1.6, -0.1), 0.42, 0.55),
    ]
    eyes: list[Field] = [partial(ball, (x, 0.27, 0.6), (0.19, 0.13, 0.2)) for x in (-0.27, 0.27)]
    body = partial(joined, parts, 0.1)
    whole = partial(carved, body, partial(joined, eyes, 0.01), 0.06)
    return surface(
        lambda p: np.maximum(whole(p), -1.45 - p[:, 1]), (-1, -1.55, -0.9), (1, 1.4, 1.1), 110
    )


def tree() -> Mesh:
    """Return a tree with roots, boughs and a crown."""
    crown = [
        (0, 1.5, 0, 0.62),
        (0.55, 1.15, 0.1, 0.42),
        (-0.5, 1.2, 0.2, 0.45),
        (0.1, 1.2, -0.5, 0.42),
    ]
    parts: list[Field] = [partial(rod, (0, -0.9, 0), (0.05, 0.5, 0), 0.2, 0.13)]
    for turn in np.arange(5) * 2 * np.pi / 5:
        x, z = np.cos(turn), np.sin(turn)
        parts.append(partial(rod, (0, -0.75, 0), (0.55 * x, -1.0, 0.55 * z), 0.13, 0.04))
    for x, y, z, r in crown:
        parts.append(partial(rod, (0.05, 0.3, 0), (x, y, z), 0.11, 0.07))
        parts.append(partial(ball, (x, y, z), (r, 0.85 * r, r)))
    return surface(partial(joined, parts, 0.08), (-1.2, -1.2, -1.2), (1.2, 2.2, 1.2), 110)


def part(deflection: float, angle: float) -> Mesh:
    """Return a flange with a hub, a bore and six holes, as CAD exports it.

    Its triangles lie within ``deflection`` of the true surface and turn by ``angle`` radians.
    """
    turns = np.arange(6) * np.pi / 3
    holes = [cylinder((0.76 * np.cos(t), 0.76 * np.sin(t)), 0.12, -0.1, 0.4) for t in turns]
    body = fused(cylinder((0, 0), 1.0, 0.0, 0.22), [cylinder((0, 0), 0.45, 0.1, 0.85)])
    return _upright(cut(body, [cylinder((0, 0), 0.25, -0.1, 1.0), *holes]), deflection, angle)


def plinth(angle: float) -> Mesh:
    """Return two drums, one upon the other, whose walls turn by ``angle`` radians a face."""
    body = fused(cylinder((0, 0), 0.95, -1.9, -1.65), [cylinder((0, 0), 0.75, -1.7, -1.42)])
    return _upright(body, 0.1, angle)


def _upright(body: Solid, deflection: float, angle: float) -> Mesh:
    made = tessellated(laid_over(body, 1), deflection, angle)
    return clean(Mesh(made.vertices, made.faces)).mesh


def text(words: str, pieces: int) -> Mesh:
    """Return letters, upright, each of whose Bézier curves has so many pieces."""
    letters = []
    for rings in _letters(TextPath((0, 0), words, size=1.0), pieces):
        outer, *inner = sorted(rings, key=_area, reverse=True)
        solid = cut(prism(outer, 0, 0.25), [prism(ring, -1, 1) for ring in inner])
        letters.append(tessellated(solid, 1e-3, 0.5))
    counts = np.cumsum([0, *(len(letter.vertices) for letter in letters)])
    points = np.vstack([letter.vertices for letter in letters])
    faces = [letter.faces + first for letter, first in zip(letters, counts, strict=False)]
    return clean(Mesh(points, np.vstack(faces))).mesh


def _letters(path: Outline, pieces: int) -> list[list[np.ndarray]]:
    """Return the rings of each letter: those that lie within another belong to it."""
    rings: list[np.ndarray] = []
    points: list[np.ndarray] = []
    for bezier, code in path.iter_bezier():
        if code == Outline.MOVETO:
            points = []
        elif code == Outline.CLOSEPOLY:
            rings.append(np.array(points))
        else:
            steps = np.arange(1, pieces + 1) / pieces if bezier.degree > 1 else np.ones(1)
            points.extend(bezier(step) for step in steps)
    letters: list[list[np.ndarray]] = []
    for ring in sorted(rings, key=_area, reverse=True):
        around = [other for other in letters if Outline(other[0]).contains_point(ring[0])]
        (around[0].append if around else lambda one: letters.append([one]))(ring)
    return letters


def _area(ring: np.ndarray) -> float:
    x, y = ring.T
    return abs(x @ np.roll(y, 1) - y @ np.roll(x, 1)) / 2
