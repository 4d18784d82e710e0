"""Parts that a refined object keeps of its own, a claim each."""

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
    notes,
    numbers,
    placed,
    points_of,
    refined,
    rigged,
)

VALUES = {
    "FLOAT": ("value", 1.5),
    "INT": ("value", 7),
    "INT8": ("value", 5),
    "BOOLEAN": ("value", True),
    "FLOAT_VECTOR": ("vector", (1, 2, 3)),
    "FLOAT2": ("vector", (1, 2)),
    "FLOAT_COLOR": ("color", (0.1, 0.2, 0.3, 0.4)),
    "BYTE_COLOR": ("color", (1, 0, 1, 1)),
    "QUATERNION": ("value", (0.6, 0, 0.8, 0)),
    "FLOAT4X4": ("value", (1, 2, 3, 4, 2, 5, 6, 7, 3, 6, 8, 9, 4, 7, 9, 10)),
    "INT32_2D": ("value", (3, -4)),
    "STRING": ("value", b"name"),
}


@pytest.mark.parametrize("domain", ["POINT", "EDGE", "FACE", "CORNER"])
def test_attributes_of_every_type_keep_what_is_the_same_everywhere(domain):
    obj = cube()
    for kind, (field, value) in VALUES.items():
        for row in obj.data.attributes.new(kind, kind, domain).data:
            setattr(row, field, np.reshape(value, (4, 4)) if kind == "FLOAT4X4" else value)
    new = refined(obj, levels=1).data
    for kind, (field, value) in VALUES.items():
        attribute = new.attributes[kind]
        assert (attribute.data_type, attribute.domain) == (kind, domain)
        rows = [numbers_in(getattr(row, field)) for row in attribute.data]
        kept = [row for row in rows if any(row)]
        # Twenty-four halves of edges keep it; what is new inside faces is zero.
        assert len(kept) == (24 if domain == "EDGE" else len(rows))
        assert all(row == pytest.approx(numbers_in(value), abs=1e-5) for row in kept)


def numbers_in(value):
    """A value as a list of numbers: of a text those of its letters."""
    if isinstance(value, str | bytes):
        return list(value.encode() if isinstance(value, str) else value)
    return np.reshape(value, -1).astype(float).tolist()


def test_the_chosen_maps_and_colours_stay_chosen():
    data = cube().data
    for name in ("One", "Two"):
        data.uv_layers.new(name=name)
        data.color_attributes.new(name=f"Colour {name}", type="BYTE_COLOR", domain="CORNER")
    data.uv_layers["Two"].active_render = True
    data.uv_layers.active = data.uv_layers["One"]
    data.attributes.active_color_name = "Colour Two"
    data.attributes.default_color_name = "Colour One"
    new = refined(bpy.context.object).data
    assert new.uv_layers["Two"].active_render
    assert new.uv_layers.active.name == "One"
    assert new.attributes.active_color_name == "Colour Two"
    assert new.attributes.default_color_name == "Colour One"


