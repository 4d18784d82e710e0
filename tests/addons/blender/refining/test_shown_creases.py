"""Hard edges of a mesh that is shaded smooth stay sharp where lines do."""

from dataclasses import replace

import numpy as np
import pytest

from addons.blender.pns_refine.refining.compute import Choice, compute
from addons.blender.pns_refine.refining.shown_creases import shown_creases
from addons.blender.pns_refine.refining.snapshot import Domain, Layer, Rule
from pns_common import Creases, load_model, loop
from tests.addons.blender.quads import cube, grid

CELLS = 6
LINES = Creases(angle=66.0, levels=2)


def hard_edges_alone(shape):
    """Return what is kept where nothing turns so much that it is a line."""
    return shown(shape, keeping(Creases(angle=179.0))).named


def shown(shape, scheme):
    return shown_creases(shape, shape.control(whole=False), scheme)


def keeping(creases):
    return replace(loop(), creases=creases)


def marks(name, domain, values):
    rows = np.asarray(values, dtype=bool)[:, None]
    return Layer(name, "BOOLEAN", domain, Rule.KEEP, rows)


def with_sharp_middle(**layers):
    """A hilly square with the row of edges across its middle marked sharp."""
    edges = grid(CELLS).edges
    middle = (edges // (CELLS + 1) == CELLS // 2).all(axis=1)
    return grid(CELLS, (marks("sharp_edge", Domain.EDGE, middle), *layers.values())), edges[middle]


def test_edges_marked_sharp_are_the_hard_ones_of_a_smooth_mesh():
    shape, middle = with_sharp_middle()
    found = hard_edges_alone(shape)
    assert sorted(map(tuple, found.tolist())) == sorted(map(tuple, middle.tolist()))


def test_a_mesh_that_is_shaded_flat_has_none():
    flat = marks("sharp_face", Domain.FACE, np.ones(CELLS**2))
    shape, _ = with_sharp_middle(flat=flat)
    assert len(hard_edges_alone(shape)) == 0
    assert len(hard_edges_alone(grid(CELLS))) == 0


def test_the_edges_of_a_flat_face_are_hard_and_its_diagonal_is_not():
    one = np.arange(CELLS**2) == CELLS * 3 + 3
    shape = grid(CELLS, (marks("sharp_face", Domain.FACE, one),))
    assert len(hard_edges_alone(shape)) == 4


def test_they_are_kept_beside_lines_for_as_many_levels_and_only_where_lines_are_asked_for():
    shape, middle = with_sharp_middle()
    made, of_cube = (shown(each, keeping(LINES)) for each in (shape, cube()))
    assert made.named is not None
    assert of_cube.named is not None
    assert (len(made.named), made.levels) == (len(middle), 2)
    assert len(of_cube.named) == 12
    assert shown(shape, loop()).named is None


@pytest.mark.parametrize(("kept", "sharp"), [(True, 2 * CELLS), (False, 0)])
def test_a_refined_mesh_has_what_is_left_of_them(kept, sharp):
    shape, _ = with_sharp_middle()
    model = load_model()
    made = compute(shape, Choice(model, 1, crease_lines=kept))
    assert model.card.sharpness_levels is not None
    assert (made.crease_sharpness == model.card.sharpness_levels - 1).sum() == sharp
