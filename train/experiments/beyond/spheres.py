"""Spheres from h = 1.63 R to h = 0.04 R: does the gain depend on resolution?"""

import numpy as np

from pns_common.mesh import Mesh
from pns_common.refine import refine
from pns_common.topology import build_topology
from train.data.primitives import globe, icosphere, tetrahedron
from train.experiments.beyond.models import model_files
from train.experiments.harness.contenders import LOOP, contenders
from train.experiments.harness.experiment import Cell, Column, Experiment, Outcome, Table
from train.experiments.harness.laboratory import Laboratory
from train.metrics.shape import face_normal_error
from train.surfaces.implicit import SphereRidge

LEVELS = 3
SPLITS = 6
MOST_FACES = 350_000
"""Of a result: the finest spheres are refined less often."""
COLUMNS = (
    Column("mesh", "Mesh"),
    Column("faces", "Faces", "d"),
    Column("spacing", "h / R", ".3f"),
    Column("method", "Method"),
    Column("distance_percent", "Distance %", "+.1f"),
    Column("normal_percent", "Normals %", "+.1f"),
    Column("deviation", "Largest − least radius", ".2e"),
    Column("deviation_to_loop", "Over Loop's", ".2f"),
)
NOTE = (
    f"Vertices on the unit sphere; {LEVELS} levels, fewer where there would be more than "
    f"{MOST_FACES:,} faces. h is the mean edge; the distance is the root "
    "mean square of |‖p‖ − 1| over all vertices. How evenly round the result is, is the spread of "
    "its radii."
)


def run(laboratory: Laboratory) -> Outcome:
    """Refine icospheres and a globe of each resolution."""
    coarsest = tetrahedron()
    spheres = {"tetrahedron": Mesh(coarsest.vertices / np.sqrt(3), coarsest.faces)}
    spheres |= {f"icosphere {20 * 4**k}": icosphere(k) for k in range(SPLITS)}
    spheres |= {f"globe {n}": globe(n, n // 2 - 1) for n in (4, 6, 12, 24, 48)}
    rows: list[tuple[Cell, ...]] = []
    for name, mesh in list(spheres.items())[: laboratory.scale.instances]:
        laboratory.progress(f"spheres: {name}", len(rows), len(spheres) * len(contenders()))
        rows += _rows(name, mesh, min(LEVELS, laboratory.scale.levels))
    return Outcome((Table("spheres", "Spheres", COLUMNS, tuple(rows)),), notes=(NOTE,))


def _rows(name: str, mesh: Mesh, levels: int) -> list[tuple[Cell, ...]]:
    while len(mesh.faces) * 4**levels > MOST_FACES:
        levels -= 1
    edges = build_topology(mesh.faces, len(mesh.vertices)).edges
    ends = mesh.vertices[edges]
    spacing = float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean())
    ball = SphereRidge(radius=1.0, amplitude=0.0, sharpness=1.0, angle=0.3)
    errors: dict[str, tuple[float, float, float]] = {}
    for method, scheme in contenders().items():
        refined = refine(mesh, scheme, levels, threads=1).mesh
        radius = np.linalg.norm(refined.vertices, axis=1)
        errors[method] = (
            float(np.sqrt(((radius - 1) ** 2).mean())),
            float(face_normal_error(ball, refined).mean()),
            float(np.ptp(radius)),
        )
    loop = errors[LOOP]
    return [
        (
            name,
            len(mesh.faces),
            spacing,
            method,
            100 * (1 - own[0] / loop[0]),
            100 * (1 - own[1] / loop[1]),
            own[2],
            own[2] / loop[2],
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
