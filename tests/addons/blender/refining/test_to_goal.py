"""Faces only where the surface bends, in Blender's arrays: all that hangs on a mesh comes along."""

from dataclasses import replace

import numpy as np
import pytest

from addons.blender.pns_refine.refining.compute import Choice
from addons.blender.pns_refine.refining.snapshot import Domain, Layer, Rule
from addons.blender.pns_refine.refining.to_goal import refine_snapshot
from pns_common import Mesh, MeshError, load_model, loop, refine
from tests.addons.blender.quads import cube, cut, grid


def shape():
    """A sheet of triangles that bends on one side alone."""
    flat = cut(grid(6))
    x = flat.points[:, 0]
    return replace(flat, points=flat.points + np.outer(np.maximum(x, 0) ** 2, [0, 0, 1]))


def layer(domain, rule, values, kind="FLOAT"):
    return Layer("mine", kind, domain, rule, np.asarray(values))


def refined(snapshot, *layers, model=None, **goal):
    choice = Choice(model, 2, **{"max_faces": 400, "crease_lines": False, **goal})
    return refine_snapshot(replace(snapshot, layers=layers), choice)


def test_faces_are_the_librarys_and_hang_together():
    made = refined(shape())
    mesh = Mesh(shape().points, shape().triangles)
    expected = refine(mesh, loop(), max_faces=400, creases=None)
    np.testing.assert_array_equal(made.points, expected.mesh.vertices)
    np.testing.assert_array_equal(made.faces.vertices.reshape(-1, 3), expected.mesh.faces)
    # Each corner's edge runs to the next corner.
    ends = np.roll(expected.mesh.faces, -1, axis=1).reshape(-1)
    pairs = np.sort(np.stack([made.faces.vertices, ends], axis=1))
    np.testing.assert_array_equal(np.sort(made.edges[made.faces.edges]), pairs)
    assert made.report["adaptive"]["faces"] <= 400
    assert not made.distance.any()


def test_positions_as_attributes_become_positions():
    own = shape()
    corners = own.points[own.triangles].reshape(-1, 3)
    made = refined(
        own, layer(Domain.POINT, Rule.BLEND, own.points), layer(Domain.CORNER, Rule.BLEND, corners)
    )
    at_points, at_corners = (each.values for each in made.layers if each.name == "mine")
    np.testing.assert_allclose(at_points, made.points)
    # Corners are linear in each face, on which the curved sheet's vertices stand in x and y.
    inside = np.abs(made.points[made.faces.vertices][:, :2]).max(axis=1) < 0.5
    np.testing.assert_allclose(
        at_corners[inside, :2], made.points[made.faces.vertices][inside, :2], atol=0.02
    )


def test_each_edge_falls_into_its_pieces_and_creases_stay():
    own = cut(cube(np.inf))
    made = refined(own, layer(Domain.EDGE, Rule.KEEP, np.arange(1, len(own.edges) + 1)[:, None]))
    assert len(made.points) == 8, "a cube of creases is flat"
    ball = replace(cut(cube()), layers=())
    numbers = np.arange(1, len(ball.edges) + 1)[:, None]
    made = refined(ball, layer(Domain.EDGE, Rule.KEEP, numbers))
    (values,) = (each.values[:, 0] for each in made.layers if each.name == "mine")
    for number, (a, b) in enumerate(ball.edges, 1):
        pieces = made.edges[values == number]
        # A chain from one end to the other.
        ends, counts = np.unique(pieces, return_counts=True)
        assert sorted(ends[counts == 1]) == sorted([a, b])


def test_votes_and_marks_go_to_what_is_left_of_each():
    own = shape()
    faces = np.arange(len(own.triangles))[:, None]
    points = (own.points[:, :1] > 0.01).astype(int)
    made = refined(
        own,
        layer(Domain.FACE, Rule.VOTE, faces),
        replace(layer(Domain.POINT, Rule.VOTE, points), name="side"),
        replace(layer(Domain.POINT, Rule.KEEP, points), name="kept"),
    )
    values = {each.name: each.values[:, 0] for each in made.layers}
    np.testing.assert_array_equal(values["mine"], made.faces.parents)
    old = len(own.points)
    far = np.abs(made.points[:, 0]) > 0.3
    np.testing.assert_array_equal(values["side"][far], made.points[far, 0] > 0)
    np.testing.assert_array_equal(values["kept"][:old], points[:, 0])
    assert not values["kept"][old:].any()


def test_found_edges_are_marked_and_shaded_on_both_sides():
    made = refined(cut(cube()), model=load_model(), crease_lines=True, tolerance="1%")
    (sharp,) = (each.values[:, 0] for each in made.layers if each.name == "sharp_edge")
    ends = made.points[made.edges[sharp]]
    assert len(made.faces.parents) == len(ends) == 12
    (normals,) = (each.values for each in made.layers if each.kind == "NORMAL")
    assert (np.abs(normals).max(axis=1) > 0.99).all()


def test_what_cannot_be_is_said_in_plain_words():
    with pytest.raises(MeshError, match=r"quads or larger faces.*Ctrl T"):
        refined(cube())
    with pytest.raises(MeshError, match="set them to 1"):
        refined(cut(cube(2.5)))
    with pytest.raises(MeshError, match="On Limit Surface"):
        refined(shape(), limit=False)
