"""Colours of vertices: no two around one vertex have the same."""

from __future__ import annotations

from pns_common.kernels import Connectivity, f8_1d, i8_1d, kernel, u4_1d


@kernel
def colour_stars(
    mesh: Connectivity, faces: i8_1d | u4_1d, starts: i8_1d, taken: i8_1d, colour: i8_1d
):
    """Colour vertices so that those on the faces around any one vertex differ; return how many.

    Args:
        faces: (H,) the faces around vertex 0, 1, …, one after another.
        starts: (V + 1,) where those of each vertex begin.
        taken: (V + 1,) scratch; −1 on entry.
        colour: (V,) out; −1 on entry.
    """
    corners, offsets, most = mesh.corners, mesh.offsets, 0
    for v in range(colour.shape[0]):
        for around in range(starts[v], starts[v + 1]):
            f = faces[around]
            # v stands in the star of each corner of f.
            for h in range(offsets[f], offsets[f + 1]):
                w = corners[h]
                for beyond in range(starts[w], starts[w + 1]):
                    g = faces[beyond]
                    for other in range(offsets[g], offsets[g + 1]):
                        if colour[corners[other]] >= 0:
                            taken[colour[corners[other]]] = v
        free = 0
        while taken[free] == v:
            free += 1
        colour[v] = free
        most = max(most, free + 1)
    return most


@kernel
def multiply_rows(
    later_starts: i8_1d,
    later_columns: i8_1d,
    later_weights: f8_1d,
    starts: i8_1d,
    columns: i8_1d,
    weights: f8_1d,
    total: f8_1d,
    to_starts: i8_1d,
    to_columns: i8_1d,
    to_weights: f8_1d,
):
    """Multiply two sparse matrices; return how many entries the product has.

    Args:
        later_starts, later_columns, later_weights: where the entries of each row of the left matrix
            begin, and these.
        starts, columns, weights: the right matrix.
        total: (C,) scratch, one for each of its columns; 0 on entry.
        to_starts, to_columns, to_weights: the product, out; each row's columns ascend.
    """
    count = 0
    for r in range(later_starts.shape[0] - 1):
        to_starts[r] = count
        for e in range(later_starts[r], later_starts[r + 1]):
            m = later_columns[e]
            for i in range(starts[m], starts[m + 1]):
                c = columns[i]
                if total[c] == 0:
                    slot = count
                    while slot > to_starts[r] and to_columns[slot - 1] > c:
                        to_columns[slot] = to_columns[slot - 1]
                        slot -= 1
                    to_columns[slot] = c
                    count += 1
                total[c] += later_weights[e] * weights[i]
        for i in range(to_starts[r], count):
            to_weights[i] = total[to_columns[i]]
            total[to_columns[i]] = 0.0
    to_starts[later_starts.shape[0] - 1] = count
    return count
