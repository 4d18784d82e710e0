"""Go through the levels with compiled kernels."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pns_common.base.blocks import Blocks
from pns_common.base.deferred import Deferred
from pns_common.connectivity.creases import Creases
from pns_common.fused.levels.level import (
    FusedLevel,
    FusedStep,
    control_level,
    loop_step,
    next_level,
)
from pns_common.fused.levels.mesh_edges import split_mesh_faces
from pns_common.levels.diagnostics import LevelReport
from pns_common.levels.refined_levels import (
    AfterLevel,
    LevelsReport,
    RefinedLevels,
    check_coordinates,
)
from pns_common.mesh import Mesh
from pns_common.schemes import Scheme


def refine_fused(
    mesh: Mesh,
    scheme: Scheme,
    levels: int,
    reference_length: float,
    creases: Creases,
    blocks: Blocks,
    after_level: AfterLevel,
) -> RefinedLevels:
    """Return what ``refine.refine_arrays`` makes, bit for bit.

    Raises:
        ParameterError: a crease is no edge.
        ModelError: a network returned something that is not finite, or of another shape.
        MeshError: the refined coordinates are too large.
    """
    level = control_level(mesh.vertices, mesh.faces, creases, blocks)
    control = level
    step = _checked_step(level, scheme, reference_length, 0, blocks)
    reports = [step.report]
    after_level()
    for depth in range(1, levels):
        level = next_level(level, step.points, blocks, sharp=creases.sharp_at(depth))
        step = _checked_step(level, scheme, reference_length, depth, blocks)
        reports.append(step.report)
        after_level()
    added = step.added
    # All of it is one number in memory.
    nothing = np.broadcast_to(0.0, len(step.points))
    return RefinedLevels(
        points=step.points,
        faces=split_mesh_faces(level.mesh, np.int64, blocks),
        ratio=nothing if added is None else added.ratio,
        gate=nothing if added is None else added.gate,
        looked_at=Deferred(lambda: _look(control, reports)),
        split_topology=level.topology,
    )


def _look(control: FusedLevel, reports: Sequence[Callable[[], LevelReport]]) -> LevelsReport:
    """Make the report of all levels."""
    return LevelsReport([report() for report in reports], int(control.multi_fan_vertices.sum()))


def _checked_step(
    level: FusedLevel, scheme: Scheme, length: float, depth: int, blocks: Blocks
) -> FusedStep:
    """Make the step of one level, as ``step.level_step`` chooses it."""
    if not scheme.acts_at(depth):
        step = loop_step(level, blocks)
    else:
        # Loop has no use for its kernels.
        from pns_common.fused.learned.learned_step import learned_step

        # What overflows under an absurd budget is caught just below.
        with np.errstate(over="ignore", invalid="ignore"):
            step = learned_step(level, scheme, length, blocks)
    check_coordinates(step.largest)
    return step
