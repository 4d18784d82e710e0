"""One claim for each attribute, map and key that a refined object keeps."""

import math

import bpy
import numpy as np
import pytest
from scene import (
    cube,
    grid,
    numbers,
    points_of,
    refined,
)

TYPES = [
    ("FLOAT", "value", 1.5),
    ("INT", "value", 7),
    ("INT8", "value", 5),
    ("BOOLEAN", "value", True),
    ("FLOAT_VECTOR", "vector", (1, 2, 3)),
    ("FLOAT2", "vector", (1, 2)),
    ("FLOAT_COLOR", "color", (0.1, 0.2, 0.3, 0.4)),
    ("BYTE_COLOR", "color", (1, 0, 1, 1)),
    ("QUATERNION", "value", (0.6, 0, 0.8, 0)),
    ("FLOAT4X4", "value", tuple(range(16))),
    ("INT32_2D", "value", (3, -4)),
    ("STRING", "value", b"name"),
]


@pytest.mark.parametrize(("kind", "field", "value"), TYPES)
@pytest.mark.parametrize("domain", ["POINT", "EDGE", "FACE", "CORNER"])
def test_a_constant_attribute_stays_constant(kind, field, value, domain):
    obj = cube()
    attribute = obj.data.attributes.new("mine", kind, domain)
    if kind == "STRING":
        for row in attribute.data:
            row.value = value
    else:
        rows = np.tile(np.asarray(value).reshape(-1), len(attribute.data))
        attribute.data.foreach_set(field, rows)
    carried = refined(obj, levels=1).data.attributes["mine"]
    assert (carried.data_type, carried.domain) == (kind, domain)
    rows = values_of(carried, field, np.size(value))
    kept = rows.any(axis=1) if rows.dtype.kind == "f" else rows[:, 0] != b""
    # Twenty-four halves of edges keep it; what is new inside faces is zero.
    assert kept.sum() == (24 if domain == "EDGE" else len(rows))
    for row in rows[kept]:
        if kind == "STRING":
            assert row[0] == value
        else:
            np.testing.assert_allclose(row, np.reshape(value, -1), atol=1e-5)


def values_of(attribute, field, width):
    """All rows of an attribute."""
    if attribute.data_type == "STRING":
        texts = [row.value for row in attribute.data]
        return np.array([[t.encode() if isinstance(t, str) else t] for t in texts])
    if attribute.data_type == "BOOLEAN":
        rows = np.empty(len(attribute.data), np.bool_)
        attribute.data.foreach_get(field, rows)
        return rows[:, None].astype(float)
    return numbers(attribute.data, field, width)


def test_whole_numbers_are_never_mixed():
    obj = grid(4)
    attribute = obj.data.attributes.new("mine", "INT", "POINT")
    given = np.arange(len(attribute.data), dtype=np.int32) * 1000
    attribute.data.foreach_set("value", given)
    kept = refined(obj).data.attributes["mine"]
    values = numbers(kept.data, "value").astype(int).ravel()
    assert set(values) <= set(given.tolist())
    np.testing.assert_array_equal(values[: len(given)], given)


