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


@pytest.fixture(scope="module")
def client():
    with local(create_app(Settings(workers=1, faces=100_000))) as opened:
        until(lambda: opened.get("/readyz").status_code == 200)
        yield opened


@pytest.fixture(scope="module")
def part():
    return part_glb()


def tree_of(glb):
    return msgspec.json.decode(read_glb(glb).text)


def report_of(answer):
    assert answer.status_code == 200, answer.text
    return tree_of(answer.content)["asset"]["extras"]["pns"]


def test_a_body_in_gzip_is_refined_as_it_was_before(client, part):
    plain = client.post("/subdivide", content=part, headers=GLB)
    packed = client.post(
        "/subdivide", content=gzip.compress(part), headers=GLB | {"Content-Encoding": "gzip"}
    )
    assert packed.status_code == 200
    assert packed.content == plain.content


def test_a_raw_glb_is_refined_and_carries_its_report(client, part):
    answer = client.post("/subdivide?levels=2", content=part, headers=GLB)
    assert answer.headers["content-type"] == "model/gltf-binary"
    report = report_of(answer)
    assert report["scheme"] == "pns"
    assert report["totals"]["faces"] == 16 * FACES
    assert [level["faces"] for level in report["levels"]] == [4 * FACES, 16 * FACES]
    assert tree_of(answer.content)["materials"] == tree_of(part)["materials"]
    assert "refine;dur=" in answer.headers["server-timing"]


def test_every_way_to_send_a_file_gives_the_same_answer(client, part):
    raw = client.post("/subdivide", content=part, headers=GLB)
    for kind in ("application/octet-stream", "model/gltf-binary"):
        form = client.post("/subdivide", files={"file": ("part.glb", part, kind)})
        assert form.content == raw.content
    text = as_gltf_json(part, Limits())
    as_json = client.post(
        "/subdivide", content=text, headers={"Content-Type": "model/gltf+json; charset=utf-8"}
    )
    in_form = client.post("/subdivide", files={"file": text})
    assert as_json.content == in_form.content
    assert report_of(as_json)["levels"] == report_of(raw)["levels"]


def test_files_beside_the_document_come_as_parts_or_in_an_archive(client, part):
    container = read_glb(part)
    tree = msgspec.json.decode(container.text)
    tree["buffers"][0]["uri"] = "data/part%201.bin"
    text, binary = msgspec.json.encode(tree), bytes(container.binary or b"")
    named = {"file": ("part.gltf", text), "data/part 1.bin": ("part 1.bin", binary)}
    in_parts = client.post("/subdivide", files=named)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scene/part.gltf", text)
        archive.writestr("scene/data/part 1.bin", binary)
    raw = client.post(
        "/subdivide", content=packed.getvalue(), headers={"Content-Type": "application/zip"}
    )
    in_form = client.post("/subdivide", files={"file": ("part.zip", packed.getvalue())})
    assert report_of(in_parts)["totals"]["faces"] == 16 * FACES
    assert in_parts.content == raw.content == in_form.content

    missing = client.post("/subdivide", files={"file": ("part.gltf", text)})
    assert missing.status_code == 422
    assert missing.json()["code"] == "missing-file"
    assert missing.json()["pointer"] == "/buffers/0/uri"


def test_accept_json_gives_the_same_report_alone(client, part):
    whole = client.post("/subdivide", content=part, headers=GLB)
    alone = client.post("/subdivide", content=part, headers=GLB | {"Accept": "application/json"})
    assert alone.headers["content-type"] == "application/json"
    assert alone.json() == report_of(whole)


def test_parameters_reach_the_operator(client, part):
    query = "/subdivide?scheme=pns&budget=0.25&reference_length=2.5&diagnostics=full"
    answer = client.post(query, content=part, headers=GLB)
    report = report_of(answer)
    assert report["budget"] == 0.25
    assert report["meshes"][0]["reference_length"] == 2.5
    attributes = tree_of(answer.content)["meshes"][0]["primitives"][0]["attributes"]
    assert {"_PNS_RATIO", "_PNS_GATE"} <= set(attributes)
    loop = client.post("/subdivide?scheme=loop", content=part, headers=GLB)
    assert report_of(loop)["scheme"] == "loop"
    bare = client.post("/subdivide?diagnostics=none", content=part, headers=GLB)
    assert "extras" not in tree_of(bare.content)["asset"]


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "off", "3mf"])
def test_other_mesh_formats_come_back_as_the_glb_that_their_glb_gives(client, part, kind):
    triangles = example_part()
    content = formats.write(triangles, kind)
    raw = client.post("/subdivide", content=content, headers={"Content-Type": f"model/{kind}"})
    assert report_of(raw)["totals"]["faces"] == 16 * FACES
    assert report_of(raw)["levels"][0]["edges"]["boundary"] == 0
    form = client.post("/subdivide", files={"file": (f"part.{kind.upper()}", content)})
    assert form.content == raw.content
    direct = report_of(client.post("/subdivide", content=part, headers=GLB))
    mean_ratio = report_of(raw)["levels"][0]["proximity_ratio"]["mean"]
    assert mean_ratio == pytest.approx(direct["levels"][0]["proximity_ratio"]["mean"], rel=1e-3)


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


def test_a_model_given_to_the_application_is_the_one_that_runs(part):
    """And it crosses to each worker once."""
    before = CountedModel.pickled
    app = create_app(Settings(workers=1), model=CountedModel(), warm_up=hold_model)
    with local(app) as client:
        for _ in range(3):
            report = report_of(client.post("/subdivide", content=part, headers=GLB))
            assert report["model"] == "zero"
            assert report["levels"][0]["proximity_ratio"]["max"] == 0
    assert CountedModel.pickled == before + 1


def test_what_an_upload_says_is_not_logged(capfd):
    kind = {"Content-Type": "multipart/form-data; boundary=b"}
    # Its worker starts here, so that it writes to the stream that is captured.
    with local(create_app(Settings(workers=1), warm_up=hold_model)) as client:
        answer = client.post("/subdivide", content=b"--b\r\nNot a header: x", headers=kind)
        assert answer.status_code == 400
    assert "header" not in capfd.readouterr().err


def test_without_a_model_loop_still_works(part):
    settings = Settings(workers=1, model="missing.onnx")
    with local(create_app(settings, warm_up=hold_model)) as client:
        refused = client.post("/subdivide", content=part, headers=GLB)
        assert refused.status_code == 503
        assert refused.json()["code"] == "no-model"
        assert client.post("/subdivide?scheme=loop", content=part, headers=GLB).status_code == 200
        assert client.get("/readyz").status_code == 503


@pytest.mark.parametrize("target", ["gltf", "obj", "ply", "stl", "off", "3mf"])
def test_an_answer_in_another_format_is_what_the_command_writes(client, target):
    query = f"levels=1&scheme=loop&format={target}"
    answer = client.post(f"/subdivide?{query}", content=part_glb(), headers=GLB)
    written = converted(part_glb(), "glb", target, Options(levels=1, scheme="loop"), None, Limits())
    assert answer.content == written.content
    assert answer.headers["content-type"] == MEDIA_TYPES[target]
