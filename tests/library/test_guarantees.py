"""Promises of the construction, for any weights, on any mesh: of each rule over its base scheme."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Creases, Mesh, ModelError, catmull_clark, loop, parallel, pns
from pns_common.mesh.topology import EdgeClass
from pns_common.operator.formula import edge_inputs
from pns_common.refinement import control_level
from tests.support.control_points import refine
from tests.support.directed import NUMBERS, directed_model, directed_model_bytes
from tests.support.meshes import bent, bumpy_sphere, grid, manifolds, rotation, soups
from tests.support.networks import (
    Float64Model,
    default_model,
    huge_model,
    random_layers,
    random_model,
)
from tests.support.polygons import (
    SHAPES,
    correspondence,
    envelope,
    polygon_manifolds,
    polygon_soups,
    quad_grid,
    quad_star,
    renumbered,
    rows_of,
    uneven,
)
from train.certificates.double_precision import double_model
from train.certificates.learned_once import largest_turn

# The paper's rule, and that of directed edges over both schemes.
RULES = ["paper", "loop", "catmull-clark"]
LEARNED_ONCE = RULES[1:]
BASES = {"paper": loop(), "loop": loop(), "catmull-clark": catmull_clark()}
MODELS = {"paper": [random_model(0), random_model(1, 30.0), huge_model(2)]} | {
    rule: [directed_model(seed, scale, rule) for seed, scale in ((0, 0.3), (1, 3.0), (2, 300.0))]
    for rule in LEARNED_ONCE
}
# In double precision; the directed ones of weights so small that the vertices of faces are asked
# for less than a whole edge.
EXACT = {"paper": Float64Model(random_layers(3))} | {
    rule: double_model(directed_model(3, 0.3, rule), directed_model_bytes(3, 0.3, rule))
    for rule in LEARNED_ONCE
}
QUADS = polygon_manifolds() | manifolds()
MANIFOLDS = {"paper": manifolds(), "loop": manifolds(), "catmull-clark": QUADS}
ANY = {rule: soups() | manifolds() for rule in ("paper", "loop")}
ANY["catmull-clark"] = polygon_soups() | QUADS
ROUNDING = 1 + 1e-12
QUAD = np.array([[0, 1, 3], [1, 2, 0], [2, 3, 1], [3, 0, 2]])

every_rule = pytest.mark.parametrize("rule", RULES)
each_directed = pytest.mark.parametrize("rule", LEARNED_ONCE)
numbers, seeds = st.integers(0, 2), st.integers(0, 2**31)


def once(mesh, scheme, **options):
    return refine(mesh, scheme, 1, **options)


def sheet(rule, n, height=None):
    return (quad_grid if rule == "catmull-clark" else grid)(n, height)


# --- bounds ---------------------------------------------------------------------------------------


@every_rule
@given(
    data=st.data(),
    number=numbers,
    power=st.floats(-3, 3),
    length=st.sampled_from(["auto", 0.3, 1.0]),
)
def test_displacement_within_budget(rule, data, number, power, length):
    """‖x − x0‖ ≤ C h² / R at every new vertex, from the output positions; of
    the paper's at edges alone."""
    mesh, model, budget = data.draw(ANY[rule]), MODELS[rule][number], 10**power
    refined = once(mesh, pns(model, budget), creases=None, reference_length=length)
    plain, length = once(mesh, BASES[rule]).mesh.vertices, refined.report["reference_length"]
    if not length:
        np.testing.assert_array_equal(refined.mesh.vertices, plain)
        return
    bound, topology = envelope(mesh, budget, length)[: len(plain)], mesh.topology()
    apart = np.linalg.norm(refined.mesh.vertices - plain, axis=1)
    inside = np.ones(len(apart), dtype=bool)
    if rule == "paper":
        bound[: len(mesh.vertices)] = 0
        edges = topology.edge_class != EdgeClass.INTERIOR
        bound[len(mesh.vertices) :][edges] = 0
    else:
        # On a boundary h² is the mean over both spokes of the curve alone.
        inside[topology.edges[topology.edge_class == EdgeClass.BOUNDARY].reshape(-1)] = False
    size = np.abs(mesh.vertices).max()
    assert (apart <= ROUNDING * bound + 1e-14 * size)[inside].all()
    assert refined.ratio.max() <= ROUNDING


