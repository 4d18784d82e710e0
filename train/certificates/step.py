"""One step of a scheme with what certificates need beside the refined mesh."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pns_common.blocks import Blocks
from pns_common.frames import face_normals
from pns_common.mesh import Mesh
from pns_common.schemes import ControlLevel, Placement, Scheme, loop
from pns_common.topology import Topology, build_topology


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


def step(scheme: Scheme, mesh: Mesh, reference_length: float = 1.0) -> Step:
    """Apply a scheme's two rules once."""
    topology = build_topology(mesh.faces, len(mesh.vertices))
    normals = face_normals(mesh.vertices, mesh.faces)
    level = ControlLevel(mesh.vertices, topology, normals, reference_length, Blocks(threads=1))
    placed = (scheme.vertex_rule(level), scheme.edge_rule(level))
    return Step(
        positions=np.concatenate([rule.positions for rule in placed]),
        displacement=np.concatenate([_displacement(rule) for rule in placed]),
        degenerate=np.concatenate([rule.degenerate for rule in placed]),
        topology=topology,
    )


def departure(scheme: Scheme, mesh: Mesh, reference_length: float = 1.0) -> Step:
    """A step whose displacement is recomputed from the positions and Loop's.

    The difference of positions sees everything; where it is below their rounding, what the scheme
    says it has added is finer.
    """
    found, base = step(scheme, mesh, reference_length), step(loop(), mesh, reference_length)
    apart = found.positions - base.positions
    lost = np.abs(apart - found.displacement).max(axis=1) <= rounding(mesh)
    displacement = np.where(lost[:, None], found.displacement, apart)
    return Step(found.positions, displacement, found.degenerate, found.topology)


def rounding(mesh: Mesh) -> float:
    """How far two ways of computing one position may differ."""
    return 16 * float(np.finfo(float).eps) * float(np.abs(mesh.vertices).max())


def _displacement(placement: Placement) -> Float[np.ndarray, "N 3"]:
    if placement.displacement is None:
        return np.zeros_like(placement.loop)
    return placement.displacement
