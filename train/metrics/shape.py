"""Metrics of a whole refined mesh: all its vertices and faces, at any level.

The one-step metrics of `train.metrics.one_step` are the published ones, at inserted vertices; these
see old vertices too, and their normal error is one that shading would show.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pns_common import Mesh, Refinement
from train.refining import LevelFigures, figures
from train.surfaces.implicit import Surface, signed_distance, unit_normal
from train.vectors import dot, face_normals, norm

PROJECTIONS = 4
FOOT_POINT_STEPS = 40
# A foot point that a step moves by less than this, in the surface's unit, is found.
CONVERGED = 1e-12

# Where a step turns back by more than this share of the one before, half of it gets nearer.
SWINGS = -1 / 3


@dataclass(frozen=True, slots=True)
class ShapeErrors:
    """Errors of one mesh; lengths in the surface's units, angles in radians.

    Attributes:
        distance: root mean square of |f| / ‖∇f‖ over all vertices.
        hausdorff: the largest.
        normal_mean, normal_max: angle between a face's normal and the surface's at the point
            nearest to the face's centroid; faces without area are left out.
    """

    distance: float
    hausdorff: float
    normal_mean: float
    normal_max: float


@dataclass(frozen=True, slots=True)
class LevelErrors:
    """Errors of a mesh after a number of levels, and the figures of the last one."""

    level: int
    shape: ShapeErrors
    figures: LevelFigures


def level_errors(surface: Surface, refinement: Refinement, level: int) -> LevelErrors:
    """Measure a refinement whose last step was the given level."""
    return LevelErrors(level, shape_errors(surface, refinement.mesh), figures(refinement)[-1])


def shape_errors(surface: Surface, mesh: Mesh) -> ShapeErrors:
    """Measure all vertices and faces of a mesh against a surface."""
    distance = np.abs(signed_distance(surface, mesh.vertices))
    angle = face_normal_error(surface, mesh)
    return ShapeErrors(
        distance=float(np.sqrt((distance**2).mean())),
        hausdorff=float(distance.max()),
        normal_mean=float(angle.mean()),
        normal_max=float(angle.max()),
    )


def face_normal_error(surface: Surface, mesh: Mesh) -> Float[np.ndarray, " N"]:
    """Return the angle of each face with area to the surface at its centroid's nearest point."""
    normals = face_normals(mesh.vertices, mesh.faces)
    has_area = dot(normals, normals) > 0
    centroids = mesh.vertices[mesh.faces[has_area]].mean(axis=1)
    target = unit_normal(surface, nearest_points(surface, centroids))
    own = normals[has_area]
    return np.arctan2(norm(np.cross(own, target)), dot(own, target))


def nearest_points(surface: Surface, points: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, "P 3"]:
    """Return the point of a surface nearest to each point, for points close to it.

    Foot-point iteration: onto the tangent plane at the last estimate, then back to the surface.
    It converges where distance times curvature is below 1; the nearest estimate seen is kept. The
    surface's parameters are floats.
    """
    nearest = _projected(surface, points)
    left = np.arange(len(points))
    estimate, before, share = nearest, np.zeros_like(points), np.ones(len(points))
    for _ in range(FOOT_POINT_STEPS):
        sought = points[left]
        normal, away = unit_normal(surface, estimate), sought - estimate
        step = away - dot(away, normal)[:, None] * normal
        # Where the surface bends towards the point, whole steps swing.
        share = np.where(dot(step, before) < SWINGS * dot(before, before), 0.5, share)
        estimate = _projected(surface, estimate + share[:, None] * step)
        nearer = norm(sought - estimate) < norm(sought - nearest[left])
        nearest[left[nearer]] = estimate[nearer]
        moves = norm(step) > CONVERGED
        if not moves.any():
            break
        left, estimate, before, share = left[moves], estimate[moves], step[moves], share[moves]
    return nearest


def _projected(surface: Surface, points: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, "P 3"]:
    """Return points moved along ∇f onto the surface by Newton's method."""
    for _ in range(PROJECTIONS):
        gradient = surface.gradient(points)
        step = surface.value(points) / dot(gradient, gradient)
        points = points - step[:, None] * gradient
        # Newton's method squares what is left.
        if np.abs(step * norm(gradient)).max(initial=0) < CONVERGED:
            break
    return points
