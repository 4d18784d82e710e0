"""Sectors around vertices, and normals of limit surfaces that masks along them give.

A sector holds the corners around a vertex p between two edges that are not interior, anticlockwise;
or all corners of a closed fan. Its spokes are vertices around p. Of k triangles they are q_0 … q_k:
corner j lies between q_j and q_{j+1}. Of the quads that k corners become they are q_0, d_0, q_1, …,
q_k, with d_j the vertex of corner j's face. In a closed sector q_k = q_0.
"""

from __future__ import annotations

from pns_common.kernels import Connectivity, b1_1d, f8_2d, i4_1d, i8_1d, inlined, kernel, u4_1d
from pns_common.kernels.connectivity import face_of, following_corner, opposed, preceding_corner
from pns_common.kernels.vectors import between, cross, divisor, dot, norm, over

# Tangents that span less than this, of the product of their lengths, span no plane.
NO_PLANE = 1e-9


@kernel
def label_sectors(
    mesh: Connectivity,
    quads: bool,
    of_corner: i4_1d,
    first: i4_1d,
    size: i4_1d,
    spokes: u4_1d,
):
    """Find the sectors, open ones first; return how many are open, and how many there are.

    Args:
        mesh: any mesh; of triangles unless ``quads``.
        quads: whether spokes are those of the quads that corners become.
        of_corner: (H,) out: the sector of each corner; −1 on entry.
        first: (H,) out: the first corner of each sector.
        size: (H,) out: how many corners each sector has.
        spokes: out: k + 1 of each sector, or 2 k + 1, one after another.
    """
    count, opened, to = 0, 0, 0
    at_edges, at_faces = mesh.vertex_count, mesh.vertex_count + mesh.edges.shape[0]
    for closed in (False, True):
        for start in range(of_corner.shape[0]):
            if of_corner[start] >= 0:
                continue
            if not closed and opposed(mesh, start) >= 0:
                continue
            h, before, corners = start, start, 0
            while h >= 0 and of_corner[h] < 0:
                of_corner[h] = count
                corners += 1
                if quads:
                    spokes[to], spokes[to + 1] = (
                        at_edges + mesh.corner_edges[h],
                        at_faces + face_of(mesh, h),
                    )
                    to += 2
                else:
                    spokes[to] = mesh.corners[following_corner(mesh, h)]
                    to += 1
                before = preceding_corner(mesh, h)
                h = opposed(mesh, before)
            spokes[to] = at_edges + mesh.corner_edges[before] if quads else mesh.corners[before]
            to += 1
            first[count], size[count] = start, corners
            count += 1
        if not closed:
            opened = count
    return opened, count


@kernel
def sector_normals(
    begin: int,
    end: int,
    points: f8_2d,
    vertices: u4_1d,
    starts: i8_1d,
    spokes: u4_1d,
    at: i8_1d,
    masks: f8_2d,
    outwards: b1_1d,
    to: f8_2d,
):
    """Write the unit normals of the limit surface in sectors begin … end − 1; 0 without area.

    Args:
        points: of vertices and spokes.
        vertices: (S,) p of each sector.
        starts: (S + 1,) where the spokes of each begin.
        spokes: rows of points.
        at: (S,) where the tangent masks of each begin in ``masks``.
        masks: (M, 2) weights of spokes, less p, in both tangents.
        outwards: (S,) sectors whose normal must agree with the area around the vertex.
        to: (S, 3) out.
    """
    for s in range(begin, end):
        u, v, area, last = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        for j in range(starts[s + 1] - starts[s]):
            spoke = between(points, vertices[s], spokes[starts[s] + j])
            u = _add(u, masks[at[s] + j, 0], spoke)
            v = _add(v, masks[at[s] + j, 1], spoke)
            area = _add(area, 1.0, cross(last, spoke))
            last = spoke
        normal = cross(u, v)
        if outwards[s] and dot(normal, area) < 0:
            normal = -normal[0], -normal[1], -normal[2]
        if not norm(normal) > NO_PLANE * norm(u) * norm(v):
            normal = area
        normal = over(normal, divisor(normal))
        for k in range(3):
            to[s, k] = normal[k]


@inlined
def _add(sums, weight, v):
    """Return sums + weight v."""
    return sums[0] + weight * v[0], sums[1] + weight * v[1], sums[2] + weight * v[2]