def test_seams_of_a_uv_map_do_not_crack():
    obj = cube()
    layer = obj.data.uv_layers.new(name="Map")
    rng = np.random.default_rng(0)
    for row in layer.data:
        row.uv = rng.random(2)
    new = refined(obj, levels=2).data
    uv = numbers(new.uv_layers["Map"].data, "uv", 2)
    corners = numbers(new.loops, "vertex_index").astype(int).ravel()
    # Every side is a patch of its own: along its border, the map must be the straight line between
    # the corners it had, whatever the other side does.
    side = np.repeat(np.arange(6), 16)
    old = numbers(layer.data, "uv", 2)
    for face, side_of in enumerate(side):
        for corner in range(4 * face, 4 * face + 4):
            vertex = corners[corner]
            if vertex < 8:
                starts = 4 * side_of
                place = [obj.data.loops[starts + i].vertex_index for i in range(4)].index(vertex)
                np.testing.assert_allclose(uv[corner], old[starts + place], atol=1e-6)
    first_level = refined(obj, levels=1).data
    uv = numbers(first_level.uv_layers["Map"].data, "uv", 2)
    edges = {tuple(sorted(e.vertices)): i for i, e in enumerate(obj.data.edges)}
    checked = 0
    for number, loop in enumerate(first_level.loops):
        face = number // 4 // 4
        ends = [tuple(sorted(e)) for e in edges if loop.vertex_index >= 8]
        for a, b in ends:
            middle = middle_of(first_level, a, b)
            if middle != loop.vertex_index:
                continue
            side_of = face
            ring = [obj.data.loops[4 * side_of + i].vertex_index for i in range(4)]
            if a in ring and b in ring:
                expected = (old[4 * side_of + ring.index(a)] + old[4 * side_of + ring.index(b)]) / 2
                np.testing.assert_allclose(uv[number], expected, atol=1e-6)
                checked += 1
    assert checked == 6 * 4 * 2


def middle_of(mesh, a, b):
    """The vertex that stands on the edge between two old ones."""
    beside = [set(), set()]
    for edge in mesh.edges:
        for place, end in enumerate((a, b)):
            if end in edge.vertices:
                beside[place] |= set(edge.vertices) - {end}
    common = beside[0] & beside[1]
    return next(iter(common)) if len(common) == 1 else None


def test_a_map_without_seams_follows_the_surface():
    obj = grid(6)
    layer = obj.data.uv_layers.new(name="Map")
    for loop, row in zip(obj.data.loops, layer.data, strict=True):
        row.uv = obj.data.vertices[loop.vertex_index].co.xy
    new = refined(obj, levels=1, scheme="LOOP").data
    uv = numbers(new.uv_layers["Map"].data, "uv", 2)
    where = points_of(new)[numbers(new.loops, "vertex_index").astype(int).ravel(), :2]
    inside = (np.abs(where) < 0.6).all(axis=1)
    np.testing.assert_allclose(uv[inside], where[inside], atol=1e-5)


def test_the_chosen_maps_and_colours_stay_chosen():
    obj = cube()
    for name in ("One", "Two"):
        obj.data.uv_layers.new(name=name)
        obj.data.color_attributes.new(name=f"Colour {name}", type="BYTE_COLOR", domain="CORNER")
    obj.data.uv_layers["Two"].active_render = True
    obj.data.uv_layers.active = obj.data.uv_layers["One"]
    obj.data.attributes.active_color_name = "Colour Two"
    obj.data.attributes.default_color_name = "Colour One"
    new = refined(obj).data
    assert new.uv_layers["Two"].active_render
    assert new.uv_layers.active.name == "One"
    assert new.attributes.active_color_name == "Colour Two"
    assert new.attributes.default_color_name == "Colour One"


def test_vertex_groups_are_weighted_by_the_masks():
    obj = grid(6)
    left, lock = obj.vertex_groups.new(name="Left"), obj.vertex_groups.new(name="Locked")
    for vertex in obj.data.vertices:
        left.add([vertex.index], (vertex.co.x + 1) / 2, "REPLACE")
    lock.add([0], 0.25, "REPLACE")
    lock.lock_weight = True
    new = refined(obj, levels=1, scheme="LOOP")
    assert [g.name for g in new.vertex_groups] == ["Left", "Locked"]
    assert [g.lock_weight for g in new.vertex_groups] == [False, True]
    for vertex in new.data.vertices:
        weights = {m.group: m.weight for m in vertex.groups}
        # The weight is linear in x, and so it stays.
        assert weights.get(0, 0) == pytest.approx((vertex.co.x + 1) / 2, abs=1e-5)


