"""Edges and vertices that stay sharp: named, or edges found by their angle or by a network."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float, Integer

from pns_common.errors import ParameterError
from pns_common.mesh.normals import measure_faces
from pns_common.mesh.rows import dot
from pns_common.mesh.topology import MOSTLY_SHARP, Topology, check_vertices
from pns_common.parallel import Blocks
from pns_common.parameters import is_masked, is_number, is_whole

HALF_TURN = 180
_ANGLE = re.compile(r"angle:(\d{1,3}(?:\.\d+)?)")
# What boundaries do: curves; curves but for the corners of single faces; or nothing at all. Of
# OpenSubdiv the first are its VTX_BOUNDARY_EDGE_ONLY and VTX_BOUNDARY_EDGE_AND_CORNER.
BORDERS = ("smooth", "corners", "fixed")


@dataclass(frozen=True, eq=False)
class Creases:
    """Edges and vertices of a control mesh that are kept sharp.

    Attributes:
        named: (N, 2) pairs of vertices; None for none.
        sharpness: (N,) sharpness of these, 0 … 1; None: 1.
        wears: whether it counts levels, 0 … infinity, as OpenSubdiv's does: s at level 0, s − 1 at
            level 1, and so on, and smooth from 0 on, whatever ``levels`` says.
        angle: find edges that turn by more than this, in degrees; None: find none.
        learned: ask the sharpness network of the scheme's model.
        levels: at how many levels the edges are sharp (semi-sharp creases, DeRose, Kass and Truong
            1998); None: at all. Edges that are sharp at the last level count as sharp for good in
            limits.
        vertices: (M,) vertices that are kept as corners; None for none.
        vertex_sharpness: (M,) at how many levels these are corners, 0 … infinity: s at level 0,
            s − 1 at level 1, and so on, OpenSubdiv's numbers. What is less than a level is the
            corner weight κ there: (1 − κ) the rule without + κ p. None: at as many as the edges.
        soft_corners: (V,) corner weight κ of every vertex, at as many levels as the edges; None: 0.
        border: what boundaries do. "smooth": they become curves. "corners": these end at vertices
            of one face alone. "fixed": they stay as they are.

    Raises:
        ParameterError: pairs or vertices that are no whole numbers, sharpness that is not one
            number from 0 to 1 a pair, or from 0 on a vertex, an angle outside 0 … 180, levels
            below 1, or another border.

    Example:
        >>> Creases(np.array([[0, 1]]), sharpness=np.array([0.5])).levels is None
        True
    """

    named: Integer[np.ndarray, "N 2"] | None = None
    sharpness: Float[np.ndarray, " N"] | None = None
    angle: float | None = None
    learned: bool = False
    levels: int | None = None
    vertices: Integer[np.ndarray, " M"] | None = None
    vertex_sharpness: Float[np.ndarray, " M"] | None = None
    border: str = "smooth"
    soft_corners: Float[np.ndarray, " V"] | None = None
    wears: bool = False

    def __post_init__(self) -> None:
        if self.named is not None:
            object.__setattr__(self, "named", as_pairs(self.named))
        if self.sharpness is not None:
            largest, range_ = (np.inf, "≥ 0") if self.wears else (1.0, "from 0 to 1")
            expected = f"a number {range_} for each named edge"
            _check_numbers("sharpness", self.sharpness, self.named, largest, expected)
        if self.vertices is not None:
            object.__setattr__(self, "vertices", as_vertices(self.vertices))
        if self.vertex_sharpness is not None:
            expected = "a number ≥ 0 for each vertex"
            given = self.vertex_sharpness, self.vertices
            _check_numbers("vertex_sharpness", *given, np.inf, expected)
        angle, levels = self.angle, self.levels
        if angle is not None and not (is_number(angle) and 0 < angle < HALF_TURN):
            raise ParameterError("angle", angle, expected="degrees between 0 and 180")
        if levels is not None and not (is_whole(levels) and levels >= 1):
            raise ParameterError("levels", levels, expected="a whole number, at least 1")
        if self.border not in BORDERS:
            raise ParameterError("border", self.border, expected=", ".join(BORDERS))

    def with_named(self, pairs: Integer[np.ndarray, "N 2"]) -> Creases:
        """Return a copy with further pairs of vertices named, as sharp as any may be."""
        if len(pairs) == 0:
            return self
        if self.named is None:
            return replace(self, named=pairs)
        sharpness = self.sharpness
        if sharpness is not None:
            most = np.full(len(pairs), np.inf if self.wears else 1.0)
            sharpness = np.concatenate([most, sharpness])
        return replace(self, named=np.concatenate([pairs, self.named]), sharpness=sharpness)

    @property
    def finds(self) -> bool:
        """Tell whether edges are found by their shape."""
        return self.learned or self.angle is not None

    def sharp_pairs(self, depth: int = 0) -> Integer[np.ndarray, "N 2"] | None:
        """Return the named edges that count as sharp at a level: those of sharpness above ½."""
        if self.named is None or not (self.wears or self.sharp_at(depth)):
            return None
        if self.sharpness is None:
            return self.named
        return self.named[self.sharpness - (depth if self.wears else 0) > MOSTLY_SHARP]

    def sharp_at(self, depth: int) -> bool:
        """Return whether the edges are sharp at a level; level 0 refines the control mesh."""
        return self.levels is None or depth < self.levels

    def applied(
        self,
        points: Float[np.ndarray, "V 3"],
        topology: Topology,
        normals: Float[np.ndarray, "F 3"] | None = None,
        blocks: Blocks | None = None,
    ) -> Topology:
        """Return the topology with what is named, and the edges found by their angle.

        Args:
            points, topology: the mesh.
            normals: unit normals of its faces; measured where they are None and needed.
            blocks: how the work is shared.

        Raises:
            ParameterError: a named pair is no edge of the mesh, or a vertex is not there.
        """
        topology = self.applied_by_name(topology)
        if self.angle is None:
            return topology
        return topology.with_creases(self.found(points, topology, normals, blocks))

    def applied_by_name(self, topology: Topology) -> Topology:
        """Return the topology with this border, and the edges and vertices that are named.

        Raises:
            ParameterError: a named pair is no edge of the mesh, or a vertex is not there.
        """
        topology = topology.with_border(self.border)
        if self.soft_corners is not None:
            topology = topology.with_soft_corners(self.soft_corners)
        if self.vertices is not None and len(self.vertices):
            check_vertices("vertices", self.vertices, topology.vertex_count)
            sharpness = np.zeros(topology.vertex_count)
            given = self.vertex_sharpness
            if given is None:
                given = np.inf if self.levels is None else float(self.levels)
            np.maximum.at(sharpness, self.vertices, given)
            topology = topology.with_vertex_sharpness(sharpness)
        if self.named is None or len(self.named) == 0:
            return topology
        rows = topology.rows_of(self.named)
        if self.sharpness is None:
            return topology.with_creases(rows)
        sharpness = np.zeros(len(topology.edges))
        np.maximum.at(sharpness, rows, self.sharpness)
        return topology.with_wear(sharpness) if self.wears else topology.with_sharpness(sharpness)

    def found(
        self,
        points: Float[np.ndarray, "V 3"],
        topology: Topology,
        normals: Float[np.ndarray, "F 3"] | None = None,
        blocks: Blocks | None = None,
    ) -> Integer[np.ndarray, " N"]:
        """Return the interior edges that are found by their angle."""
        if self.angle is None:
            return np.zeros(0, dtype=np.int64)
        cosine = edge_cosines(points, topology, normals, blocks)
        return np.flatnonzero(cosine < np.cos(np.radians(self.angle)))


NO_CREASES = Creases()


def chosen_creases(
    given: Integer[np.ndarray, "N 2"] | Creases | str | None, automatic: Creases
) -> Creases:
    """Return the creases that an argument asks for; "auto": those of the scheme.

    "off" and None are no creases; "angle:40" is edges that turn by more than 40 degrees.

    Raises:
        ParameterError: another word, an angle out of range, or no pairs of whole numbers.
    """
    if isinstance(given, str):
        if given in ("auto", "off"):
            return automatic if given == "auto" else NO_CREASES
        if (found := _ANGLE.fullmatch(given)) is None:
            expected = '"auto", "off", "angle:" and degrees, None, or pairs of vertices'
            raise ParameterError("creases", given, expected=expected)
        return Creases(angle=float(found[1]))
    return given if isinstance(given, Creases) else Creases(given)


def one_of_creases(
    creases: Integer[np.ndarray, "N 2"] | Creases | str | None,
    crease: Integer[np.ndarray, "N 2"] | Creases | str | None,
) -> Integer[np.ndarray, "N 2"] | Creases | str | None:
    """Return the one of two names of an argument that is given; "auto" without any.

    Raises:
        ParameterError: both are.
    """
    if isinstance(crease, str) and crease == "auto":
        return creases
    if not (isinstance(creases, str) and creases == "auto"):
        raise ParameterError("crease", crease, expected="no other value than that of creases")
    return crease


def edge_cosines(
    points: Float[np.ndarray, "V 3"],
    topology: Topology,
    normals: Float[np.ndarray, "F 3"] | None = None,
    blocks: Blocks | None = None,
) -> Float[np.ndarray, " E"]:
    """Return n1 · n2 of interior edges; 1 at other edges and beside faces without area."""
    if normals is None:
        normals, _ = measure_faces(points, topology, blocks or Blocks(), areas=False)
    inside, cosine = topology.interior, np.ones(len(topology.edges))

    def compare(begin: int, end: int) -> None:
        rows = inside[begin:end]
        n, m = (normals[topology.face_of(topology.half_edges[rows, side])] for side in (0, 1))
        known = (dot(n, n) > 0) & (dot(m, m) > 0)
        cosine[rows] = np.where(known, dot(n, m), 1.0)

    (blocks or Blocks()).run(len(inside), compare)
    return cosine


def as_pairs(creases: Any) -> Integer[np.ndarray, "N 2"]:
    """Return a copy of creases as rows of two whole numbers, whatever they number.

    Raises:
        ParameterError: they are something else.
    """
    if is_masked(creases):
        raise ParameterError("creases.mask", True, expected="no masked values")
    try:
        pairs = np.asarray(creases)
    except ValueError as error:  # rows differ in length
        row = next(row for row, pair in enumerate(creases) if not _is_pair(pair))
        raise ParameterError(f"creases[{row}]", creases[row], expected="two vertices") from error
    if pairs.size == 0 and pairs.ndim in (1, 2):
        # An empty list has no integers to tell it from one of floats.
        return np.zeros((0, 2), dtype=np.int64)
    if pairs.ndim != 2 or pairs.shape[1] != 2:
        expected = "(N, 2): a row of two vertices for each edge"
        raise ParameterError("creases.shape", pairs.shape, expected=expected)
    if pairs.dtype.kind not in "iu":
        expected = "whole numbers of an integer type"
        raise ParameterError("creases.dtype", str(pairs.dtype), expected=expected)
    # Before the cast: 2⁶⁴ − 1 would become −1.
    huge = np.flatnonzero((pairs > np.iinfo(np.int64).max).any(axis=1))
    if len(huge):
        row = int(huge[0])
        raise ParameterError(f"creases[{row}]", pairs[row].tolist(), expected="two vertices")
    return pairs.astype(np.int64)


def as_vertices(given: Any) -> Integer[np.ndarray, " M"]:
    """Return a copy of numbers of vertices. Raises ParameterError: they are something else."""
    values = np.asarray(given)
    whole = values.dtype.kind in "iu" or values.size == 0
    if is_masked(given) or values.ndim != 1 or not whole:
        expected = "(M,) whole numbers of vertices"
        raise ParameterError("vertices", f"{values.dtype} {values.shape}", expected=expected)
    return values.astype(np.int64)


def _check_numbers(
    name: str, given: Any, of: np.ndarray | None, largest: float, expected: str
) -> None:
    """Raise ParameterError unless there is a number from 0 to the largest for each row."""
    values, count = np.asarray(given), 0 if of is None else len(of)
    if values.shape != (count,) or values.dtype.kind not in "fiu":
        raise ParameterError(name, f"{values.dtype} {values.shape}", expected=expected)
    wrong = np.flatnonzero(~((values >= 0) & (values <= largest)))
    if len(wrong):
        raise ParameterError(f"{name}[{wrong[0]}]", values[wrong[0]], expected=expected)


def _is_pair(row: Any) -> bool:
    try:
        return np.shape(row) == (2,)
    except ValueError:  # it holds rows that differ in length
        return False
