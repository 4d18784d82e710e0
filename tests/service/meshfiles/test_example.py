"""The example part: a closed surface that subdivision has something to do on."""

import io

import trimesh

from pns_common.mesh.topology import EdgeClass, build_topology
from service.meshes.weld import weld
from service.meshfiles.example import part, part_glb


def test_a_closed_manifold_of_genus_one_facing_outwards():
    triangles = part()
    welded = weld(triangles.vertices, triangles.faces)
    topology = build_topology(welded.faces, len(welded.points))
    assert (topology.edge_class == EdgeClass.INTERIOR).all()
    assert len(welded.points) - len(topology.edges) + len(welded.faces) == 0
    assert 1000 <= len(welded.faces) <= 2000
    assert trimesh.Trimesh(welded.points, welded.faces, process=False).volume > 0


def test_the_file_is_the_same_each_time_and_has_normals_uvs_and_a_material():
    data = part_glb()
    assert data == part_glb()
    mesh = trimesh.load_scene(io.BytesIO(data), file_type="glb", process=False).to_mesh()
    assert mesh.visual.material.name == "steel"
    assert len(mesh.visual.uv) == len(mesh.vertices)
    outwards = (mesh.vertex_normals[mesh.faces].mean(axis=1) * mesh.face_normals).sum(axis=1)
    assert (outwards > 0).all()
