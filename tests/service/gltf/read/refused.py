"""Refine a file, or say what is wrong with it."""

import pytest

from service.bodies.sibling_files import ALONE
from service.errors import ServiceError
from service.gltf.subdivide import subdivide_gltf
from service.options import Limits, Options


def refine(data, media="glb", limits=None, siblings=ALONE, **options):
    options = Options(**{"scheme": "loop", "levels": 1, **options})
    return subdivide_gltf(data, media, options, None, limits or Limits(), siblings=siblings)


def refusal(data, media="glb", **given):
    """The error that refuses a file."""
    with pytest.raises(ServiceError) as refused:
        refine(data, media, **given)
    return refused.value
