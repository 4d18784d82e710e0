"""Bending of a surface beyond Loop's: ripples that the control mesh does not have."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pns_common import Mesh
from train.data.dense_meshes import CONTROL_ENDING, asset_files, read_mesh
from train.data.primitives import PRIMITIVES, TRIANGULATED_QUADS
from train.experiments.beyond.models import model_files
from train.experiments.harness.contenders import LOOP, OURS, contenders
from train.experiments.harness.experiment import Experiment, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.metrics.shape import bending
from train.refining import refine

LEVELS = 4
CAGE, QUADS, PRIMITIVE = "authored cage", "triangulated quads", "primitive"

NOTE = (
    f"After {LEVELS} levels, from vertex normals that are linear over each face; it has no unit. "
    "A surface nearer to its control mesh has to bend more than Loop's, which shrinks. What the "
    "mesh's diagonals or valences add on top shows as ripples."
)


@dataclass(frozen=True, slots=True)
class Row:
    """One method on one mesh."""

    kind: str = column("Kind")
    mesh: str = column("Mesh")
    method: str = column("Method")
    bending: float = column("∫ (κ₁² + κ₂²) dA", ".1f")
    to_loop: float = column("/ Loop's", ".2f")
    to_n1: float = column("/ N1's", ".2f")


def meshes(laboratory: Laboratory) -> Iterator[tuple[str, str, Mesh]]:
    """Yield kind, name and mesh."""
    if laboratory.assets is not None:
        for path in asset_files(laboratory.assets):
            if path.stem.endswith(CONTROL_ENDING):
                yield CAGE, path.stem.removesuffix(CONTROL_ENDING), read_mesh(path)
    for name, make in TRIANGULATED_QUADS.items():
        yield QUADS, name, make()
    for name, make in PRIMITIVES.items():
        if name not in TRIANGULATED_QUADS:
            yield PRIMITIVE, name, make()


def run(laboratory: Laboratory) -> Outcome:
    """Measure all meshes."""
    chosen, rows = list(meshes(laboratory))[: laboratory.scale.instances], []
    for number, (kind, name, mesh) in enumerate(chosen):
        laboratory.progress(f"fairness: {name}", number, len(chosen))
        rows += _rows(kind, name, mesh, min(LEVELS, laboratory.scale.levels))
    ours = [row for row in rows if row.method == OURS]
    return Outcome(
        (
            table("fairness_ours", "Bending, PNS", Row, ours),
            table("fairness", "Every method", Row, rows),
        ),
        notes=(NOTE,),
    )


def _rows(kind: str, name: str, mesh: Mesh, levels: int) -> list[Row]:
    energies = {
        method: bending(refine(mesh, scheme, levels).mesh)
        for method, scheme in contenders().items()
    }
    return [
        Row(kind, name, method, energy, energy / energies[LOOP], energy / energies["N1"])
        for method, energy in energies.items()
    ]


def read_files(laboratory: Laboratory) -> list[Path]:
    """Return the bundled models and the control meshes."""
    folder = [] if laboratory.assets is None else asset_files(laboratory.assets)
    return [*model_files(laboratory), *folder]


EXPERIMENT = Experiment(
    name="fairness",
    title="Fairness",
    source="Beyond the paper.",
    run=run,
    seconds=30,
    reads=read_files,
)
