"""Edges that are sharp in truth: of exact solids, and of coarse meshes that stand for them."""

import numpy as np
import pytest

from pns_common import Mesh
from train.connectivity import connect
from train.data.pairs.faceted import sampled
from train.data.pairs.lathe import centred, polygon, raised
from train.data.pairs.machined import true_edges
from train.data.pairs.references import Pair, Reference, sharp_edges
from train.data.sharp_labels import coarse_sharp_edges
from train.metrics.shape import volume
from train.surfaces.brep import box, chamfered, cut, cylinder, edge_groups, filleted, tessellated

CENTRED = (-1, -1, -1), (1, 1, 1)


def drum(sides):
    """A cylinder of radius 1 and height 2."""
    return turned(np.array([[1.0, -1], [1, 1]]), sides)


def turned(outline, sides):
    return raised(outline, polygon(sides), (centred(sides),) * 2)


def length(segments):
    return np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).sum()


def test_a_drilled_box_has_its_volume_its_normals_and_its_sharp_edges():
    drilled = tessellated(cut(box(*CENTRED), [cylinder((0, 0), 0.5, -2, 2)]), 1e-3, 0.1)
    assert volume(Mesh(drilled.vertices, drilled.faces)) == pytest.approx(8 - np.pi / 2, rel=2e-3)
    assert length(true_edges(drilled)) == pytest.approx(12 * 2 + 2 * np.pi, rel=1e-3)
    corners = drilled.vertices[drilled.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    assert (across[:, None] * drilled.normals).sum(axis=2).min() > 0.99
    bore = np.hypot(*corners[..., :2].reshape(-1, 2).T) < 0.5 + 1e-6
    inward = -corners[..., :2].reshape(-1, 2)[bore] / 0.5
    normals = drilled.normals.reshape(-1, 3)[bore]
    side = np.abs(normals[:, 2]) < 0.5
    np.testing.assert_allclose(normals[side, :2], inward[side], atol=1e-6)


def test_a_fillet_leaves_no_sharp_edge_and_a_chamfer_two():
    solid = box(*CENTRED)
    upright = next(group for group in edge_groups(solid) if len(group) == 4)
    expected = 8 * 2 + 2 * (4 * 1.6 + 4 * 0.2 * np.sqrt(2))
    bevelled = tessellated(chamfered(solid, upright, 0.2), 1e-3, 0.1)
    assert length(true_edges(bevelled)) == pytest.approx(expected)
    solid = box(*CENTRED)
    upright = next(group for group in edge_groups(solid) if len(group) == 4)
    expected = 2 * (4 * 1.6 + 2 * np.pi * 0.2)
    rounded = tessellated(filleted(solid, upright, 0.2), 1e-3, 0.1)
    assert length(true_edges(rounded)) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("known", [True, False])
def test_the_rims_of_a_drum_are_sharp_and_its_sides_are_not(known):
    fine, coarse = drum(180), drum(12)
    surface = sampled(fine.vertices, fine.faces, np.random.default_rng(0))
    sharp = sharp_edges(fine) if known else None
    level = connect(coarse.faces, len(coarse.vertices))
    ends = coarse.vertices[level.edges.numpy()]
    on_rim = (np.hypot(ends[..., 0], ends[..., 1]) > 0.9).all(axis=1)
    rim = on_rim & (ends[:, 0, 2] == ends[:, 1, 2])
    labels = coarse_sharp_edges(Pair("drum", coarse, surface, sharp))
    np.testing.assert_array_equal(labels, rim)


def test_edges_beside_a_sharp_one_are_not_sharp():
    """Bands beside a rim: the rim alone, though the bands' edges are as near as the reach."""
    shape = np.array([[1.0, 0], [1, 1], [1, 1.05], [1, 1.1], [0, 1.1]])
    coarse = turned(shape, 16)
    fine = turned(shape, 176)
    surface = Reference(fine.vertices, fine.vertices)
    labels = coarse_sharp_edges(Pair("bands", coarse, surface, sharp_edges(fine)))
    heights = coarse.vertices[connect(coarse.faces, len(coarse.vertices)).edges.numpy()][..., 2]
    assert set(np.unique(heights[labels])) == {0.0, 1.1}
    assert labels.sum() == 32
