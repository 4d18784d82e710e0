"""However geometry is stored, it is refined as the plain storage of the same numbers would be."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.service.gltf.read.refused import refine
from tests.support.gltf import files, validator
from tests.support.gltf.shapes import box, octahedron

INTEGERS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123}
# (component type, normalized) by attribute, as glTF and KHR_mesh_quantization allow.
ANY = [("f4", False)] + [(kind, flag) for kind in INTEGERS for flag in (False, True)]
STORAGE = {
    "POSITION": ANY,
    "NORMAL": [("f4", False), ("i1", True), ("i2", True)],
    "TANGENT": [("f4", False), ("i1", True), ("i2", True)],
    "TEXCOORD_0": ANY,
    "COLOR_0": [("f4", False), ("u1", True), ("u2", True)],
    "_ID": [("u2", False), ("u1", False), ("i1", False), ("f4", False)],
}
WIDTHS = {"POSITION": 3, "NORMAL": 3, "TANGENT": 4, "TEXCOORD_0": 2, "_ID": 1}


def meaning(values, normalized):
    """The numbers that stored ones stand for (glTF 2.0 §3.6.2.2)."""
    if values.dtype.kind == "f" or not normalized:
        return values.astype(np.float32)
    return np.maximum(values / np.iinfo(values.dtype).max, -1).astype(np.float32)


def store(tree, binary, values, *, normalized=False, gap=0, sparse=None, index=False):
    """An accessor with `gap` words between its elements; `sparse`: rows kept apart, or "all"."""

    def view(data, **more):
        binary.extend(b"\0" * (-len(binary) % 4))
        place = {"buffer": 0, "byteOffset": len(binary), "byteLength": len(data)}
        tree["bufferViews"].append(place | more)
        binary.extend(data)
        return len(tree["bufferViews"]) - 1

    count, width = len(values), values.shape[1] * values.itemsize
    kinds = {"componentType": files.COMPONENTS[values.dtype.str[1:]]}
    accessor = kinds | {"count": count, "type": files.TYPES[values.shape[1]]}
    if normalized:
        accessor["normalized"] = True
    apart = np.zeros(count, dtype=bool)
    if sparse is not None:
        apart[:] = True if sparse == "all" else sparse
        apart[0] = True
    if sparse != "all":
        stride = width if index else width + -width % 4 + 4 * gap
        # What a sparse accessor replaces may be anything.
        rows = [
            b"\1" * width if hidden else row.tobytes()
            for row, hidden in zip(values, apart, strict=True)
        ]
        data = b"".join(row.ljust(stride, b"\xcd") for row in rows)
        accessor["bufferView"] = view(data, **({} if index else {"byteStride": stride}))
    if sparse is not None:
        rows = np.flatnonzero(apart).astype(np.uint16)
        accessor["sparse"] = {
            "count": len(rows),
            "indices": {"bufferView": view(rows.tobytes()), "componentType": 5123},
            "values": {"bufferView": view(values[apart].tobytes())},
        }
    tree["accessors"].append(accessor)
    return len(tree["accessors"]) - 1


@st.composite
def attribute(draw, name, count):
    """(stored numbers, normalized) of one attribute."""
    kind, normalized = draw(st.sampled_from(STORAGE[name]))
    width = WIDTHS.get(name) or draw(st.sampled_from([3, 4]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    dtype = np.dtype(kind)
    if name in ("NORMAL", "TANGENT"):
        scale = 1 if kind == "f4" else np.iinfo(dtype).max
        unit = rng.integers(0, 3, count)
        values = np.zeros((count, width))
        values[np.arange(count), unit] = scale * rng.choice([-1, 1], count)
        if name == "TANGENT":
            values[:, 3] = scale
        return values.astype(dtype), normalized
    low, high = (0, 2) if kind == "f4" else (0, 100)
    if dtype.kind == "i" and name != "_ID":
        low = -high
    # Few different values: vertices that coincide are common.
    return rng.integers(low, high, (count, width)).astype(dtype), normalized


@st.composite
def primitive(draw):
    """Attributes as stored, corners of a mode, and how each is laid out."""
    count = draw(st.integers(3, 9))
    optional = st.lists(st.sampled_from(list(STORAGE)[1:]), unique=True)
    names = ["POSITION", *sorted(draw(optional))]
    if "TANGENT" in names and "NORMAL" not in names:
        names.remove("TANGENT")
    mode = draw(st.sampled_from([4, 4, 5, 6]))
    kind = draw(st.sampled_from([None, "u1", "u2", "u4"]))
    if kind is None:
        count -= count % 3
        corners = np.arange(count)
    else:
        length = 3 * draw(st.integers(1, 6)) if mode == 4 else draw(st.integers(3, 9))
        corners = np.array(
            draw(st.lists(st.integers(0, count - 1), min_size=length, max_size=length))
        )
    layouts = st.one_of(
        st.none(), st.just("all"), st.lists(st.booleans(), min_size=count, max_size=count)
    )
    return {
        "mode": mode,
        "index_kind": kind,
        "corners": corners,
        "attributes": {name: draw(attribute(name, count)) for name in names},
        "gaps": {name: draw(st.integers(0, 2)) for name in names},
        "sparse": {name: draw(layouts) for name in names},
    }


def triangles(corners, mode):
    """By the specification's formulas, one face at a time (glTF 2.0 §3.7.2.1)."""
    if mode == 4:
        return corners.reshape(-1, 3)
    rows = []
    for i in range(len(corners) - 2):
        places = (i, i + 1 + i % 2, i + 2 - i % 2) if mode == 5 else (i + 1, i + 2, 0)
        rows.append([corners[place] for place in places])
    return np.array(rows)


