"""A GLB's scene as plain triangles, read back without the pipeline that wrote it."""

from service.gltf.read.primitives import read_primitive
from service.gltf.read.upload import read_upload
from service.meshfiles import flatten as scenes


def flatten(glb, kind, limits):
    upload = read_upload(glb, "glb", lambda triangles: triangles, limits)
    surfaces = {
        plan.mesh: [
            scenes.Surface(read_primitive(upload.document, upload.buffers, plan.mesh, number))
            for number in plan.primitives
        ]
        for plan in upload.plans
    }
    return scenes.flatten(upload, surfaces, kind, limits)
