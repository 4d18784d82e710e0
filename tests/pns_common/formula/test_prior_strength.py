"""Even meshes get more of the prior than others, in use everywhere alike."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pns_common import Mesh, load_model, loop, pns, refine
from pns_common.formula.prior_strength import ENOUGH, EVEN, prior_strength
from pns_common.geometry.side_lengths import SideLengths, measure_sides
from pns_common.refine_parts import refine_parts
from tests.support.kernels import by_arrays, by_kernels
from tests.support.meshes import bumpy_sphere, grid, icosphere
from tests.support.networks import scale_free_model
from tests.support.renumbering import renumbered

UNEVEN, TOP = 0.8, 1.2
SCHEME = pns(scale_free_model(prior_strength=UNEVEN, even_prior_strength=TOP))


def sides(variation, faces=1000):
    """Sides of mean length 1."""
    return SideLengths(faces, 3.0 * faces, 3.0 * faces * (1 + variation**2))


def test_from_even_to_uneven_it_falls_and_from_few_to_many_faces_it_rises():
    assert prior_strength(UNEVEN, TOP, sides(0.0)) == TOP
    assert prior_strength(UNEVEN, TOP, sides(EVEN[1] + 0.01)) == UNEVEN
    assert prior_strength(UNEVEN, TOP, sides(sum(EVEN) / 2)) == pytest.approx((UNEVEN + TOP) / 2)
    assert prior_strength(UNEVEN, TOP, sides(0.0, ENOUGH[0])) == UNEVEN
    halfway = sum(ENOUGH) // 2
    assert prior_strength(UNEVEN, TOP, sides(0.0, halfway)) == pytest.approx((UNEVEN + TOP) / 2)
    assert prior_strength(UNEVEN, TOP, SideLengths()) == UNEVEN


@given(st.floats(0, 2), st.floats(-1e-6, 1e-6), st.integers(1, 500))
def test_it_is_continuous(variation, more, faces):
    at, beside = (
        prior_strength(UNEVEN, TOP, sides(abs(value), faces))
        for value in (variation, variation + more)
    )
    assert min(UNEVEN, TOP) <= at <= max(UNEVEN, TOP)
    assert abs(at - beside) < 1e-5


def test_a_mesh_of_even_faces_gets_it_and_a_stretched_one_does_not():
    points, faces = icosphere(2)
    stretched = points * [1, 1, 6]
    for vertices, expected in ((points, TOP), (stretched, UNEVEN)):
        report = refine(Mesh(vertices, faces), SCHEME).report
        assert report["prior_strength"] == expected
    assert refine(Mesh(points, faces), loop()).report["prior_strength"] is None
    assert refine(Mesh(points, faces), pns(load_model("paper"))).report["prior_strength"] is None
    older = pns(scale_free_model(prior_strength=UNEVEN))
    assert refine(Mesh(points, faces), older).report["prior_strength"] == UNEVEN


def between():
    """A mesh whose s lies between both."""
    points, faces = icosphere(2)
    return Mesh(points * [1, 1, 2.7], faces)


def test_what_is_fitted_is_the_scheme_of_that_strength():
    mesh = between()
    measured = measure_sides(mesh.vertices, mesh.faces)
    strength = prior_strength(UNEVEN, TOP, measured)
    assert UNEVEN < strength < TOP
    fixed = pns(scale_free_model(prior_strength=strength))
    fitted = SCHEME.fitted(lambda: measured)
    assert fitted.prior_strength == strength
    assert fitted.fitted(lambda: pytest.fail("it is fitted")) is fitted
    for way in (by_arrays, by_kernels):
        made, expected = (way(mesh, 2, scheme=scheme) for scheme in (fitted, fixed))
        assert made.points.tobytes() == expected.points.tobytes()
    assert refine(mesh, SCHEME, 2).report["prior_strength"] == strength
    with_r = refine(mesh, fixed, 2).mesh.vertices
    np.testing.assert_array_equal(refine(mesh, SCHEME, 2).mesh.vertices, with_r)


def test_it_does_not_depend_on_numbers_place_size_or_handedness():
    mesh = between()
    turn = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    s = refine(mesh, SCHEME).report["prior_strength"]
    others = [
        Mesh(7.5 * mesh.vertices @ turn.T + 3, mesh.faces),
        Mesh(mesh.vertices, mesh.faces[:, ::-1]),
        renumbered(mesh, 0).mesh,
    ]
    for other in others:
        assert refine(other, SCHEME).report["prior_strength"] == pytest.approx(s, rel=1e-12)


def test_each_part_of_many_has_its_own():
    meshes = [between(), Mesh(*icosphere(1)), Mesh(*grid(9)), Mesh(*bumpy_sphere(1))]
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    union = Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([m.faces + v for m, v in zip(meshes, first, strict=False)]),
    )
    starts = np.cumsum([0, *(len(mesh.faces) for mesh in meshes)])
    made = refine_parts(union, starts, SCHEME, 1)
    assert made is not None
    alone = [refine(mesh, SCHEME) for mesh in meshes]
    assert [report["prior_strength"] for report in made.reports] == [
        part.report["prior_strength"] for part in alone
    ]
    assert len({report["prior_strength"] for report in made.reports}) >= 3
    corners = np.concatenate([part.mesh.vertices[part.mesh.faces] for part in alone])
    np.testing.assert_array_equal(made.mesh.vertices[made.mesh.faces], corners)
