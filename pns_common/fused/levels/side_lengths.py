"""The sides of faces measured by kernels, of a mesh or of each of its parts."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.base.blocks import Blocks
from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.side_lengths import sum_sides
from pns_common.geometry.side_lengths import BLOCK_FACES, SideLengths


def side_lengths(
    points: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], blocks: Blocks
) -> SideLengths:
    """Return what ``measure_sides`` does."""
    return side_lengths_of_parts(points, faces, np.array([0, len(faces)]), blocks)[0]


def side_lengths_of_parts(
    points: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    parts: Int[np.ndarray, " Q"],
    blocks: Blocks,
) -> list[SideLengths]:
    """Return the same of each part by itself.

    ``parts`` (P + 1,) says where the faces of each begin, and where the last one's end.
    """
    counts = np.diff(parts)
    of_part = -(-counts // BLOCK_FACES)
    last = np.cumsum(of_part)
    within = np.arange(int(last[-1]), dtype=np.int64) - np.repeat(last - of_part, of_part)
    starts = np.add(np.repeat(parts[:-1], of_part), BLOCK_FACES * within)
    ends = np.minimum(starts + BLOCK_FACES, np.repeat(parts[1:], of_part))
    sums = np.empty((len(starts), 2))
    measure = sum_sides.over(points, faces, starts, ends, ROWS, sums)
    some = max(1, -(-len(starts) // (2 * blocks.threads)))
    blocks.unheard().of_rows(some).run(len(starts), measure)
    return [
        SideLengths().with_blocks(int(count), sums[end - own : end])
        for count, own, end in zip(counts, of_part, last, strict=True)
    ]
