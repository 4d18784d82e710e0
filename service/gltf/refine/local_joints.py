"""Joints of meshes that are refined together: each mesh counts its own, from 0.

Joints are refined in blocks of columns. Named as in the file, the columns of all meshes would be as
many as all their joints; counted in each mesh, they are as many as the most that one has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from .skins import Binding

# Joints are unsigned integers of at most two bytes.
_JOINTS = 2**16


@dataclass(frozen=True, eq=False)
class LocalJoints:
    """The joints that have weight in each of P parts.

    Attributes:
        joints: ascending in each part, one part after the other.
        first: (P,) where each part's begin.
    """

    joints: Int[np.ndarray, " J"]
    first: Int[np.ndarray, " P"]

    def named(self, binding: Binding, part: Int[np.ndarray, " N"]) -> Binding:
        """Return the binding of vertices of some parts with joints as the file names them."""
        bound = binding.weights > 0
        place = np.where(bound, self.first[part][:, None] + binding.joints, 0)
        return Binding(np.where(bound, np.append(self.joints, 0)[place], 0), binding.weights)


def local_joints(
    binding: Binding, part: Int[np.ndarray, " N"], count: int
) -> tuple[LocalJoints, Binding]:
    """Return the joints of `count` parts, and the binding of some parts' vertices to them."""
    bound = binding.weights > 0
    codes = part[:, None] * _JOINTS + binding.joints
    used = np.unique(codes[bound])
    first = np.searchsorted(used, np.arange(count) * _JOINTS)
    place = np.where(bound, np.searchsorted(used, codes) - first[part][:, None], 0)
    return LocalJoints(used % _JOINTS, first), Binding(place, binding.weights)
