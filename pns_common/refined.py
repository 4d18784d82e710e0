"""A refined mesh, what it was made of, and its report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
from jaxtyping import Float

from pns_common.errors import MeshError
from pns_common.mesh.mesh import LARGEST_COORDINATE, Mesh, as_html
from pns_common.mesh.reference_length import measure_reference_length
from pns_common.mesh.rows import extent
from pns_common.mesh.selection import Selected
from pns_common.mesh.topology import Topology
from pns_common.operator.formula import Additions
from pns_common.operator.level import Level
from pns_common.operator.scheme import Scheme
from pns_common.parallel import Blocks
from pns_common.report import (
    LevelReport,
    Report,
    child_angles,
    level_report,
    limit_distances,
    longest,
)
from pns_common.schemes.base_scheme import BaseScheme
from pns_common.schemes.limit import limit_normals, limit_positions, limit_shift
from pns_common.schemes.matrix import SubdivisionMatrix, subdivision_matrix


@dataclass(frozen=True, eq=False)
class Step:
    """One level: the mesh before it, where its vertices went, and what the rule added."""

    level: Level
    points: Float[np.ndarray, "W 3"]
    added: Additions | None

    def report(self) -> LevelReport:
        """Measure and summarise the step."""
        mesh, blocks = self.level.topology, self.level.blocks.quiet()
        base_points = None if self.added is None else self.added.base_points
        quads, shift = self.level.base.polygons, crease_shift(self.level, self.points)
        angles = child_angles(mesh, self.points, base_points, blocks, quads)
        return level_report(mesh, self.added, *angles, shift, quads)


@dataclass(frozen=True, eq=False)
class Refinement:
    """A refined mesh, its report, and the last level's diagnostics at each of its vertices.

    Attributes:
        mesh: the refined mesh.
        ratio, gate: (V,) proximity ratio and gate of the last level; 0 at old vertices without a
            vertex rule, and after levels of the base scheme.
        steps: the levels, from which the report is made when it is first read.
        scheme: for the report.
        surface: the refined mesh's connectivity where vertices were put on the limit surface; else
            None.
        selected: what is left where some faces were refined alone; None: all were.
    """

    mesh: Mesh
    ratio: Float[np.ndarray, " V"]
    gate: Float[np.ndarray, " V"]
    steps: Sequence[Step] = field(repr=False)
    scheme: Scheme = field(repr=False)
    surface: Topology | None = field(repr=False)
    selected: Selected | None = field(repr=False, default=None)

    @cached_property
    def normals(self) -> Float[np.ndarray, "V 3"] | None:
        """(V, 3) exact normals of the limit surface, on creases the mean of both sides'.

        None unless vertices were put on it. They are computed when they are first read.
        """
        if self.surface is None:
            return None
        normals = limit_normals(*self._surface()).vertices
        return normals if self.selected is None else normals[self.selected.vertices]

    def _surface(self) -> tuple[Float[np.ndarray, "V 3"], Topology, Blocks, BaseScheme]:
        """Return what limits are computed from."""
        assert self.surface is not None
        last = self.steps[-1]
        return last.points, self.surface, last.level.blocks.quiet(), self.scheme.base

    @cached_property
    def reference_length(self) -> float:
        """R, the unit of length of the budget."""
        return reference_length_of(self.steps[0].level)

    @cached_property
    def report(self) -> Report:
        """Counts and diagnostics; see ``Report``."""
        shift = 0.0 if self.surface is None else limit_shift(*self._surface())
        return self._report_of(self.steps, self.steps[0].level.topology, shift)

    def _report_of(self, steps: Sequence[Step], control: Topology, shift: float = 0.0) -> Report:
        levels = [step.report() for step in steps]
        return {
            "scheme": self.scheme.name,
            "budget": self.scheme.budget,
            "model": self.scheme.model,
            "model_hash": self.scheme.model_hash,
            "reference_length": self.reference_length,
            "multi_fan_vertices": int(control.multi_fan_vertices.sum()),
            **limit_distances(levels, shift),
            "levels": levels,
        }

    @property
    def topologies(self) -> list[Topology]:
        """The connectivity of each level before it was refined: for ``columns.refine_columns``."""
        return [step.level.topology for step in self.steps]

    @cached_property
    def parents(self) -> SubdivisionMatrix:
        """The control vertices that each refined vertex is made of, with their weights.

        S with a row for each refined vertex and a column for each control vertex: ``S @ values``
        carries values of vertices to the refined mesh. It holds the base scheme's masks over all
        levels and its limit masks; what a model adds to positions is not linear and no part of it.
        """
        base = self.scheme.base
        to_limit = None if self.surface is None else partial(limit_positions, base=base)
        made = subdivision_matrix(self.topologies, base, at_last=to_limit)
        if self.selected is None:
            return made
        return made.unmoved(self.selected.still).take(self.selected.vertices)

    def __repr__(self) -> str:
        vertices, faces = len(self.mesh.vertices), self.mesh.face_count
        name, levels = self.scheme.name, len(self.steps)
        return f"Refinement({name!r}, levels={levels}, vertices={vertices}, faces={faces})"

    def _repr_html_(self) -> str:
        counts = {"scheme": self.scheme.name, "levels": len(self.steps)}
        sizes = {"vertices": len(self.mesh.vertices), "faces": self.mesh.face_count}
        return as_html(self.mesh, counts | sizes)


def reference_length_of(level: Level) -> float:
    """Return R of a refinement that begins at a level."""
    if level.reference_length is not None:
        return level.reference_length
    return measure_reference_length(level.points, level.topology.corners)


def crease_shift(level: Level, placed: Float[np.ndarray, "W 3"]) -> float | None:
    """Return the longest way from the smooth rules to new vertices of creases and to corners.

    None without any.
    """
    mesh = level.topology
    rows = np.concatenate([mesh.crease_edges, np.flatnonzero(mesh.soft)])
    corners = np.flatnonzero(mesh.corner_weights)
    if len(rows) == 0 and len(corners) == 0:
        return None
    smooth = level.base.place(level.points, mesh.without_creases(), level.blocks.quiet())
    vertices = np.unique(np.concatenate([mesh.edges[rows].reshape(-1), corners]))
    at = np.concatenate([vertices.astype(np.int64), mesh.vertex_count + rows])
    return longest(placed[at] - smooth[at])


def check_coordinates(points: Float[np.ndarray, "W 3"], blocks: Blocks) -> None:
    """Raise MeshError where refined coordinates are too large, or not numbers."""
    sizes = blocks.quiet().run(
        len(points), lambda begin, end: np.abs(extent(points[begin:end])).max()
    )
    # Written so that NaN fails it too.
    if not all(size <= LARGEST_COORDINATE for size in sizes):
        reason = f"coordinates beyond {LARGEST_COORDINATE:g}, or not numbers, after refinement"
        raise MeshError(f"{reason}: the budget is too large", element="vertices")
