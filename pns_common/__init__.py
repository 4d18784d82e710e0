"""Proximity-Preserving Neural Subdivision: the operator, in numpy.

from pns_common import Mesh, load_model, pns, refine

refined = refine(Mesh(vertices, faces), pns(load_model()), levels=2)
refined.mesh.vertices, refined.mesh.faces, refined.report
"""

from pns_common.errors import MeshError, ModelError, ParameterError, PnsError
from pns_common.interop.subdivide import subdivide
from pns_common.mesh import Mesh, clean
from pns_common.onnx_model import load_model
from pns_common.refine import Refinement, refine
from pns_common.schemes import Scheme, loop, pns

__all__ = [
    "Mesh",
    "MeshError",
    "ModelError",
    "ParameterError",
    "PnsError",
    "Refinement",
    "Scheme",
    "clean",
    "load_model",
    "loop",
    "pns",
    "refine",
    "subdivide",
]
