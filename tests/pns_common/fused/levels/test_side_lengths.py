"""Kernels measure the sides of a mesh, and of each of its parts, with the bits of the arrays."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common.base.blocks import Blocks
from pns_common.fused.levels.side_lengths import side_lengths, side_lengths_of_parts
from pns_common.geometry.side_lengths import BLOCK_FACES, measure_sides


def soup(count, seed=0):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((300, 3)), rng.integers(0, 300, (count, 3))


@pytest.mark.parametrize("count", [1, BLOCK_FACES - 1, BLOCK_FACES, 3 * BLOCK_FACES + 1])
@pytest.mark.parametrize("threads", [1, 3])
def test_a_mesh_has_the_bits_of_the_arrays(count, threads):
    points, faces = soup(count)
    assert side_lengths(points, faces, Blocks(threads)) == measure_sides(points, faces)


@given(st.lists(st.integers(1, 2 * BLOCK_FACES), min_size=1, max_size=4), st.integers(1, 3))
def test_each_part_is_measured_as_if_it_were_alone(counts, threads):
    parts = np.cumsum([0, *counts])
    points, faces = soup(parts[-1], len(counts))
    measured = side_lengths_of_parts(points, faces, parts, Blocks(threads))
    alone = [measure_sides(points, faces[a:b]) for a, b in itertools.pairwise(parts)]
    assert measured == alone
