"""One step of a scheme with what certificates need beside it, and the meshes they try it on."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
import torch
from jaxtyping import Bool, Float, Int

from pns_common import Mesh, loop
from train.certificates.bodies import Body
from train.certificates.subject import Subject
from train.connectivity import Connectivity, connect
from train.reference import Surroundings, edge_frames, read_edges
from train.refining import AnyScheme, refine


@dataclass(frozen=True, eq=False)
class Step:
    """The new vertices of one step, old vertices first.

    Attributes:
        positions: where the scheme puts them.
        ratio: the proximity ratio that the scheme reports: finer than positions where these round.
        level: connectivity of the control mesh.
    """

    mesh: Mesh
    positions: Float[np.ndarray, "N 3"]
    ratio: Float[np.ndarray, " N"]
    level: Connectivity

    @property
    def degenerate(self) -> Bool[np.ndarray, " N"]:
        """Vertices of interior edges whose frame is the fallback."""
        points = torch.tensor(self.mesh.vertices)
        edges = read_edges(Surroundings(self.level, points), first_face=True)
        frames = edge_frames(edges, first_face=True)
        marks = np.zeros(len(self.positions), dtype=bool)
        interior = self.level.interior
        marks[len(points) + interior] = frames.degenerate[interior]
        return marks

    def added(self, envelope: Float[np.ndarray, " N"]) -> Float[np.ndarray, " N"]:
        """Return ‖δ‖ from positions and Loop's; where these round, from ratio and envelope."""
        base = step(loop(), self.mesh).positions
        apart = np.linalg.norm(self.positions - base, axis=1)
        return np.where(apart <= rounding(self.mesh), self.ratio * envelope, apart)


def step(
    scheme: AnyScheme,
    mesh: Mesh,
    creases: Int[np.ndarray, "N 2"] | Literal["auto"] | None = None,
) -> Step:
    """Apply a scheme once, at reference length 1.

    ``creases`` are edges to be kept sharp; "auto": the scheme's own, which `Step.level` does not
    know.
    """
    refined = refine(mesh, scheme, 1, 1.0, creases=creases)
    named = None if isinstance(creases, str) else creases
    level = connect(mesh.faces, len(mesh.vertices), named)
    return Step(mesh, refined.mesh.vertices, refined.ratio, level)


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
        mesh = Mesh(size * body.mesh.vertices, body.mesh.faces)
        name = body.name if size == 1 else f"{body.name} times {size:g}"
        yield Trial(name, mesh, NO_CREASES)
        yield Trial(f"creased {name}", mesh, drawn_creases(mesh, rng))


def drawn_creases(mesh: Mesh, rng: np.random.Generator) -> Int[np.ndarray, "N 2"]:
    """Return a quarter of a mesh's edges, which make darts, curves and corners."""
    edges = np.unique(connect(mesh.faces, len(mesh.vertices)).edges.numpy(), axis=0)
    return edges[rng.random(len(edges)) < 1 / 4]
