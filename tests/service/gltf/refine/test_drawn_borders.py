"""What primitives draw on a flat side keeps its place and its shape."""

import numpy as np
import pytest

from pns_common import load_model
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support.gltf import files

MODEL = load_model()


def sign():
    """A square of long triangles with a small rectangle of another primitive in it."""
    rng = np.random.default_rng(3)
    frame = np.array([[-4, -3], [4, -3], [4, 3], [-4, 3]])
    inner = np.array([[0, 0], [1, 0], [1, 0.5], [0, 0.5]])
    points = np.column_stack([np.concatenate([frame, inner]), np.zeros(8)])
    around = [(k, (k + 1) % 4, 4 + (k + 1) % 4) for k in range(4)]
    around += [(k, 4 + (k + 1) % 4, 4 + k) for k in range(4)]
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    shape = {"POSITION": points @ turn.T}
    wall, drawn = np.array(around), np.array([[4, 5, 6], [4, 6, 7]])
    return [{**shape, "indices": wall}, {**shape, "indices": drawn}], turn[:, 2]


def refined(meshes, **options):
    data = files.glb(*meshes)
    return subdivide_gltf(data, "glb", Options(**options), MODEL, Limits()).glb


def drawn(glb, mesh=0):
    """Return the corners of the rectangle's refined triangles."""
    faces, attributes = files.primitive_of(glb, mesh, 1)
    return attributes["POSITION"][faces].astype(float)


def area(triangles):
    sides = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return np.linalg.norm(np.cross(*sides), axis=1).sum() / 2


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_a_rectangle_on_a_wall_stays_where_and_nearly_as_it_was(levels):
    shape, normal = sign()
    corners = shape[1]["POSITION"][4:]
    kept, let_go = (drawn(refined([shape], levels=levels, crease=c)) for c in ("auto", "off"))
    assert abs(area(kept) / 0.5 - 1) < 0.3
    assert area(let_go) / 0.5 > 1.5
    middles = kept.mean(axis=(0, 1)) - corners.mean(axis=0)
    assert np.linalg.norm(middles) < 0.05
    assert np.abs(kept @ normal).max() < 1e-6


def test_loop_and_lines_that_are_asked_for_by_name_are_as_they_were():
    shape, _ = sign()
    for options in ({"scheme": "loop"}, {"crease": "lines"}):
        off = refined([shape], **{**options, "crease": options.get("crease", "off")})
        np.testing.assert_array_equal(drawn(refined([shape], **options)), drawn(off))


def test_many_small_meshes_have_the_bits_of_each_alone():
    shape, _ = sign()
    other = [{**part, "POSITION": part["POSITION"] * 2 + 1} for part in shape]
    both = refined([shape, other], levels=2)
    for number, own in enumerate((shape, other)):
        np.testing.assert_array_equal(drawn(both, number), drawn(refined([own], levels=2)))
