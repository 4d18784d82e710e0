"""T5, regular regions: the surface stays as smooth as Loop's. Measured, not proved.

C¹ limits show in the refined meshes: the angle between neighbouring faces goes to nothing, in the
end by half a level.
"""

import numpy as np

from train.certificates.bodies import bumpy_torus
from train.certificates.certificate import Certificate, Kind
from train.certificates.subject import Subject
from train.refining import refine

LEVELS = 5

AT_LEAST = 0.5


def regular_smoothness(subject: Subject, seed: int) -> Certificate:
    """Measure T5 on a torus whose vertices are all regular: the order at which normals settle.

    The value is the fall of the largest face-normal jump from the last level but one to the last,
    in powers of two; 1 for Loop.
    """
    refined = refine(bumpy_torus(seed), subject.scheme, LEVELS, 1.0)
    jumps = np.array([level.normal_jump for level in refined.levels])
    order = float(np.log2(jumps[-2] / jumps[-1])) if jumps[-1] > 0 else np.inf
    where = f"bumpy torus, level {LEVELS}: largest jump {np.degrees(jumps[-1]):.1f}°"
    name = "normals settle in regular regions"
    return Certificate("T5", name, order, low=AT_LEAST, where=where, kind=Kind.MEASURED)
