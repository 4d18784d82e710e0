"""Proximity-Preserving Neural Subdivision: the operator, in numpy.

    from pns_common import Mesh, load_model, pns, refine

    refined = refine(Mesh(vertices, faces), pns(load_model()), levels=2)
    refined.mesh.vertices, refined.mesh.faces, refined.report

Where to read:

    the formula         correction.py (edges), vertex/operator.py (old vertices)
    its parts           edge/frames.py F, edge/features.py φ, side_gate.py γ, prior.py D,
                        thin_faces.py ℓ, fold_guard.py G; at boundaries boundary_prior.py and
                        boundary_rule.py
    Loop                stencils.py (masks), topology.py (split), limit/ (limit surface)
    a rule, a scheme    level.py what a rule sees, placement.py what it answers; loop_rules.py,
                        learned_rules.py (the paper's), scale_free.py (the default's), schemes.py
    one level           step.py in formulas, array_steps.py one after the other
    all levels          refine.py; refine_parts.py many meshes at once, pieces/ one mesh in pieces
    model files         model_card.py, model_contract.py, onnx_model.py, numpy_network/
    other libraries     interop/
    the same compiled   fused/: each module names the one whose bits it has
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
