"""Materials, creases, marks, shading and modifiers stay; what is lost is named."""

import math

import bpy
import numpy as np
import pytest
from mathutils.kdtree import KDTree
from scene import (
    chosen,
    cube,
    evaluated,
    grid,
    numbers,
    placed,
    points_of,
    refined,
)


def test_materials_stay_on_their_faces():
    obj = cube()
    for name in "abc":
        obj.data.materials.append(bpy.data.materials.new(name))
    for number, face in enumerate(obj.data.polygons):
        face.material_index = number % 3
    obj.material_slots[1].link = "OBJECT"
    obj.material_slots[1].material = bpy.data.materials.new("own")
    new = refined(obj, levels=1)
    assert [s.material.name for s in new.material_slots] == ["a", "own", "c"]
    assert [s.link for s in new.material_slots] == ["DATA", "OBJECT", "DATA"]
    materials = numbers(new.data.polygons, "material_index").astype(int).ravel()
    np.testing.assert_array_equal(materials, np.repeat(np.arange(6) % 3, 4))


def test_a_crease_of_one_stays_sharp_for_good():
    obj = cube()
    crease = obj.data.attributes.new("crease_edge", "FLOAT", "EDGE")
    crease.data.foreach_set("value", np.ones(12, np.float32))
    new = refined(obj, levels=3, scheme="LOOP")
    # All edges of a cube are sharp, so its corners stay and its sides are flat.
    np.testing.assert_allclose(points_of(new.data)[:8], points_of(obj.data), atol=1e-6)
    assert np.isclose(np.abs(points_of(new.data)), 1, atol=1e-6).any(axis=1).all()
    assert (numbers(new.data.attributes["crease_edge"].data, "value") == 1).sum() == 12 * 8


def test_a_crease_that_wears_off_lies_between_smooth_and_sharp():
    heights = []
    for value in (0.0, 0.2, 0.3, 0.4, 1.0):
        obj = cube(f"cube {value}")
        crease = obj.data.attributes.new("crease_edge", "FLOAT", "EDGE")
        crease.data.foreach_set("value", np.full(12, value, np.float32))
        new = refined(obj, levels=2, scheme="LOOP")
        heights.append(np.linalg.norm(points_of(new.data)[0]))
    assert heights == sorted(heights)
    assert len(set(np.round(heights, 4))) == 5


def test_what_is_left_of_a_crease_stands_on_the_halves():
    obj = cube()
    crease = obj.data.attributes.new("crease_edge", "FLOAT", "EDGE")
    # Sharp for 3.6 levels.
    crease.data.foreach_set("value", np.r_[0.6, np.zeros(11)].astype(np.float32))
    values = numbers(refined(obj, levels=2).data.attributes["crease_edge"].data, "value").ravel()
    assert values[values > 0] == pytest.approx([math.sqrt(0.16)] * 4)


def test_edges_of_large_angles_are_sharp_on_request():
    obj = cube()
    new = refined(obj, levels=2, crease_angle=math.radians(60), scheme="LOOP")
    np.testing.assert_allclose(points_of(new.data)[:8], points_of(obj.data), atol=1e-6)
    blunt = refined(obj, levels=2, crease_angle=math.radians(91), scheme="LOOP")
    assert np.linalg.norm(points_of(blunt.data)[0]) < 1.2