@each_directed
@given(data=st.data(), number=numbers, learned=st.booleans())
def test_no_child_folds(rule, data, number, learned):
    """Children stay within the card's angle of the base's, whose creases are the same."""
    mesh, scheme = data.draw(ANY[rule]), pns(MODELS[rule][number])
    ours = once(mesh, scheme, creases="auto" if learned else None)
    step, faces = ours.steps[0], ours.mesh.faces
    plain = step.level.base.place(step.level.points, step.level.topology, step.level.blocks)
    # Of quads the triangle at each corner.
    triangles = faces if faces.shape[1] == 3 else faces[:, QUAD].reshape(-1, 3)
    assert largest_turn(triangles, plain, ours.mesh.vertices) <= NUMBERS["fold_angle"] + 1e-4


@pytest.mark.parametrize("rule", [*LEARNED_ONCE, "tied by nothing"])
@given(data=st.data(), number=numbers, levels=st.integers(1, 3))
def test_the_limit_surface_is_within_the_reported_distance(rule, data, number, levels):
    untied = rule == "tied by nothing"
    model = default_model(number, 10.0**number) if untied else MODELS[rule][number]
    mesh = data.draw(ANY["loop" if untied else rule])
    ours, plain = (
        refine(mesh, scheme, levels, limit=True)
        for scheme in (pns(model), loop() if untied else BASES[rule])
    )
    apart = np.linalg.norm(ours.mesh.vertices - plain.mesh.vertices, axis=1).max()
    rounding = 1e-13 * np.abs(mesh.vertices).max()
    assert apart <= ours.report["limit_distance"] * ROUNDING + rounding
    assert ours.report["limit_distance"] <= ours.report["limit_distance_bound"] * ROUNDING
    assert ours.report["learned_levels"] == 1


@every_rule
@given(data=st.data(), number=numbers, levels=st.integers(1, 2))
def test_any_mesh_is_refined_and_reported(rule, data, number, levels):
    mesh = data.draw(ANY[rule])
    for scheme in (pns(MODELS[rule][number]), BASES[rule]):
        made = refine(mesh, scheme, levels)
        assert np.isfinite(made.mesh.vertices).all()
        first = len(mesh.corners) if rule == "catmull-clark" else 4 * mesh.face_count
        assert made.mesh.face_count == first * 4 ** (levels - 1)
        json.dumps(made.report, allow_nan=False)
        last = made.report["levels"][-1]
        assert (last["vertices"], last["faces"]) == (len(made.mesh.vertices), made.mesh.face_count)
        irregular = int((mesh.topology().edge_class == EdgeClass.IRREGULAR).sum())
        assert made.report["levels"][0]["edges"]["irregular"] == irregular
        assert all(0 <= level["normal_jump_max"] <= np.pi for level in made.report["levels"])
        learned = made.report["levels"][: made.report["learned_levels"]]
        assert len(learned) == (0 if scheme.rule is None else levels if rule == "paper" else 1)
        for level in learned:
            assert 0 <= level["proximity_ratio"]["max"] <= ROUNDING
            assert 0 <= level["gate"]["max"] <= 1


@every_rule
def test_a_budget_of_zero_is_the_base_scheme_bit_for_bit(rule):
    points, faces = SHAPES["cylinder"] if rule == "catmull-clark" else grid(5, bent)
    mesh = Mesh(uneven(points), faces)
    ours, plain = (refine(mesh, s, 2) for s in (pns(MODELS[rule][1], 0.0), BASES[rule]))
    np.testing.assert_array_equal(ours.mesh.vertices, plain.mesh.vertices)
    assert ours.ratio.max() == 0


def test_trained_levels_stay_within_the_envelope_at_every_level():
    report = refine(Mesh(*grid(7, bent)), pns(MODELS["paper"][1]), 4).report
    assert all(0 < level["proximity_ratio"]["max"] <= ROUNDING for level in report["levels"])


# --- symmetry -------------------------------------------------------------------------------------


def moved_apart(mesh, model, seed):
    """Return how far refining fails to commute with a random rigid motion, at each vertex."""
    rng = np.random.default_rng(seed)
    turn, shift = rotation(rng), rng.standard_normal(3)
    still = once(mesh, pns(model))
    after = once(Mesh(mesh.vertices @ turn.T + shift, rows_of(mesh)), pns(model))
    assert still.report["levels"][0].get("degenerate_frames", 0) == 0
    return np.linalg.norm(after.mesh.vertices - (still.mesh.vertices @ turn.T + shift), axis=1)


@every_rule
@given(data=st.data(), seed=seeds)
def test_commutes_with_rigid_motion(rule, data, seed):
    mesh = data.draw(MANIFOLDS[rule])
    assert moved_apart(mesh, EXACT[rule], seed).max() < (1e-12 if rule == "paper" else 1e-10)


