"""How far to push control vertices so that Loop's limit surface passes near where they were."""

from jaxtyping import Float
from torch import Tensor

from train.connectivity import Connectivity
from train.loop_masks import limit_weight
from train.reference import Surroundings
from train.tensors import dot, unit


def normal_push(points: Float[Tensor, "V 3"], mesh: Connectivity) -> Float[Tensor, "V 3"]:
    """Return (e · m) m of every vertex, m its unit normal."""
    normal = unit(Surroundings(mesh, points).mean_normal)
    return dot(full_push(points, mesh), normal)[:, None] * normal


def full_push(points: Float[Tensor, "V 3"], mesh: Connectivity) -> Float[Tensor, "V 3"]:
    """Return e: what Loop's limit takes from every vertex.

    Inside it is w (p − mean of the neighbours) with w = 8 k β / (8 k β + 3), also where one crease
    ends; on curves (2 p − both neighbours) / 6; corners and isolated vertices stay.
    """
    around, (_, second, third) = Surroundings(mesh, points), mesh.sharpest[0].T
    inside = -limit_weight(mesh.valence)[:, None] * around.umbrella
    beside = points[mesh.sharpest[1]]
    curve = (2 * points - beside[:, 0] - beside[:, 1]) / 6
    return (1 - second)[:, None] * inside + (second - third)[:, None] * curve
