"""Messy meshes by chance: few vertices and many faces make every irregularity there is."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pns_common.mesh.mesh import Mesh, clean
from pns_common.operator.scheme import loop
from pns_common.refinement import refine
from service.gltf.subdivide import subdivide_gltf
from service.meshes.weld import weld
from service.options import Limits, Options
from tests.support.gltf import files
from tests.support.networks import random_model

MODEL = random_model(0)
# Positions from a small grid: coincident vertices, flat faces and zero lengths are common.
POINT = st.tuples(*[st.integers(-1, 1)] * 3)


@st.composite
def primitives(draw):
    """A triangle primitive with attributes by chance."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.integers(3, 7))
    shape = {"POSITION": np.array(draw(st.lists(POINT, min_size=count, max_size=count)), float)}
    faces = rng.integers(0, count, (draw(st.integers(1, 12)), 3))
    if draw(st.booleans()):
        shape["indices"] = faces.astype(draw(st.sampled_from([np.uint8, np.uint16, np.uint32])))
    else:
        shape["POSITION"] = shape["POSITION"][faces.reshape(-1)]
    rows = len(shape["POSITION"])
    if draw(st.booleans()):
        shape["NORMAL"] = rng.integers(-1, 2, (rows, 3)).astype(float)
    if draw(st.booleans()):
        shape["TANGENT"] = rng.integers(-1, 2, (rows, 4)).astype(float)
    if draw(st.booleans()):
        shape["TEXCOORD_0"] = rng.random((rows, 2))
    if draw(st.booleans()):
        colours = rng.integers(0, 3, (rows, draw(st.sampled_from([3, 4]))), dtype=np.uint8)
        shape["COLOR_0"] = files.Normalized(colours)
    if draw(st.booleans()):
        shape["_ID"] = rng.integers(0, 3, (rows, 1), dtype=np.uint16)
    return shape


def corners_of(shape):
    indices = shape.get("indices", np.arange(len(shape["POSITION"]))).reshape(-1, 3)
    return indices.astype(np.int64)


@given(st.lists(primitives(), min_size=1, max_size=4), st.integers(1, 2))
def test_any_mesh_comes_back_refined(mesh, levels):
    data = files.glb(mesh)
    options = Options(levels=levels, scheme="loop")
    result = subdivide_gltf(data, "glb", options, None, Limits())

    # What the operator makes of the same triangles, put together here.
    starts = np.cumsum([0, *(len(shape["POSITION"]) for shape in mesh)])
    joined = weld(
        np.concatenate([shape["POSITION"] for shape in mesh]),
        np.concatenate([corners_of(s) + n for s, n in zip(mesh, starts, strict=False)]),
    )
    proper = [len({*face}) == 3 for face in joined.faces.tolist()]
    assert result.report["totals"]["faces"] == 4**levels * sum(proper)
    if not any(proper):
        return
    cleaned = clean(Mesh(joined.points, joined.faces)).mesh
    expected = refine(cleaned, loop(), levels).mesh
    wanted = expected.vertices.astype(np.float32)[expected.faces]
    shared = {frozenset(map(tuple, triangle)) for triangle in wanted.tolist()}

    tree, _ = files.unpack(result.glb)
    before, _ = files.unpack(data)
    for number, shape in enumerate(mesh):
        if tree["meshes"][0]["primitives"][number] == before["meshes"][0]["primitives"][number]:
            continue
        faces, attributes = files.primitive_of(result.glb, 0, number)
        for triangle in attributes["POSITION"][faces].tolist():
            assert frozenset(map(tuple, triangle)) in shared
        assert faces.max() == len(attributes["POSITION"]) - 1
        for name, values in attributes.items():
            # A mesh without normals gets some.
            assert name in {"NORMAL", *shape}
            assert np.isfinite(values).all()
        for name in {"NORMAL", "TANGENT"} & set(attributes):
            lengths = np.linalg.norm(attributes[name][:, :3], axis=1)
            np.testing.assert_allclose(lengths, 1, atol=1e-5)


@st.composite
def moving_primitives(draw):
    """A primitive by chance that may have a skin and morph targets, in any storage."""
    shape = draw(primitives())
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rows = len(shape["POSITION"])
    storage = draw(st.sampled_from([lambda w: w / 2, files.Normalized, lambda w: 0.0 * w]))
    for number in range(draw(st.integers(0, 2))):
        joints = rng.integers(0, 5, (rows, 4)).astype(draw(st.sampled_from([np.uint8, np.uint16])))
        weights = rng.integers(0, 3, (rows, 4), dtype=np.uint8)
        shape[f"JOINTS_{number}"] = joints
        shape[f"WEIGHTS_{number}"] = storage(weights)
    names = draw(st.sets(st.sampled_from(["POSITION", "NORMAL", "TANGENT", "COLOR_0"])))
    deltas = {name: rng.integers(-1, 2, (rows, 3)).astype(float) for name in sorted(names)}
    shape["targets"] = [deltas] * draw(st.integers(0, 2)) if deltas else []
    if not shape["targets"]:
        del shape["targets"]
    return shape


@given(
    st.lists(moving_primitives(), min_size=1, max_size=3),
    st.sampled_from(["off", "normals", "angle:30"]),
    st.sampled_from([0.0, 0.01]),
)
def test_any_skins_targets_and_creases_come_back_whole(mesh, crease, tolerance):
    """By the learned scheme, within its bound, and twice the same."""
    options = Options(crease=crease, weld_tolerance=tolerance, uv="smooth", diagnostics="full")
    data = files.glb(mesh)
    result = subdivide_gltf(data, "glb", options, MODEL, Limits())
    assert subdivide_gltf(data, "glb", options, MODEL, Limits()).glb == result.glb
    for level in result.report["levels"]:
        assert 0 <= level["proximity_ratio"]["max"] <= 1 + 1e-12
    before, after = (files.unpack(glb)[0]["meshes"][0]["primitives"] for glb in (data, result.glb))
    for number in range(len(mesh)):
        if after[number] == before[number]:
            continue
        _, attributes = files.primitive_of(result.glb, 0, number)
        targets = files.targets_of(result.glb, 0, number)
        given_targets = mesh[number].get("targets", [])
        assert [list(target) for target in targets] == [list(target) for target in given_targets]
        for values in (*attributes.values(), *(v for target in targets for v in target.values())):
            assert np.isfinite(values).all()
            assert len(values) == len(attributes["POSITION"])
        weights = [v for name, v in attributes.items() if name.startswith("WEIGHTS_")]
        if weights:
            rows = np.hstack(weights)
            full = 1 if rows.dtype.kind == "f" else 255
            assert set(rows.sum(axis=1, dtype=np.float64).tolist()) <= {0, full}