def test_shape_keys_stay_with_all_that_moves_them():
    obj = grid(5)
    group, *_ = (obj.vertex_groups.new(name=name) for name in ("Mask", "Other"))
    group.lock_weight = True
    for vertex in obj.data.vertices:
        group.add([vertex.index], (vertex.co.x + 1) / 2, "REPLACE")
    obj.shape_key_add(name="Basis")
    up, on = obj.shape_key_add(name="Up"), obj.shape_key_add(name="On")
    for point in up.points:
        point.co.z += 1
    on.relative_key, on.mute, on.vertex_group = up, True, "Mask"
    up.slider_min, up.slider_max, up.value = -2, 3, 0.75
    key = obj.data.shape_keys
    key["studio"] = {"id": 3, "é": [1.0, 2.0]}
    up.keyframe_insert("value", frame=1)
    driver = on.driver_add("value").driver
    driver.type, obj["smile"] = "SUM", 0.5
    target = driver.variables.new().targets[0]
    target.id, target.data_path = obj, '["smile"]'
    track = key.animation_data.nla_tracks.new()
    track.strips.new("Strip", 10, key.animation_data.action)
    new = refined(obj, levels=1, scheme="LOOP")
    made = new.data.shape_keys
    for before, after in zip(key.key_blocks, made.key_blocks, strict=True):
        for name in ("name", "slider_min", "slider_max", "value", "mute", "vertex_group"):
            assert getattr(after, name) == getattr(before, name), name
        assert after.relative_key.name == before.relative_key.name
    basis, lifted = (numbers(block.points, "co", 3) for block in made.key_blocks[:2])
    np.testing.assert_allclose(lifted - basis, np.tile([0, 0, 1], (len(basis), 1)), atol=1e-5)
    assert made["studio"].to_dict() == {"id": 3, "é": [1.0, 2.0]}
    assert made.animation_data.action == key.animation_data.action
    (strip,) = made.animation_data.nla_tracks[0].strips
    assert (strip.name, strip.action, strip.frame_start) == (
        "Strip",
        made.animation_data.action,
        10,
    )
    # As with Blender's own duplicates, what listened to the object listens to its copy.
    new["smile"] = 0.25
    new.update_tag()
    bpy.context.view_layer.update()
    assert (made.key_blocks["On"].value, on.value) == pytest.approx((0.25, 0.5))
    # Weights are linear in x, and so they stay.
    assert [(g.name, g.lock_weight) for g in new.vertex_groups] == [
        ("Mask", True),
        ("Other", False),
    ]
    for vertex in new.data.vertices:
        weight = sum(member.weight for member in vertex.groups)
        assert weight == pytest.approx((vertex.co.x + 1) / 2, abs=1e-5)


def test_materials_parents_modifiers_and_properties_are_those_of_the_object():
    obj = cube()
    for name in "abc":
        obj.data.materials.append(bpy.data.materials.new(name))
    for number, face in enumerate(obj.data.polygons):
        face.material_index = number % 3
    obj.material_slots[1].link = "OBJECT"
    obj.material_slots[1].material = bpy.data.materials.new("own")
    other, parent = bpy.data.collections.new("Other"), bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.children.link(other)
    other.objects.link(obj)
    obj.parent, obj["tag"], obj.data["mesh tag"] = parent, 3, 4
    obj.modifiers.new("Bend", "SIMPLE_DEFORM").angle = 1.25
    obj.constraints.new("COPY_LOCATION")
    new = refined(obj, levels=1)
    assert [s.material.name for s in new.material_slots] == ["a", "own", "c"]
    materials = [face.material_index for face in new.data.polygons]
    assert materials == np.repeat(np.arange(6) % 3, 4).tolist()
    assert (new.parent, set(new.users_collection)) == (parent, set(obj.users_collection))
    assert (new.modifiers["Bend"].angle, len(new.constraints)) == (1.25, 1)
    assert (new["tag"], new.data["mesh tag"]) == (3, 4)


def test_marks_of_edges_stay_on_both_halves_and_creases_wear_off():
    obj = cube()
    crease = obj.data.attributes.new("crease_edge", "FLOAT", "EDGE")
    # Sharp for 3.6 levels, of which 2.6 are left.
    crease.data.foreach_set("value", np.r_[0.6, np.zeros(11)].astype(np.float32))
    for edge in (0, 5):
        obj.data.edges[edge].use_seam = obj.data.edges[edge].use_edge_sharp = True
    if own := hasattr(obj.data.edges[0], "use_freestyle_mark"):  # an attribute since 5.0
        obj.data.edges[0].use_freestyle_mark = obj.data.edges[5].use_freestyle_mark = True
    else:
        marks = obj.data.attributes.new("freestyle_edge", "BOOLEAN", "EDGE").data
        marks[0].value = marks[5].value = True
    new = refined(obj, levels=1, crease_lines=False, scheme="LOOP").data
    drawn = (
        [e.use_freestyle_mark for e in new.edges]
        if own
        else numbers(new.attributes["freestyle_edge"].data)
    )
    ends = {v for edge in (0, 5) for v in obj.data.edges[edge].vertices}
    for marks in ([e.use_seam for e in new.edges], [e.use_edge_sharp for e in new.edges], drawn):
        there = [edge for edge, on in zip(new.edges, marks, strict=True) if on]
        assert len(there) == 4
        assert {min(edge.vertices) for edge in there} <= ends
    left = numbers(new.attributes["crease_edge"].data)
    assert left[left > 0] == pytest.approx([math.sqrt(0.26)] * 2)


