"""Assets through the whole pipeline."""

from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options
from tests.support.gltf import files
from tests.support.networks import random_model


def subdivide(*meshes, data=None, **options):
    data = files.glb(*meshes) if data is None else data
    options = Options(**{"scheme": "loop", "levels": 1, **options})
    model = random_model(0) if options.scheme == "pns" else None
    return subdivide_gltf(data, "glb", options, model, Limits())


def corner_positions(data, mesh=0, primitive=0):
    faces, attributes = files.primitive_of(data, mesh, primitive)
    return attributes["POSITION"][faces]
