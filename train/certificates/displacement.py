"""T1, bounded displacement: no vertex leaves Loop's by more than C h² / R.

h is the edge's length at an edge vertex, or the longest edge of its two faces where the scheme says
so, and the root mean square edge around an old vertex; irregular edges, and the vertices on them,
are not moved at all, nor are boundaries but by a rule of their own. No crease lines are kept: the
theorem is about what is added to Loop, and the Loop that it is measured from here knows none.
"""

from collections.abc import Sequence
from itertools import product

import numpy as np
from jaxtyping import Float

from pns_common.mesh import Mesh
from pns_common.refine import refine
from train.certificates.bodies import Body
from train.certificates.certificate import Certificate, worst
from train.certificates.plain_loop import plain_loop
from train.certificates.step import rounding
from train.certificates.subject import Subject

# Faces up to which a mesh is refined further.
LARGEST = 20_000

AT_MOST = 1 + 1e-12

# Of a mesh's size. A scale-free rule asks for a share of h: only on small meshes is that more than
# the budget, which falls as h², and something to cut off.
SMALL = 2.0**-10


def bounded_displacement(subject: Subject, bodies: Sequence[Body], levels: int = 3) -> Certificate:
    """Certify T1 from output positions and an independent Loop, at every level; R is 1.

    The value is the largest proximity ratio; positions may be off by their rounding.
    """
    measured = []
    sizes = (1.0,) if subject.scheme.guard is None else (1.0, SMALL)
    for body, size in product(bodies, sizes):
        mesh = Mesh(size * body.mesh.vertices, body.mesh.faces)
        for level in range(1, levels + 1):
            if level > 1 and len(mesh.faces) > LARGEST:
                break
            refined = refine(mesh, subject.scheme, 1, 1.0, creases=None, threads=1).mesh
            ratio, place = worst_ratio(
                mesh,
                refined.vertices,
                subject.budget,
                moves_boundaries=subject.scheme.moves_boundaries,
                wide_bound=subject.scheme.wide_bound,
            )
            times = f" times {size:g}" if size != 1 else ""
            measured.append((ratio, f"{body.name}{times}, level {level}, {place}"))
            mesh = refined
    ratio, place = worst(measured)
    return Certificate("T1", "bounded displacement", ratio, high=AT_MOST, where=place)


def worst_ratio(
    control: Mesh,
    refined: Float[np.ndarray, "N 3"],
    curvature: float,
    *,
    moves_boundaries: bool = False,
    wide_bound: bool = False,
) -> tuple[float, str]:
    """Return the largest ratio ‖p − p_Loop‖ / (C h² / R) of one step, and at which vertex.

    ``curvature`` is C / R; what the rule moves and what its bound counts: as in ``Scheme``.
    """
    base = plain_loop(control.vertices, control.faces)
    apart = np.linalg.norm(refined - base.positions, axis=1)
    reach = base.wide_reach if wide_bound else base.reach
    if moves_boundaries:
        reach = reach + base.boundary_reach
    ratio = apart / (curvature * reach**2 + rounding(control))
    place = int(np.argmax(ratio))  # numpy's argmax finds a NaN first
    return float(ratio[place]), base.labels[place]
