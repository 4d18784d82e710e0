"""Files beside a document: found by relative names, and nothing else is ever opened."""

import base64
import io
import json
import unicodedata
import zipfile

import numpy as np
import pytest

from service.bodies.archive import MAX_ENTRIES, ArchiveError, open_archive
from service.bodies.sibling_files import File, SiblingFiles, folder_of, safe_name
from service.errors import LimitError, UnreadableError
from service.options import Limits
from tests.service.gltf.read.refused import refine, refusal
from tests.support.gltf import files
from tests.support.gltf.shapes import box
from tests.support.memory import most_of

PNG = b"\x89PNG\r\n\x1a\n" + bytes(30)


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


def with_images(*images, **contents):
    """A document beside its buffer and other files, refined."""
    text, binary = external(images=images)
    return refine(text, "gltf", siblings=beside(box__bin=binary, **contents))


def told_of_images(made):
    return [change for change in made.report["changes"] if change["pointer"].startswith("/images")]


EMBEDDED = {"pointer": "/images/0", "code": "embedded", "what": "embedded", "count": 1}


@pytest.mark.parametrize("step", ["%41", "a/", "a"])
def test_a_uri_without_end_takes_what_any_text_does(step):
    refined, used = most_of(with_images, step * 2**20)
    assert used < 6 * len(step) * 2**20
    assert len(told_of_images(refined)[0]["what"]) < 10_000


def test_a_file_is_predicted_as_often_as_buffers_name_it():
    text, content = external()
    tree = json.loads(text)
    tree["buffers"] *= 100
    content = content.ljust(2**20, b"\0")
    tree["buffers"][0]["byteLength"] = len(content)
    limits = Limits(max_memory_bytes=100 * 2**20)
    body = json.dumps(tree).encode()
    assert refusal(body, "gltf", siblings=beside(box__bin=content), limits=limits).limit == "memory"


@pytest.mark.parametrize(
    ("uri", "name"),
    [
        *(("box.bin", "box.bin"), ("./a/b%20c.bin", "a/b c.bin"), ("a//b.bin", "a/b.bin")),
        *(("a\\b.bin", "a/b.bin"), ("a%5Cb.bin", "a/b.bin"), ("./a/../b.bin", "b.bin")),
        *(("a/b/.//../../c.bin", "c.bin"), ("a%2F%2e%2e%2Fb.bin", "b.bin")),
    ],
)
def test_a_relative_uri_is_decoded_to_a_name(uri, name):
    assert safe_name(uri) == name


UNSAFE = ["file:///etc/passwd", "https://example.com/box.bin", "/etc/passwd", "../box.bin"]
UNSAFE += ["a/../../box.bin", "./../box.bin", "a/..", "%2e%2e/box.bin", "a%2f..%2f..%2fbox.bin"]
UNSAFE += ["..\\box.bin", "a\\..\\..\\box.bin", "\\\\server\\box.bin", "C:\\box.bin"]
UNSAFE += ["C%3A/box.bin", "box%00.bin", "", "."]


@pytest.mark.parametrize("uri", UNSAFE)
def test_a_uri_that_leads_elsewhere_is_never_opened(uri):
    asked = []
    error = refusal(external(uri)[0], "gltf", siblings=SiblingFiles(asked.append))
    assert (error.code, error.pointer) == ("unsafe-uri", "/buffers/0/uri")
    assert not asked


def test_a_buffer_that_did_not_come_is_named():
    error = refusal(external()[0], "gltf", siblings=beside())
    assert (error.code, error.pointer) == ("missing-file", "/buffers/0/uri")
    assert "'box.bin'" in error.detail


def test_external_files_give_what_an_embedded_file_gives():
    result, whole = with_images("a.png", a__png=PNG, notes__txt=b"?"), refine(files.glb([box()]))
    (faces, attributes), (wanted_faces, wanted) = map(files.primitive_of, (result.glb, whole.glb))
    np.testing.assert_array_equal(faces, wanted_faces)
    for name, values in wanted.items():
        np.testing.assert_array_equal(attributes[name], values)
    tree, content = files.unpack(result.glb)
    (image,) = tree["images"]
    view = tree["bufferViews"][image["bufferView"]]
    assert image["mimeType"] == "image/png"
    assert content[view["byteOffset"] :][: view["byteLength"]] == PNG
    unused = {
        "pointer": "",
        "code": "unused-file",
        "what": "not used by the document: notes.txt",
        "count": 1,
    }
    assert all(change in result.report["changes"] for change in (EMBEDDED, unused))


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
    result = refine(text, "gltf", siblings=beside(box__bin=binary, a__image=content))
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
    result = with_images(*images, notes__txt=b"no image")
    assert files.unpack(result.glb)[0]["images"] == [{"uri": image} for image in images]
    told = {"code": "kept-by-uri", "what": f"kept by its URI: {uri} {why}"}
    assert told_of_images(result) == [{"pointer": "/images/0", **told, "count": 1}]


