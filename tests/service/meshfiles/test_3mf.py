"""3MF: parts of a print go in and come out with their colours, names, places and unit."""

import ctypes
import io
import zipfile
from dataclasses import replace

import lib3mf
import numpy as np
import pytest

from service.errors import LimitError, ServiceError
from service.gltf.read.container import decode_object, read_glb
from service.meshfiles import formats
from service.meshfiles.convert import converted
from service.meshfiles.example import part
from service.meshfiles.mesh_file import COLOUR, MATERIAL, OBJECT, Labels, Layer
from service.options import Limits, Options

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
RELATIONS = (
    '<Relationships><Relationship Target="/3D/a.model" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
)
TETRAHEDRON = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
MESH = (
    "<mesh><vertices>"
    + "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in TETRAHEDRON)
    + "</vertices><triangles>"
    + "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in FACES)
    + "</triangles></mesh>"
)


def package(model, relations=RELATIONS, **more):
    """A package of one model, and other parts by name."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("_rels/.rels", relations)
        archive.writestr("3D/a.model", model)
        for name, text in more.items():
            archive.writestr(name, text)
    return file.getvalue()


def model(resources, items='<item objectid="1"/>', head=""):
    return (
        f'<model xmlns="{CORE}" xmlns:p="{PRODUCTION}" {head}><resources>{resources}</resources>'
        f"<build>{items}</build></model>"
    )


def opened(data):
    """Return a model as the consortium's own library reads it, to its letter."""
    read = lib3mf.get_wrapper().CreateModel()
    reader = read.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromBuffer(data)
    assert reader.GetWarningCount() == 0
    return read


def items_of(read):
    items, iterator = [], read.GetBuildItems()
    while iterator.MoveNext():
        items.append(iterator.GetCurrent())
    return items


def mesh_of(read, item):
    return read.GetMeshObjectByID(item.GetObjectResourceID())


def print_of_two():
    """Two tetrahedra, by the consortium's library: one of two materials, one of blended colours."""
    made = lib3mf.get_wrapper().CreateModel()
    made.SetUnit(lib3mf.ModelUnit.Inch)
    materials = made.AddBaseMaterialGroup()
    red = materials.AddMaterial("red & hard", lib3mf.Color(255, 0, 0, 255))
    blue = materials.AddMaterial("blue", lib3mf.Color(0, 0, 255, 128))
    colours = made.AddColorGroup()
    shades = [colours.AddColor(lib3mf.Color(0, 60 * k, 0, 255)) for k in range(4)]
    for name in ("left", "right"):
        mesh = made.AddMeshObject()
        mesh.SetName(name)
        for place in TETRAHEDRON:
            mesh.AddVertex(lib3mf.Position((ctypes.c_float * 3)(*place)))
        for face in FACES.tolist():
            mesh.AddTriangle(lib3mf.Triangle((ctypes.c_uint32 * 3)(*face)))
        for number, face in enumerate(FACES.tolist()):
            ids = [red if number < 2 else blue] * 3
            group = materials.GetResourceID()
            if name == "right":
                ids, group = [shades[corner] for corner in face], colours.GetResourceID()
            own = lib3mf.TriangleProperties(group, (ctypes.c_uint32 * 3)(*ids))
            mesh.SetTriangleProperties(number, own)
        mesh.SetObjectLevelProperty(materials.GetResourceID(), red)
        place = lib3mf.get_wrapper().GetTranslationTransform(0 if name == "left" else 30, 0, 5)
        made.AddBuildItem(mesh, place)
    return bytes(made.QueryWriter("3mf").WriteToBuffer())


def test_parts_colours_materials_and_unit_of_another_writer_are_read():
    mesh = formats.read(print_of_two(), "3mf")
    assert mesh.unit == "inch"
    assert mesh.changes == ()
    assert mesh.labels[OBJECT].names == ("left", "right")
    np.testing.assert_allclose(mesh.vertices[mesh.faces][:4], np.add(TETRAHEDRON, [0, 0, 5])[FACES])
    np.testing.assert_allclose(
        mesh.vertices[mesh.faces][4:], np.add(TETRAHEDRON, [30, 0, 5])[FACES]
    )
    materials = mesh.labels[MATERIAL]
    assert [materials.names[k] if k >= 0 else "" for k in materials.of_face] == (
        ["red & hard"] * 2 + ["blue"] * 2 + [""] * 4
    )
    colours = mesh.layers[COLOUR]
    shown = colours.values[colours.rows].reshape(-1, 3, 4)
    assert shown[0].tolist() == [[255, 0, 0, 255]] * 3
    assert shown[2].tolist() == [[0, 0, 255, 128]] * 3
    assert shown[4:, :, 1].tolist() == (60 * FACES).tolist()


