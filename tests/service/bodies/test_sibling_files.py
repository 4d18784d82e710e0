"""Files beside a document: found by relative names, and nothing else is ever opened."""

import base64
import io
import json
import tracemalloc
import unicodedata
import zipfile

import numpy as np
import pytest

from service.bodies.archive import MAX_ENTRIES, ArchiveError, open_archive
from service.bodies.sibling_files import File, SiblingFiles, folder_of, safe_name
from service.errors import GltfError, LimitError, UnreadableError
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support.gltf import files
from tests.support.gltf.shapes import box

PNG = b"\x89PNG\r\n\x1a\n" + bytes(30)
SAFE = [
    ("box.bin", "box.bin"),
    ("./a/b%20c.bin", "a/b c.bin"),
    ("a//b.bin", "a/b.bin"),
    ("a\\b.bin", "a/b.bin"),
    ("a%5Cb.bin", "a/b.bin"),
    ("./a/../b.bin", "b.bin"),
    ("a/b/.//../../c.bin", "c.bin"),
    ("a%2F%2e%2e%2Fb.bin", "b.bin"),
]
UNSAFE = [
    "file:///etc/passwd",
    "https://example.com/box.bin",
    "/etc/passwd",
    "../box.bin",
    "a/../../box.bin",
    "./../box.bin",
    "a/..",
    "%2e%2e/box.bin",
    "a%2f..%2f..%2fbox.bin",
    "..\\box.bin",
    "a\\..\\..\\box.bin",
    "\\\\server\\box.bin",
    "C:\\box.bin",
    "C%3A/box.bin",
    "box%00.bin",
    "",
    ".",
]


def external(uri="box.bin", images=()):
    """(text of a .gltf, content of its buffer)."""
    tree, binary = files.document([box()])
    tree["buffers"][0]["uri"] = uri
    tree["images"] = [{"uri": image} for image in images]
    return json.dumps(tree).encode(), bytes(binary)


def beside(**contents):
    """SiblingFiles by name; dots are written as double underscores."""
    named = {name.replace("__", "."): content for name, content in contents.items()}
    return SiblingFiles(
        lambda name: File(name, named[name]) if name in named else None, frozenset(named)
    )


def refine(text, siblings, **limits):
    options = Options(scheme="loop", levels=1)
    return subdivide_gltf(text, "gltf", options, None, Limits(**limits), siblings=siblings)


@pytest.mark.parametrize("step", ["%41", "a/", "a"])
def test_a_uri_without_end_takes_what_any_text_does(step):
    text, content = external(images=[step * 2**20])
    text = text.replace(b"box.bin", b"b.bin")
    refine(text, beside(b__bin=content))  # the first call loads the kernels
    tracemalloc.start()
    try:
        refined = refine(text, beside(b__bin=content))
        used = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert used < 6 * len(text)
    (told,) = [change for change in refined.report["changes"] if change["pointer"] == "/images/0"]
    assert len(told["what"]) < 10_000


def test_a_file_is_predicted_as_often_as_buffers_name_it():
    text, content = external()
    tree = json.loads(text)
    tree["buffers"] *= 100
    content = content.ljust(2**20, b"\0")
    tree["buffers"][0]["byteLength"] = len(content)
    with pytest.raises(LimitError) as refusal:
        refine(json.dumps(tree).encode(), beside(box__bin=content), max_memory_bytes=100 * 2**20)
    assert refusal.value.limit == "memory"


@pytest.mark.parametrize(("uri", "name"), SAFE)
def test_a_relative_uri_is_decoded_to_a_name(uri, name):
    assert safe_name(uri) == name


@pytest.mark.parametrize("uri", UNSAFE)
def test_a_uri_that_leads_elsewhere_is_never_opened(uri):
    asked = []
    siblings = SiblingFiles(lambda name: asked.append(name))
    text, _ = external(uri)
    with pytest.raises(GltfError) as refusal:
        refine(text, siblings)
    assert (refusal.value.code, refusal.value.pointer) == ("unsafe-uri", "/buffers/0/uri")
    assert not asked


def test_a_buffer_that_did_not_come_is_named():
    text, _ = external()
    with pytest.raises(GltfError) as refusal:
        refine(text, beside())
    assert (refusal.value.code, refusal.value.pointer) == ("missing-file", "/buffers/0/uri")
    assert "'box.bin'" in refusal.value.detail


