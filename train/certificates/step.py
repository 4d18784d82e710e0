"""One step of a scheme with what certificates need beside the refined mesh."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import Topology, build_topology
from pns_common.levels.step import level_step
from pns_common.mesh import Mesh
from pns_common.rules.control_level import control_level
from pns_common.rules.placement import Placement
from pns_common.schemes import loop
from train.refining import AnyScheme


@dataclass(frozen=True, eq=False)
class Step:
    """The new vertices of one step, old vertices first.

    Attributes:
        positions: where the scheme puts them.
        displacement: what the scheme says it has added to Loop's positions.
        degenerate: vertices whose frame was the fallback.
    """

    positions: Float[np.ndarray, "N 3"]
    displacement: Float[np.ndarray, "N 3"]
    degenerate: Bool[np.ndarray, " N"]
    topology: Topology


def step(
    scheme: AnyScheme,
    mesh: Mesh,
    reference_length: float = 1.0,
    creases: Int[np.ndarray, "N 2"] | None = None,
) -> Step:
    """Apply a scheme once, as at the control mesh; ``creases`` are edges to be kept sharp."""
    topology = with_creases(build_topology(mesh.faces, len(mesh.vertices)), creases)
    made = level_step(control_level(mesh.vertices, topology, reference_length), scheme)
    placed = (made.vertices, made.edges)
    return Step(
        positions=np.concatenate([rule.positions for rule in placed]),
        displacement=np.concatenate([_displacement(rule) for rule in placed]),
        degenerate=np.concatenate([rule.degenerate for rule in placed]),
        topology=topology,
    )


def departure(scheme: AnyScheme, mesh: Mesh, reference_length: float = 1.0) -> Step:
    """Return a step whose displacement is recomputed from the positions and Loop's.

    The difference of positions sees everything; where it is below their rounding, what the scheme
    says it has added is finer.
    """
    ours, base = step(scheme, mesh, reference_length), step(loop(), mesh, reference_length)
    apart = ours.positions - base.positions
    lost = np.abs(apart - ours.displacement).max(axis=1) <= rounding(mesh)
    displacement = np.where(lost[:, None], ours.displacement, apart)
    return Step(ours.positions, displacement, ours.degenerate, ours.topology)


def rounding(mesh: Mesh) -> float:
    """Return how far two ways of computing one position may differ."""
    return 16 * float(np.finfo(float).eps) * float(np.abs(mesh.vertices).max())


def _displacement(placement: Placement) -> Float[np.ndarray, "N 3"]:
    if placement.displacement is None:
        return np.zeros_like(placement.loop)
    return placement.displacement
