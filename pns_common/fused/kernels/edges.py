"""Edges of a face list without a sort: a linked chain of edges at each edge's lower vertex.

The numbering is that of ``pns_common.connectivity.topology``: by first appearance over the faces'
(a, b), (b, c), (c, a). Indices are int32.
"""

from __future__ import annotations

from pns_common.connectivity.topology import EdgeClass
from pns_common.fused.kernels.compiled import (
    CLASSES_OUT,
    INDEX,
    INDEX_OUT,
    INDICES,
    INDICES_OUT,
    INTEGERS_2,
    SIZE,
    kernel,
    natural,
)

INTERIOR, BOUNDARY, IRREGULAR, CREASE = (
    int(EdgeClass.INTERIOR),
    int(EdgeClass.BOUNDARY),
    int(EdgeClass.IRREGULAR),
    int(EdgeClass.CREASE),
)
# Columns of a link: the other vertex, the next link of the chain, the first two half-edges.
HIGH, NEXT, FIRST, SECOND = 0, 1, 2, 3
NONE, SEVERAL = -1, -2
# What ``chain_edges`` returns in place of the number of edges when its chains are too long.
TOO_LONG = -1


def _may_repeat(f, links, face_edges):
    """Return whether an earlier face may have the three edges of face f; yes if not known."""
    for i in range(3):
        e = face_edges[f, i]
        if links[e, SECOND] >= 0:
            # Two faces are on this edge: f and this one.
            g = links[e, FIRST] // 3
            other = face_edges[f, i + 1 if i < 2 else 0]
            return (
                face_edges[g, 0] == other or face_edges[g, 1] == other or face_edges[g, 2] == other
            )
    return True


def _repeats(faces, f):
    return faces[f, 0] == faces[f, 1] or faces[f, 1] == faces[f, 2] or faces[f, 2] == faces[f, 0]


@kernel(SIZE, INDICES, SIZE, INDEX_OUT, INDEX_OUT, INDICES_OUT, INDICES_OUT, INDEX_OUT)
def chain_edges(faces, most_steps, head, low, links, face_edges, plain):
    """Give each edge its number; returns how many there are, or TOO_LONG.

    A vertex of valence k that is the lower end of its edges takes k² / 2 steps: ``most_steps``
    bounds them, so that no mesh takes much longer than a sort would.

    Args:
        faces: (F, 3) vertices.
        most_steps: steps along chains, of all half-edges together.
        head: (V,) the chain of each vertex; −1 on entry.
        low: (3 F,) out: the lower vertex of each edge.
        links: (3 F, 4) out: HIGH, NEXT, FIRST, SECOND of each edge; SECOND is NONE where the edge
            has one half-edge and SEVERAL where it has more than two.
        face_edges: (F, 3) out: edges (a, b), (b, c), (c, a) of each face.
        plain: (1,) out: 1 where no face repeats a vertex and no two faces have the same three: then
            the edges of the split mesh follow by arithmetic.
    """
    count, steps = 0, 0
    plain[0] = 1
    for f in range(faces.shape[0]):
        fresh = False
        for i in range(3):
            start, end = faces[f, i], faces[f, i + 1 if i < 2 else 0]
            a, b = (start, end) if start < end else (end, start)
            if a == b:
                plain[0] = 0
            e = head[a]
            while e >= 0 and links[e, HIGH] != b:
                e = links[e, NEXT]
                steps += 1
            if e < 0:
                e = count
                count += 1
                fresh = True
                low[e] = a
                links[e, HIGH] = b
                links[e, NEXT] = head[a]
                links[e, FIRST] = 3 * f + i
                links[e, SECOND] = NONE
                head[a] = e
            elif links[e, SECOND] == NONE:
                links[e, SECOND] = 3 * f + i
            else:
                links[e, SECOND] = SEVERAL
            face_edges[f, i] = e
        if steps > most_steps:
            return TOO_LONG
        # A face whose vertices are those of an earlier one brings no edge.
        if not fresh and plain[0] == 1 and _may_repeat(f, links, face_edges):
            plain[0] = 0
    return count


@kernel(SIZE, INDICES, INDEX, INDEX_OUT)
def count_ends(edges, rows, counts):
    """Count how many of some edges end at each vertex; ``counts`` (V,) is 0 on entry."""
    for e in rows:
        counts[edges[e, 0]] += 1
        counts[edges[e, 1]] += 1
    return 0


@kernel(
    SIZE,
    *(INDICES, INDEX, INDEX, INTEGERS_2, SIZE, SIZE, SIZE),
    *(INDICES_OUT, INDICES_OUT, CLASSES_OUT),
)
def classify(faces, starts, low, links, plain, begin, end, edges, half_edges, edge_class):
    """Write ends, half-edges, and classes of edges begin … end − 1.

    Args:
        starts: (3 F,) where each half-edge starts.
        plain: 1 where no face repeats a vertex: then no edge asks its faces. 0 where one may.
        edges: (E, 2) out: endpoints a < b.
        half_edges: (E, 2) out: the first half-edge, and the second where there are two.
        edge_class: (E,) out: EdgeClass values.
    """
    for e in range(natural(begin), end):
        first, second = links[e, FIRST], links[e, SECOND]
        edges[e, 0], edges[e, 1] = low[e], links[e, HIGH]
        half_edges[e, 0], half_edges[e, 1] = first, second
        kind = IRREGULAR
        if plain or not _repeats(faces, first // 3):
            if second == NONE:
                kind = BOUNDARY
            elif second >= 0 and (plain or not _repeats(faces, second // 3)):
                # Two half-edges that run against each other.
                kind = INTERIOR if starts[first] != starts[second] else IRREGULAR
        edge_class[e] = kind
    return 0