@given(manifolds(), seeds)
def test_commutes_with_rigid_motion_through_a_model_file(mesh, seed):
    """The file reads single precision: a feature's last bit may move η by 1e-6 of the budget."""
    longest, model = np.linalg.norm(np.ptp(mesh.vertices, axis=0)), MODELS["paper"][0]
    length = once(mesh, loop()).report["reference_length"]
    allowed = 1e-12 + 1e-6 * model.card.budget / length * longest**2
    assert moved_apart(mesh, model, seed).max() <= allowed


@every_rule
@given(data=st.data(), power=st.integers(-20, 20))
def test_scaling_a_mesh_scales_the_result(rule, data, power):
    """By a power of two, which is exact in binary."""
    mesh, scheme, scale = data.draw(MANIFOLDS[rule]), pns(EXACT[rule]), 2.0**power
    small = refine(mesh, scheme, 2).mesh.vertices
    large = refine(Mesh(scale * mesh.vertices, rows_of(mesh)), scheme, 2).mesh.vertices
    np.testing.assert_allclose(large / scale, small, rtol=0, atol=1e-12)


@each_directed
@given(data=st.data(), seed=seeds)
def test_renumbering_permutes_the_output(rule, data, seed):
    mesh, scheme = data.draw(MANIFOLDS[rule]), pns(EXACT[rule])
    other, order = renumbered(mesh, seed)
    ours, theirs = (once(each, scheme).mesh.vertices for each in (mesh, other))
    where = correspondence(mesh, other, order)[: len(ours)]
    np.testing.assert_allclose(theirs[where], ours, rtol=0, atol=1e-10)


@each_directed
@given(data=st.data())
def test_a_mirrored_mesh_gives_the_mirrored_result(rule, data):
    mesh, scheme, flip = data.draw(MANIFOLDS[rule]), pns(EXACT[rule]), np.array([-1.0, 1, 1])
    other = Mesh(mesh.vertices * flip, [face[::-1] for face in rows_of(mesh)])
    ours, theirs = (once(each, scheme).mesh.vertices for each in (mesh, other))
    where = correspondence(mesh, other, np.arange(len(mesh.vertices)))[: len(ours)]
    np.testing.assert_allclose(theirs[where] * flip, ours, rtol=0, atol=1e-10)


def test_halving_the_reference_length_doubles_the_correction():
    mesh, scheme = Mesh(*bumpy_sphere()), pns(MODELS["paper"][0])
    base = once(mesh, loop()).mesh.vertices
    whole, half = (once(mesh, scheme, reference_length=r).mesh.vertices - base for r in (1.0, 0.5))
    np.testing.assert_allclose(half, 2 * whole, rtol=0, atol=1e-15)


# --- planes and borders ---------------------------------------------------------------------------


@every_rule
@pytest.mark.parametrize("number", range(3))
def test_planes_give_the_base_scheme(rule, number):
    """Exactly across the axes, δ = 0 anyhow; but for directed edges' borders, which are curves."""
    rng, scheme = np.random.default_rng(0), pns(MODELS[rule][number])
    quads = [quad_grid(7), quad_star(5, 3), SHAPES["pentagon"]]
    for points, faces in quads if rule == "catmull-clark" else [grid(7)]:
        points = points + 0.03 * rng.standard_normal(points.shape)
        for axis in (0, 1, 2, None):
            points[:, 2] = rng.uniform(-5, 5)
            turn = rotation(rng).T if axis is None else np.roll(np.eye(3), axis, axis=1)
            mesh = Mesh(points @ turn, faces)
            ours, plain = (refine(mesh, s, 1) for s in (scheme, BASES[rule]))
            inside, topology = np.ones(len(ours.mesh.vertices), dtype=bool), mesh.topology()
            if rule != "paper":
                inside[topology.edges[topology.sharp_edges].reshape(-1)] = False
                inside[len(points) + topology.sharp_edges.astype(np.int64)] = False
            apart = (ours.mesh.vertices - plain.mesh.vertices)[inside]
            assert np.abs(apart).max() <= (1e-15 if axis is None else 0)
            if rule == "paper":
                assert ours.ratio.max() * scheme.budget < 1e-28
                deep = (refine(mesh, s, 3).mesh.vertices for s in (scheme, loop()))
                np.testing.assert_allclose(*deep, rtol=0, atol=1e-14 if axis is None else 0)


