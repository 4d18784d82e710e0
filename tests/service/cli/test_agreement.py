"""The command and the service give the same bytes for the same options, for every format."""

import time
from dataclasses import fields
from urllib.parse import urlencode

import pytest
from fastapi.testclient import TestClient

from service.bodies.media import FORMATS, KINDS
from service.http.app import create_app
from service.meshfiles import formats
from service.meshfiles.glb import as_gltf_json, triangles_glb
from service.options import Limits, Options
from service.settings import Settings

# Each option with a value that is not its default.
CHOSEN = {
    "levels": {"levels": 1},
    "scheme": {"scheme": "loop"},
    "budget": {"budget": 0.25},
    "reference_length": {"reference_length": 2.5},
    "diagnostics": {"diagnostics": "full"},
    "uv": {"uv": "smooth"},
    "normals": {"normals": "smooth"},
    "crease": {"crease": "normals"},
    "weld": {"weld": "off"},
    "weld_tolerance": {"weld_tolerance": 0.001},
    "border": {"border": "fixed"},
    "polygons": {"polygons": "auto"},
    "material": {"material": "a"},
    "group": {"group": "b"},
    "compress": {"compress": "draco"},
    "limit": {"limit": False},
    "tolerance": {"tolerance": "1%"},
    "angle": {"angle": 10.0},
    "max_faces": {"max_faces": 100},
    "max_edge_length": {"max_edge_length": "5%"},
}
MEDIA = {kind: media for media, kind in FORMATS.items()}


CORNERS = [(x, y, z) for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
QUADS = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
NORMALS = [(0, 0, -1), (0, 0, 1), (0, -1, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0)]


def box():
    """A box of two materials and groups, with normals, which say that its edges are hard."""
    text = "".join("v {} {} {}\n".format(*corner) for corner in CORNERS)
    text += "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    text += "".join("vn {} {} {}\n".format(*normal) for normal in NORMALS)
    for number, quad in enumerate(QUADS, start=1):
        text += f"usemtl {'ac'[number % 2]}\ng {'bd'[number // 4]}\n"
        text += "f " + " ".join(f"{v + 1}/{k}/{number}" for k, v in enumerate(quad, 1)) + "\n"
    return text.encode()


def content(kind):
    if kind == "quads":
        return box()
    mesh = formats.read(box(), "obj")
    if kind not in ("glb", "gltf"):
        return formats.write(mesh, kind)
    glb = triangles_glb(mesh)
    return glb if kind == "glb" else as_gltf_json(glb, Limits())


@pytest.fixture(scope="module")
def client():
    with TestClient(create_app(Settings(workers=1)), base_url="http://127.0.0.1") as opened:
        for _ in range(1200):
            if opened.get("/readyz").status_code == 200:
                break
            time.sleep(0.05)
        yield opened


def test_every_option_is_tried():
    names = {field.name for field in fields(Options)}
    assert names == set(CHOSEN)
    defaults = Options()
    assert all(getattr(defaults, name) != chosen[name] for name, chosen in CHOSEN.items())


@pytest.mark.spawning
@pytest.mark.parametrize("kind", [*KINDS, "quads"])
def test_each_option_gives_the_same_bytes_by_command_and_service(pns, tmp_path, client, kind):
    data = content(kind)
    kind = "obj" if kind == "quads" else kind
    source = tmp_path / f"in.{kind}"
    source.write_bytes(data)
    for name, chosen in [("", {}), *CHOSEN.items()]:
        query = {key: str(value).lower() for key, value in chosen.items()}
        answer = client.post(
            f"/subdivide?{urlencode(query)}",
            content=source.read_bytes(),
            headers={"Content-Type": MEDIA[kind]},
        )
        given = [
            "--no-limit" if value is False else f"--{key.replace('_', '-')}={value}"
            for key, value in chosen.items()
        ]
        outcome = pns("subdivide", source.name, "-o", "out.glb", *given)
        assert answer.status_code == 200 or (kind != "obj" and name in ("material", "group")), name
        if answer.status_code == 200:
            assert outcome.code == 0, (name, outcome.err, answer.text)
            assert (tmp_path / "out.glb").read_bytes() == answer.content, name
        else:
            assert outcome.code == 1, name
            assert answer.json()["detail"] in outcome.err, name