def test_another_reader_finds_what_was_refined():
    written = converted(
        print_of_two(), "3mf", "3mf", Options(levels=1, scheme="loop"), None, Limits()
    )
    read = opened(written.content)
    assert read.GetUnit() == lib3mf.ModelUnit.Inch
    items = items_of(read)
    assert [mesh_of(read, item).GetName() for item in items] == ["left", "right"]
    assert [mesh_of(read, item).GetTriangleCount() for item in items] == [16, 16]
    assert all(mesh_of(read, item).IsManifoldAndOriented() for item in items)
    left, right = (mesh_of(read, item) for item in items)
    kinds = {left.GetTriangleProperties(k).ResourceID for k in range(16)}
    (group,) = kinds
    materials = read.GetBaseMaterialGroupByID(group)
    names = [materials.GetName(left.GetTriangleProperties(k).PropertyIDs[0]) for k in range(16)]
    assert names == ["red & hard"] * 8 + ["blue"] * 8
    own = right.GetTriangleProperties(3)
    green = [read.GetColorGroupByID(own.ResourceID).GetColor(k).Green for k in own.PropertyIDs]
    # The middle child: halfway between the corners 0, 2 and 1.
    assert sorted(green) == [30, 60, 90]


def test_components_are_placed_and_mirrors_keep_the_outside_outside():
    inner = f'<object id="7">{MESH}</object>'
    outer = (
        '<object id="1"><components>'
        '<component objectid="7" transform="1 0 0 0 1 0 0 0 1 100 0 0"/>'
        '<component objectid="7" transform="-1 0 0 0 1 0 0 0 1 0 0 0"/></components></object>'
    )
    moved = '<item objectid="1" transform="0 2 0 -2 0 0 0 0 2 0 0 1"/>'
    mesh = formats.read(package(model(inner + outer, moved)), "3mf")
    first, second = mesh.vertices[:4], mesh.vertices[4:]
    turn = np.array([[0, 2, 0], [-2, 0, 0], [0, 0, 2]])
    np.testing.assert_allclose(first, np.add(TETRAHEDRON, [100, 0, 0]) @ turn + [0, 0, 1])
    np.testing.assert_allclose(second, (TETRAHEDRON * [-1, 1, 1]) @ turn + [0, 0, 1])
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)).reshape(2, 4).sum(axis=1) / 6
    np.testing.assert_allclose(volumes, 8 * 1000 / 6)


def test_parts_in_other_models_of_the_package_are_found():
    part_of = '<component p:path="/3D/Objects/b.model" objectid="4"/>'
    main = model(f'<object id="1"><components>{part_of}</components></object>')
    other = model(f'<object id="4" name="lid">{MESH}</object>', "")
    mesh = formats.read(package(main, **{"3D/Objects/b.model": other, "a.config": "x"}), "3mf")
    assert mesh.labels[OBJECT].names == ("lid",)
    assert len(mesh.faces) == 4
    assert [(change.what, change.count) for change in mesh.changes] == [
        ("other files of the package dropped", 1)
    ]


def test_a_glb_has_metres_and_stands_upright_and_so_does_what_comes_back():
    options = Options(levels=1, scheme="loop")
    data = package(model(f'<object id="1">{MESH}</object>', head='unit="centimeter"'))
    glb = converted(data, "3mf", "glb", options, None, Limits()).content
    (node,) = decode_object(read_glb(glb).text, Limits())["nodes"]
    assert node["scale"] == [0.01] * 3
    again = converted(glb, "glb", "3mf", options, None, Limits())
    mesh = formats.read(again.content, "3mf")
    here = formats.read(converted(data, "3mf", "3mf", options, None, Limits()).content, "3mf")
    assert (mesh.unit, here.unit) == ("meter", "centimeter")
    high, low = here.vertices.max(axis=0), here.vertices.min(axis=0)
    # Refined once more, it is smaller still, and stands in the same place.
    assert (mesh.vertices.max(axis=0) < 0.01 * high + 1e-9).all()
    assert (mesh.vertices.min(axis=0) > 0.01 * low - 1e-9).all()
    assert mesh.vertices.max() > 0.02