def test_external_files_give_what_an_embedded_file_gives():
    text, binary = external(images=["a.png"])
    result = refine(text, beside(box__bin=binary, a__png=PNG, notes__txt=b"?"))
    options = Options(scheme="loop", levels=1)
    whole = subdivide_gltf(files.glb([box()]), "glb", options, None, Limits())
    faces, attributes = files.primitive_of(result.glb)
    expected_faces, expected = files.primitive_of(whole.glb)
    np.testing.assert_array_equal(faces, expected_faces)
    for name, values in expected.items():
        np.testing.assert_array_equal(attributes[name], values)
    tree, content = files.unpack(result.glb)
    (image,) = tree["images"]
    view = tree["bufferViews"][image["bufferView"]]
    assert image["mimeType"] == "image/png"
    assert content[view["byteOffset"] :][: view["byteLength"]] == PNG
    changes = {(change["pointer"], change["what"]) for change in result.report["changes"]}
    assert ("/images/0", "embedded") in changes
    assert ("", "not used by the document: notes.txt") in changes


@pytest.mark.parametrize(
    ("content", "kind", "extension"),
    [
        (b"\xff\xd8\xff\xe0", "image/jpeg", None),
        (b"\xabKTX 20\xbb\r\n\x1a\n", "image/ktx2", "KHR_texture_basisu"),
        (b"RIFF\x04\0\0\0WEBP", "image/webp", "EXT_texture_webp"),
        (b"\0\0\0\x1cftypavif", "image/avif", "EXT_texture_avif"),
        (b"DDS \x7c\0\0\0", "image/vnd-ms.dds", "MSFT_texture_dds"),
    ],
)
@pytest.mark.parametrize("declared", [True, False])
def test_images_are_embedded_where_the_document_may_hold_their_type(
    content, kind, extension, declared
):
    text, binary = external(images=["a.image"])
    if extension is not None and declared:
        text = json.dumps(json.loads(text) | {"extensionsUsed": [extension]}).encode()
    result = refine(text, beside(box__bin=binary, a__image=content))
    tree, _ = files.unpack(result.glb)
    if extension is None or declared:
        assert tree["images"][0]["mimeType"] == kind
        assert "uri" not in tree["images"][0]
    else:
        assert tree["images"] == [{"uri": "a.image"}]
        assert any(extension in change["what"] for change in result.report["changes"])


@pytest.mark.parametrize(
    ("uri", "why"),
    [
        ("notes.txt", "is no known type of image"),
        ("a.png", "did not come with the document"),
        ("../textures/a.png", "leads out of the document's folder"),
        ("/a.png", "leads out of the document's folder"),
    ],
)
def test_an_image_that_cannot_be_embedded_keeps_its_uri_and_says_why(uri, why):
    images = [uri, "https://example.org/a.png"]
    text, binary = external(images=images)
    result = refine(text, beside(box__bin=binary, notes__txt=b"no image"))
    assert files.unpack(result.glb)[0]["images"] == [{"uri": image} for image in images]
    changes = [c for c in result.report["changes"] if c["pointer"].startswith("/images")]
    told = {"code": "kept-by-uri", "what": f"kept by its URI: {uri} {why}"}
    assert changes == [{"pointer": "/images/0", **told, "count": 1}]


def test_an_image_in_the_json_comes_into_the_gltf_s_buffer():
    encoded = "data:image/png;base64," + base64.b64encode(PNG).decode()
    text, binary = external(images=[encoded, "data:image/png;base64,AAAA", "data:image/png,?"])
    result = refine(text, beside(box__bin=binary))
    tree, content = files.unpack(result.glb)
    view = tree["bufferViews"][tree["images"][0].pop("bufferView")]
    assert content[view["byteOffset"] :][: view["byteLength"]] == PNG
    # What is no image, or no data, stays as it is.
    others = [{"uri": "data:image/png;base64,AAAA"}, {"uri": "data:image/png,?"}]
    assert tree["images"] == [{"mimeType": "image/png"}, *others]
    changes = [c for c in result.report["changes"] if c["pointer"].startswith("/images")]
    assert changes == [{"pointer": "/images/0", "code": "embedded", "what": "embedded", "count": 1}]


def test_files_on_disk_are_read_from_their_own_folder_only(tmp_path):
    own = tmp_path / "own"
    (own / "sub").mkdir(parents=True)
    (own / "sub" / "in.bin").write_bytes(b"in")
    (tmp_path / "out.bin").write_bytes(b"out")
    (own / "link.bin").symlink_to(tmp_path / "out.bin")
    (tmp_path / "alias").symlink_to(own)
    for folder in (own, tmp_path / "alias"):
        siblings = folder_of(folder / "box.gltf")
        assert siblings.find("sub/in.bin") == File("sub/in.bin", b"in")
        # Of the last two a file cannot have the name.
        for name in ("link.bin", "none.bin", "sub", "../out.bin", "a" * 5000, "a" * 300 + "/b"):
            assert siblings.find(name) is None


def archive(entries, compression=zipfile.ZIP_DEFLATED):
    """A .zip of (name or ZipInfo, content)."""
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", compression) as opened:
        for name, content in entries:
            opened.writestr(name, content)
    return target.getvalue()


def link(name):
    info = zipfile.ZipInfo(name)
    info.external_attr = 0o120777 << 16
    return info