def test_an_image_in_the_json_comes_into_the_gltf_s_buffer():
    encoded = "data:image/png;base64," + base64.b64encode(PNG).decode()
    # What is no image, or no data, stays as it is.
    others = ["data:image/png;base64,AAAA", "data:image/png,?"]
    result = with_images(encoded, *others)
    tree, content = files.unpack(result.glb)
    view = tree["bufferViews"][tree["images"][0].pop("bufferView")]
    assert content[view["byteOffset"] :][: view["byteLength"]] == PNG
    assert tree["images"] == [{"mimeType": "image/png"}, *({"uri": uri} for uri in others)]
    assert told_of_images(result) == [EMBEDDED]


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


TEXT, BINARY = external()
APPLE = [("__MACOSX/scene/._box.gltf", b"?"), ("scene/._box.gltf", b"?")]
WHOLE = {
    "beside it": [("s/box.gltf", TEXT), ("s/box.bin", BINARY), ("readme.txt", b"?"), *APPLE],
    "elsewhere": [
        ("x/gltf/box.gltf", external("../parts/box.bin", images=["./../y/../../a.png"])[0]),
        ("x/parts/box.bin", BINARY),
        ("a.png", PNG),
    ],
    "separators of Windows": [
        ("x\\", b""),
        ("x\\box.gltf", external("parts/box.bin")[0]),
        ("x\\parts\\box.bin", BINARY),
    ],
}


@pytest.mark.parametrize(
    ("entries", "told"),
    [
        ("beside it", ["not used by the document: readme.txt"]),
        ("elsewhere", ["embedded"]),
        ("separators of Windows", []),
    ],
)
def test_an_archive_holds_a_document_and_what_it_names(entries, told):
    main, siblings = open_archive(archive(WHOLE[entries]), 2**20)
    report = refine(main.content, "gltf", siblings=siblings).report
    assert report["totals"]["faces"] == 48
    assert [change["what"] for change in report["changes"]] == told


@pytest.mark.parametrize("uri", ["../../box.bin", "a/../../../box.bin", "%2e%2e/%2e%2e/box.bin"])
def test_no_uri_leads_out_of_an_archive(uri):
    entries = [("x/box.gltf", external(uri)[0]), ("box.bin", BINARY)]
    main, siblings = open_archive(archive(entries), 2**20)
    assert refusal(main.content, "gltf", siblings=siblings).code == "unsafe-uri"


@pytest.mark.parametrize("forms", [("NFC", "NFD"), ("NFD", "NFC")])
def test_accents_are_found_in_either_form(tmp_path, forms):
    said, stored = (unicodedata.normalize(form, "Körper.bin") for form in forms)
    text, binary = external(said)
    main, siblings = open_archive(archive([("a.gltf", text), (stored, binary)]), 2**20)
    (tmp_path / stored).write_bytes(binary)
    for beside_it in (siblings, folder_of(tmp_path / "a.gltf")):
        made = refine(main.content, "gltf", siblings=beside_it)
        assert made.report["totals"]["faces"] == 48


def link(name):
    info = zipfile.ZipInfo(name)
    info.external_attr = 0o120777 << 16
    return info


ONE = ("a.gltf", b"{}")
BAD = {
    "no document": [("a.bin", b"")],
    "two documents": [ONE, ("b.glb", b"glTF")],
    "a link": [ONE, (link("x.bin"), b"/etc/passwd")],
    "one name twice": [ONE, ("x", b"1"), ("x", b"2")],
    **{name: [ONE, (name, b"")] for name in ("../x.bin", "/x.bin", "C:/x.bin")},
    **{name: [ONE, (name, b"")] for name in ("..\\x.bin", "C:\\x.bin")},
}


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("case", BAD)
def test_archives_that_are_not_one_document_and_what_lies_beside_it_are_refused(case):
    with pytest.raises(ArchiveError) as refused:
        open_archive(archive(BAD[case]), 2**20)
    assert refused.value.status == 422


def lying():
    """An entry that lies about its size."""
    data = bytearray(archive([("a.gltf", TEXT)]))
    for signature, at in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        start = data.index(signature) + at
        data[start : start + 4] = (10).to_bytes(4, "little")
    return bytes(data)


def test_what_comes_out_is_counted_before_it_is_made():
    """By entries, by size and by ratio."""
    many = archive([(f"{number}", b"") for number in range(MAX_ENTRIES + 1)])
    packed = archive([("a.gltf", bytes(2**25))])
    plain = archive([("a.gltf", bytes(2000))], zipfile.ZIP_STORED)
    for data, most, limit in (
        *((many, 2**20, "archive-entries"), (packed, 2**30, "archive-bytes")),
        (plain, 1999, "archive-bytes"),
    ):
        with pytest.raises(LimitError) as refused:
            open_archive(data, most)
        assert refused.value.limit == limit
    open_archive(plain, 2000)
    with pytest.raises(UnreadableError):
        open_archive(lying(), 2**30)