def test_faces_without_area_do_not_disturb_a_plane():
    """A sliver inside a flat patch has no normal: the gate stays shut there."""
    vertices = np.array([[0, 0, 0], [2, 0, 0], [1, 1, 0], [1, 0, 0], [1, -1, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 3, 1], [0, 4, 3], [3, 4, 1]])
    mesh = Mesh(vertices, faces)
    refined = once(mesh, pns(MODELS["paper"][2]))
    np.testing.assert_array_equal(refined.mesh.vertices, once(mesh, loop()).mesh.vertices)
    assert refined.report["levels"][0]["degenerate_frames"] == 3


def test_zero_reference_length_switches_the_correction_off():
    mesh = Mesh(np.full((4, 3), 2.0), np.array([[0, 1, 2], [0, 2, 3]]))
    refined = once(mesh, pns(MODELS["paper"][0]))
    assert refined.report["reference_length"] == 0
    np.testing.assert_array_equal(refined.mesh.vertices, 2.0)


@given(soups(), numbers)
def test_degenerate_frames_are_rotations_and_features_finite(mesh, number):
    scheme = pns(MODELS["paper"][number])
    level = control_level(mesh, scheme, 1.0)
    at = edge_inputs(level, scheme.rule, level.topology.interior)
    frames = at.basis.reshape(-1, 3, 3)
    identity = np.einsum("eji,eki->ejk", frames, frames)
    np.testing.assert_allclose(identity, np.broadcast_to(np.eye(3), identity.shape), atol=1e-9)
    assert (np.linalg.det(frames) > 0).all()
    assert np.isfinite(at.features).all()


@each_directed
@pytest.mark.parametrize("number", range(3))
def test_tiles_that_share_a_border_meet(rule, number):
    """Nothing that is learned inside moves a border."""
    points, faces = sheet(rule, 7, bent)
    points[:, 0] += 0.05 * np.sin(5 * points[:, 1]) * (np.abs(points[:, 1]) < 0.9)
    centre = points[faces].mean(axis=1)[:, 0]
    halves = [faces[centre < 0], faces[centre > 0]]
    assert sum(map(len, halves)) == len(faces)
    made = []
    for half in halves:
        used = np.unique(half)
        mesh = Mesh(points[used], np.searchsorted(used, half))
        refined = refine(mesh, pns(MODELS[rule][number]), 2, 1.0, creases="auto").mesh
        made.append({tuple(point) for point in refined.vertices.tolist()})
    # The ends of what they share turn otherwise in each, and so do their neighbours' limits.
    assert len(made[0] & made[1]) >= 4 * 4 + 1


@each_directed
@pytest.mark.parametrize("limit", [False, True])
def test_an_open_sheet_keeps_its_corners_and_its_area(rule, limit):
    refined = refine(Mesh(*sheet(rule, 5)), pns(MODELS[rule][0]), 3, limit=limit).mesh
    corners = {(x, y, 0.0) for x in (-1.0, 1.0) for y in (-1.0, 1.0)}
    assert corners <= {tuple(point) for point in refined.vertices.tolist()}
    a, b, c = (refined.vertices[refined.triangulated().faces[:, k]] for k in range(3))
    assert np.cross(b - a, c - a)[:, 2].sum() / 2 == pytest.approx(4, rel=1e-12)


def test_marked_creases_stay_as_sharp_as_in_the_base_scheme():
    marked = Creases(np.array([[14, 15], [15, 16]]))
    ours = refine(Mesh(*grid(6, bent)), pns(MODELS["loop"][0]), 3, creases=marked)
    assert ours.report["levels"][-1]["edges"]["crease"] == 8


# --- the run --------------------------------------------------------------------------------------


@each_directed
@pytest.mark.parametrize("creases", ["auto", None])
def test_an_answer_that_is_no_number_is_an_error(rule, creases):
    with pytest.raises(ModelError, match="finite"):
        once(Mesh(*sheet(rule, 5, bent)), pns(directed_model(0, 1e25, rule)), creases=creases)


@every_rule
@pytest.mark.parametrize(("threads", "rows"), [(2, 8192), (3, 300), (1, 77)])
def test_bits_do_not_depend_on_threads_or_block_size(rule, threads, rows, monkeypatch):
    points, faces = sheet(rule, 20, bent)
    mesh, scheme = Mesh(uneven(points, by=0.005), faces), pns(MODELS[rule][0])
    expected = refine(mesh, scheme, 2, threads=1)
    monkeypatch.setattr(parallel, "LEAST_ROWS", rows)
    monkeypatch.setattr(parallel, "BLOCK_ROWS", rows)
    refined = refine(mesh, scheme, 2, threads=threads)
    np.testing.assert_array_equal(refined.mesh.vertices, expected.mesh.vertices)
    np.testing.assert_array_equal(refined.ratio, expected.ratio)
    assert refined.report == expected.report
