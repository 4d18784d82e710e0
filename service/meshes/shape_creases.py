"""Which edges of a control mesh are creases by its shape: an angle, or the lines that it shows."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Int

from pns_common.base.arrays import dot
from pns_common.connectivity.creases import NO_CREASES, Creases
from pns_common.connectivity.topology import build_topology
from pns_common.geometry.crease_lines import CREASE_ANGLE, CREASE_LEVELS
from pns_common.geometry.frames import face_normals
from pns_common.mesh import Mesh
from pns_common.schemes import Scheme

from ..options import Options

LINES = Creases(line_angle=CREASE_ANGLE, levels=CREASE_LEVELS)


def lines_of(options: Options, scheme: Scheme) -> Creases:
    """Return the crease lines to look for: those of the scheme, or of who asks for them."""
    return {"auto": scheme.creases, "lines": LINES}.get(options.crease, NO_CREASES)


def creases_by_shape(mesh: Mesh, options: Options, scheme: Scheme) -> Creases:
    """Return the edges that the options keep sharp by the mesh's shape; lines are to be found."""
    if options.crease_angle is not None:
        return Creases(edges_sharper_than(mesh, options.crease_angle))
    return lines_of(options, scheme)


def edges_sharper_than(mesh: Mesh, angle: float) -> Int[np.ndarray, "N 2"]:
    """Return the interior edges whose two faces' normals differ by more than `angle` radians.

    Faces without area have no normal, and make no crease.
    """
    topology = build_topology(mesh.faces, len(mesh.vertices))
    normals = face_normals(mesh.vertices, mesh.faces)
    n1, n2 = (normals[topology.edge_faces[topology.interior, side]] for side in (0, 1))
    defined = (dot(n1, n1) > 0) & (dot(n2, n2) > 0)
    # The chord of an angle keeps small angles that a cosine would round away.
    chord = n1 - n2
    sharp = defined & (dot(chord, chord) > (2 * math.sin(angle / 2)) ** 2)
    return topology.edges[topology.interior[sharp]]