def stored(mesh, nodes):
    """The mesh in a file as it is laid out."""
    tree, binary = files.document()
    tree["meshes"] = [{"primitives": []}]
    for shape in mesh:
        entry = {"attributes": {}, "mode": shape["mode"]}
        for name, (values, normalized) in shape["attributes"].items():
            entry["attributes"][name] = store(
                tree,
                binary,
                values,
                normalized=normalized,
                gap=shape["gaps"][name],
                sparse=shape["sparse"][name],
            )
            if name == "POSITION":
                tree["accessors"][-1]["min"] = values.min(axis=0).tolist()
                tree["accessors"][-1]["max"] = values.max(axis=0).tolist()
        if shape["index_kind"]:
            corners = shape["corners"].astype(shape["index_kind"]).reshape(-1, 1)
            entry["indices"] = store(tree, binary, corners, index=True)
        tree["meshes"][0]["primitives"].append(entry)
    tree["extensionsUsed"] = tree["extensionsRequired"] = ["KHR_mesh_quantization"]
    tree["nodes"] = [{"mesh": 0, "translation": [n, 0, 0]} for n in range(nodes)]
    if nodes > 1:
        where = store(tree, binary, np.arange(3.0 * nodes, dtype=np.float32).reshape(-1, 3))
        tree["extensionsUsed"] = [*tree["extensionsUsed"], "EXT_mesh_gpu_instancing"]
        tree["nodes"][0]["extensions"] = {
            "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": where}}
        }
    tree["scenes"] = [{"nodes": list(range(nodes))}]
    tree["buffers"] = [{"byteLength": len(binary)}]
    return files.pack(tree, bytes(binary))


def plain(mesh):
    """The same numbers, dense, and mode 4."""
    shapes = []
    for shape in mesh:
        entry = {"indices": triangles(shape["corners"], shape["mode"]).astype(np.uint32)}
        for name, (values, normalized) in shape["attributes"].items():
            if name in ("_ID", "COLOR_0"):
                entry[name] = files.Normalized(values) if normalized else values
            else:
                entry[name] = meaning(values, normalized)
        shapes.append(entry)
    return files.glb(shapes)