@pytest.mark.parametrize("levels", [1, 2])
def test_what_is_in_hidden_faces_is_hidden(levels):
    mesh = grid(3).data
    mesh.polygons.foreach_set("hide", [i in (0, 1, 3, 4) for i in range(9)])
    for rows, hidden in zip((mesh.edges, mesh.vertices), hidden_around(mesh), strict=True):
        rows.foreach_set("hide", hidden)
    new = refined(bpy.context.object, levels=levels).data
    edges, points = hidden_around(new)
    assert [e.hide for e in new.edges] == edges
    assert [v.hide for v in new.vertices] == points
    assert 0 < sum(edges) < len(edges)


def hidden_around(mesh):
    """Masks of the edges, and of the vertices, that have hidden faces alone."""
    edges, points = [True] * len(mesh.edges), [True] * len(mesh.vertices)
    for face in mesh.polygons:
        for corner in [] if face.hide else face.loop_indices:
            edges[mesh.loops[corner].edge_index] = False
            points[mesh.loops[corner].vertex_index] = False
    return edges, points


def test_normals_are_the_surfaces_and_turn_with_a_rig():
    plain = refined(cube(), levels=1).data
    assert all(p.use_smooth for p in plain.polygons)
    # A side has one normal up to its corners.
    assert (np.abs(numbers(plain.corner_normals, "vector", 3)).max(axis=1) > 0.98).all()
    rig = rigged(grid(4), Bone=(0, lambda x: 1.0))
    new = refined(bpy.data.objects["Grid"], levels=1)
    still, at_rest = numbers(evaluated(new).corner_normals, "vector", 3), points_of(evaluated(new))
    pose = rig.pose.bones["Bone"]
    pose.rotation_mode, pose.rotation_euler = "XYZ", (math.pi / 2, 0, 0)
    turned = numbers(evaluated(new).corner_normals, "vector", 3)
    matrix = np.array(pose.matrix.to_3x3()) @ np.array(pose.bone.matrix_local.to_3x3()).T
    np.testing.assert_allclose(turned, still @ matrix.T, atol=0.02)
    np.testing.assert_allclose(points_of(evaluated(new)), at_rest @ matrix.T, atol=1e-5)
    obj = grid(4, "Custom")
    obj.data.normals_split_custom_set([(0, 0, 1)] * len(obj.data.loops))
    custom = numbers(refined(obj).data.corner_normals, "vector", 3)
    # Blender keeps two angles for each, and takes those whose cosine is above 1 − 10⁻⁴ for none.
    np.testing.assert_allclose(custom, np.tile([0, 0, 1], (len(custom), 1)), atol=np.sqrt(2e-4))


@pytest.mark.parametrize("marks", ["points", "edges"])
@pytest.mark.parametrize("boundary", ["ALL", "PRESERVE_CORNERS"])
def test_without_correction_quads_are_those_of_subdivision_surface(boundary, marks):
    """Suzanne, sharp at no level, at a part of one, at more, and for good, against OpenSubdiv."""
    bpy.ops.mesh.primitive_monkey_add(calc_uvs=True)
    obj, kinds = bpy.context.object, [0, 0.25, 0, 0.35, 0.6, 1, 0, 0.2, 0.45]
    data = obj.data
    if marks == "points":
        name, domain = "crease_vert", "POINT"
        sharp = np.resize(kinds, len(data.vertices))
    else:
        name, domain = "crease_edge", "EDGE"
        ends = numbers(data.edges, "vertices", 2).astype(int)
        faces = np.bincount(numbers(data.loops, "edge_index").astype(int).ravel())
        # At boundaries Blender has rules of its own.
        sharp = np.where(
            np.isin(ends, ends[faces == 1]).any(axis=1), 0, np.resize(kinds, len(ends))
        )
    data.attributes.new(name, "FLOAT", domain).data.foreach_set("value", sharp.astype(np.float32))
    modifier = obj.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels, modifier.use_limit_surface, modifier.boundary_smooth = 2, False, boundary
    own = evaluated(obj).copy()
    obj.modifiers.clear()
    new = refined(obj, levels=2, budget=0.0, border=boundary, limit=False).data
    assert [len(p.vertices) for p in new.polygons] == [4] * len(own.polygons)
    (places, uv), (expected, uv_expected) = corners_of(new), corners_of(own)
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