def test_materials_of_a_glb_become_materials_of_their_colour():
    tree = converted(
        formats.write(part(), "obj"), "obj", "glb", Options(levels=1, scheme="loop"), None, Limits()
    ).content
    written = converted(tree, "glb", "3mf", Options(levels=1, scheme="loop"), None, Limits())
    read = opened(written.content)
    groups = read.GetBaseMaterialGroups()
    assert groups.MoveNext()
    group = groups.GetCurrentBaseMaterialGroup()
    colours = [group.GetDisplayColor(k) for k in group.GetAllPropertyIDs()]
    assert colours
    assert all(colour.Alpha == 255 for colour in colours)


def test_what_a_format_cannot_say_is_told():
    options = Options(levels=1, scheme="loop")
    written = converted(print_of_two(), "3mf", "stl", options, None, Limits())
    told = {change["what"].partition(" dropped")[0] for change in written.report["changes"]}
    assert told == {"unit of lengths, inch,", "objects", "materials", "vertex colours"}
    mesh = part()
    values = np.zeros((len(mesh.vertices), 3), dtype=np.uint8)
    values[0] = 255
    painted = replace(
        mesh,
        layers={COLOUR: Layer(values, mesh.corners)},
        labels={MATERIAL: Labels(("steel",), np.zeros(len(mesh.faces), dtype=np.int64))},
    )
    around = int((mesh.faces == 0).any(axis=1).sum())
    assert [(change.what, change.count) for change in formats.held(painted, "3mf")[1]] == [
        ("materials of faces of several colours dropped: not written to 3MF files", around)
    ]


def test_a_file_has_the_same_bytes_each_time():
    mesh = formats.read(print_of_two(), "3mf")
    assert formats.write(mesh, "3mf") == formats.write(mesh, "3mf")
    again = formats.read(formats.write(mesh, "3mf"), "3mf")
    assert formats.write(again, "3mf") == formats.write(mesh, "3mf")


def of_parts(number, part, count):
    """An object of so many copies of another one."""
    parts = f'<component objectid="{part}"/>' * count
    return f'<object id="{number}"><components>{parts}</components></object>'


def printed(mesh, items='<item objectid="1"/>', head=""):
    return package(model(f'<object id="1">{mesh}</object>', items, head))


NO_PART = '<item objectid="1" p:path="/3D/z.model"/>'
CIPHER = 'requiredextensions="q" xmlns:q="http://cipher"'
REFUSED = [
    (b"PK\x03\x04", "the archive cannot be read"),
    (package(model(""), relations="<Relationships/>"), "names no 3D model"),
    (package("<model"), "3D/a.model of the 3MF file is no XML"),
    (package(f'<!DOCTYPE x [<!ENTITY a "b">]>{model("")}'), "line 1 of 3D/a.model.*no DTD"),
    (package(model("")), "has no object 1 in 3D/a.model"),
    (printed(""), "prints no triangles"),
    (printed(MESH.replace("z=", "w=", 1)), "'z' is missing"),
    (printed(MESH.replace("10.0", "ten", 1)), "'ten'"),
    (
        printed(MESH.replace('v1="1"', 'v1="4"')),
        "triangle 3 of object 1 in 3D/a.model names vertices 4, 2, 3, expected 0 … 3",
    ),
    (printed(MESH, '<item objectid="1" transform="1 0"/>'), "a transform has twelve numbers"),
    (package(model(of_parts(1, 1, 1))), "object 1 of the 3MF file is a part of itself"),
    (package(model("", head=CIPHER)), "it needs the extension http://cipher"),
    (package(model("", head='unit="parsec"')), "unit 'parsec' must be one of micron, milli"),
    (printed("", NO_PART), "no part 3D"),
]


@pytest.mark.parametrize(("data", "text"), REFUSED)
def test_what_is_no_print_is_refused_with_its_place(data, text):
    with pytest.raises(ServiceError, match=text):
        formats.read(data, "3mf")


def test_copies_of_copies_are_counted_before_they_are_made():
    many = "".join(of_parts(number, number + 1, 2) for number in range(1, 40))
    with pytest.raises(LimitError, match="too many"):
        formats.read(package(model(f'{many}<object id="40">{MESH}</object>')), "3mf")
