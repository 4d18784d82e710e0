"""A mesh with data, and what its refinement has in their place: for each library's meshes."""

import numpy as np

from pns_common import Mesh, load_model, loop, pns, refine
from tests.support.meshes import bumpy_sphere

VERTICES, FACES = bumpy_sphere()
SCHEME = pns(load_model("paper"))
EXPECTED = refine(Mesh(VERTICES, FACES), SCHEME, 2).mesh
UV = VERTICES[:, :2] / 4 + 0.5


def split_uv(uv, levels=2):
    """Texture coordinates of the refined mesh, from the edges of each refined mesh in turn."""
    for level in range(levels):
        faces = refine(Mesh(VERTICES, FACES), loop(), level).mesh.faces if level else FACES
        made = refine(Mesh(VERTICES, FACES), loop(), level + 1).mesh.faces
        grown = np.empty((made.max() + 1, uv.shape[1]))
        grown[: len(uv)] = uv
        for corner, (a, b) in enumerate([(0, 1), (1, 2), (2, 0)]):
            # The middle child of a face has its edge vertices as corners.
            grown[made[3::4][:, corner]] = (uv[faces[:, a]] + uv[faces[:, b]]) / 2
        uv = grown
    return uv


def same_surface(vertices, faces):
    np.testing.assert_allclose(vertices, EXPECTED.vertices, atol=1e-12)
    np.testing.assert_array_equal(faces, EXPECTED.faces)