def test_polygons_to_a_goal_keep_all_that_they_carry():
    """A drum whose rims are sharp: its two lids stay whole."""
    bpy.ops.mesh.primitive_cylinder_add(vertices=12, calc_uvs=True)
    obj = bpy.context.object
    obj.data.materials.append(bpy.data.materials.new("wall"))
    obj.data.materials.append(bpy.data.materials.new("lid"))
    for face in obj.data.polygons:
        face.material_index = int(len(face.vertices) > 4)
    crease = obj.data.attributes.new("crease_edge", "FLOAT", "EDGE")
    for edge, mark in zip(obj.data.edges, crease.data, strict=True):
        heights = {round(obj.data.vertices[number].co.z) for number in edge.vertices}
        mark.value = edge.use_seam = len(heights) == 1
    group = obj.vertex_groups.new(name="Top")
    group.add([v.index for v in obj.data.vertices if v.co.z > 0], 1.0, "REPLACE")
    obj.shape_key_add(name="Basis")
    for point in obj.shape_key_add(name="Up").points:
        point.co.z += 1
    new = refined(obj, detail="TOLERANCE", tolerance=0.2)
    made = new.data
    lids = [face for face in made.polygons if len(face.vertices) > 4]
    assert [face.material_index for face in lids] == [1, 1]
    assert sum(face.material_index for face in made.polygons) == 2
    count = sum(len(face.vertices) for face in lids)
    assert count > 24
    assert sum(edge.use_seam for edge in made.edges) == count
    assert (numbers(made.attributes["crease_edge"].data) == 1).sum() == count
    basis, up = (numbers(block.points, "co", 3) for block in made.shape_keys.key_blocks)
    np.testing.assert_allclose(up - basis, np.tile([0, 0, 1], (len(basis), 1)), atol=1e-5)
    for vertex in made.vertices:
        weight = sum(member.weight for member in vertex.groups)
        assert weight == pytest.approx((vertex.co.z + 1) / 2, abs=1e-5)
    normals = numbers(made.corner_normals, "vector", 3)
    heights = points_of(made)[numbers(made.loops, "vertex_index").astype(int).ravel(), 2]
    uv = numbers(made.uv_layers[0].data, "uv", 2)
    for face in made.polygons:
        corners = list(face.loop_indices)
        if face.material_index:
            assert np.abs(normals[corners, 2]).min() > 0.999
        else:
            np.testing.assert_allclose(uv[corners, 1], 0.75 + heights[corners] / 4, atol=1e-5)
    assert "triangles" not in notes(new)
    assert "whatever UV Smooth says" in notes(new)


def test_every_loss_is_named_and_loose_parts_stay():
    points = [(0, 0, 0), (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (3, 0, 0), (4, 0, 0)]
    obj = placed("Many", points, [(0, 1, 2, 3, 4)], [(5, 6)])
    obj.data.attributes.new("id", "INT", "POINT")
    obj.data.attributes.new("stress", "FLOAT", "EDGE")
    obj.data.normals_split_custom_set([(0, 0, 1)] * 5)
    obj.vertex_groups.new(name="g").add([0], 0.0, "REPLACE")
    obj.shape_key_add(name="Basis")
    for kind in ("HOOK", "CLOTH", "MULTIRES", "PARTICLE_SYSTEM"):
        obj.modifiers.new(kind, kind)
    new = refined(obj, scheme="LOOP")
    assert any({*edge.vertices} == {5, 6} for edge in new.data.edges)
    np.testing.assert_array_equal(points_of(new.data)[5:7], points_of(obj.data)[5:])
    split = placed("Split", [(0, 0, 0), (1, 0, 0), (0, 1, 0)] * 2, [(0, 1, 2), (3, 4, 5)])
    text = notes(new) + notes(refined(split))
    words = "triangles without id stress normals weight masks Hooks CLOTH Multires Particles Merge"
    assert all(word in text for word in words.split()), text


def test_an_edited_mesh_is_refined_as_it_is_edited():
    obj = cube()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.resize(value=(3, 3, 3))
    assert bpy.ops.object.pns_refine(levels=1) == {"FINISHED"}
    assert bpy.context.mode == "OBJECT"
    assert np.abs(points_of(bpy.context.object.data)).max() > 2.9
    assert np.abs(points_of(chosen(obj).data)).max() == 3
