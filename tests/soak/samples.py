"""Files of honest clients: a part in every format, no two alike, and the mesh it must become."""

from __future__ import annotations

import hashlib
import io
import zipfile
from dataclasses import dataclass

import numpy as np

from service.bodies import uploads
from service.meshfiles.convert import converted
from service.meshfiles.example import part
from service.meshfiles.formats import write
from service.meshfiles.glb import as_gltf_json, triangles_glb
from service.meshfiles.mesh_file import of_triangles
from service.options import Limits, Options

MULTIPART = "multipart/form-data; boundary=a-soak-boundary"
OF_EACH = 3


@dataclass(frozen=True)
class Sample:
    """A request and the sha256 of its answer, computed here and not by the service."""

    name: str
    query: str
    content_type: str
    body: bytes
    digest: str


def a_part(number):
    """The example's part; no two numbers have one shape."""
    mesh = part()
    rng = np.random.default_rng(number)
    moved = mesh.vertices + 1e-3 * rng.standard_normal(mesh.vertices.shape)
    return of_triangles(moved, mesh.faces)


def large_body():
    """A part whose refinement takes seconds at four levels."""
    return triangles_glb(a_part(99))


def samples():
    """`OF_EACH` of each format: GLB, glTF, archive, form, OBJ, PLY, STL, OFF and 3MF."""
    made = []
    for number in range(OF_EACH):
        mesh = a_part(number)
        glb = triangles_glb(mesh)
        gltf = as_gltf_json(glb, Limits())
        made += [
            _sample(f"glb-{number}", "model/gltf-binary", glb),
            _sample(f"gltf-{number}", "model/gltf+json", gltf),
            _sample(f"zip-{number}", "application/zip", _zip(gltf)),
            _sample(f"form-{number}", MULTIPART, _form(glb)),
        ]
        for kind in ("obj", "ply", "stl", "off", "3mf"):
            made.append(_sample(f"{kind}-{number}", f"model/{kind}", write(mesh, kind)))
    return made


def small_sample():
    """A tetrahedron: what a small job is."""
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
    faces = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
    return _sample("small", "model/gltf-binary", triangles_glb(of_triangles(vertices, faces)))


def _sample(name, content_type, body):
    options, limits = Options(levels=1, scheme="loop"), Limits()
    sent = uploads.sent(body, content_type, limits)
    done = converted(sent.data, sent.kind, "glb", options, None, limits, siblings=sent.siblings)
    digest = hashlib.sha256(done.content).hexdigest()
    return Sample(name, "levels=1&scheme=loop", content_type, body, digest)


def _zip(gltf):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("part.gltf", gltf)
    return packed.getvalue()


def _form(glb):
    head = b'--a-soak-boundary\r\nContent-Disposition: form-data; name="file"; filename="p.glb"'
    return head + b"\r\n\r\n" + glb + b"\r\n--a-soak-boundary--\r\n"
