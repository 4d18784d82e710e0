"""The command and the service give the same bytes for the same options, for every format."""

import time
from dataclasses import fields, replace
from urllib.parse import urlencode

import numpy as np
import pytest
from fastapi.testclient import TestClient

from service.bodies.media import FORMATS, KINDS
from service.http.app import create_app
from service.meshfiles import formats
from service.meshfiles.glb import as_gltf_json, triangles_glb
from service.meshfiles.mesh_file import (
    GROUP,
    MATERIAL,
    NORMAL,
    UV,
    Labels,
    Layer,
    MeshFile,
    of_triangles,
)
from service.options import Limits, Options
from service.settings import Settings
from tests.support.gltf.shapes import box

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
    "max_faces": {"max_faces": 100},
    "max_edge_length": {"max_edge_length": "5%"},
}
MEDIA = {kind: media for media, kind in FORMATS.items()}


def mesh():
    """A box of two materials with normals, which say that its edges are hard, and coordinates."""
    shape = box()
    made = of_triangles(shape["POSITION"].astype(float), shape["indices"])
    a, b, c = made.vertices[made.faces].transpose(1, 0, 2)
    normals = (b - a)[:, [1, 2, 0]] * (c - a)[:, [2, 0, 1]]
    normals -= (b - a)[:, [2, 0, 1]] * (c - a)[:, [1, 2, 0]]
    layers = {
        NORMAL: Layer(normals, made.corners * 0 + (range_of(made) // 3)),
        UV: Layer(made.vertices[:, :2] / 2 + 0.5, made.corners),
    }
    halves = np.arange(len(made.faces)) // 2 % 2  # pairs of triangles, which make quads
    labels = {MATERIAL: Labels(("a", "c"), halves), GROUP: Labels(("b", "d"), halves // 2)}
    return MeshFile(made.vertices, made.offsets, made.corners, layers, labels=labels)


def range_of(made):
    return (made.corners * 0 + 1).cumsum() - 1


def quads():
    """The box, its triangles joined in pairs."""
    made = mesh()
    pairs = (np.arange(len(made.corners)).reshape(-1, 6)[:, [0, 1, 2, 5]]).reshape(-1)
    corners = made.corners.reshape(-1, 6)
    assert (corners[:, [0, 2]] == corners[:, [3, 4]]).all()
    return replace(
        made,
        offsets=made.offsets[: len(pairs) // 4 + 1] // 3 * 4,
        corners=made.corners[pairs],
        layers={name: Layer(own.values, own.rows[pairs]) for name, own in made.layers.items()},
        labels={kind: Labels(own.names, own.of_face[::2]) for kind, own in made.labels.items()},
    )


def content(kind):
    if kind not in ("glb", "gltf"):
        return formats.write(mesh(), kind)
    glb = triangles_glb(mesh())
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
    data = formats.write(quads(), "obj") if kind == "quads" else content(kind)
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
