"""Mitres: faces within a plane side, between corners of lines, do not come to lie on others."""

import numpy as np
import pytest

from pns_common import Mesh, crease_lines, load_model, pns, refine
from pns_common.connectivity.creases import with_creases
from pns_common.connectivity.topology import build_topology
from pns_common.geometry.crease_lines import line_rows
from pns_common.geometry.frames import face_normals
from tests.support.crease_lines import WITH_GENTLE, lines, normals_of
from tests.support.meshes import rotation
from train.data.parts import closed_grid_faces
from train.data.primitives import box

GENERAL = pns(load_model())
HIGH = 0.1


def frame(sides, width, stretch=1.0):
    """A picture frame: a rectangle turned round a polygon's rim, its mitres at the corners."""
    around = 2 * np.pi * np.arange(sides) / sides
    rim = np.stack([stretch * np.cos(around), np.sin(around)], axis=1)
    outline = ((1, 0), (1, HIGH), (1 - width, HIGH), (1 - width, 0))
    rings = [np.c_[reach * rim, np.full(sides, height)] for reach, height in outline]
    return Mesh(np.concatenate(rings), closed_grid_faces(4, sides)[:, ::-1])


def mitres(sides):
    """Of a frame the edges from its outer to its inner rim, above and below."""
    k = np.arange(sides)
    return {*zip(k + sides, k + 2 * sides, strict=True), *zip(k, k + 3 * sides, strict=True)}


@pytest.mark.parametrize(("sides", "width"), [(4, 0.02), (4, 0.3), (4, 0.7), (5, 0.3), (6, 0.1)])
@pytest.mark.parametrize("stretch", [1.0, 3.0])
def test_a_frame_stays_one(sides, width, stretch):
    mesh = frame(sides, width, stretch)
    sides_normals = face_normals(mesh.vertices, mesh.faces)
    for levels in (1, 2):
        refined = refine(mesh, GENERAL, levels).mesh
        normals = face_normals(refined.vertices, refined.faces)
        # Before its lines end its children lie in its sides, and none lies on its face.
        flat = np.abs(sides_normals[:, 2]) > 0.99
        of_flat = np.repeat(flat, 4**levels)
        turned = (normals * np.repeat(sides_normals, 4**levels, axis=0)).sum(axis=1)
        assert (turned[of_flat] > 0.99).all()


@pytest.mark.parametrize("sides", [4, 5, 6])
def test_mitres_are_kept_with_the_lines(sides):
    found = lines(frame(sides, 0.2), WITH_GENTLE)
    assert mitres(sides) <= found
    # All other lines turn: four rims, and as many edges down the walls, inside and out.
    assert len(found) == len(mitres(sides)) + 6 * sides


def test_where_the_rims_are_round_nothing_is_held():
    assert not mitres(24) & lines(frame(24, 0.2), WITH_GENTLE)


def test_where_loop_stays_between_the_sides_there_are_none():
    assert len(crease_lines(box(4, 2, 0.1))) == 12
    # A wide frame is nearly a fan.
    assert not mitres(6) & lines(frame(6, 0.8), WITH_GENTLE)


def test_a_side_that_is_not_plane_has_none():
    mesh = frame(4, 0.2)
    points = mesh.vertices.copy()
    # The upper inner rim lower: the four upper sides slope, and turn at their mitres.
    points[8:12, 2] -= 0.05
    assert not {(4 + k, 8 + k) for k in range(4)} & lines(Mesh(points, mesh.faces))


def test_creases_that_are_named_have_them_too():
    mesh = frame(4, 0.2)
    topology = build_topology(mesh.faces, len(mesh.vertices))
    normals, named = normals_of(mesh), [pair for pair in lines(mesh) if pair not in mitres(4)]
    creased = with_creases(topology, np.array(named))
    rows = line_rows(mesh.vertices, normals, creased, WITH_GENTLE)
    assert {tuple(pair) for pair in topology.edges[rows].tolist()} == mitres(4)


@pytest.mark.parametrize("seed", range(3))
def test_they_go_with_the_mesh(seed):
    rng, mesh = np.random.default_rng(seed), frame(4, 0.2)
    order = rng.permutation(16)
    points, faces = np.empty((16, 3)), order[mesh.faces][rng.permutation(32)]
    points[order] = 7 * mesh.vertices @ rotation(rng).T + [1, 2, 3]
    expected = {tuple(sorted(order[list(pair)])) for pair in lines(mesh)}
    assert lines(Mesh(points, faces)) == expected
    mirrored = Mesh(points * [-1, 1, 1], faces[:, ::-1])
    assert lines(mirrored) == expected