@pytest.mark.parametrize(("flat", "left"), [(False, 12), (True, 0)])
def test_edges_marked_sharp_are_kept_where_the_mesh_is_shaded_smooth(flat, left):
    obj = grid(6)
    obj.data.polygons.foreach_set("use_smooth", np.full(36, not flat))
    for edge in obj.data.edges:
        edge.use_edge_sharp = all(v // 7 == 3 for v in edge.vertices)
    made = refined(obj, levels=1).data.attributes.get("crease_edge")
    # Sharp for six levels, of which five are left: 10 c² = 5.
    kept = 0 if made is None else np.isclose(numbers(made.data, "value"), math.sqrt(0.5)).sum()
    assert kept == left


def test_seams_sharp_edges_and_marks_stay_on_their_edges():
    obj = cube()
    for edge in (0, 5):
        obj.data.edges[edge].use_seam = True
        obj.data.edges[edge].use_edge_sharp = True
    mark_for_freestyle(obj.data, (0, 5))
    marked = {tuple(obj.data.edges[i].vertices) for i in (0, 5)}
    new = refined(obj, levels=1, crease_lines=False, scheme="LOOP").data
    marks = [[e.use_seam for e in new.edges], [e.use_edge_sharp for e in new.edges]]
    for mark in [*marks, freestyle_marks(new)]:
        edges = [tuple(e.vertices) for e, on in zip(new.edges, mark, strict=True) if on]
        assert len(edges) == 4
        assert {min(e) for e in edges} <= {v for pair in marked for v in pair}


def mark_for_freestyle(mesh, edges):
    """Mark edges for Freestyle, which is an attribute since 5.0."""
    if hasattr(mesh.edges[0], "use_freestyle_mark"):
        for edge in edges:
            mesh.edges[edge].use_freestyle_mark = True
        return
    marks = mesh.attributes.new("freestyle_edge", "BOOLEAN", "EDGE")
    for edge in edges:
        marks.data[edge].value = True


def freestyle_marks(mesh):
    """Return whether edges are marked for Freestyle."""
    if hasattr(mesh.edges[0], "use_freestyle_mark"):
        return [e.use_freestyle_mark for e in mesh.edges]
    return [row.value for row in mesh.attributes["freestyle_edge"].data]


@pytest.mark.parametrize("levels", [1, 2])
def test_what_is_in_hidden_faces_is_hidden(levels):
    obj = grid(3)
    mesh = obj.data
    mesh.polygons.foreach_set("hide", [i in (0, 1, 3, 4) for i in range(9)])
    for rows, hidden in zip((mesh.edges, mesh.vertices), hidden_around(mesh), strict=True):
        rows.foreach_set("hide", hidden)
    new = refined(obj, levels=levels).data
    edges, points = hidden_around(new)
    assert [e.hide for e in new.edges] == edges
    assert [v.hide for v in new.vertices] == points
    assert 0 < sum(edges) < len(edges)


def hidden_around(mesh):
    """Return masks of the edges, and of the vertices, that have hidden faces alone."""
    edges, points = [True] * len(mesh.edges), [True] * len(mesh.vertices)
    for face in mesh.polygons:
        for corner in [] if face.hide else face.loop_indices:
            edges[mesh.loops[corner].edge_index] = False
            points[mesh.loops[corner].vertex_index] = False
    return edges, points


def test_flat_faces_become_smooth_ones_between_sharp_edges():
    obj = cube()
    obj.data.polygons.foreach_set("use_smooth", [i == 2 for i in range(6)])
    new = refined(obj, levels=1).data
    assert all(p.use_smooth for p in new.polygons)
    assert sum(e.use_edge_sharp for e in new.edges) == 24
    # A side has one normal up to its corners.
    normals = numbers(new.corner_normals, "vector", 3)
    assert (np.abs(normals).max(axis=1) > 0.98).all()
    # Without edges to keep, a face that is flat among smooth ones stays flat.
    kept = refined(obj, levels=1, crease_lines=False).data
    assert [p.use_smooth for p in kept.polygons] == [8 <= p.index < 12 for p in kept.polygons]


def test_normals_follow_a_rig():
    """They are the limit surface's, and turn with the bones."""
    obj = grid(4)
    obj.vertex_groups.new(name="Bone").add(range(25), 1.0, "REPLACE")
    armature = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(armature)
    chosen(armature)
    bpy.ops.object.mode_set(mode="EDIT")
    armature.data.edit_bones.new("Bone").tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    obj.modifiers.new("Armature", "ARMATURE").object = armature
    new = refined(obj, levels=1)
    still = numbers(evaluated(new).corner_normals, "vector", 3)
    pose = armature.pose.bones["Bone"]
    pose.rotation_mode, pose.rotation_euler = "XYZ", (math.pi / 2, 0, 0)
    bpy.context.view_layer.update()
    turned = numbers(evaluated(new).corner_normals, "vector", 3)
    matrix = np.array(pose.matrix.to_3x3()) @ np.array(pose.bone.matrix_local.to_3x3()).T
    np.testing.assert_allclose(turned, still @ matrix.T, atol=0.02)
    assert np.abs(turned - still).max() > 0.5


def test_an_edited_mesh_is_refined_as_it_is_edited():
    obj = cube()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.resize(value=(3, 3, 3))
    assert bpy.ops.object.pns_refine(levels=1) == {"FINISHED"}
    assert bpy.context.mode == "OBJECT"
    assert np.abs(points_of(bpy.context.object.data)).max() > 2.9
    assert np.abs(points_of(obj.data)).max() == 3


def test_custom_normals_are_rebuilt():
    obj = grid(4)
    obj.data.normals_split_custom_set([(0, 0, 1)] * len(obj.data.loops))
    assert obj.data.has_custom_normals
    new = refined(obj)
    assert new.data.has_custom_normals
    normals = numbers(new.data.corner_normals, "vector", 3)
    # Blender keeps two angles for each, and takes those whose cosine is above 1 − 10⁻⁴ for none.
    np.testing.assert_allclose(normals, np.tile([0, 0, 1], (len(normals), 1)), atol=np.sqrt(2e-4))
    assert any("normals" in note for note in notes(new))


def test_modifiers_parents_collections_and_properties_are_kept():
    obj = cube()
    parent = bpy.data.objects.new("Parent", None)
    other = bpy.data.collections.new("Other")
    bpy.context.scene.collection.children.link(other)
    bpy.context.scene.collection.objects.link(parent)
    other.objects.link(obj)
    obj.parent, obj["tag"], obj.data["mesh tag"] = parent, 3, 4
    obj.modifiers.new("Bend", "SIMPLE_DEFORM").angle = 1.25
    obj.constraints.new("COPY_LOCATION")
    new = refined(obj)
    assert new.parent == parent
    assert set(new.users_collection) == set(obj.users_collection)
    assert new.modifiers["Bend"].angle == 1.25
    assert len(new.constraints) == 1
    assert (new["tag"], new.data["mesh tag"]) == (3, 4)


def test_an_armature_bends_the_result():
    obj = grid(8)
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    chosen(rig)
    bpy.ops.object.mode_set(mode="EDIT")
    bone = rig.data.edit_bones.new("Bone")
    bone.tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    group = obj.vertex_groups.new(name="Bone")
    for vertex in obj.data.vertices:
        group.add([vertex.index], 1.0, "REPLACE")
    obj.modifiers.new("Armature", "ARMATURE").object = rig
    new = refined(obj)
    rig.pose.bones["Bone"].location = (0, 2, 0)
    bpy.context.view_layer.update()
    moved = points_of(evaluated(new)) - points_of(new.data)
    np.testing.assert_allclose(moved, np.tile([0, 0, 2], (len(moved), 1)), atol=1e-5)


@pytest.mark.parametrize("boundary", ["ALL", "PRESERVE_CORNERS"])
def test_without_correction_quads_are_those_of_subdivision_surface(boundary):
    """Suzanne, with a sharp edge and sharp points, against Blender's own OpenSubdiv."""
    bpy.ops.mesh.primitive_monkey_add(calc_uvs=True)
    obj = bpy.context.object
    crease = obj.data.attributes.new("crease_edge", "FLOAT", "EDGE")
    crease.data[0].value = 1
    # Sharp at no level, at a part of one, at more, and for good.
    sharp = np.resize([0, 0.25, 0, 0.35, 0.6, 1, 0], len(obj.data.vertices)).astype(np.float32)
    obj.data.attributes.new("crease_vert", "FLOAT", "POINT").data.foreach_set("value", sharp)
    modifier = obj.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels, modifier.use_limit_surface, modifier.boundary_smooth = 2, False, boundary
    own = evaluated(obj).copy()
    obj.modifiers.clear()
    new = refined(obj, levels=2, budget=0.0, border=boundary, limit=False).data
    assert [len(p.vertices) for p in new.polygons] == [4] * len(own.polygons)
    (places, uv), (expected, uv_expected) = corners_of(new), corners_of(own)
    left = numbers(new.attributes["crease_vert"].data, "value")[: len(sharp), 0]
    np.testing.assert_allclose(
        left, np.sqrt(np.clip(sharp**2 - 0.2, 0, 1) + 0.2 * (sharp == 1)), atol=1e-6
    )
    tree = KDTree(len(expected))
    for number, place in enumerate(expected):
        tree.insert(place, number)
    tree.balance()
    _, nearest, apart = zip(*(tree.find(place) for place in places), strict=True)
    assert max(apart) < 1e-5
    np.testing.assert_allclose(uv, uv_expected[list(nearest)], atol=1e-4)


def corners_of(mesh):
    """Each corner's place, a little towards the middle of its face, and its point of the map."""
    points = points_of(mesh)[numbers(mesh.loops, "vertex_index").astype(int).ravel()]
    middle = points.reshape(-1, 4, 3).mean(axis=1)
    places = 0.9 * points + 0.1 * np.repeat(middle, 4, axis=0)
    return places, numbers(mesh.uv_layers[0].data, "uv", 2)


def test_quads_stay_quads_with_groups_keys_and_creases():
    obj = grid(3)
    obj.vertex_groups.new(name="all").add(range(16), 1.0, "REPLACE")
    obj.data.attributes.new("crease_edge", "FLOAT", "EDGE").data[0].value = 1
    obj.shape_key_add(name="Basis")
    for point in obj.shape_key_add(name="Up").points:
        point.co.z += 1
    new = refined(obj, levels=2)
    assert [len(p.vertices) for p in new.data.polygons] == [4] * 9 * 16
    assert all(v.groups[0].weight == pytest.approx(1) for v in new.data.vertices)
    assert (numbers(new.data.attributes["crease_edge"].data, "value") == 1).sum() == 4
    basis, up = (numbers(b.points, "co", 3) for b in new.data.shape_keys.key_blocks)
    np.testing.assert_allclose(up - basis, np.tile([0, 0, 1], (len(basis), 1)), atol=1e-5)


def test_loose_edges_and_points_stay():
    obj = placed(
        "Loose",
        [*[(0, 0, 0), (1, 0, 0), (0, 1, 0)], (3, 0, 0), (4, 0, 0), (5, 5, 5)],
        [(0, 1, 2)],
        [(3, 4)],
    )
    new = refined(obj, levels=1)
    assert any(set(e.vertices) == {3, 4} for e in new.data.edges)
    np.testing.assert_array_equal(points_of(new.data)[3:6], points_of(obj.data)[3:])
    assert any("edges without faces" in note for note in notes(new))


def test_every_loss_is_named():
    obj = placed("Many", [(0, 0, 0), (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0)], [(0, 1, 2, 3, 4)])
    obj.data.attributes.new("id", "INT", "POINT")
    obj.data.attributes.new("stress", "FLOAT", "EDGE")
    obj.vertex_groups.new(name="g").add([0], 0.0, "REPLACE")
    obj.modifiers.new("Hook", "HOOK")
    obj.modifiers.new("Cloth", "CLOTH")
    obj.modifiers.new("Multires", "MULTIRES")
    obj.modifiers.new("Particles", "PARTICLE_SYSTEM")
    text = "\n".join(notes(refined(obj, scheme="LOOP")))
    split = placed("Split", [(0, 0, 0), (1, 0, 0), (0, 1, 0)] * 2, [(0, 1, 2), (3, 4, 5)])
    text += "\n".join(notes(refined(split)))
    for word in (
        "triangles",
        "id",
        "stress",
        "weight 0",
        "Hook",
        "Cloth",
        "Multires",
        "Particles",
        "Merge by Distance",
    ):
        assert word in text, word


def notes(obj):
    """Return what the panel says is lost."""
    import json

    return json.loads(obj.data.pns_result.notes)


def test_undo_takes_the_new_object_back():
    bpy.context.preferences.edit.use_global_undo = True
    cube()
    bpy.ops.ed.undo_push(message="cube")
    refined(bpy.context.object)
    bpy.ops.ed.undo_push(message="refined")
    assert len(bpy.data.objects) == 2
    bpy.ops.ed.undo()
    assert [obj.name for obj in bpy.data.objects] == ["Cube"]
    assert len(bpy.data.objects["Cube"].data.polygons) == 6
    bpy.ops.ed.redo()
    assert len(bpy.data.objects) == 2


def test_undo_gives_the_old_mesh_back():
    bpy.context.preferences.edit.use_global_undo = True
    cube()
    bpy.ops.ed.undo_push(message="cube")
    refined(bpy.context.object, keep_original=False)
    bpy.ops.ed.undo_push(message="refined")
    bpy.ops.ed.undo()
    assert len(bpy.data.objects["Cube"].data.polygons) == 6
