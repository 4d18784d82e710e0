"""Which edges of a control mesh are creases by its shape: an angle, or the lines that it shows."""

from __future__ import annotations

from pns_common.connectivity.creases import NO_CREASES, Creases
from pns_common.crease_lines import LINES
from pns_common.geometry.sharp_edges import edges_sharper_than
from pns_common.mesh import Mesh
from pns_common.schemes import Scheme

from ..options import Options


def lines_of(options: Options, scheme: Scheme) -> Creases:
    """Return the crease lines to look for: those of the scheme, or of who asks for them."""
    return {"auto": scheme.creases, "lines": LINES}.get(options.crease, NO_CREASES)


def creases_by_shape(mesh: Mesh, options: Options, scheme: Scheme) -> Creases:
    """Return the edges that the options keep sharp by the mesh's shape; lines are to be found."""
    if options.crease_angle is not None:
        return Creases(edges_sharper_than(mesh.vertices, mesh.faces, options.crease_angle))
    return lines_of(options, scheme)
