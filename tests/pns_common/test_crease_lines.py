"""The default keeps the lines that a mesh shows: found, named or not at all."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from pns_common import Creases, Mesh, ParameterError, crease_lines, load_model, loop, pns, refine
from pns_common.connectivity.topology import build_topology
from pns_common.crease_lines import LINES, named_on
from pns_common.geometry.crease_lines import line_rows
from pns_common.geometry.frames import face_normals
from pns_common.refine_parts import refine_parts
from tests.support.meshes import block, bumpy_sphere
from train.data.primitives import box, cylinder

GENERAL = pns(load_model())
BLOCK = Mesh(*block(3, noise=0.02))


def test_both_ways_find_the_same_lines(monkeypatch):
    front_door = import_module("pns_common.crease_lines")
    for mesh in (BLOCK, cylinder(6), cylinder(16, rows=6), Mesh(*bumpy_sphere())):
        topology = build_topology(mesh.faces, len(mesh.vertices))
        normals = face_normals(mesh.vertices, mesh.faces)
        for angle, asked in ((None, LINES), (66.0, Creases(line_angle=66.0))):
            expected = topology.edges[line_rows(mesh.vertices, normals, topology, asked)]
            for loaded in (True, False):
                monkeypatch.setattr(front_door, "kernels_loaded", lambda loaded=loaded: loaded)
                np.testing.assert_array_equal(crease_lines(mesh, angle), expected)


@pytest.mark.parametrize("angle", [0, 180, -1, np.nan])
def test_an_angle_that_is_none_is_refused(angle):
    with pytest.raises(ParameterError, match="angle"):
        crease_lines(box(), angle)


@pytest.mark.parametrize("angle", [0, 180, -1, np.nan])
def test_creases_of_such_an_angle_are_refused_too(angle):
    with pytest.raises(ParameterError, match="line_angle"):
        Creases(line_angle=angle)


@pytest.mark.parametrize("angle", [0, 66, 80, -1, np.nan])
def test_gentler_lines_are_below_the_others(angle):
    with pytest.raises(ParameterError, match="edged_angle"):
        Creases(line_angle=66.0, edged_angle=angle)


@pytest.mark.parametrize("edged", ["no", 0, np.ones(2)])
def test_a_mesh_is_edged_or_it_is_not(edged):
    # Where annotations are enforced, another kind ends there first.
    with pytest.raises((ParameterError, TypeError), match="edged"):
        Creases(line_angle=66.0, edged=edged)


@pytest.mark.parametrize("levels", [0, -1, True])
def test_creases_are_sharp_at_one_level_at_least(levels):
    with pytest.raises(ParameterError, match="levels"):
        Creases(levels=levels)


@pytest.mark.parametrize("limit", [False, True])
def test_the_default_keeps_the_lines_as_if_they_had_been_named(limit):
    by_default = refine(BLOCK, GENERAL, 2, limit=limit)
    lines = Creases(crease_lines(BLOCK), levels=2)
    named = refine(BLOCK, GENERAL, 2, limit=limit, creases=lines)
    assert by_default.mesh.vertices.tobytes() == named.mesh.vertices.tobytes()
    assert by_default.report == named.report
    assert by_default.report["levels"][0]["edges"]["crease"] == 36


def test_a_box_refines_to_itself_and_without_lines_it_does_not():
    corners = refine(box(), GENERAL, 2).mesh.vertices[:8]
    np.testing.assert_allclose(corners, box().vertices, atol=1e-15)
    rounded = refine(box(), GENERAL, 3, creases=None).mesh.vertices[:8]
    assert np.linalg.norm(rounded - box().vertices, axis=1).min() > 0.05


@pytest.mark.parametrize(
    "scheme", [loop(), pns(load_model("signed")), pns(load_model(), budget=0.0)]
)
def test_who_does_not_ask_for_lines_keeps_none(scheme):
    assert scheme.creases.line_angle is None
    assert "crease" not in refine(box(), scheme).report["levels"][0]["edges"]


def test_any_scheme_can_ask():
    asked = refine(box(), replace(loop(), creases=Creases(line_angle=66.0))).mesh.vertices
    np.testing.assert_array_equal(
        asked, refine(box(), loop(), creases=crease_lines(box())).mesh.vertices
    )


@pytest.mark.parametrize("by", ["kernels", "arrays"])
def test_lines_are_sharp_at_so_many_levels_and_loops_from_then_on(by, monkeypatch):
    if by == "arrays":
        monkeypatch.setattr(
            import_module("pns_common.refine"), "kernels_can_serve", lambda *_: False
        )
    lines = crease_lines(BLOCK)
    for sharp in (1, 2):
        made = refine(BLOCK, loop(), 3, creases=Creases(lines, levels=sharp))
        first = refine(BLOCK, loop(), sharp, creases=lines).mesh
        np.testing.assert_array_equal(
            made.mesh.vertices, refine(first, loop(), 3 - sharp).mesh.vertices
        )
        counts = [level["edges"].get("crease", 0) for level in made.report["levels"]]
        assert counts == [36 * 2**depth if depth < sharp else 0 for depth in range(3)]


def test_another_word_is_refused():
    with pytest.raises(ParameterError, match="auto"):
        refine(box(), GENERAL, creases="lines")


def joined(parts):
    """All as one mesh, and where the faces of each begin."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    union = Mesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)]),
    )
    return union, np.cumsum([0, *(len(part.faces) for part in parts)])


