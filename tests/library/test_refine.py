"""refine: the report, determinism, and levels that compose."""

import json

import numpy as np
import pytest

import pns_common
from pns_common import Mesh, MeshError, loop, pns, refine, refine_many
from pns_common.mesh.topology import build_topology
from tests.support.meshes import bent, bow_tie, bumpy_sphere, grid, three_pages
from tests.support.networks import random_model

MODEL = random_model(0, scale=30.0)


def test_coordinates_that_outgrow_the_operator_are_an_error():
    vertices, faces = bumpy_sphere(0, subdivisions=0)
    for budget, levels in [(1e80, 1), (1e308, 1), (1e70, 3)]:
        with pytest.raises(MeshError, match="too large"):
            refine(Mesh(vertices, faces), pns(MODEL, budget), levels)


def test_report_is_json_and_counts_what_was_made():
    vertices, faces = grid(5, bent)
    refined = refine(Mesh(vertices, faces), pns(MODEL), 2)
    report = json.loads(json.dumps(refined.report))
    assert report["scheme"] == "pns"
    assert report["model_hash"] == MODEL.hash
    first, second = report["levels"]
    assert first["faces"] == 4 * len(faces)
    assert second["faces"] == len(refined.mesh.faces)
    assert second["vertices"] == len(refined.mesh.vertices)
    assert first["edges"] == {"interior": 40, "boundary": 16, "irregular": 0}
    edges = len(refined.ratio) - first["vertices"]
    interior = build_topology(
        refine(Mesh(vertices, faces), loop(), 1).mesh.faces, first["vertices"]
    ).interior
    ratio = refined.ratio[first["vertices"] :]
    assert len(ratio) == edges
    assert second["proximity_ratio"]["max"] == ratio[interior].max()
    assert second["proximity_ratio"]["mean"] == pytest.approx(ratio[interior].mean(), rel=1e-12)
    assert second["gate"]["max"] == refined.gate.max()
    assert (refined.ratio[: first["vertices"]] == 0).all()


def test_irregularities_are_counted_not_refused():
    pages = refine(Mesh(*three_pages()), pns(MODEL)).report
    assert pages["levels"][0]["edges"] == {"interior": 0, "boundary": 6, "irregular": 1}
    assert pages["multi_fan_vertices"] == 2
    assert refine(Mesh(*bow_tie()), loop()).report["multi_fan_vertices"] == 1


def test_more_levels_give_a_finer_mesh_of_one_surface():
    mesh = Mesh(*bumpy_sphere())
    coarse = refine(mesh, "pns", 1, creases=None).mesh.vertices
    fine = refine(mesh, "pns", 3, creases=None).mesh.vertices
    np.testing.assert_allclose(fine[: len(coarse)], coarse, rtol=0, atol=1e-12)


def test_many_meshes_are_refined_as_each_alone():
    meshes = [Mesh(*bumpy_sphere(seed)) for seed in range(3)]
    together = refine_many([(mesh, None) for mesh in meshes], pns(MODEL), 2)
    for mesh, refined in zip(meshes, together, strict=True):
        alone = refine(mesh, pns(MODEL), 2, creases=None)
        np.testing.assert_array_equal(refined.mesh.vertices, alone.mesh.vertices)
        assert refined.report == alone.report


def test_progress_never_falls_and_ends_with_all_faces():
    told = []
    mesh = Mesh(*bumpy_sphere(0, subdivisions=2))
    refine(mesh, pns(MODEL), 3, limit=True, progress=lambda *faces: told.append(faces))
    made = [faces for faces, _ in told]
    total = sum(len(mesh.faces) * 4**level for level in (1, 2, 3))
    assert made == sorted(made)
    assert told[-1] == (total, total)


def test_an_exception_of_progress_ends_the_refinement():
    def stop(*faces):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        refine(Mesh(*bumpy_sphere()), loop(), progress=stop)


def test_two_calls_with_the_first_ones_length_are_two_levels():
    mesh = Mesh(*bumpy_sphere())
    once = refine(mesh, pns(MODEL), 1, limit=False)
    length = once.report["reference_length"]
    again = refine(once.mesh, pns(MODEL), 1, length)
    both = refine(mesh, pns(MODEL), 2)
    np.testing.assert_array_equal(again.mesh.vertices, both.mesh.vertices)


def test_public_names_exist():
    assert all(hasattr(pns_common, name) for name in pns_common.__all__)
