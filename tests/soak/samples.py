"""Files of honest clients: a part in every format, no two alike, and the mesh it must become."""

from __future__ import annotations

import base64
import hashlib
import io
import json
import zipfile
from dataclasses import dataclass

from service.bodies import uploads
from service.gltf.read.container import read_glb
from service.meshfiles.convert import converted
from service.meshfiles.formats import write
from service.meshfiles.glb import triangles_glb
from service.options import Limits, Options
from tests.soak.bodies import a_part, small_body

BOUNDARY = "a-soak-boundary"
MULTIPART = f"multipart/form-data; boundary={BOUNDARY}"
OF_EACH = 3


@dataclass(frozen=True)
class Sample:
    """A request and the sha256 of its answer, computed here and not by the service."""

    name: str
    query: str
    content_type: str
    body: bytes
    digest: str


def samples() -> list[Sample]:
    """`OF_EACH` of each format: GLB, glTF, archive, form, OBJ, PLY, STL and OFF."""
    made = []
    for number in range(OF_EACH):
        mesh = a_part(number)
        glb = triangles_glb(mesh)
        gltf = _as_gltf(glb)
        made += [
            _sample(f"glb-{number}", "model/gltf-binary", glb),
            _sample(f"gltf-{number}", "model/gltf+json", gltf),
            _sample(f"zip-{number}", "application/zip", _zip(gltf)),
            _sample(f"form-{number}", MULTIPART, _form(glb)),
        ]
        for kind in ("obj", "ply", "stl", "off", "3mf"):
            made.append(_sample(f"{kind}-{number}", f"model/{kind}", write(mesh, kind)))
    return made


def small_sample() -> Sample:
    """A tetrahedron: what a small job is."""
    return _sample("small", "model/gltf-binary", small_body())


def _sample(name: str, content_type: str, body: bytes) -> Sample:
    options = Options(levels=1, scheme="loop")
    limits = Limits()
    sent = uploads.sent(body, content_type, limits)
    done = converted(sent.data, sent.kind, "glb", options, None, limits, siblings=sent.siblings)
    digest = hashlib.sha256(done.content).hexdigest()
    return Sample(name, "levels=1&scheme=loop", content_type, body, digest)


def _as_gltf(glb: bytes) -> bytes:
    container = read_glb(glb)
    tree = json.loads(bytes(container.text))
    data = base64.b64encode(container.binary or b"").decode()
    tree["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{data}"
    return json.dumps(tree).encode()


def _zip(gltf: bytes) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("part.gltf", gltf)
    return packed.getvalue()


def _form(glb: bytes) -> bytes:
    head = (
        f'--{BOUNDARY}\r\nContent-Disposition: form-data; name="file"; filename="part.glb"\r\n'
        "Content-Type: model/gltf-binary\r\n\r\n"
    )
    return head.encode() + glb + f"\r\n--{BOUNDARY}--\r\n".encode()
