"""Columns of a mesh at vertices, corners, faces and edges, refined by one function.

Every format and library is an adapter: it reads what it has into columns, and writes them again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Integer, Shaped

from pns_common.carry import rules
from pns_common.carry.charts import Linear, chart_points, charts_of, refine_charts
from pns_common.carry.columns import level_topologies
from pns_common.carry.rules import Rule
from pns_common.mesh.topology import Topology
from pns_common.parallel import Blocks, available_threads
from pns_common.schemes.base_scheme import BaseScheme
from pns_common.schemes.limit import limit_positions

# Rules that make new numbers; the others choose one of those that there are.
BLENDING = (rules.smooth, rules.linear)
# The corner that gives its label to each corner of a triangle's children (aab, abc, …).
OWNERS = np.array([0, 0, 0, 1, 1, 1, 2, 2, 2, 0, 1, 2])


@dataclass(frozen=True, eq=False)
class Column:
    """Values at one kind of element.

    Attributes:
        values: (N, …) a row for each element, in the type in which they are stored.
        rule: for new vertices; at corners, whether values are smooth, linear or a corner's own; at
            faces and edges children have their parents' values.
        keep: of smooth values at corners, what stays linear: see ``charts``.
        unit: scale rows to length 1, as of directions.
        same: (N, J) corners of a vertex that agree in these are one point; None: in their values.
    """

    values: Shaped[np.ndarray, " N *K"]
    rule: Rule = rules.linear
    keep: Linear = "boundaries"
    unit: bool = False
    same: Shaped[np.ndarray, "N J"] | None = None


Columns = Mapping[str, Column]


def _none() -> Columns:
    return {}


@dataclass(frozen=True, eq=False)
class Carried:
    """Columns of a mesh by name.

    Attributes:
        vertices: (V, …) each.
        corners: (H, …) each, face after face.
        faces: (F, …) each.
        edges: (E, …) each, in the order of the control mesh's topology; edges inside of its faces
            get zeros.
    """

    vertices: Columns = field(default_factory=_none)
    corners: Columns = field(default_factory=_none)
    faces: Columns = field(default_factory=_none)
    edges: Columns = field(default_factory=_none)


def refine_carried(
    carried: Carried,
    topologies: Sequence[Topology],
    base: BaseScheme,
    *,
    limit: bool = False,
    blocks: Blocks | None = None,
) -> Carried:
    """Refine columns with the mesh that carries them, by the scheme's masks and split.

    Args:
        carried: the control mesh's.
        topologies: those of the meshes that are refined, control mesh first, one at least.
        base: their scheme.
        limit: apply the limit mask to what is smooth, where the vertices are on the limit.
        blocks: how the work is shared.
    """
    known = Carrier(topologies, base, limit, blocks or Blocks())

    def each(columns: Columns, refined: Callable[[Column], np.ndarray]) -> Columns:
        return {
            name: replace(column, values=refined(column), same=None)
            for name, column in columns.items()
        }

    return Carried(
        each(carried.vertices, known.at_vertices),
        each(carried.corners, known.at_corners),
        each(carried.faces, known.at_faces),
        each(carried.edges, known.at_edges),
    )


def refine_column(
    column: Column, topologies: Sequence[Topology], base: BaseScheme, *, limit: bool = False
) -> Shaped[np.ndarray, " W *K"]:
    """Refine one column of vertices, or of the points of charts; as ``refine_carried``."""
    return Carrier(topologies, base, limit, Blocks(available_threads())).at_vertices(column)


def rule_for(values: Shaped[np.ndarray, " N *K"]) -> Rule:
    """Return the rule of values of unknown meaning: whole numbers but for bytes are labels."""
    return rules.linear if values.dtype.kind in "fc" or values.dtype == np.uint8 else rules.nearest


def in_type_of(
    old: Shaped[np.ndarray, "..."], blended: Shaped[np.ndarray, " M *K"]
) -> Shaped[np.ndarray, " M *K"]:
    """Return blended values in the type of others; integers are rounded, in place."""
    return (blended if old.dtype.kind in "fc" else np.rint(blended, out=blended)).astype(old.dtype)


def edge_parents(
    topologies: Sequence[Topology], last: Topology, parents: Integer[np.ndarray, " E"] | None = None
) -> Integer[np.ndarray, " G"]:
    """Return the control edge that each edge of the last topology is a piece of, or −1.

    ``parents`` are other names of the control mesh's edges.
    """
    parents = np.arange(len(topologies[0].edges)) if parents is None else parents
    for mesh, finer in pairwise([*topologies, last]):
        # Half of an edge runs from an old vertex to the edge's: edges inside faces do not.
        low, high = finer.edges.astype(np.int64).T
        half = low < mesh.vertex_count
        parents = np.where(half, parents[np.where(half, high - mesh.vertex_count, 0)], -1)
    return parents


@dataclass(frozen=True, eq=False)
class Carrier:
    """Refine columns one by one over one mesh; arguments as of ``refine_carried``."""

    topologies: Sequence[Topology]
    base: BaseScheme
    limit: bool = False
    blocks: Blocks = field(default_factory=Blocks)

    @cached_property
    def last(self) -> Topology:
        """The topology of the refined mesh."""
        return self.base.split(self.topologies[-1], self.blocks)

    def at_vertices(self, column: Column) -> Shaped[np.ndarray, " W *K"]:
        """Refine values at vertices."""
        rows = _rows(column)
        for mesh in self.topologies:
            rows = column.rule(rows, mesh, self.base, self.blocks)
        if self.limit and column.rule is rules.smooth:
            rows = limit_positions(rows, self.last, self.blocks, self.base)
        return _stored(column, rows)

    def at_corners(self, column: Column) -> Shaped[np.ndarray, " D *K"]:
        """Refine values at corners to those of the refined faces, one after the other."""
        if column.rule not in BLENDING:
            return _stored(column, _rows(column)[self._corner_parents])
        values, corners = self.at_points(column)
        return values[corners]

    def at_points(
        self, column: Column
    ) -> tuple[Shaped[np.ndarray, " P *K"], Integer[np.ndarray, " D"]]:
        """Refine values at corners; return those of points of charts, and the corners' points."""
        rows, first = _rows(column), self.topologies[0]
        points, at = chart_points(first.corners, rows if column.same is None else column.same)
        smooth = column.rule is rules.smooth and column.keep != "all"
        if smooth:
            charts = charts_of(points, self.topologies, self.base, self.blocks)
        elif len(at) == first.vertex_count and np.array_equal(points, first.corners):
            charts = self.topologies
        else:  # nothing is sharp, where nothing is smooth
            faces = points, first.offsets
            charts = level_topologies(faces, len(at), len(self.topologies), base=self.base)
        values = rows[at]
        if smooth:
            values, corners = refine_charts(
                values, charts, self.base, self.blocks, keep=column.keep, limit=self.limit
            )
        else:
            rule = rules.linear if column.rule is rules.smooth else column.rule
            for chart in charts:
                values = rule(values, chart, self.base, self.blocks)
            corners = self.base.faces(charts[-1], self.blocks, np.int64)
        return _stored(column, values), corners.reshape(-1)

    def at_faces(self, column: Column) -> Shaped[np.ndarray, " G *K"]:
        """Return the values of the faces that the refined ones are parts of."""
        return column.values[self.face_parents]

    def at_edges(self, column: Column) -> Shaped[np.ndarray, " G *K"]:
        """Return the values of edges at their pieces, and zeros at edges inside of faces."""
        parents = edge_parents(self.topologies, self.last)
        values = np.zeros((len(parents), *column.values.shape[1:]), dtype=column.values.dtype)
        values[parents >= 0] = column.values[parents[parents >= 0]]
        return values

    @cached_property
    def face_parents(self) -> Integer[np.ndarray, " G"]:
        """The control face that each refined face is a part of."""
        parents = np.arange(self.topologies[0].face_count)
        for mesh in self.topologies:
            parents = np.repeat(parents, np.diff(mesh.offsets) if self.base.polygons else 4)
        return parents

    @cached_property
    def _corner_parents(self) -> Integer[np.ndarray, " D"]:
        """The corner that gives each refined corner its label.

        A child at a corner has that corner's. A triangle's child in the middle has at each of its
        corners that of the corner before.
        """
        parents = np.arange(len(self.topologies[0].corners))
        if self.base.polygons:
            return np.repeat(parents, 4 ** len(self.topologies))
        for _ in self.topologies:
            parents = parents.reshape(-1, 3)[:, OWNERS].reshape(-1)
        return parents


def _rows(column: Column) -> Shaped[np.ndarray, "N K"]:
    """Return values as rows of numbers; those that are blended as doubles."""
    rows = column.values.reshape(len(column.values), -1)
    blends = column.rule in BLENDING
    return rows.astype(np.result_type(rows, np.float64)) if blends else rows


def _stored(column: Column, rows: Shaped[np.ndarray, "N K"]) -> Shaped[np.ndarray, "N ..."]:
    rows = scaled_to_unit(rows) if column.unit else rows
    rows = in_type_of(column.values, rows) if column.rule in BLENDING else rows
    return rows.reshape(len(rows), *column.values.shape[1:])


def scaled_to_unit(rows: Float[np.ndarray, "N K"]) -> Float[np.ndarray, "N K"]:
    """Return rows of length 1; a row without length stays."""
    lengths = np.linalg.norm(rows, axis=1, keepdims=True)
    return rows / np.where(lengths > 0, lengths, 1)
