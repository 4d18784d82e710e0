"""How many rings of faces a piece needs around its own, so that it makes them as the whole does.

A ring of faces is all faces that share a vertex with those within. Let w be the *reach* of a
level's rules: a child of face f has its bits as soon as all faces within w rings of f are there,
with theirs.

- Loop: w = 1. An edge vertex reads the two faces of its edge; an old vertex the faces at it; all of
  these touch f.
- Learned rules: w = 2. The edge (a, b) of f reads mean normals, umbrella heights and pushes at the
  vertex d opposite f, so the faces at d, which is a neighbour of f's corners; an old vertex reads
  its neighbours' heights, mean jumps and pushes, so the faces at these. What they count (valence,
  sharp edges, fans) is of the same faces, and pushes of boundaries and creases are of neighbours
  along them. At a boundary the bend of the face beside f is that of its neighbours too: these touch
  f, and what they bend against lies at d.
- Edge rules that read no fields and leave old vertices to Loop (``paper-5``): w = 1: two faces.
- The fold guard then halves displacements round after round, and a round reaches a child's ring. It
  reaches nowhere through a face that no scales in [0, 1] could fold (see exact.py). One ring for it
  is two of children: the outermost, whose neighbours are not known, and one to spare.
- Crease lines are looked for on the control mesh alone, before its level: whether an edge of f is
  of one is read of edges up to ``ROUNDS`` farther along, whose faces lie within as many rings, and
  of the faces that touch these.

Splitting turns a ring into two rings of children: all faces within two rings of f's children lie
in children of faces within one ring of f (each has a corner at, or on an edge from, a corner of f).
So with r rings needed at the next level, w + ⌈r / 2⌉ are needed at this one; at the last level one
more than w, for the angle between a piece's children and their neighbours. Loop alone needs two
rings at any depth.
"""

from __future__ import annotations

from pns_common.connectivity.creases import NO_CREASES, Creases
from pns_common.errors import ParameterError, PnsError
from pns_common.geometry.crease_lines.going_on import ROUNDS
from pns_common.rules.learned import LearnedEdgeRule, LearnedVertexRule
from pns_common.rules.loop import loop_vertex_rule
from pns_common.rules.scale_free import ScaleFreeEdgeRule, ScaleFreeVertexRule
from pns_common.schemes import Scheme

LOOP_REACH, FIELDS_REACH = 1, 2
# Rings for the fold guard, where nothing is known yet of how far it goes.
GUARD_RINGS = 1
# A ring for each round, one for what is read of the farthest edge's surroundings, which touch its
# faces, and two for edges that are held: they begin on lines, and so do others that end where they
# do.
LINES_REACH = ROUNDS + 3
# Rings that tell whether an edge of a face stands alone: what may be like it is an edge of a face
# that touches that one, and turns against one that touches this.
ROWS_REACH = 2


class ThinHaloError(PnsError):
    """A piece has too few rings around it to be sure of its own faces; more of them will do."""

    def __init__(self, level: int, faces: int):
        super().__init__(f"level {level}: {faces} of the piece's faces are not certain")
        self.level, self.faces = level, faces


def halo_rings(
    scheme: Scheme, levels: int, guard_rings: int = GUARD_RINGS, lines: Creases = NO_CREASES
) -> int:
    """Return the rings of control faces that a piece needs for so many levels.

    ``lines`` says which crease lines are looked for.

    The guard may go further than ``guard_rings``; refining the piece then says so (ThinHaloError).
    """
    needed = 0
    for level in reversed(range(levels)):
        guarded = scheme.guard is not None and scheme.acts_at(level)
        own = reach(scheme, level) + guarded * guard_rings
        needed = own + (1 if level == levels - 1 else -(-needed // 2))
    return needed + lines_reach(lines)


def lines_reach(lines: Creases) -> int:
    """Return how many rings tell which edges are of lines."""
    return 0 if lines.line_angle is None else LINES_REACH


def reach(scheme: Scheme, level: int) -> int:
    """Return w: rings that the rules of a level read, without the guard.

    Raises:
        ParameterError: a scheme of other rules than Loop's and a model's.
    """
    if not scheme.acts_at(level):
        return LOOP_REACH
    edges, vertices = scheme.edge_rule, scheme.vertex_rule
    if isinstance(edges, ScaleFreeEdgeRule) and isinstance(vertices, ScaleFreeVertexRule):
        return FIELDS_REACH
    if isinstance(edges, LearnedEdgeRule):
        if isinstance(vertices, LearnedVertexRule):
            return FIELDS_REACH
        if vertices is loop_vertex_rule:
            return LOOP_REACH if edges.operator.features.vertex_fields is None else FIELDS_REACH
    raise ParameterError("scheme", scheme.name, expected="loop() or pns(model)")
