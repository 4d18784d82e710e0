"""What kernels measure of faces, against its definitions, until it is forgotten."""

import numpy as np
import pytest

from pns_common.base.blocks import Blocks
from pns_common.fused.levels.face_measures import FaceMeasures, face_normals
from tests.support.meshes import bumpy_sphere
from tests.support.plain_operator import PlainMesh

POINTS, FACES = bumpy_sphere(2, subdivisions=0)
PLAIN = PlainMesh(POINTS, FACES)


def measures(blocks=None):
    return FaceMeasures(POINTS, FACES.astype(np.int32), blocks or Blocks(1))


@pytest.mark.parametrize("blocks", [Blocks(1), Blocks(2, rows=5)], ids=["whole", "blocks"])
def test_normals_and_areas_of_faces(blocks):
    at_faces = measures(blocks)
    areas = [PLAIN.area(*face) for face in FACES]
    sizes = np.linalg.norm(areas, axis=1)
    np.testing.assert_allclose(at_faces.areas, np.column_stack([areas, sizes]), atol=1e-14)
    np.testing.assert_allclose(at_faces.normals, areas / sizes[:, None], atol=1e-14)
    alone = face_normals(POINTS, FACES.astype(np.int32), blocks)
    np.testing.assert_array_equal(alone, at_faces.normals)


def test_they_are_measured_once_and_go_when_they_are_forgotten():
    at_faces = measures()
    normals = at_faces.normals
    assert at_faces.normals is normals
    assert len(at_faces.areas) == len(FACES)
    at_faces.forget_areas()
    assert at_faces.normals is normals
    assert not at_faces.holds_areas
    # Who asks again has them, and never too few.
    assert len(at_faces.areas) == len(FACES)
    at_faces.forget()
    assert at_faces.normals is not normals
    np.testing.assert_array_equal(at_faces.normals, normals)
    assert len(at_faces.areas) == len(FACES)
