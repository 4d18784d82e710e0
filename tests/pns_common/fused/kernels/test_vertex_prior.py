"""The prior of old vertices by the plain formula, one vertex at a time, with tips and without."""

import numpy as np
import pytest

from pns_common import Mesh
from pns_common.base.blocks import Blocks
from pns_common.formula.tips import ring_further
from pns_common.fused.kernels.vertex_prior import add_priors, add_priors_but_at_tips
from pns_common.fused.learned.surroundings import Surroundings
from pns_common.fused.levels.face_measures import FaceMeasures
from pns_common.masks.stencils import loop_ring_weight
from tests.support.kernels import WAYS, edges_built
from tests.support.meshes import bumpy_sphere
from tests.support.plain_operator import PlainMesh

# So bumpy that some vertices are tips, some half, and some are none.
POINTS, FACES = bumpy_sphere(1, subdivisions=0, bump=0.4)
PLAIN, COUNT, RNG = PlainMesh(POINTS, FACES), 12, np.random.default_rng(1)
PUSHES = np.array([PLAIN.push(v) for v in range(COUNT)])
PUSHED = np.array([PLAIN.loop_vertex(v, PUSHES) for v in range(COUNT)])
OF_CURVES = 0.1 * RNG.standard_normal((COUNT, 3))
# In another order than they have, and not all of them.
CHOSEN = np.array([7, 2, 11, 5, 9, 0, 3], dtype=np.int32)
BEGIN, END = 1, 6
# s of each of the rows.
STRENGTHS = RNG.uniform(0.5, 1.5, len(CHOSEN))


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("curves", [False, True])
def test_without_tips(way, curves):
    prior, of_curves = PUSHED.copy(), OF_CURVES if curves else np.zeros((0, 3))
    WAYS[way](add_priors)(of_curves, 0.0, STRENGTHS, CHOSEN, BEGIN, END, prior)
    rows, strengths = CHOSEN[BEGIN:END], STRENGTHS[BEGIN:END, None]
    expected = strengths * PUSHED[rows] + curves * OF_CURVES[rows]
    np.testing.assert_allclose(prior[rows], expected, rtol=1e-15)
    others = np.delete(np.arange(COUNT), rows)
    np.testing.assert_array_equal(prior[others], PUSHED[others])


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("curves", [False, True])
def test_at_tips(way, curves):
    mesh = edges_built(Mesh(POINTS, FACES))
    faces, no_fans = FaceMeasures(POINTS, mesh.faces, Blocks(1)), np.zeros(COUNT, dtype=bool)
    rings = Surroundings(POINTS, mesh, faces, no_fans, 1.0, Blocks(1), altitudes=0.8).rings
    each = np.arange(rings.valence.max() + 1)
    prior, of_curves = PUSHED.copy(), OF_CURVES if curves else np.zeros((0, 3))
    WAYS[way](add_priors_but_at_tips)(
        *(of_curves, 0.0, STRENGTHS, CHOSEN, BEGIN, END),
        *(PUSHES, rings.means, rings.fields, rings.valence),
        *(loop_ring_weight(each), ring_further(each), 0.8, prior),
    )
    rows, strengths = CHOSEN[BEGIN:END], STRENGTHS[BEGIN:END, None]
    without = curves * OF_CURVES
    without[rows] += strengths * PUSHED[rows]
    expected = [PLAIN.kept_at_tip(v, without[v], PUSHES, 0.8) for v in rows]
    np.testing.assert_allclose(prior[rows], expected, rtol=0, atol=1e-14)
    at_tips = np.linalg.norm(prior[rows] - without[rows], axis=1) > 1e-9
    assert at_tips.any()
    assert not at_tips.all()
    others = np.delete(np.arange(COUNT), rows)
    np.testing.assert_array_equal(prior[others], PUSHED[others])
