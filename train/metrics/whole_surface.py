"""A scheme on a data set after several levels, over all vertices, against Loop."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from pns_common import Mesh, loop
from train.connectivity import connect
from train.data.datasets import Dataset, Instance
from train.metrics.shape import face_normal_error, nearest_points
from train.reference import Surroundings
from train.refining import AnyScheme, largest_turn, refine
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


def whole_surface(scheme: AnyScheme, dataset: Dataset, levels: int) -> WholeSurface:
    """Refine every instance in the paper's units and measure it whole."""
    rows = []
    for instance in dataset.instances:
        refined = refine(instance.mesh, scheme, levels, PAPER_UNITS)
        distance = signed_distance(instance.surface, refined.mesh.vertices)
        rows.append(
            (
                np.sqrt((distance**2).mean()),
                np.abs(distance).max(),
                face_normal_error(instance.surface, refined.mesh).mean(),
                refined.levels[-1].normal_jump,
                max(level.ratio for level in refined.levels),
                sum(level.flipped for level in refined.levels),
            )
        )
    return WholeSurface(*np.array(rows, dtype=float).T)


def gain(surface: WholeSurface, reference: WholeSurface) -> Gain:
    """Compare paired errors; negative is worse."""
    return Gain(
        distance=_percent(surface.distance.mean(), reference.distance.mean()),
        worst=float(100 * (1 - (surface.distance / reference.distance).max())),
        normal=_percent(surface.normal.mean(), reference.normal.mean()),
    )


def surface_jump(instance: Instance, levels: int) -> float:
    """Return the largest jump of Loop's refined mesh once its vertices lie on the surface."""
    refined = refine(instance.mesh, loop(), levels, PAPER_UNITS).mesh
    laid = Mesh(nearest_points(instance.surface, refined.vertices), refined.faces)
    return normal_jump(laid)


def normal_jump(mesh: Mesh) -> float:
    """Return the largest angle between faces that share an interior edge, radians.

    Faces without area have no normal, and turn from none.
    """
    level = connect(mesh.faces, len(mesh.vertices))
    return largest_turn(Surroundings(level, torch.tensor(mesh.vertices)))


def _percent(value: float, reference: float) -> float:
    return float(100 * (1 - value / reference))
