"""`mesh.pns` of a PolyData."""

import numpy as np
import pytest

from pns_common import Mesh, loop, pns, refine
from tests.support.meshes import bumpy_sphere
from tests.support.networks import random_model

pyvista = pytest.importorskip("pyvista")

VERTICES, FACES = bumpy_sphere()


def test_every_polydata_has_the_accessor():
    import pns_common.pyvista  # noqa: F401  (it registers `mesh.pns`)

    mesh = pyvista.PolyData.from_regular_faces(VERTICES, FACES)
    scheme = pns(random_model(0))
    refined, smooth = mesh.pns.subdivide(2, scheme), mesh.pns.loop()
    for made, expected in (
        (refined, refine(Mesh(VERTICES, FACES), scheme, 2).mesh),
        (smooth, refine(Mesh(VERTICES, FACES), loop()).mesh),
    ):
        np.testing.assert_allclose(made.points, expected.vertices, atol=1e-12)
        np.testing.assert_array_equal(made.regular_faces, expected.faces)
