"""The Jacobian of the operator at a star by automatic differentiation."""

import torch
from jaxtyping import Float
from torch import Tensor

from train.certificates.adversary import Operator
from train.connectivity import connect
from train.spectra.stars import Star


def operator_jacobian(operator: Operator, star: Star) -> Float[Tensor, "M M"]:
    """Return the derivative of the refined inner coordinates by the inner coordinates.

    The counterpart of `train.spectra.spectrum.jacobian`, which takes differences of any scheme.
    """
    level = connect(star.mesh.faces, len(star.mesh.vertices))
    points, refined = torch.tensor(star.mesh.vertices), torch.from_numpy(star.refined)
    where = (torch.from_numpy(star.inner),)

    def inner_to_inner(inner: Float[Tensor, "N 3"]) -> Float[Tensor, " M"]:
        return operator(points.index_put(where, inner), level).points[refined].reshape(-1)

    derivative = torch.autograd.functional.jacobian(inner_to_inner, points[where])
    return derivative.reshape(3 * len(star.inner), -1)
