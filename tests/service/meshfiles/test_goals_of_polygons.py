"""Polygon files with a goal: faces stay polygons, with what corners and faces carry."""

import numpy as np
import pytest

from pns_common import load_model
from service.errors import InvalidParameter
from service.meshfiles.convert import converted
from service.options import Limits, Options

ROOF = b"""v -1 -1 0
v 0 -1 0
v 1 -1 0
v -1 0 0
v 0 0 1
v 1 0 0
v -1 1 0
v 0 1 0
v 1 1 0
vt 0 0
vt .5 0
vt 1 0
vt 0 .5
vt .5 .5
vt 1 .5
vt 0 1
vt .5 1
vt 1 1
g left
f 1/1 2/2 5/5 4/4
f 4/4 5/5 8/8 7/7
g right
f 2/2 3/3 6/6 5/5
f 5/5 6/6 9/9 8/8
"""


def refined(data, kind="obj", target="obj", **options):
    return converted(data, kind, target, Options(**options), load_model(), Limits())


@pytest.mark.parametrize("goal", [{"tolerance": "2%"}, {"max_faces": 60}])
def test_faces_of_several_levels_keep_groups_and_coordinates(goal):
    text = refined(ROOF, **goal, scheme="catmull-clark").content.decode()
    lines = [line.split() for line in text.splitlines() if line]
    points, places = (
        np.array([line[1:3] for line in lines if line[0] == kind], dtype=float)
        for kind in ("v", "vt")
    )
    group, sizes = None, []
    for first, *rest in lines:
        if first == "g":
            group = rest[0]
        elif first == "f":
            corners = np.array([corner.split("/")[:2] for corner in rest], dtype=int) - 1
            sizes.append(len(corners))
            across = places[corners[:, 1], 0]
            assert (across <= 0.5).all() if group == "left" else (across >= 0.5).all()
            # Coordinates are linear in the file's faces, the surface is near to that.
            assert np.abs(points[corners[:, 0]] - (2 * places[corners[:, 1]] - 1)).max() < 0.3
    assert set(sizes) == {3, 4}


def test_polygons_of_a_gltf_are_refused_with_a_goal():
    glb = refined(ROOF, target="glb", levels=1).content
    with pytest.raises(InvalidParameter, match="stay triangles"):
        refined(glb, "glb", "glb", tolerance="2%", scheme="catmull-clark")


@pytest.mark.parametrize("target", ["glb", "stl", "obj"])
def test_as_many_faces_as_are_asked_for_are_those_that_are_written(target):
    made = refined(ROOF, target=target, max_faces=200)
    written = made.faces if target == "obj" else made.triangles
    assert 150 < written <= 200
