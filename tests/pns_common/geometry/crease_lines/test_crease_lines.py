"""Crease lines: what is sharp stays, what is round does not, whatever stands for it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Creases, Mesh
from pns_common.connectivity.topology import EdgeClass, build_topology
from pns_common.geometry.crease_lines import is_edged, with_crease_lines
from tests.support.crease_lines import (
    CHAMFERED,
    RIB,
    SHARP_ALONE,
    WEDGE,
    WITH_GENTLE,
    lines,
    normals_of,
    pleat,
)
from tests.support.meshes import (
    block,
    bumpy_sphere,
    folded_sheet,
    grid,
    manifolds,
    rotation,
    soups,
)
from train.data.primitives import box, cone, cylinder, globe, icosphere, l_block, tetrahedron, torus

ROUND = {
    "tetrahedron": tetrahedron(),
    "octahedron": globe(4, 1),
    "icosahedron": icosphere(0),
    "icosphere": icosphere(2),
    "globe": globe(20, 9),
    "tube of eight sides": torus(12, 8),
    "tube of six sides": torus(12, 6),
    "bumpy sphere": Mesh(*bumpy_sphere()),
    "flat": Mesh(*grid(5)),
    "waves": Mesh(*grid(12, lambda x, y: 0.2 * np.sin(4 * x) * np.cos(3 * y))),
}
# Each with how many of its edges are of lines.
SHARP = {
    "box": (box(), 12),
    "thin box": (box(4, 2, 0.1), 12),
    "L block": (l_block(), 22),
    "cylinder of six sides": (cylinder(6), 12),
    "cylinder of 16 sides": (cylinder(16, rows=6), 32),
    "prism of five sides": (cylinder(5), 15),
    "cone": (cone(16), 16),
    "wedge": (WEDGE, 9),
    "block": (Mesh(*block(4)), 48),
    "block without a lid": (Mesh(*block(4, closed=False)), 32),
    "noisy block": (Mesh(*block(4, noise=0.02)), 48),
}


@pytest.mark.parametrize("creases", [SHARP_ALONE, WITH_GENTLE])
@pytest.mark.parametrize("name", ROUND)
def test_what_may_stand_for_a_round_shape_has_no_lines(name, creases):
    assert lines(ROUND[name], creases) == set()


@pytest.mark.parametrize("name", SHARP)
def test_edges_between_flat_sides_are_lines(name):
    mesh, count = SHARP[name]
    assert len(lines(mesh)) == count


def test_a_mesh_is_edged_where_half_of_its_turns_are_sharp():
    assert is_edged(1, 2)
    assert not is_edged(1, 3)
    assert not is_edged(0, 0)
    # What is known of the whole is not asked of a piece of it.
    for edged, count in ((True, 15), (False, 13)):
        assert len(lines(CHAMFERED, replace(WITH_GENTLE, edged=edged))) == count
    for edged, count in ((True, 2), (None, 0), (False, 0)):
        assert len(lines(pleat(30, cells=2), replace(WITH_GENTLE, edged=edged))) == count


def test_what_is_in_rows_does_not_make_a_part_round():
    """A chamfered bar beside a pipe: of 146 edges that turn 45 are sharp, and two stand alone."""
    pipe = cylinder(16, rows=6)
    faces = np.concatenate([CHAMFERED.faces, pipe.faces + len(CHAMFERED.vertices)])
    both = Mesh(np.concatenate([CHAMFERED.vertices, pipe.vertices + 5]), faces)
    assert len(lines(both, WITH_GENTLE)) == 15 + 32
    # Of a pipe by itself nothing else is sharp.
    assert len(lines(pipe, WITH_GENTLE)) == 32


@pytest.mark.parametrize("degrees", [30, -30])
def test_gentle_folds_of_edged_meshes_are_lines_on_ridges_and_in_hollows(degrees):
    assert len(lines(pleat(degrees), replace(WITH_GENTLE, edged=True))) == 4


def fold(sign):
    """A narrow sheet, folded along its middle: by 80 degrees half way, by 30 at its ends."""
    points, faces = grid(17)
    x, y = points[:, 0], points[:, 1] / 20
    half = np.radians(np.clip(75 - 100 * np.abs(x), 15, 40))
    folded = np.stack([x, y * np.cos(half), -sign * np.abs(y) * np.sin(half)], axis=1)
    return Mesh(folded, faces)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_where_sharp_turns_gentle_along_a_fold_an_edged_mesh_has_one_line(sign):
    """Two pipes meet in such a curve, in a hollow."""
    assert len(lines(fold(sign), replace(WITH_GENTLE, edged=True))) == 16
    assert len(lines(fold(sign))) == 0


def test_a_rib_between_two_plates_is_sharp_all_around():
    """Its slope meets both plates by 45 degrees, where its sides and the plates meet by 90."""
    assert len(lines(RIB, WITH_GENTLE)) == 27


@given(
    manifolds()
    | soups()
    | st.sampled_from([mesh for mesh, _ in SHARP.values()] + [CHAMFERED, pleat(30)]),
    st.integers(0, 99),
    st.floats(0.01, 100),
    st.booleans(),
    st.booleans(),
)
def test_lines_do_not_depend_on_where_a_mesh_lies_nor_on_its_numbers(
    mesh, seed, scale, mirrored, turned_over
):
    rng = np.random.default_rng(seed)
    turned = scale * (mesh.vertices @ rotation(rng).T) + rng.standard_normal(3)
    faces = mesh.faces
    if mirrored:
        turned = turned * [1, 1, -1]
    if turned_over:
        faces = faces[:, ::-1]
    order = rng.permutation(len(turned))
    moved = np.empty_like(turned)
    moved[order] = turned
    renumbered = Mesh(moved, np.roll(order[faces][rng.permutation(len(faces))], seed % 3, axis=1))
    for creases in (SHARP_ALONE, WITH_GENTLE):
        expected = {tuple(sorted(order[list(pair)])) for pair in lines(mesh, creases)}
        assert lines(renumbered, creases) == expected


@pytest.mark.parametrize("seed", range(4))
def test_the_rim_of_a_sheet_with_two_sides_is_no_hollow_however_it_is_turned(seed):
    """Its faces turn by 180 degrees there: of which one rises above the other rounding decides."""
    points, faces = folded_sheet(13)
    turned = Mesh(points @ rotation(np.random.default_rng(seed)).T, faces)
    assert len(lines(turned)) == 8
    assert lines(turned, WITH_GENTLE) == lines(turned)


def test_lines_become_creases_beside_those_that_are_there():
    mesh = box()
    plain = build_topology(mesh.faces, 8)
    creased = with_crease_lines(plain, mesh.vertices, normals_of(mesh), SHARP_ALONE)
    assert (creased.edge_class == EdgeClass.CREASE).sum() == 12
    assert len(creased.interior) == 6
    assert with_crease_lines(plain, mesh.vertices, normals_of(mesh), Creases()) is plain
