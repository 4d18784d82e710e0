"""How far a level's rules read, and how many rings a piece needs for that."""

from dataclasses import replace

import numpy as np
import pytest

from pns_common import Creases, Mesh, ParameterError, crease_lines, load_model, loop, pns, refine
from pns_common.crease_lines import turns_of_parts
from pns_common.features.edge_features import FEATURE_SETS
from pns_common.features.ring_features import RING_FEATURE_SETS
from pns_common.pieces.halo import LINES_REACH, ROWS_REACH, halo_rings, reach
from pns_common.runtimes.onnx_model import bundled_models, model_from_bytes
from tests.support.meshes import bumpy_sphere
from tests.support.networks import (
    CARD,
    VERTEX_CARD,
    perceptron_bytes,
    random_layers,
    two_perceptrons_bytes,
)
from tests.support.pieces import adjacent
from tests.support.schemes import along_normal
from train.data.primitives import cylinder

SCHEMES = {"loop": loop(), **{name: pns(load_model(name)) for name in bundled_models()}}


def of_edges(name):
    """A scheme whose edges see a feature set; its old vertices are Loop's."""
    layers = random_layers(0, (FEATURE_SETS[name].count, 16, 3))
    card = replace(CARD, features=name, orientation="symmetric")
    return pns(model_from_bytes(perceptron_bytes(layers, card=card), name))


def of_vertices(name):
    """A scheme whose old vertices see a feature set."""
    edges = random_layers(0, (FEATURE_SETS[VERTEX_CARD.features].count, 16, 3))
    vertices = random_layers(1, (RING_FEATURE_SETS[name].count, 16, 3))
    card = replace(VERTEX_CARD, vertex_features=name)
    return pns(model_from_bytes(two_perceptrons_bytes(edges, vertices, card=card), name))


SETS = {name: of_edges(name) for name in FEATURE_SETS}
SETS |= {name: of_vertices(name) for name in RING_FEATURE_SETS}


def test_rings_that_a_piece_needs():
    needed = {
        name: [halo_rings(scheme, n) for n in (1, 2, 3, 6)] for name, scheme in SCHEMES.items()
    }
    assert needed == {
        "loop": [2, 2, 2, 2],
        "paper": [2, 2, 2, 2],
        "signed": [3, 4, 4, 4],
        "full": [3, 4, 4, 4],
        "general": [4, 4, 4, 4],
    }


@pytest.mark.parametrize("name", SCHEMES | SETS)
def test_a_level_reads_as_far_as_its_reach_and_no_farther(name):
    scheme = (SCHEMES | SETS)[name]
    points, faces = bumpy_sphere(3, 2)
    before = refine(Mesh(points, faces), scheme, 1, 1.0).mesh
    moved = points.copy()
    moved[0] *= 1.001
    after = refine(Mesh(moved, faces), scheme, 1, 1.0).mesh
    changed = (before.vertices != after.vertices).any(axis=1)[before.faces].any(axis=1)
    parents = changed.reshape(-1, 4).any(axis=1)
    at_vertex = (faces == 0).any(axis=1)
    assert not (parents & ~adjacent(faces, at_vertex, reach(scheme, 0))).any()
    assert (parents & ~adjacent(faces, at_vertex, reach(scheme, 0) - 1)).any()


def dented_bend():
    """A sheet folded along a straight line, in uneven columns, with a dent in the line.

    Beside the line two vertices are one, 68, in which three edges end that begin on it.
    """
    columns, far = np.arange(16), np.arange(7) - 3
    along, across = np.tile(columns + (columns % 2 == 0) / 2, 7), np.repeat(far, 16)
    points = np.stack([along, np.minimum(across, 0), -np.maximum(across, 0)], axis=1)
    points[3 * 16 + 11, 2] = -0.8
    points[68] = points[68:70].mean(axis=0)
    here = (np.arange(6)[:, None] * 16 + columns[:-1]).reshape(-1)
    corners = here, here + 1, here + 17, here, here + 17, here + 16
    faces = np.stack(corners, axis=1).reshape(-1, 3)
    faces[faces == 69] = 68
    return Mesh(points, faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)])


def test_a_held_edge_is_known_within_the_reach_of_lines_and_no_nearer():
    mesh, face, edge = dented_bend(), [51, 68, 67], [51, 68]
    at_face = (mesh.faces == face).all(axis=1)
    assert at_face.sum() == 1

    def is_held(rings):
        near = Mesh(mesh.vertices, mesh.faces[adjacent(mesh.faces, at_face, rings)])
        return edge in crease_lines(near, 66.0).tolist()

    whole = edge in crease_lines(mesh, 66.0).tolist()
    assert is_held(LINES_REACH) == whole
    assert is_held(LINES_REACH - 1) != whole


def test_the_reach_of_rows_tells_what_turns_alone_and_no_nearer_one():
    mesh, lines = cylinder(12, rows=4), Creases(line_angle=66.0, edged_angle=21.0)
    owner = np.digitize(mesh.vertices[mesh.faces].mean(axis=1) @ [1, 2, 3], [-1, 0, 1])

    def counted(rings):
        total = np.zeros(2, dtype=np.int64)
        for part in range(4):
            near = adjacent(mesh.faces, owner == part, rings)
            own = (owner[near] == part).astype(np.int64)
            total += turns_of_parts(mesh.vertices, mesh.faces[near], lines, own, 2)[1]
        return total.tolist()

    assert counted(ROWS_REACH) == [24, 24]  # the rims; the walls' 36 are in rows
    assert counted(ROWS_REACH - 1) != [24, 24]


def test_a_scheme_of_unknown_rules_has_no_known_reach():
    with pytest.raises(ParameterError, match="scheme"):
        halo_rings(along_normal(0.1), 1)
