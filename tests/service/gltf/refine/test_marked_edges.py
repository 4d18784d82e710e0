"""Edges that smooth shading marks as hard stay sharp by default; flat shading marks none."""

import json

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from service.cli.commands import app
from tests.support.shared import shared_path


def creases_of(path, tmp_path, *options):
    """Creases of the control mesh, as the report of a refinement counts them."""
    report = tmp_path / "report.json"
    arguments = ["subdivide", str(path), "-o", str(tmp_path / "out.glb"), "--levels", "1"]
    done = CliRunner().invoke(app, [*arguments, "--report", str(report), *options])
    assert done.exit_code == 0, done.output
    return json.loads(report.read_text())["levels"][0]["edges"].get("crease", 0)


def test_a_hard_rim_of_a_smooth_shape_stays_sharp(tmp_path):
    """Its brim turns by 34 degrees, which no angle of `auto` finds."""
    path = shared_path("cases/obj_hard_edges_reference.glb")
    assert creases_of(path, tmp_path) > creases_of(path, tmp_path, "--crease", "off") == 0


@pytest.mark.parametrize("smooth", [True, False])
def test_flat_shading_marks_nothing(smooth, tmp_path):
    """A sphere that turns by less than 40 degrees, shaded smooth and flat."""
    sphere = trimesh.creation.icosphere(subdivisions=2)
    if not smooth:
        sphere.unmerge_vertices()
    normals = sphere.vertex_normals if smooth else np.repeat(sphere.face_normals, 3, axis=0)
    made = trimesh.Trimesh(sphere.vertices, sphere.faces, vertex_normals=normals, process=False)
    made.export(tmp_path / "sphere.glb", include_normals=True)
    assert creases_of(tmp_path / "sphere.glb", tmp_path) == 0
