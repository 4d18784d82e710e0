"""Skins: weights go through the stencil by joint, and every refined vertex still adds up to one."""

import numpy as np
import pytest

from pns_common import Mesh, loop, refine
from pns_common.carry.weights import whole_units
from pns_common.parallel import Blocks
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from service.stages import Stages
from tests.service.gltf.subdivided import subdivide
from tests.support.gltf import files
from tests.support.gltf.shapes import octahedron


def bound(joints, weights, **others):
    return octahedron(JOINTS_0=np.asarray(joints, dtype=np.uint8), WEIGHTS_0=weights, **others)


def by_joint(attributes, count, sets=1):
    """(N, joints) weights, sets added up."""
    total = np.zeros((len(attributes["POSITION"]), count))
    for number in range(sets):
        joints, weights = attributes[f"JOINTS_{number}"], attributes[f"WEIGHTS_{number}"]
        full = 1 if weights.dtype.kind == "f" else np.iinfo(weights.dtype).max
        rows = np.arange(len(total))[:, None]
        np.add.at(total, (rows, joints.astype(int)), weights.astype(float) / full)
    return total


def random_binding(seed, joints=3):
    rng = np.random.default_rng(seed)
    weights = np.zeros((6, 4))
    weights[:, :joints] = rng.dirichlet(np.ones(joints), 6)
    return np.tile([2, 0, 1, 0], (6, 1)), weights


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_weights_follow_the_positions_of_loop(levels):
    # Three joints in four slots: nothing is cut, so weights are Loop's columns, like x, y and z.
    joints, weights = random_binding(0)
    faces, attributes = files.primitive_of(subdivide([bound(joints, weights)], levels=levels).glb)
    shape = octahedron()
    columns = weights[:, [1, 2, 0]]
    expected = refine(Mesh(columns, shape["indices"]), loop(), levels).mesh
    by_row = by_joint(attributes, 3)
    np.testing.assert_allclose(by_row[faces], expected.vertices[expected.faces], atol=2e-7)


def test_a_joint_whose_weight_rounds_to_nothing_is_none():
    """A 255th of one vertex is less than half as much everywhere else."""
    joints, weights = np.tile([3, 0, 0, 0], (6, 1)), np.tile([255, 0, 0, 0], (6, 1))
    joints[0, 1], weights[0, :2] = 7, [254, 1]
    shape = bound(joints, files.Normalized(weights.astype(np.uint8)))
    _, attributes = files.primitive_of(subdivide([shape], levels=2).glb)
    assert not attributes["JOINTS_0"][attributes["WEIGHTS_0"] == 0].any()


@pytest.mark.parametrize("dtype", [np.float32, np.uint8, np.uint16])
@pytest.mark.parametrize("sets", [1, 2])
def test_weights_sum_to_one_exactly_and_unused_joints_are_zero(dtype, sets):
    rng = np.random.default_rng(0)
    shape = octahedron()
    for number in range(sets):
        shape[f"JOINTS_{number}"] = rng.integers(0, 40, (6, 4), dtype=np.uint8)
    weights = rng.dirichlet(np.ones(4 * sets), 6)
    full = 1 if dtype is np.float32 else np.iinfo(dtype).max
    if full > 1:
        weights = whole_units(weights, full, Blocks(1)).astype(dtype)
    for number in range(sets):
        part = weights[:, 4 * number : 4 * number + 4]
        shape[f"WEIGHTS_{number}"] = part if full == 1 else files.Normalized(part)
    result = subdivide([shape], levels=3)
    _, attributes = files.primitive_of(result.glb)
    joints = np.hstack([attributes[f"JOINTS_{n}"] for n in range(sets)])
    shares = np.hstack([attributes[f"WEIGHTS_{n}"] for n in range(sets)])
    assert (joints.dtype, shares.dtype) == (np.uint8, dtype)
    total = np.zeros(len(shares), dtype=np.float32 if full == 1 else np.int64)
    for column in shares.T:
        total = total + column
    assert (total == full).all()
    assert not joints[shares == 0].any()
    # No joint is named twice, and the heaviest come first.
    for row, weight in zip(joints, shares, strict=True):
        named = row[weight > 0]
        assert len(set(named.tolist())) == len(named)
        assert (weight[1:] <= weight[:-1]).all()
    changes = {change["what"]: change["count"] for change in result.report["changes"]}
    (lost,) = (what for what in changes if "lost their lightest joints" in what)
    assert 0 < changes[lost] <= len(shares)
    assert 0 < int(lost.split()[-5]) < 100