def test_weights_that_sum_to_one_go_on_doing_so():
    obj = grid(6)
    first, second = (obj.vertex_groups.new(name=name) for name in "ab")
    rng = np.random.default_rng(1)
    for vertex in obj.data.vertices:
        weight = float(rng.random())
        first.add([vertex.index], weight, "REPLACE")
        second.add([vertex.index], 1 - weight, "REPLACE")
    for vertex in refined(obj).data.vertices:
        assert sum(m.weight for m in vertex.groups) == pytest.approx(1, abs=1e-5)


def keyed():
    """A hill with two shape keys, one driven, one animated."""
    obj = grid(5)
    obj.shape_key_add(name="Basis")
    up, on = obj.shape_key_add(name="Up"), obj.shape_key_add(name="On")
    for point in up.points:
        point.co.z += 1
    on.relative_key = up
    for number, point in enumerate(on.points):
        point.co.x += 0.1 * math.sin(number)
    up.slider_min, up.slider_max, up.value = -2, 3, 0.75
    on.mute = True
    on.vertex_group = obj.vertex_groups.new(name="Mask").name
    key = obj.data.shape_keys
    key.name = "Keys"
    up.keyframe_insert("value", frame=1)
    driver = on.driver_add("value").driver
    driver.type = "SUM"
    variable = driver.variables.new()
    variable.targets[0].id = obj
    variable.targets[0].data_path = '["smile"]'
    obj["smile"] = 0.5
    return obj


def test_shape_keys_keep_names_values_and_ranges():
    old, new = (o.data.shape_keys.key_blocks for o in _pair(keyed()))
    assert [b.name for b in new] == [b.name for b in old]
    for before, after in zip(old, new, strict=True):
        for name in ("slider_min", "slider_max", "value", "mute", "vertex_group", "interpolation"):
            assert getattr(after, name) == getattr(before, name), name
        assert after.relative_key.name == before.relative_key.name


def test_custom_properties_of_shape_keys_are_kept():
    obj = cube()
    obj.shape_key_add(name="Basis")
    obj.data.shape_keys["studio"] = {"id": 3, "é": [1.0, 2.0]}
    assert refined(obj).data.shape_keys["studio"].to_dict() == {"id": 3, "é": [1.0, 2.0]}


def test_a_key_that_lifts_all_by_one_goes_on_doing_so():
    _, new = _pair(keyed())
    basis, up = (numbers(b.points, "co", 3) for b in new.data.shape_keys.key_blocks[:2])
    np.testing.assert_allclose(up - basis, np.tile([0, 0, 1], (len(basis), 1)), atol=1e-5)


def test_actions_and_drivers_of_keys_are_kept():
    old, new = _pair(keyed())
    data, before = new.data.shape_keys.animation_data, old.data.shape_keys.animation_data
    assert data.action == before.action
    if hasattr(data, "action_slot"):
        assert data.action_slot == before.action_slot
    (driver,) = data.drivers
    assert driver.data_path == before.drivers[0].data_path
    # As with Blender's own duplicates, what listened to the object listens to its copy.
    assert driver.driver.variables[0].targets[0].id == new
    assert before.drivers[0].driver.variables[0].targets[0].id == old
    new["smile"] = 0.25
    new.update_tag()
    bpy.context.view_layer.update()
    assert new.data.shape_keys.key_blocks["On"].value == pytest.approx(0.25)


def test_tracks_of_keys_are_kept():
    obj = keyed()
    data = obj.data.shape_keys.animation_data
    track = data.nla_tracks.new()
    track.name = "Track"
    track.strips.new("Strip", 10, data.action).name = "Strip"
    _, new = _pair(obj)
    (copied,) = new.data.shape_keys.animation_data.nla_tracks
    assert copied.name == "Track"
    assert [(s.name, s.action, s.frame_start) for s in copied.strips] == [
        ("Strip", data.action, 10)
    ]


def _pair(obj):
    return obj, refined(obj)
