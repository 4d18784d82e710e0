"""Proximity-Preserving Neural Subdivision: the operator, in numpy.

    from pns_common import Mesh, load_model, pns, refine

    refined = refine(Mesh(vertices, faces), pns(load_model()), levels=2)
    refined.mesh.vertices, refined.mesh.faces, refined.report

Where to read, each room seeing only those above it:

    base/           arrays of any backend, row blocks, whole files; errors.py beside it
    mesh.py         the control mesh; connectivity/ what follows from its faces: topology.py (split)
    geometry/       what is measured on it: frames.py F, rings.py, thin_faces.py ℓ, crease_lines/
    masks/          Loop: stencils.py one step's masks, limit/ those of the limit surface
    features/       φ, what the networks read of an edge and of a vertex's ring
    formula/        correction.py (edges) and vertex_operator.py (old vertices); side_gate.py γ,
                    prior.py D, tips.py, curve_prior.py, fold_guard.py G
    models/         what a model says of itself: card.py, contract.py; the bundled files
    rules/          control_level.py what a rule sees, placement.py what it answers; loop.py,
                    learned.py (the paper's), scale_free.py (the default's), curves.py
    schemes.py      a rule for old vertices and one for edges
    levels/         step.py one level in formulas, array_steps.py one after the other; the report
    fused/          the same compiled: each module names the one whose bits it has
    runtimes/       what runs a model file: onnx_model.py loads it, and finds who does
    arguments.py    what may be asked; refine.py all levels, refine_parts.py many meshes at once,
    interop/        meshes of other libraries
"""

from pns_common.connectivity.creases import Creases
from pns_common.crease_lines import crease_lines
from pns_common.errors import MeshError, ModelError, ParameterError, PnsError
from pns_common.interop.subdivide import subdivide
from pns_common.mesh import Mesh, clean
from pns_common.refine import Refinement, refine
from pns_common.runtimes.onnx_model import load_model
from pns_common.schemes import Scheme, loop, pns

__all__ = [
    "Creases",
    "Mesh",
    "MeshError",
    "ModelError",
    "ParameterError",
    "PnsError",
    "Refinement",
    "Scheme",
    "clean",
    "crease_lines",
    "load_model",
    "loop",
    "pns",
    "refine",
    "subdivide",
]
