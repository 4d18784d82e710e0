"""Creases of a control mesh by its shape: edges beyond an angle, or those of the scheme."""

from __future__ import annotations

import numpy as np

from pns_common.creases import NO_CREASES, Creases, edge_cosines
from pns_common.mesh import Mesh
from pns_common.schemes import Scheme
from pns_common.sharpness import creases_by_name

from ..options import Options


def creases_by_shape(mesh: Mesh, options: Options, scheme: Scheme) -> Creases:
    """Return the edges of a mesh that the options keep sharp by its shape, by name.

    With `crease=auto` these are the scheme's: none for Loop and models of format 1.
    """
    if options.crease == "auto" and scheme.creases.finds:
        return creases_by_name(mesh, scheme.creases, scheme)
    if options.crease_angle is None:
        return NO_CREASES
    topology = mesh.topology()
    rows = np.flatnonzero(edge_cosines(mesh.vertices, topology) < np.cos(options.crease_angle))
    return Creases(topology.edges[rows].astype(np.int64))
