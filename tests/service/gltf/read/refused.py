"""Files with something wrong, and what is said of them."""

from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options


def refine(data, media="glb", limits=None, **options):
    options = Options(**{"scheme": "loop", "levels": 1, **options})
    return subdivide_gltf(data, media, options, None, limits or Limits())
