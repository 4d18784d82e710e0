"""One step of a scheme with what certificates need beside the refined mesh."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Int

from pns_common import Mesh, loop
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


def step(scheme: AnyScheme, mesh: Mesh, creases: Int[np.ndarray, "N 2"] | None = None) -> Step:
    """Apply a scheme once, at reference length 1; ``creases`` are edges to be kept sharp."""
    refined = refine(mesh, scheme, 1, 1.0, creases=creases)
    level = connect(mesh.faces, len(mesh.vertices), creases)
    return Step(mesh, refined.mesh.vertices, refined.ratio, level)


def rounding(mesh: Mesh) -> float:
    """Return how far two ways of computing one position may differ."""
    return 16 * float(np.finfo(float).eps) * float(np.abs(mesh.vertices).max())
