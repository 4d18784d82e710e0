"""Swept profiles: smooth curves by their lengths, on surfaces that bend mostly one way."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from pns_common.connectivity.topology import EdgeClass, build_topology

from train.data.pairs.swept import random_profile, swept_pair

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS)
def test_a_profile_goes_on_smoothly_at_the_speed_of_its_arc_length(seed):
    """Between points so near each other that the sharpest arc is straight there."""
    profile = random_profile(np.random.default_rng(seed))
    along = np.linspace(0, profile.starts[-1], 4001)
    step = np.diff(profile.at(along), axis=0)
    speed = np.linalg.norm(step, axis=1) / np.diff(along)
    np.testing.assert_allclose(speed, 1, atol=1e-3)
    turn = np.einsum("ij,ij->i", step[1:], step[:-1]) / (speed[1:] * speed[:-1])
    assert (turn > 0.99 * np.diff(along)[1:] ** 2).all()
    assert np.abs(profile.bends).max() > 0


@given(SEEDS)
def test_arcs_turn_by_their_angle_and_straight_pieces_by_none(seed):
    profile = random_profile(np.random.default_rng(seed))
    for bend, start, end, here, there in zip(
        profile.bends,
        profile.starts,
        profile.starts[1:],
        profile.headings,
        profile.headings[1:],
        strict=False,
    ):
        before, after = (
            profile.at(np.array([start, start + 1e-7])),
            profile.at(np.array([end - 1e-7, end])),
        )
        for ends, heading in ((before, here), (after, there)):
            way = (ends[1] - ends[0]) / 1e-7
            np.testing.assert_allclose(way, [np.cos(heading), np.sin(heading)], atol=1e-4)
        assert np.isclose(there - here, bend * (end - start))


def test_faces_are_longer_than_wide_by_far_and_hang_together():
    rng = np.random.default_rng(1)
    pairs = [pair for pair in (swept_pair(rng) for _ in range(12)) if pair is not None]
    thinnest = []
    for pair in pairs:
        mesh = pair.coarse
        topology = build_topology(mesh.faces, len(mesh.vertices))
        assert (topology.edge_class != EdgeClass.IRREGULAR).all()
        a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
        sides = np.stack([b - a, c - b, a - c])
        longest = (sides**2).sum(axis=2).max(axis=0)
        thinnest.append((longest / np.linalg.norm(np.cross(b - a, c - a), axis=1)).max())
    assert np.median(thinnest) > 8
