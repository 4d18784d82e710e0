"""Meshes refined as parts of one are what they are alone, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pns_common import Mesh, crease_lines, load_model, loop, pns, refine
from pns_common.connectivity.disjoint_union import disjoint_faces
from pns_common.errors import MeshError, ParameterError
from pns_common.fused import kernels_available
from pns_common.levels.diagnostics import _p99
from pns_common.refine_parts import refine_parts
from tests.support.meshes import bumpy_sphere
from train.data.primitives import cylinder

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])

needs_kernels = pytest.mark.skipif(not kernels_available(), reason="numba is not installed")


def sheet(size: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A bumpy open sheet of 2 size² faces."""
    x, y = np.meshgrid(np.arange(size + 1.0), np.arange(size + 1.0))
    points = np.column_stack([x.ravel(), y.ravel(), rng.normal(scale=0.4, size=x.size)])
    low = (np.arange(size)[:, None] * (size + 1) + np.arange(size)).ravel()
    right, up = low + 1, low + size + 1
    return points, np.concatenate(
        [np.column_stack([low, right, up + 1]), np.column_stack([low, up + 1, up])]
    )


def parts_of(rng: np.random.Generator, count: int) -> list[Mesh]:
    meshes: list[Mesh] = []
    for number in range(count):
        if number % 3 == 0:
            points, faces = sheet(int(rng.integers(1, 6)), rng)
        else:
            points, faces = TETRAHEDRON * rng.uniform(0.01, 9) + rng.normal(size=3), FACES
            if number % 3 == 1 and number % 2:
                points, faces = bumpy_sphere(number)
            elif number % 3 == 1:
                # Two faces on one edge of a third, and a vertex of two fans.
                points = np.concatenate([points, rng.normal(size=(2, 3))])
                faces = np.concatenate([faces, [[0, 1, 4], [3, 4, 5]]])
        meshes.append(Mesh(points, faces))
    return meshes


def joined(meshes: list[Mesh]) -> tuple[Mesh, np.ndarray]:
    """One mesh of all, and where the faces of each begin."""
    starts = np.cumsum([0] + [len(mesh.faces) for mesh in meshes])
    points = np.concatenate([mesh.vertices for mesh in meshes])
    faces = disjoint_faces((mesh.faces, len(mesh.vertices)) for mesh in meshes)
    return Mesh(points, faces), starts


@needs_kernels
@pytest.mark.parametrize("name", ["paper", "general", None])
@pytest.mark.parametrize(("levels", "reference_length"), [(1, 1.0), (3, "auto")])
def test_each_part_is_what_it_is_alone(
    name: str | None, levels: int, reference_length: float | str
) -> None:
    scheme = loop() if name is None else pns(load_model(name))
    meshes = parts_of(np.random.default_rng(3), 12)
    whole, starts = joined(meshes)
    made = refine_parts(whole, starts, scheme, levels, reference_length)
    assert made is not None
    shares = np.split(made.mesh.faces, starts[1:-1] * 4**levels)
    for mesh, report, share in zip(meshes, made.reports, shares, strict=True):
        alone = refine(mesh, scheme, levels, reference_length)
        own = np.unique(share)
        assert np.array_equal(made.mesh.vertices[own], alone.mesh.vertices)
        assert np.array_equal(np.searchsorted(own, share), alone.mesh.faces)
        assert np.array_equal(made.ratio[own], alone.ratio)
        assert np.array_equal(made.gate[own], alone.gate)
        assert report == alone.report


@needs_kernels
def test_each_part_is_put_on_its_own_limit_surface() -> None:
    scheme = pns(load_model("paper"))
    meshes = parts_of(np.random.default_rng(5), 12)
    whole, starts = joined(meshes)
    made = refine_parts(whole, starts, scheme, 2, limit=True)
    assert made is not None
    assert made.normals is not None
    for mesh, share in zip(meshes, np.split(made.mesh.faces, starts[1:-1] * 16), strict=True):
        alone = refine(mesh, scheme, 2, limit=True)
        own = np.unique(share)
        assert np.array_equal(made.mesh.vertices[own], alone.mesh.vertices)
        assert np.array_equal(made.normals[own], alone.normals)


