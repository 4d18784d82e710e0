"""The whole service on real files: workers, pipeline and bundled model together."""

import gzip
import io
import zipfile

import msgspec
import pytest

from service.bodies.media import MEDIA_TYPES
from service.gltf.read.container import read_glb
from service.http.app import create_app
from service.meshfiles import formats
from service.meshfiles.convert import converted
from service.meshfiles.example import part as example_part
from service.meshfiles.example import part_glb
from service.meshfiles.glb import as_gltf_json
from service.options import Limits, Options
from service.settings import Settings
from service.workers.jobs import hold_model
from tests.support.live import GLB, local, until
from tests.support.stand_in_models import CountedModel

FACES = 1920
PART = part_glb()


@pytest.fixture(scope="module")
def client():
    with local(create_app(Settings(workers=1, faces=100_000), warm_up=hold_model)) as opened:
        until(lambda: opened.get("/readyz").status_code == 200)
        yield opened


def post(client, query="", body=PART, **headers):
    return client.post(f"/subdivide?{query}", content=body, headers=GLB | headers)


def tree_of(glb):
    return msgspec.json.decode(read_glb(glb).text)


def report_of(answer):
    assert answer.status_code == 200, answer.text
    return tree_of(answer.content)["asset"]["extras"]["pns"]


def test_a_glb_is_refined_and_carries_its_report_which_comes_alone_too(client):
    answer = post(client, "levels=2")
    assert answer.headers["content-type"] == "model/gltf-binary"
    assert "refine;dur=" in answer.headers["server-timing"]
    report = report_of(answer)
    assert (report["scheme"], report["totals"]["faces"]) == ("pns", 16 * FACES)
    assert [level["faces"] for level in report["levels"]] == [4 * FACES, 16 * FACES]
    assert tree_of(answer.content)["materials"] == tree_of(PART)["materials"]
    alone = post(client, Accept="application/json")
    assert alone.headers["content-type"] == "application/json"
    assert alone.json() == report


def test_every_way_to_send_a_file_gives_the_same_answer(client):
    raw = post(client)
    encoded = {"Content-Encoding": "gzip"}
    assert post(client, body=gzip.compress(PART), **encoded).content == raw.content
    for kind in ("application/octet-stream", "model/gltf-binary"):
        form = client.post("/subdivide", files={"file": ("part.glb", PART, kind)})
        assert form.content == raw.content
    text = as_gltf_json(PART, Limits())
    as_json = post(client, body=text, **{"Content-Type": "model/gltf+json; charset=utf-8"})
    assert as_json.content == client.post("/subdivide", files={"file": text}).content
    assert report_of(as_json)["levels"] == report_of(raw)["levels"]


def test_files_beside_the_document_come_as_parts_or_in_an_archive(client):
    container = read_glb(PART)
    tree = msgspec.json.decode(container.text)
    tree["buffers"][0]["uri"] = "data/part%201.bin"
    text, binary = msgspec.json.encode(tree), bytes(container.binary or b"")
    named = {"file": ("part.gltf", text), "data/part 1.bin": ("part 1.bin", binary)}
    in_parts = client.post("/subdivide", files=named)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scene/part.gltf", text)
        archive.writestr("scene/data/part 1.bin", binary)
    raw = post(client, body=packed.getvalue(), **{"Content-Type": "application/zip"})
    in_form = client.post("/subdivide", files={"file": ("part.zip", packed.getvalue())})
    assert report_of(in_parts)["totals"]["faces"] == 16 * FACES
    assert in_parts.content == raw.content == in_form.content
    missing = client.post("/subdivide", files={"file": ("part.gltf", text)})
    pointed = missing.json()["code"], missing.json()["pointer"]
    assert (missing.status_code, *pointed) == (422, "missing-file", "/buffers/0/uri")


def test_parameters_reach_the_operator(client):
    answer = post(client, "scheme=pns&budget=0.25&reference_length=2.5&diagnostics=full")
    report = report_of(answer)
    assert (report["budget"], report["meshes"][0]["reference_length"]) == (0.25, 2.5)
    attributes = tree_of(answer.content)["meshes"][0]["primitives"][0]["attributes"]
    assert {"_PNS_RATIO", "_PNS_GATE"} <= set(attributes)
    assert report_of(post(client, "scheme=loop"))["scheme"] == "loop"
    assert "extras" not in tree_of(post(client, "diagnostics=none").content)["asset"]


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "off", "3mf"])
def test_other_mesh_formats_come_back_as_the_glb_that_their_glb_gives(client, kind):
    content = formats.write(example_part(), kind)
    raw = post(client, body=content, **{"Content-Type": f"model/{kind}"})
    form = client.post("/subdivide", files={"file": (f"part.{kind.upper()}", content)})
    assert form.content == raw.content
    found, direct = report_of(raw), report_of(post(client))
    assert found["totals"]["faces"] == 16 * FACES
    assert found["levels"][0]["edges"]["boundary"] == 0
    means = [report["levels"][0]["proximity_ratio"]["mean"] for report in (found, direct)]
    assert means[0] == pytest.approx(means[1], rel=1e-3)


@pytest.mark.parametrize("target", ["gltf", "obj", "ply", "stl", "off", "3mf"])
def test_an_answer_in_another_format_is_what_the_command_writes(client, target):
    answer = post(client, f"levels=1&scheme=loop&format={target}")
    written = converted(PART, "glb", target, Options(levels=1, scheme="loop"), None, Limits())
    assert answer.content == written.content
    assert answer.headers["content-type"] == MEDIA_TYPES[target]


def test_what_a_conversion_loses_is_in_the_report(client):
    text = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\ng red\nf 1 2 3 4\n"
    files = {"file": ("quad.obj", text), "quad.mtl": ("quad.mtl", b"newmtl red\n")}
    report = report_of(client.post("/subdivide", files=files))
    assert {(change["what"], change["count"]) for change in report["changes"]} == {
        ("groups dropped: not written to GLB files", 1),
        ("vertices dropped that no face uses", 1),
        ("not used by the document: quad.mtl", 1),
    }
    assert report["totals"]["faces"] == 16


def test_a_model_given_to_the_application_runs_and_no_upload_is_logged(capfd):
    """And it crosses to each worker once."""
    before = CountedModel.pickled
    # Its worker starts here, so that it writes to the stream that is captured.
    app = create_app(Settings(workers=1), model=CountedModel(), warm_up=hold_model)
    with local(app) as client:
        for _ in range(2):
            report = report_of(post(client))
            assert report["model"] == "zero"
            assert report["levels"][0]["proximity_ratio"]["max"] == 0
        kind = {"Content-Type": "multipart/form-data; boundary=b"}
        assert post(client, body=b"--b\r\nNot a header: x", **kind).status_code == 400
    assert CountedModel.pickled == before + 1
    assert "header" not in capfd.readouterr().err


def test_without_a_model_loop_still_works():
    settings = Settings(workers=1, model="missing.onnx")
    with local(create_app(settings, warm_up=hold_model)) as client:
        refused = post(client)
        assert (refused.status_code, refused.json()["code"]) == (503, "no-model")
        assert post(client, "scheme=loop").status_code == 200
        assert client.get("/readyz").status_code == 503
