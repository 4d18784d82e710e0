"""Metrics of a whole refined mesh: all its vertices and faces, at any level.

The one-step metrics of `train.metrics.one_step` are the published ones, at inserted vertices; these
see old vertices too, and their normal error is one that shading would show.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pns_common import Mesh
from train.refining import Refined
from train.surfaces.implicit import Surface, signed_distance, unit_normal
from train.vectors import dot, face_normals, norm, unit

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
    """Errors of a mesh after a number of levels, with what the refinement's report adds.

    Attributes:
        normal_jump: largest angle between the normals of neighbouring faces.
        ratio: largest proximity ratio of the last step.
        flipped: faces of the last step that oppose their Loop counterpart.
    """

    level: int
    faces: int
    shape: ShapeErrors
    normal_jump: float
    ratio: float
    flipped: int


@dataclass(frozen=True, slots=True)
class DistanceLevel:
    """The mesh that a step has made, without normal errors: cheap on half a million faces."""

    faces: int
    distance: float
    hausdorff: float
    jump: float
    ratio: float
    flipped: int


def distance_level(surface: Surface, refinement: Refined) -> DistanceLevel:
    """Measure the distances and the report of a refinement's last step."""
    distance = np.abs(signed_distance(surface, refinement.mesh.vertices))
    last = refinement.levels[-1]
    return DistanceLevel(
        faces=last.faces,
        distance=float(np.sqrt((distance**2).mean())),
        hausdorff=float(distance.max()),
        jump=last.normal_jump,
        ratio=last.ratio,
        flipped=last.flipped,
    )


def level_errors(surface: Surface, refinement: Refined, level: int) -> LevelErrors:
    """Measure a refinement whose last step was the given level."""
    last = refinement.levels[-1]
    return LevelErrors(
        level=level,
        faces=last.faces,
        shape=shape_errors(surface, refinement.mesh),
        normal_jump=last.normal_jump,
        ratio=last.ratio,
        flipped=last.flipped,
    )


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


# Faces with twice their area below this share of their squared sides are left out.
NO_AREA = 1e-12


def bending(mesh: Mesh, normals: Float[np.ndarray, "V 3"] | None = None) -> float:
    """Return ∫ ‖∇n‖² dA = ∫ (κ₁² + κ₂²) dA of the vertex normals, linear over each face.

    It has no unit: a sphere has 8π at any size. Without `normals` they are the faces' mean by area.
    """
    normals = vertex_normals(mesh) if normals is None else normals
    corners, corner_normals = mesh.vertices[mesh.faces], normals[mesh.faces]
    sides = np.roll(corners, -1, axis=1) - corners
    twice = norm(np.cross(sides[:, 0], -sides[:, 2]))
    square = (sides**2).sum(axis=2)
    defined = twice > NO_AREA * square.sum(axis=1)
    total = 0.0
    for side in range(3):
        opposite = -(sides[:, (side + 1) % 3] * sides[:, (side + 2) % 3]).sum(axis=1)
        change = ((corner_normals[:, (side + 1) % 3] - corner_normals[:, side]) ** 2).sum(axis=1)
        total += float((opposite / np.where(defined, twice, np.inf) * change).sum()) / 2
    return total


def vertex_normals(mesh: Mesh) -> Float[np.ndarray, "V 3"]:
    """Return unit normals, the faces' mean by area; zero where there is none."""
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    area, corners = np.repeat(np.cross(b - a, c - a), 3, axis=0), mesh.faces.reshape(-1)
    count = len(mesh.vertices)
    return unit(np.stack([np.bincount(corners, component, count) for component in area.T], axis=1))


def volume(mesh: Mesh) -> float:
    """Return the signed volume of a closed mesh, seen from its centroid."""
    centred = mesh.vertices - mesh.vertices.mean(axis=0)
    a, b, c = (centred[mesh.faces[:, corner]] for corner in range(3))
    return float(dot(a, np.cross(b, c)).sum()) / 6
