"""The tally of one step of a piece: of its own faces, vertices and edges alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Int

from pns_common.base.arrays import dot
from pns_common.connectivity.topology import EdgeClass, next_corner
from pns_common.geometry.frames import face_normals
from pns_common.levels.diagnostics import reach_of
from pns_common.levels.step import AddedStep
from pns_common.masks.crease_shift import crease_shift
from pns_common.pieces.steps import Links, Step
from pns_common.pieces.tally import LevelTally, Summed


def tally_of(
    step: Step,
    own: Bool[np.ndarray, " F"],
    own_vertices: Bool[np.ndarray, " W"],
    own_edges: Bool[np.ndarray, " E"],
) -> LevelTally:
    """Tally what a step did to the faces, new vertices and edges that are a piece's own."""
    links, placed = step.links, step.placed
    classes = np.bincount(links.edge_class[own_edges], minlength=len(EdgeClass))
    interior, boundary, irregular, crease = (int(count) for count in classes)
    tally = LevelTally(
        vertices=int(own_vertices.sum()),
        faces=4 * int(own.sum()),
        edges=(interior, boundary, irregular, crease),
        flipped_faces=_flipped(step, own) if step.may_flip else 0,
        ratio=Summed(interior),
        gate=Summed(interior),
        chord=_largest_chord(step, own, own_edges),
        crease_shift=_crease_shift(step, own_vertices, own_edges),
    )
    return tally if placed is None else _with_rules(tally, placed, links, own_vertices, own_edges)


def _with_rules(
    tally: LevelTally,
    placed: AddedStep,
    links: Links,
    own_vertices: Bool[np.ndarray, " W"],
    own_edges: Bool[np.ndarray, " E"],
) -> LevelTally:
    """Add to a tally what the scheme's own rules did."""
    vertices, edges = placed.vertices, placed.edges
    own_old = own_vertices[: links.vertex_count]
    rows = links.interior[own_edges[links.interior]]
    degenerate = edges.degenerate[own_edges].sum() + vertices.degenerate[own_old].sum()
    tally = replace(
        tally,
        degenerate_frames=int(degenerate),
        ratio=Summed.of(edges.ratio[rows]),
        gate=Summed.of(edges.gate[rows]),
        shut=int(np.count_nonzero(edges.gate[rows] == 0)),
    )
    if vertices.corrected is not None:
        moved = vertices.corrected & own_old
        tally = replace(
            tally,
            vertex_ratio=Summed.of(vertices.ratio[moved]),
            vertex_gate=Summed.of(vertices.gate[moved]),
            shut=tally.shut + int(np.count_nonzero(vertices.gate[moved] == 0)),
        )
    if placed.guard is not None:
        tally = replace(tally, guarded=int((placed.guard[own_vertices] < 1).sum()))
    own = AddedStep(
        vertices.rows(np.flatnonzero(own_old)), edges.rows(np.flatnonzero(own_edges)), True, None
    )
    reach = reach_of(own)
    return replace(tally, learned=True, displacement=reach.longest, envelope=reach.bound)


def _crease_shift(
    step: Step, own_vertices: Bool[np.ndarray, " W"], own_edges: Bool[np.ndarray, " E"]
) -> float | None:
    """Return the longest way from smooth of an own vertex at creases; None without own ones."""
    links = step.links
    rows = np.flatnonzero(links.edge_class == EdgeClass.CREASE)
    if len(rows) == 0:
        return None
    corners, first = links.faces.reshape(-1), np.asarray(links.first, dtype=np.int64)
    ends = np.stack([corners[first], corners[next_corner(first)]], axis=1)
    half_edges = np.stack([first, links.second], axis=1)
    of_edges = ends, half_edges, links.edge_class
    shift = crease_shift(step.control, links.faces, *of_edges, rows, step.points)
    assert shift is not None  # there are creases
    old, new = own_vertices[shift.vertices], own_edges[shift.edges]
    if not (old.any() or new.any()):
        return None
    return float(max(shift.of_vertices[old].max(initial=0), shift.of_edges[new].max(initial=0)))


def _flipped(step: Step, own: Bool[np.ndarray, " F"]) -> int:
    """Count own children that oppose Loop's."""
    assert step.loop is not None
    if step.children.dtype == np.int32:
        from pns_common.fused.kernels.chords import flipped_among

        return int(flipped_among(step.points, step.loop, step.children, np.flatnonzero(own)))
    children = step.children[np.repeat(own, 4)]
    normals, counterparts = (face_normals(points, children) for points in (step.points, step.loop))
    return int((dot(counterparts, normals) < 0).sum())


def _largest_chord(
    step: Step, own: Bool[np.ndarray, " F"], own_edges: Bool[np.ndarray, " E"]
) -> float:
    """Return the largest squared distance between normals inside own faces and across own edges."""
    links, faces = step.links, np.flatnonzero(own)
    edges = links.interior[own_edges[links.interior]]
    halves = [np.asarray(half[edges], dtype=np.int64) for half in (links.first, links.second)]
    at_start = [_corner_child(half) for half in halves]
    at_end = [_corner_child(next_corner(half)) for half in halves]
    # One face's half-edge starts where the other's ends.
    pairs = (at_start[0], at_end[1]), (at_end[0], at_start[1])
    if step.children.dtype == np.int32:
        from pns_common.fused.kernels.chords import chords_between, chords_inside

        mesh = step.points, step.children
        inside = chords_inside(*mesh, faces)
        return float(max(inside, *(chords_between(*mesh, *pair) for pair in pairs)))
    inside = [_chord(step, 4 * faces + 3, 4 * faces + i) for i in range(3)]
    return max(*inside, *(_chord(step, *pair) for pair in pairs))


def _corner_child(corner: Int[np.ndarray, " N"]) -> Int[np.ndarray, " N"]:
    """Return the child that keeps corner i of face f: 4 f + i, of 3 f + i."""
    return corner + corner // 3


def _chord(step: Step, first: Int[np.ndarray, " N"], second: Int[np.ndarray, " N"]) -> float:
    n, m = (face_normals(step.points, step.children[rows]) for rows in (first, second))
    defined = (dot(n, n) > 0) & (dot(m, m) > 0)
    return float(np.max(dot(n - m, n - m), initial=0, where=defined))
