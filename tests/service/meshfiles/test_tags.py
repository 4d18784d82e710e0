"""OpenSubdiv's tags in an OBJ: creases, corners and borders are those of OpenSubdiv."""

import numpy as np
import pytest

from pns_common import load_model
from service.meshfiles.convert import converted
from service.meshfiles.obj import read_obj
from service.options import Limits, Options
from tests.support import opensubdiv
from tests.support.polygons import SHAPES, uneven

CUBE, OPEN = "cube", "open box"


def text_of(points, faces, tags):
    lines = [f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in points]
    lines += ["f " + " ".join(str(v + 1) for v in face) for face in faces]
    return "\n".join([*lines, *(line.strip() for line in tags.splitlines())]).encode()


def shape(name, *, triangles):
    points, faces = SHAPES[name]
    if triangles:
        faces = [[f[0], f[k], f[k + 1]] for f in faces for k in range(1, len(f) - 1)]
    return np.round(uneven(points), 6), [list(face) for face in faces]


def corners_of(data, levels, **options):
    chosen = Options(**{"levels": levels, "limit": False, **options})
    made = read_obj(converted(data, "obj", "obj", chosen, None, Limits()).content)
    return made.vertices[made.corners].reshape(len(made.sizes), -1, 3)


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("sharpness", [0.5, 1, 2.25, 10])
def test_creases_and_corners_are_opensubdivs(triangles, sharpness):
    points, faces = shape(CUBE, triangles=triangles)
    tags = f"""t crease 3/1/0 0 1 5 {sharpness}
        t crease 3/2/0 1 3 2 {sharpness} {sharpness}
        t corner 2/1/0 6 7 1.5
        t corner 1/1/0 4 {sharpness}"""
    scheme = "loop" if triangles else "catmull-clark"
    ours = corners_of(text_of(points, faces, tags), 2, scheme=scheme)
    oracle = opensubdiv.loop if triangles else opensubdiv.catmull_clark
    pairs, corners = [[0, 1], [1, 5], [1, 3], [3, 2]], [(6, 1.5), (7, 1.5), (4, sharpness)]
    theirs, *_ = oracle(points, faces, 2, pairs, corners, sharpness)
    # As many digits as the text has.
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-10)


def test_borders_are_those_that_are_stated():
    points, faces = shape(OPEN, triangles=False)
    for number, border in ((1, "corners"), (2, "smooth")):
        stated = text_of(points, faces, f"t interpolateboundary 1/0/0 {number}")
        bare = text_of(points, faces, "")
        ours = corners_of(stated, 1, scheme="catmull-clark")
        assert (ours == corners_of(bare, 1, scheme="catmull-clark", border=border)).all()
        # What the command asks for comes first.
        fixed = corners_of(stated, 1, scheme="catmull-clark", border="fixed")
        assert (fixed == corners_of(bare, 1, scheme="catmull-clark", border="fixed")).all()


@pytest.mark.parametrize("scheme", ["catmull-clark", "loop"])
def test_other_choices_of_creases_hold_in_place_of_tags(scheme):
    points, faces = shape(CUBE, triangles=False)
    tagged, bare = (text_of(points, faces, tags) for tags in ("t crease 2/1/0 0 1 9\n", ""))
    for crease in ("off", "angle:30"):
        ours = corners_of(tagged, 1, scheme=scheme, crease=crease)
        assert (ours == corners_of(bare, 1, scheme=scheme, crease=crease)).all()
    assert (corners_of(tagged, 1, scheme=scheme) != corners_of(bare, 1, scheme=scheme)).any()


def test_tags_that_say_nothing_of_the_mesh_are_passed_over_or_told():
    points, faces = shape(CUBE, triangles=False)
    tags = """t crease 2/1/0 0 7 3
        t crease 2/1/0 0 99 3
        t corner 1/1/0 99 3
        t crease 2/1/0 0
        t crease 3/2/0 0 1 3 x 2
        t corner
        t hole 1/0/0 2
        t interpolateboundary 1/0/0 0"""
    mesh = read_obj(text_of(points, faces, tags))
    assert {change.what: change.count for change in mesh.changes} == {
        "tags that cannot be read dropped": 3,
        "tags hole dropped": 1,
        "tags interpolateboundary dropped": 1,
    }
    ours = corners_of(text_of(points, faces, tags), 1, scheme="catmull-clark")
    assert (ours == corners_of(text_of(points, faces, ""), 1, scheme="catmull-clark")).all()


def test_with_a_model_tags_stand_beside_the_edges_that_it_finds():
    points, faces = shape(CUBE, triangles=False)
    tags = "t crease 2/1/0 0 1 9"
    bare, marked = (
        converted(data, "obj", "obj", Options(), load_model(), Limits()).report["levels"][0]
        for data in (text_of(points, faces, ""), text_of(points, faces, tags))
    )
    found = bare["edges"]["soft"]
    assert found > 6
    assert (marked["edges"]["crease"], marked["edges"]["soft"]) == (1, found - 1)