def test_an_archive_holds_a_document_and_its_neighbours():
    text, binary = external()
    apple = ["__MACOSX/scene/._box.gltf", "scene/._box.gltf"]
    names = ["scene/box.gltf", "scene/box.bin", "readme.txt", *apple]
    data = archive(zip(names, [text, binary, b"?", b"?", b"?"], strict=True))
    main, siblings = open_archive(data, 2**20)
    assert main.content == text
    result = refine(main.content, siblings)
    assert result.report["totals"]["faces"] == 48
    assert {
        "pointer": "",
        "code": "unused-file",
        "what": "not used by the document: readme.txt",
        "count": 1,
    } in result.report["changes"]


def test_a_document_names_files_elsewhere_in_its_archive():
    text, binary = external("../parts/box.bin", images=["./../y/../../a.png"])
    entries = [("x/gltf/box.gltf", text), ("x/parts/box.bin", binary), ("a.png", PNG)]
    main, siblings = open_archive(archive(entries), 2**20)
    changes = refine(main.content, siblings).report["changes"]
    assert {"pointer": "/images/0", "code": "embedded", "what": "embedded", "count": 1} in changes
    assert not any(change["what"].startswith("not used") for change in changes)


@pytest.mark.parametrize("uri", ["../../box.bin", "a/../../../box.bin", "%2e%2e/%2e%2e/box.bin"])
def test_no_uri_leads_out_of_an_archive(uri):
    text, binary = external(uri)
    main, siblings = open_archive(archive([("x/box.gltf", text), ("box.bin", binary)]), 2**20)
    with pytest.raises(GltfError) as refusal:
        refine(main.content, siblings)
    assert refusal.value.code == "unsafe-uri"


def test_archives_with_separators_of_windows_are_read():
    text, binary = external("parts/box.bin")
    entries = [("x\\", b""), ("x\\box.gltf", text), ("x\\parts\\box.bin", binary)]
    main, siblings = open_archive(archive(entries), 2**20)
    assert siblings.names == {"x/parts/box.bin"}
    assert refine(main.content, siblings).report["totals"]["faces"] == 48


@pytest.mark.parametrize("forms", [("NFC", "NFD"), ("NFD", "NFC")])
def test_accents_are_found_in_either_form(tmp_path, forms):
    said, stored = (unicodedata.normalize(form, "Körper.bin") for form in forms)
    text, binary = external(said)
    main, siblings = open_archive(archive([("a.gltf", text), (stored, binary)]), 2**20)
    (tmp_path / stored).write_bytes(binary)
    for beside_it in (siblings, folder_of(tmp_path / "a.gltf")):
        assert refine(main.content, beside_it).report["totals"]["faces"] == 48


BAD = {
    "no document": [("a.bin", b"")],
    "two documents": [("a.gltf", b"{}"), ("b.glb", b"glTF")],
    "parent folder": [("a.gltf", b"{}"), ("../x.bin", b"")],
    "absolute name": [("a.gltf", b"{}"), ("/x.bin", b"")],
    "drive": [("a.gltf", b"{}"), ("C:/x.bin", b"")],
    "parent folder of Windows": [("a.gltf", b"{}"), ("..\\x.bin", b"")],
    "drive of Windows": [("a.gltf", b"{}"), ("C:\\x.bin", b"")],
    "link": [("a.gltf", b"{}"), (link("x.bin"), b"/etc/passwd")],
    "one name twice": [("a.gltf", b"{}"), ("x", b"1"), ("x", b"2")],
}


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("case", BAD)
def test_archives_that_are_not_one_document_and_what_lies_beside_it_are_refused(case):
    with pytest.raises(ArchiveError) as refusal:
        open_archive(archive(BAD[case]), 2**20)
    assert refusal.value.status == 422


def test_entries_are_counted_before_they_are_made():
    data = archive([(f"{number}", b"") for number in range(MAX_ENTRIES + 1)])
    with pytest.raises(LimitError) as refusal:
        open_archive(data, 2**20)
    assert refusal.value.limit == "archive-entries"


def test_what_comes_out_is_limited_by_size_and_by_ratio():
    packed = archive([("a.gltf", bytes(2**25))])
    plain = archive([("a.gltf", bytes(2000))], zipfile.ZIP_STORED)
    for data, most in ((packed, 2**30), (plain, 1999)):
        with pytest.raises(LimitError) as refusal:
            open_archive(data, most)
        assert refusal.value.limit == "archive-bytes"
    open_archive(plain, 2000)


def test_an_entry_that_lies_about_its_size_is_unreadable():
    text, _ = external()
    data = bytearray(archive([("a.gltf", text)]))
    for signature, at in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        start = data.index(signature) + at
        data[start : start + 4] = (10).to_bytes(4, "little")
    with pytest.raises(UnreadableError):
        open_archive(bytes(data), 2**30)
