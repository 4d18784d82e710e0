"""A meshio.Mesh comes back as one, with all that it carries."""

import numpy as np
import pytest

from pns_common import Mesh, MeshError, load_model, pns, refine, subdivide
from tests.support.polygons import mixed_cube
from tests.support.split_data import FACES, SCHEME, UV, VERTICES, same_surface, split_uv

meshio = pytest.importorskip("meshio")


def test_the_surface_its_blocks_sets_and_data():
    part = [np.zeros(50), np.ones(len(FACES) - 50)]
    given = meshio.Mesh(
        VERTICES,
        [("triangle", FACES[:50]), ("triangle", FACES[50:])],
        point_data={"uv": UV},
        cell_data={"part": part},
        field_data={"skin": [1, 2]},
        point_sets={"pins": [0, 3]},
        cell_sets={"wall": [np.array([1, 4]), None], "rim": [[], [0]]},
        info={"unit": "mm"},
    )
    refined = subdivide(given, 2, SCHEME)
    assert isinstance(refined, meshio.Mesh)
    same_surface(refined.points, np.concatenate([block.data for block in refined.cells]))
    assert [len(block.data) for block in refined.cells] == [800, 16 * (len(FACES) - 50)]
    assert [set(values) for values in refined.cell_data["part"]] == [{0.0}, {1.0}]
    np.testing.assert_allclose(refined.point_data["uv"], split_uv(UV), atol=1e-12)
    assert (refined.field_data, refined.info) == (given.field_data, {"unit": "mm"})
    assert refined.point_sets == {"pins": [0, 3]}
    wall, none = refined.cell_sets["wall"]
    assert wall.tolist() == [*range(16, 32), *range(64, 80)]
    assert len(none) == 0
    assert [part.tolist() for part in refined.cell_sets["rim"]] == [[], [*range(16)]]


def test_a_plane_mesh_stays_plane():
    given = meshio.Mesh(np.array([[0.0, 0], [1, 0], [0, 1]]), [("triangle", [[0, 1, 2]])])
    assert subdivide(given, 2).points.shape == (15, 2)


@pytest.mark.parametrize(
    ("cells", "says"),
    [
        ([("tetra", [[0, 1, 2, 3]])], "cells of type tetra"),
        ([], "cells of type none"),
        ([("triangle", [[0, 1, 2]]), ("tetra", [[0, 1, 2, 3]])], "type tetra.*the blocks of faces"),
    ],
)
def test_other_cells_are_refused_by_name(cells, says):
    with pytest.raises(MeshError, match=says):
        subdivide(meshio.Mesh(np.eye(4)[:, :3], cells))


def test_mixed_cells_become_quads_with_their_data():
    points, faces = mixed_cube()
    quads, triangles = ([f for f in faces if len(f) == degree] for degree in (4, 3))
    given = meshio.Mesh(
        points,
        [("quad", quads), ("triangle", triangles)],
        point_data={"height": points[:, 2]},
        cell_data={"part": [np.arange(5.0), np.array([7.0, 8])]},
        cell_sets={"first": [[0], [0]]},
    )
    refined = subdivide(given, 2)
    assert [block.type for block in refined.cells] == ["quad", "quad"]
    assert [len(block.data) for block in refined.cells] == [5 * 16, 2 * 12]
    np.testing.assert_array_equal(refined.cell_data["part"][1], np.repeat([7.0, 8], 12))
    assert [part.tolist() for part in refined.cell_sets["first"]] == [
        list(range(16)),
        list(range(12)),
    ]
    expected = refine(Mesh(points, [*quads, *triangles]), pns(load_model()), 2).mesh
    np.testing.assert_allclose(refined.points, expected.vertices)
    # Linear on each face of the control mesh, where heights are those of its plane.
    columns = {"h": points[:, 0]}
    flat = subdivide(meshio.Mesh(points, [("quad", quads)], point_data=columns), 1)
    np.testing.assert_allclose(flat.point_data["h"][: len(points)], points[:, 0])
    assert flat.point_data["h"][-5:].tolist() == [points[f, 0].mean() for f in quads]


def test_quads_and_polygons_are_cut_with_their_data():
    blocks = [("quad", [[3, 2, 1, 0]]), ("triangle", [[0, 1, 2]])]
    given = meshio.Mesh(np.eye(4, 3), blocks, cell_data={"part": [[5], [6]]})
    refined = subdivide(given, 1, SCHEME, triangulate=True)
    assert [block.data.shape for block in refined.cells] == [(8, 3), (4, 3)]
    assert [values.tolist() for values in refined.cell_data["part"]] == [[5] * 8, [6] * 4]


@pytest.mark.parametrize("degree", [3, 4])
def test_lines_follow_their_edges_and_vertices_stay(degree):
    points = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [5, 5, 0], [6, 5, 0]])
    faces = [[0, 1, 2], [0, 2, 3]] if degree == 3 else [[0, 1, 2, 3]]
    given = meshio.Mesh(
        points,
        [
            ("vertex", [[4], [1]]),
            ("line", [[1, 0], [4, 5]]),
            ("triangle" if degree == 3 else "quad", faces),
            ("line", [[1, 2]]),
        ],
        cell_data={"tag": [[7, 8], [1, 2], [3] * len(faces), [4]]},
        cell_sets={"rim": [[1], [0], [], [0]]},
    )
    scheme = "loop" if degree == 3 else "catmull-clark"
    refined = subdivide(given, 2, scheme, limit=False)
    assert [block.type for block in refined.cells][:2] == ["vertex", "line"]
    assert refined.cells[0].data.tolist() == [[4], [1]]
    rim, along = refined.cells[1].data, refined.cells[3].data
    # From vertex 1 to vertex 0, each part behind the other; no edge, no parts.
    assert (rim[0, 0], rim[3, 1], rim[4].tolist()) == (1, 0, [4, 5])
    assert rim[:3, 1].tolist() == rim[1:4, 0].tolist()
    faces = refined.cells[2].data
    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    known = {frozenset(side) for side in sides.tolist()}
    assert {frozenset(part) for part in [*rim[:4].tolist(), *along.tolist()]} <= known
    assert (along[0, 0], along[-1, 1]) == (1, 2)
    tags = [values.tolist() for values in refined.cell_data["tag"]]
    assert (tags[0], tags[1], tags[3]) == ([7, 8], [1] * 4 + [2], [4] * 4)
    assert set(tags[2]) == {3}
    sets = [cells.tolist() for cells in refined.cell_sets["rim"]]
    assert sets == [[1], [0, 1, 2, 3], [], [0, 1, 2, 3]]
    assert len(along) == 4
