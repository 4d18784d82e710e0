"""Spheres from h = 1.63 R to h = 0.04 R: does the gain depend on resolution?"""

from dataclasses import dataclass

import numpy as np

from pns_common import Mesh
from train.connectivity import connect
from train.data.primitives import globe, icosphere, tetrahedron
from train.experiments.beyond.models import model_files
from train.experiments.harness.contenders import LOOP, contenders
from train.experiments.harness.experiment import Experiment, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.metrics.shape import face_normal_error
from train.refining import refine
from train.surfaces.implicit import SphereRidge

LEVELS = 3
SPLITS = 6
# Of a result: the finest spheres are refined less often.
MOST_FACES = 350_000
NOTE = (
    f"Vertices on the unit sphere; {LEVELS} levels, fewer where there would be more than "
    f"{MOST_FACES:,} faces. h is the mean edge; the distance is the root "
    "mean square of |‖p‖ − 1| over all vertices. How evenly round the result is, is the spread of "
    "its radii."
)


@dataclass(frozen=True, slots=True)
class Row:
    """One method on one sphere."""

    mesh: str = column("Mesh")
    faces: int = column("Faces", "d")
    spacing: float = column("h / R", ".3f")
    method: str = column("Method")
    distance_percent: float = column("Distance %", "+.1f")
    normal_percent: float = column("Normals %", "+.1f")
    deviation: float = column("Largest − least radius", ".2e")
    deviation_to_loop: float = column("Over Loop's", ".2f")


@dataclass(frozen=True, slots=True)
class Errors:
    """Root mean square of |‖p‖ − 1|, mean angle of normals, and the spread of the radii."""

    distance: float
    normal: float
    deviation: float


def run(laboratory: Laboratory) -> Outcome:
    """Refine icospheres and a globe of each resolution."""
    coarsest = tetrahedron()
    spheres = {"tetrahedron": Mesh(coarsest.vertices / np.sqrt(3), coarsest.faces)}
    spheres |= {f"icosphere {20 * 4**k}": icosphere(k) for k in range(SPLITS)}
    spheres |= {f"globe {n}": globe(n, n // 2 - 1) for n in (4, 6, 12, 24, 48)}
    rows: list[Row] = []
    for name, mesh in list(spheres.items())[: laboratory.scale.instances]:
        laboratory.progress(f"spheres: {name}", len(rows), len(spheres) * len(contenders()))
        rows += _rows(name, mesh, min(LEVELS, laboratory.scale.levels))
    return Outcome((table("spheres", "Spheres", Row, rows),), notes=(NOTE,))


def _rows(name: str, mesh: Mesh, levels: int) -> list[Row]:
    while len(mesh.faces) * 4**levels > MOST_FACES:
        levels -= 1
    edges = connect(mesh.faces, len(mesh.vertices)).edges.numpy()
    ends = mesh.vertices[edges]
    spacing = float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean())
    ball = SphereRidge(radius=1.0, amplitude=0.0, sharpness=1.0, angle=0.3)
    errors: dict[str, Errors] = {}
    for method, scheme in contenders().items():
        refined = refine(mesh, scheme, levels).mesh
        radius = np.linalg.norm(refined.vertices, axis=1)
        errors[method] = Errors(
            distance=float(np.sqrt(((radius - 1) ** 2).mean())),
            normal=float(face_normal_error(ball, refined).mean()),
            deviation=float(np.ptp(radius)),
        )
    loop = errors[LOOP]
    return [
        Row(
            mesh=name,
            faces=len(mesh.faces),
            spacing=spacing,
            method=method,
            distance_percent=100 * (1 - own.distance / loop.distance),
            normal_percent=100 * (1 - own.normal / loop.normal),
            deviation=own.deviation,
            deviation_to_loop=own.deviation / loop.deviation,
        )
        for method, own in errors.items()
    ]


EXPERIMENT = Experiment(
    name="spheres",
    title="Spheres at every resolution",
    source="Beyond the paper.",
    run=run,
    seconds=60,
    reads=model_files,
)
