"""Refinement with the laboratory's defaults, and rules of its own as the library's."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from pns_common import Mesh, Refinement, Scheme
from pns_common import refine as refine_by_library
from pns_common.operator.formula import Additions
from pns_common.operator.level import Level
from train.connectivity import Connectivity, connect
from train.reference import Step

Rule = Callable[[Level], Additions]
Creases = Int[np.ndarray, "N 2"] | Literal["auto"] | None


def refine(
    mesh: Mesh,
    scheme: Scheme,
    levels: int = 1,
    reference_length: float | Literal["auto"] = "auto",
    *,
    limit: bool = False,
    creases: Creases = "auto",
) -> Refinement:
    """Refine a mesh on one thread, without taking its vertices to the limit."""
    return refine_by_library(
        mesh, scheme, levels, reference_length, limit=limit, creases=creases, threads=1
    )


@dataclass(frozen=True, slots=True)
class LevelFigures:
    """Figures of a step, from the refinement's report.

    Attributes:
        ratio: largest proximity ratio, of edge and of old vertices.
        normal_jump: largest angle between neighbouring faces, radians.
        flipped: faces that oppose their counterpart under the base scheme.
    """

    faces: int
    ratio: float
    normal_jump: float
    flipped: int


def figures(refinement: Refinement) -> tuple[LevelFigures, ...]:
    """Return the figures of each level."""
    return tuple(_figures(level) for level in refinement.report["levels"])


def _figures(level: Mapping[str, Any]) -> LevelFigures:
    ratio = level["proximity_ratio"]["max"]
    if "vertex_rule" in level:
        ratio = max(ratio, level["vertex_rule"]["proximity_ratio"]["max"])
    return LevelFigures(level["faces"], ratio, level["normal_jump_max"], level["flipped_faces"])


def additions(
    level: Level,
    displacement: Float[np.ndarray, "W 3"],
    envelope: Float[np.ndarray, " W"],
    gate: Float[np.ndarray, " W"],
) -> Additions:
    """Return what a rule without a guard adds: δ, and ρ and γ to measure it against."""
    base = level.base.place(level.points, level.topology, level.blocks)
    length, known = np.linalg.norm(displacement, axis=1), envelope > 0
    ratio = np.where(known, length / np.where(known, envelope, 1.0), 0.0)
    return Additions(
        points=base + displacement,
        base_points=base,
        displacement=displacement,
        ratio=ratio,
        gate=gate,
        bound=envelope,
        corrected=None,
        degenerate=0,
        scale=None,
    )


def torch_rule(step: Callable[[Float[Tensor, "V 3"], Connectivity, float], Step]) -> Rule:
    """Return a rule that takes a step in torch, from points, connectivity and R.

    Edges are smooth or creases: the step sees no sharpness between.
    """

    def rule(level: Level) -> Additions:
        assert level.reference_length is not None  # the library measures it for every rule
        topology = level.topology
        creases = topology.edges[topology.crease_edges].astype(np.int64)
        mesh = connect(topology.faces, len(level.points), creases)
        with torch.no_grad():
            made = step(torch.tensor(level.points), mesh, level.reference_length)
        return additions(level, made.displacement.numpy(), made.envelope.numpy(), made.gate.numpy())

    return rule