@pytest.mark.parametrize(
    ("joints", "weights", "shares"),
    [
        ([[0, 0, 0, 0], [1, 0, 0, 0]], [[1.0, 0, 0, 0], [1.0, 0, 0, 0]], [[1, 0], [0, 1]]),
        (
            [[0, 1, 0, 0], [0, 1, 0, 0]],
            [[0.75, 0.25, 0, 0], [0.625, 0.375, 0, 0]],
            [[0.75, 0.25], [0.625, 0.375]],
        ),
    ],
)
def test_lips_with_different_joints_or_weights_stay_two(joints, weights, shares):
    # Two coincident open sheets, each bound in its own way: welded, they would be one surface.
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    pair = {
        "POSITION": np.concatenate([points, points]),
        "indices": np.concatenate([faces, faces[:, ::-1] + 4]),
        "JOINTS_0": np.repeat(np.array(joints, dtype=np.uint8), 4, axis=0),
        "WEIGHTS_0": np.repeat(weights, 4, axis=0),
    }
    result = subdivide([pair])
    assert result.report["levels"][0]["edges"] == {"interior": 2, "boundary": 8, "irregular": 0}
    _, attributes = files.primitive_of(result.glb)
    assert np.unique(by_joint(attributes, 2), axis=0).tolist() == sorted(shares)


def test_the_order_of_slots_and_unused_joints_do_not_open_a_seam():
    shape = octahedron()
    halves = []
    for faces, joints, weights in (
        (shape["indices"][:4], [3, 5, 0, 0], [0.75, 0.25, 0, 0]),
        (shape["indices"][4:], [5, 9, 3, 3], [0.25, 0, 0.5, 0.25]),
    ):
        halves.append(bound(np.tile(joints, (6, 1)), np.tile(weights, (6, 1)), indices=faces))
    result = subdivide(halves)
    assert result.report["levels"][0]["edges"]["boundary"] == 0
    for number in (0, 1):
        _, attributes = files.primitive_of(result.glb, 0, number)
        assert (attributes["JOINTS_0"] == [3, 5, 0, 0]).all()
        assert (attributes["WEIGHTS_0"] == np.float32([0.75, 0.25, 0, 0])).all()


def test_joints_of_a_neighbour_widen_the_type():
    shape = octahedron()
    narrow = bound(np.zeros((6, 4)), np.tile([1.0, 0, 0, 0], (6, 1)), indices=shape["indices"][:4])
    wide = {**narrow, "indices": shape["indices"][4:]}
    # The vertices 4 and 5 belong to one half each.
    wide["JOINTS_0"] = np.zeros((6, 4), dtype=np.uint16)
    wide["JOINTS_0"][5, 0] = 300
    result = subdivide([narrow, wide])
    _, attributes = files.primitive_of(result.glb)
    assert attributes["JOINTS_0"].dtype == np.uint16
    assert 300 in attributes["JOINTS_0"]


@pytest.mark.parametrize("copies", [1, 2])
def test_primitives_of_one_and_of_two_sets_move_alike_where_they_meet(copies):
    rng, shape = np.random.default_rng(5), octahedron()
    weights = np.zeros((6, 8))
    # Each vertex has four joints, and its neighbours have others.
    for row in weights:
        row[rng.permutation(8)[:4]] = rng.dirichlet(np.ones(4))
    named = np.argsort(weights, axis=1)[:, ::-1].astype(np.uint8)
    heavy = np.take_along_axis(weights, named.astype(int), axis=1)
    # Along their common edge, and on a face that both have.
    one = octahedron(indices=shape["indices"][:5], JOINTS_0=named[:, :4], WEIGHTS_0=heavy[:, :4])
    two = octahedron(indices=shape["indices"][4:], JOINTS_0=named[:, :4], WEIGHTS_0=heavy[:, :4])
    two |= {"JOINTS_1": named[:, 4:], "WEIGHTS_1": heavy[:, 4:]}
    result = subdivide(*([[two, one]] * copies), levels=2)
    wide, narrow = (files.primitive_of(result.glb, copies - 1, place)[1] for place in (0, 1))
    places = {p.tobytes(): w for p, w in zip(narrow["POSITION"], by_joint(narrow, 8), strict=True)}
    rows = by_joint(wide, 8, sets=2)
    pairs = [
        (places[p.tobytes()], row)
        for p, row in zip(wide["POSITION"], rows, strict=True)
        if p.tobytes() in places
    ]
    assert len(pairs) == 16 + 10
    for ours, theirs in pairs:
        np.testing.assert_array_equal(ours, theirs)
    # Beyond there is room for all.
    assert ((rows > 0).sum(axis=1) > 4).any()
    lost = [c for c in result.report["changes"] if "lost their lightest joints" in c["what"]]
    assert [change["count"] >= len(pairs) // 2 for change in lost] == [True] * copies


@pytest.mark.parametrize("meshes", [1, 2])
@pytest.mark.parametrize("what", ["joints", "targets"])
def test_a_job_can_be_stopped_between_joints_and_between_targets(what, meshes):
    """A small file may have tens of thousands, of which each takes as long as a coordinate."""
    told = []
    for count in (1, 24):
        if what == "joints":
            shape = bound(np.arange(24).reshape(6, 4) % count, np.full((6, 4), 0.25))
        else:
            shape = octahedron(targets=[{"POSITION": octahedron()["POSITION"]}] * count)
        data, begun = files.glb(*[[shape]] * meshes), [""]
        stages = Stages(begins=begun.append, moves=lambda _, said=begun: said.append(said[-1]))
        subdivide_gltf(data, "glb", Options(scheme="loop"), None, Limits(), stages)
        told.append(begun.count("refine"))
    assert told[1] - told[0] >= (24 - 1) // 3
