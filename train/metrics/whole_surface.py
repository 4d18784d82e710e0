"""A scheme on a data set after several levels, over all vertices, against Loop."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pns_common.base.blocks import Blocks
from pns_common.fused.levels.mesh_edges import build_edges
from pns_common.geometry.frames import face_normals
from pns_common.mesh import Mesh
from pns_common.refine import Refinement, refine
from pns_common.schemes import Scheme, loop
from train.data.datasets import Dataset, Instance
from train.metrics.shape import face_normal_error, nearest_points
from train.surfaces.implicit import signed_distance

PAPER_UNITS = 1.0


@dataclass(frozen=True, eq=False)
class WholeSurface:
    """Errors of N instances after some levels.

    Attributes:
        distance: root mean square of |f| / ‖∇f‖ over all vertices.
        largest: the largest |f| / ‖∇f‖ of a vertex.
        normal: mean angle between a face's normal and the surface's, radians.
        jump: largest angle between neighbouring faces, radians.
        ratio: largest proximity ratio of all levels; 0 for Loop.
        flipped: flipped faces of all levels.
    """

    distance: Float[np.ndarray, " N"]
    largest: Float[np.ndarray, " N"]
    normal: Float[np.ndarray, " N"]
    jump: Float[np.ndarray, " N"]
    ratio: Float[np.ndarray, " N"]
    flipped: Float[np.ndarray, " N"]


@dataclass(frozen=True, slots=True)
class Gain:
    """A scheme against Loop, in per cent of the mean error; `worst` is the worst instance's."""

    distance: float
    worst: float
    normal: float


def whole_surface(scheme: Scheme, dataset: Dataset, levels: int) -> WholeSurface:
    """Refine every instance in the paper's units and measure it whole."""
    rows = []
    for instance in dataset.instances:
        refined = refine(instance.mesh, scheme, levels, PAPER_UNITS, threads=1)
        distance = signed_distance(instance.surface, refined.mesh.vertices)
        reports = refined.report["levels"]
        rows.append(
            (
                np.sqrt((distance**2).mean()),
                np.abs(distance).max(),
                face_normal_error(instance.surface, refined.mesh).mean(),
                reports[-1]["normal_jump_max"],
                max(largest_ratio(refined, level) for level in range(levels)),
                sum(level["flipped_faces"] for level in reports),
            )
        )
    return WholeSurface(*np.array(rows, dtype=float).T)


def largest_ratio(refined: Refinement, level: int) -> float:
    """Return the largest proximity ratio of a level, of edge and of vertex vertices."""
    report = refined.report["levels"][level]
    edges = report["proximity_ratio"]["max"]
    if "vertex_rule" not in report:
        return edges
    return max(edges, report["vertex_rule"]["proximity_ratio"]["max"])


def gain(surface: WholeSurface, reference: WholeSurface) -> Gain:
    """Compare paired errors; negative is worse."""
    return Gain(
        distance=_percent(surface.distance.mean(), reference.distance.mean()),
        worst=float(100 * (1 - (surface.distance / reference.distance).max())),
        normal=_percent(surface.normal.mean(), reference.normal.mean()),
    )


def surface_jump(instance: Instance, levels: int) -> float:
    """Return the largest jump of Loop's refined mesh once its vertices lie on the surface."""
    refined = refine(instance.mesh, loop(), levels, PAPER_UNITS, threads=1).mesh
    laid = Mesh(nearest_points(instance.surface, refined.vertices), refined.faces)
    return normal_jump(laid)


def normal_jump(mesh: Mesh) -> float:
    """Return the largest angle between faces that share an interior edge, radians.

    Faces without area have no normal, and turn from none.
    """
    edges = build_edges(mesh.faces.astype(np.int32), len(mesh.vertices), Blocks(threads=1))
    normals = face_normals(mesh.vertices, mesh.faces)
    left, right = (normals[side] for side in edges.half_edges[edges.interior].T // 3)
    both = left.any(axis=1) & right.any(axis=1)
    chord = np.linalg.norm(left - right, axis=1).max(initial=0, where=both)
    return float(2 * np.arcsin(min(1.0, chord / 2)))


def _percent(value: float, reference: float) -> float:
    return float(100 * (1 - value / reference))
