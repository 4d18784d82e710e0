"""A scheme on a data set after several levels, over all vertices, against Loop."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pns_common import Mesh, Scheme
from pns_common.operator.level import Level
from pns_common.parallel import Blocks
from pns_common.schemes.loop import LOOP
from train.data.datasets import Dataset
from train.metrics.shape import face_normal_error
from train.refining import figures, refine
from train.surfaces.implicit import signed_distance

PAPER_UNITS = 1.0


@dataclass(frozen=True, eq=False)
class WholeSurface:
    """Errors of N instances after some levels.

    Attributes:
        distance: root mean square of |f| / ‖∇f‖ over all vertices.
        normal: mean angle between a face's normal and the surface's, radians.
        jump: largest angle between neighbouring faces, radians.
    """

    distance: Float[np.ndarray, " N"]
    normal: Float[np.ndarray, " N"]
    jump: Float[np.ndarray, " N"]


def whole_surface(scheme: Scheme, dataset: Dataset, levels: int) -> WholeSurface:
    """Refine every instance in the paper's units and measure it whole."""
    rows = []
    for instance in dataset.instances:
        refined = refine(instance.mesh, scheme, levels, PAPER_UNITS)
        distance = signed_distance(instance.surface, refined.mesh.vertices)
        rows.append(
            (
                np.sqrt((distance**2).mean()),
                face_normal_error(instance.surface, refined.mesh).mean(),
                figures(refined)[-1].normal_jump,
            )
        )
    return WholeSurface(*np.array(rows, dtype=float).T)


def normal_jump(mesh: Mesh) -> float:
    """Return the largest angle between faces that share an interior edge, radians.

    Faces without area have no normal, and turn from none.
    """
    jumps = Level(mesh.vertices, mesh.topology(), LOOP, None, Blocks()).edges.jumps
    return float(2 * np.arcsin(min(1.0, np.sqrt(jumps.max(initial=0) / 2))))