def was_left(made, primitive):
    return made.report["dropped"]["degenerate_faces"] and any(
        change["what"].startswith("left as it was") and change["pointer"].endswith(f"/{primitive}")
        for change in made.report["changes"]
    )


@pytest.mark.spawning
def test_every_storage_is_refined_as_its_plain_twin_and_is_valid(tmp_path):
    written = []

    @settings(suppress_health_check=[HealthCheck.too_slow], deadline=None, max_examples=60)
    @given(st.lists(primitive(), min_size=1, max_size=3), st.integers(1, 3))
    def check(mesh, nodes):
        result, twin = refine(stored(mesh, nodes)), refine(plain(mesh))
        assert result.report["totals"] == twin.report["totals"]
        tree, _ = files.unpack(result.glb)
        left = [was_left(result, number) for number in range(len(mesh))]
        for number in np.flatnonzero(np.logical_not(left)).tolist():
            assert tree["meshes"][0]["primitives"][number].get("mode", 4) == 4
            own, wanted = (files.primitive_of(r.glb, 0, number) for r in (result, twin))
            np.testing.assert_array_equal(own[0], wanted[0])
            assert own[1].keys() == wanted[1].keys()
            for name, values in wanted[1].items():
                assert own[1][name].dtype == values.dtype
                np.testing.assert_array_equal(own[1][name], values, err_msg=name)
        if not any(left):
            assert "KHR_mesh_quantization" not in tree.get("extensionsUsed", [])
            written.append(tmp_path / f"{len(written)}.glb")
            written[-1].write_bytes(result.glb)

    check()
    assert len(written) > 20
    assert not {code for codes in validator.errors(written) for code in codes}


@pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "f4"])
@pytest.mark.parametrize("size", [2, 3])
def test_matrices_keep_their_padded_columns(kind, size):
    # Custom attributes may be matrices; each of their columns begins at a whole word.
    dtype = np.dtype(kind)
    values = np.arange(6 * size * size).reshape(6, size, size).astype(dtype)
    tree, binary = files.document([octahedron()])
    step = size * dtype.itemsize
    step += -step % 4
    place = {"buffer": 0, "byteOffset": len(binary), "byteLength": 6 * size * step}
    binary += b"".join(row.tobytes().ljust(step, b"\0") for row in values.reshape(-1, size))
    tree["bufferViews"].append(place)
    accessor = {"bufferView": len(tree["bufferViews"]) - 1, "count": 6, "type": f"MAT{size}"}
    tree["accessors"].append(accessor | {"componentType": files.COMPONENTS[kind]})
    tree["buffers"] = [{"byteLength": len(binary)}]
    tree["meshes"][0]["primitives"][0]["attributes"]["_M"] = len(tree["accessors"]) - 1
    after, content = files.unpack(refine(files.pack(tree, bytes(binary))).glb)
    accessor = after["accessors"][after["meshes"][0]["primitives"][0]["attributes"]["_M"]]
    view = after["bufferViews"][accessor["bufferView"]]
    assert view["byteLength"] == accessor["count"] * size * step
    assert accessor["type"] == f"MAT{size}"
    first = content[view["byteOffset"] :][: size * step]
    columns = np.stack([np.frombuffer(first, dtype, size, step * n) for n in range(size)])
    assert columns.tolist() in values.tolist()


def test_quantisation_stays_declared_where_something_still_needs_it():
    tree, binary = files.document([box()], [{"POSITION": np.eye(3, dtype=np.int16), "mode": 0}])
    tree["extensionsUsed"] = tree["extensionsRequired"] = ["KHR_mesh_quantization"]
    after, _ = files.unpack(refine(files.pack(tree, bytes(binary))).glb)
    assert after["extensionsRequired"] == ["KHR_mesh_quantization"]