@pytest.mark.parametrize("limit", [False, True])
def test_parts_keep_their_lines_as_they_do_alone(limit):
    # The third alone is edged with edges that are gentler: all together are not.
    parts = [box(), Mesh(*bumpy_sphere(subdivisions=0)), cylinder(6), cylinder(8)]
    both, ends = joined(parts)
    made = refine_parts(both, ends, GENERAL, 2, limit=limit)
    assert made is not None
    alone = [refine(part, GENERAL, 2, limit=limit) for part in parts]
    assert made.reports == [part.report for part in alone]
    corners = np.concatenate([part.mesh.vertices[part.mesh.faces] for part in alone])
    np.testing.assert_array_equal(made.mesh.vertices[made.mesh.faces], corners)


def test_lines_that_are_looked_for_can_be_named():
    named = named_on(BLOCK, Creases(line_angle=66.0, levels=2))
    np.testing.assert_array_equal(named.named, crease_lines(BLOCK))
    assert (named.line_angle, named.levels) == (None, 2)
    given = Creases(np.array([[0, 1]]))
    assert named_on(BLOCK, given) is given


@pytest.mark.parametrize("edged", [None, True, False])
@pytest.mark.parametrize("gentle", [None, 20.0])
def test_parts_keep_what_is_named_beside_their_lines(gentle, edged):
    parts = [cylinder(6), box(), cylinder(8), Mesh(*bumpy_sphere(subdivisions=0))]
    union, ends = joined(parts)
    asked = Creases(line_angle=66.0, levels=2, edged_angle=gentle, edged=edged)
    # A diagonal, and of the rims so many edges that the cylinder is not edged by the others.
    named = np.concatenate([parts[0].faces[:1, :2], crease_lines(parts[0], 66)[:7]])
    made = refine_parts(union, ends, GENERAL, 2, creases=replace(asked, named=named))
    assert made is not None
    alone = [
        refine(part, GENERAL, 2, creases=asked if number else replace(asked, named=named))
        for number, part in enumerate(parts)
    ]
    assert made.reports == [part.report for part in alone]
    corners = np.concatenate([part.mesh.vertices[part.mesh.faces] for part in alone])
    np.testing.assert_array_equal(made.mesh.vertices[made.mesh.faces], corners)


@pytest.mark.parametrize("loaded", [True, False])
def test_lines_are_named_beside_what_is_named_already(loaded, monkeypatch):
    front_door = import_module("pns_common.crease_lines")
    monkeypatch.setattr(front_door, "kernels_loaded", lambda: loaded)
    given = BLOCK.faces[:1, :2]
    asked = Creases(given, line_angle=66.0, levels=2)
    named = named_on(BLOCK, asked)
    np.testing.assert_array_equal(named.named[:1], given)
    by_name, found = (refine(BLOCK, GENERAL, 2, creases=each) for each in (named, asked))
    assert by_name.report == found.report
    np.testing.assert_array_equal(by_name.mesh.vertices, found.mesh.vertices)
