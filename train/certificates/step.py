"""One step of a scheme with what certificates need beside it, and the meshes they try it on."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from pns_common import Mesh, Scheme
from train.certificates.bodies import Body
from train.certificates.subject import Subject
from train.refining import refine


@dataclass(frozen=True, eq=False)
class Step:
    """The new vertices of one step, old vertices first.

    Attributes:
        positions: where the scheme puts them.
        ratio: the proximity ratio that the scheme reports: finer than positions where these round.
    """

    mesh: Mesh
    positions: Float[np.ndarray, "N 3"]
    ratio: Float[np.ndarray, " N"]

    def added(self, base: Scheme, envelope: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        """Return ‖δ‖ from positions and a base's; where these round, from ratio and envelope."""
        apart = np.linalg.norm(self.positions - step(base, self.mesh).positions, axis=1)
        return np.where(apart <= rounding(self.mesh), self.ratio * envelope, apart)


def step(
    scheme: Scheme,
    mesh: Mesh,
    creases: Int[np.ndarray, "N 2"] | Literal["auto"] | None = None,
) -> Step:
    """Apply a scheme once, at reference length 1.

    ``creases`` are edges to be kept sharp; "auto": the scheme's own.
    """
    refined = refine(mesh, scheme, 1, 1.0, creases=creases)
    return Step(mesh, refined.mesh.vertices, refined.ratio)


def rounding(mesh: Mesh) -> float:
    """Return how far two ways of computing one position may differ."""
    return 16 * float(np.finfo(float).eps) * float(np.abs(mesh.vertices).max())


# Of a mesh's size. A scale-free rule asks for a share of h: only on small meshes is that more than
# the budget, which falls as h², and something to cut off.
SMALL = 2.0**-10

NO_CREASES = np.zeros((0, 2), dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Trial:
    """A mesh with edges to be kept sharp, as pairs of vertices, the lower first."""

    name: str
    mesh: Mesh
    creases: Int[np.ndarray, "N 2"]


def trials(subject: Subject, bodies: Sequence[Body], seed: int) -> Iterator[Trial]:
    """Yield each body as it is, and with creases; and the same where the budget cuts off."""
    rng = np.random.default_rng(seed)
    sizes = (1.0,) if subject.learned_once is None else (1.0, SMALL)
    for body, size in product(bodies, sizes):
        mesh = Mesh(size * body.mesh.vertices, body.mesh.polygons)
        name = body.name if size == 1 else f"{body.name} times {size:g}"
        yield Trial(name, mesh, NO_CREASES)
        yield Trial(f"creased {name}", mesh, drawn_creases(mesh, rng))


def drawn_creases(mesh: Mesh, rng: np.random.Generator) -> Int[np.ndarray, "N 2"]:
    """Return a quarter of a mesh's edges, which make darts, curves and corners."""
    edges = np.unique(mesh.topology().edges.astype(np.int64), axis=0)
    return edges[rng.random(len(edges)) < 1 / 4]