@needs_kernels
def test_zeros_of_normals_have_the_sign_that_they_have_alone() -> None:
    """A closed part beside one with a boundary."""
    vertices = np.concatenate([np.eye(3), -np.eye(3)])[[0, 3, 1, 4, 2, 5]]
    upper = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4]]
    lower = [[2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    alone = Mesh(vertices, np.array(upper + lower))
    mesh, starts = joined([alone, Mesh(TETRAHEDRON[:3] + 5, np.array([[0, 1, 2]]))])
    whole = refine_parts(mesh, starts, loop(), limit=True)
    assert whole is not None
    single = refine(alone, loop(), limit=True)
    assert whole.normals is not None
    assert single.normals is not None
    rows = np.empty(len(single.normals), dtype=np.int64)
    rows[single.mesh.faces] = whole.mesh.faces[: len(single.mesh.faces)]
    np.testing.assert_array_equal(np.signbit(whole.normals[rows]), np.signbit(single.normals))


@needs_kernels
def test_creases_stay_with_their_parts() -> None:
    meshes = parts_of(np.random.default_rng(4), 6)
    whole, starts = joined(meshes)
    crease = meshes[0].faces[0, :2]
    made = refine_parts(whole, starts, loop(), 2, creases=crease[None])
    assert made is not None
    alone = refine(meshes[0], loop(), 2, creases=crease[None])
    assert made.reports[0] == alone.report
    assert made.reports[1] == refine(meshes[1], loop(), 2).report


@pytest.mark.parametrize("starts", [[0], [0, 5], [0, 4, 4, 8], [1, 4, 8], [0, 3, 8]])
def test_parts_that_are_none_are_refused(starts: list[int]) -> None:
    whole, _ = joined([Mesh(TETRAHEDRON, FACES), Mesh(TETRAHEDRON, FACES)])
    with pytest.raises(ParameterError, match="part_faces"):
        refine_parts(whole, np.array(starts), loop())


@needs_kernels
def test_a_part_that_grows_beyond_all_bounds_is_refused() -> None:
    whole, starts = joined([Mesh(TETRAHEDRON, FACES), Mesh(1e74 * TETRAHEDRON, FACES)])
    with pytest.raises(MeshError):
        refine_parts(whole, starts, pns(load_model("paper"), 1e3))


def test_a_part_of_no_size_goes_alone() -> None:
    # Its R is 0, which the compiled kernels leave to the others.
    whole, starts = joined([Mesh(TETRAHEDRON, FACES), Mesh(0 * TETRAHEDRON, FACES)])
    assert refine_parts(whole, starts, pns(load_model("paper"))) is None


@given(st.integers(1, 400), st.integers(0, 2**32), st.integers(-9, 9))
@settings(max_examples=60, deadline=None)
def test_the_percentile_is_numpys(count: int, seed: int, power: int) -> None:
    values = np.random.default_rng(seed).random(count) * 10.0**power
    assert _p99(values) == float(np.percentile(values, 99))


@needs_kernels
def test_creases_that_nothing_moves_are_reported_alike_beside_creases_that_are_pushed():
    """All edges of an octahedron end at corners; the rims of a cylinder are round."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    faces = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2]])
    faces = np.concatenate([faces, [[1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]])
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    round_, rims = cylinder(12), crease_lines(cylinder(12))
    meshes, creases = [Mesh(axes, faces), round_], [edges, rims]
    together = Mesh(
        np.concatenate([axes, round_.vertices + np.array([9, 0, 0])]),
        np.concatenate([faces, round_.faces + len(axes)]),
    )
    of_parts = np.cumsum([0, len(faces), len(round_.faces)])
    named = np.concatenate([edges, rims + len(axes)])
    made = refine_parts(together, of_parts, pns(load_model()), 1, creases=named)
    for part, (mesh, own) in enumerate(zip(meshes, creases, strict=True)):
        alone = refine(mesh, pns(load_model()), 1, creases=own).report
        for name in ("limit_distance", "limit_distance_bound"):
            assert made.reports[part][name] == pytest.approx(alone[name], rel=1e-9)
