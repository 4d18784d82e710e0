"""Coarse meshes beside the surface that they stand for: what a refined mesh is trained towards."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pns_common import Mesh

# The kind of control meshes that were made for Loop's surface.
AUTHORED = "authored"

# The kind of few-faced parts that are to be no sharper than quasi-interpolation leaves them.
LATHE = "lathe"

# The kind of parts of machined surfaces: smooth, most of it bent one way alone.
SWEPT = "swept"


@dataclass(frozen=True, eq=False, slots=True)
class Reference:
    """A surface as many points on it, with its unit normals there."""

    points: Float[np.ndarray, "P 3"]
    normals: Float[np.ndarray, "P 3"]


@dataclass(frozen=True, eq=False, slots=True)
class Pair:
    """A coarse mesh and its surface; `kind` says where it comes from."""

    kind: str
    coarse: Mesh
    surface: Reference


def moved(pair: Pair, linear: Float[np.ndarray, "3 3"], shift: Float[np.ndarray, " 3"]) -> Pair:
    """Return a pair under p ↦ p · linear + shift; linear turns, or scales evenly."""
    turn = linear / np.cbrt(np.linalg.det(linear))
    return Pair(
        pair.kind,
        Mesh(pair.coarse.vertices @ linear + shift, pair.coarse.faces),
        Reference(pair.surface.points @ linear + shift, pair.surface.normals @ turn),
    )
