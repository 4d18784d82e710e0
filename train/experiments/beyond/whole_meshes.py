"""Primitives and whole assets, as they are: does refining them break anything?"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pns_common import Mesh, MeshError
from train.connectivity import connect
from train.data.dense_meshes import asset_files, read_mesh
from train.data.primitives import PRIMITIVES
from train.experiments.beyond.models import models_and_assets
from train.experiments.harness.contenders import LOOP, OURS, contenders
from train.experiments.harness.experiment import Experiment, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.metrics.self_intersection import crossing_faces
from train.metrics.shape import volume
from train.refining import AnyScheme, Refined, refine

LEVELS = 3
# Self-intersecting faces that are allowed, over Loop's.
MORE = 1.02

# Per cent of the diagonal by which a result may leave the joint box.
OVERSHOOT = 1.0

# Times N1's volume: the most that is allowed; the least is Loop's.
VOLUME = 1.1

REFERENCE = "N1"

NOTE = (
    f"{LEVELS} levels. *Flipped*: children whose normal opposes that of their counterpart under "
    "Loop, over all levels. *Overshoot*: how far a result leaves the joint bounding box of the "
    "control mesh and N1's result, in per cent of its diagonal. *Whole*: no flip, no more "
    "self-intersecting faces than Loop's and 2 % more, overshoot at most 1 %, and for closed "
    "meshes a volume between Loop's and 1.1 × N1's. *Self-intersecting before*: faces of the "
    "control mesh itself; what stays near such a mesh crosses itself where it does, and only "
    "shrinking away from it, as Loop does, mends that."
)


@dataclass(frozen=True, slots=True)
class Row:
    """One method on one mesh."""

    mesh: str = column("Mesh")
    faces: int = column("Faces", "d")
    control: int = column("Self-intersecting before", "d")
    method: str = column("Method")
    flipped: int = column("Flipped", "d")
    intersecting: int = column("Self-intersecting", "d")
    overshoot_percent: float = column("Overshoot %", ".2f")
    volume_to_loop: float | None = column("Volume / Loop's", ".3f")
    volume_to_n1: float | None = column("Volume / N1's", ".3f")
    whole: bool = column("Whole")


@dataclass(frozen=True, slots=True)
class Total:
    """One method on all meshes."""

    method: str = column("Method")
    whole: int = column("Whole", "d")
    meshes: int = column("Of", "d")
    flipped: int = column("Flipped", "d")
    intersecting: int = column("Self-intersecting faces", "d")


@dataclass(frozen=True, eq=False, slots=True)
class Measured:
    """One method's result on one mesh."""

    points: Float[np.ndarray, "V 3"]
    flipped: int
    intersecting: int
    volume: float


def meshes(laboratory: Laboratory) -> Iterator[tuple[str, Mesh]]:
    """Yield every primitive, and the whole of every file that can be read."""
    yield from ((name, make()) for name, make in PRIMITIVES.items())
    if laboratory.assets is None:
        return
    for folder in (laboratory.assets, laboratory.assets / "fixtures"):
        for path in asset_files(folder) if folder.is_dir() else []:
            try:
                yield path.name, read_mesh(path)
            except MeshError:
                continue


def measured(refined: Refined) -> Measured:
    """Measure a refinement."""
    mesh = refined.mesh
    return Measured(
        mesh.vertices,
        sum(level.flipped for level in refined.levels),
        crossing_faces(mesh),
        volume(mesh),
    )


def rows_of(
    name: str,
    mesh: Mesh,
    levels: int,
    schemes: Mapping[str, AnyScheme],
    *,
    control: int,
    limit: bool = False,
) -> list[Row]:
    """Return a row for each method, Loop and N1 among them; `control` is `crossing_faces(mesh)`."""
    surfaces = {
        method: measured(refine(mesh, scheme, levels, limit=limit))
        for method, scheme in schemes.items()
    }
    loop, reference = surfaces[LOOP], surfaces[REFERENCE]
    box = np.concatenate([mesh.vertices, reference.points])
    low, high = box.min(axis=0), box.max(axis=0)
    diagonal = float(np.linalg.norm(high - low)) or 1.0
    closed = bool(connect(mesh.faces, len(mesh.vertices)).paired.all())
    rows: list[Row] = []
    for method, surface in surfaces.items():
        beyond = np.maximum(low - surface.points, surface.points - high).max(initial=0)
        overshoot = 100 * float(beyond) / diagonal
        whole = surface.flipped == 0 and surface.intersecting <= MORE * loop.intersecting
        whole &= overshoot <= OVERSHOOT
        if closed:
            least, most = sorted((loop.volume, VOLUME * reference.volume))
            whole &= least * (1 - 1e-9) <= surface.volume <= most
        rows.append(
            Row(
                mesh=name,
                faces=len(mesh.faces),
                control=control,
                method=method,
                flipped=surface.flipped,
                intersecting=surface.intersecting,
                overshoot_percent=overshoot,
                volume_to_loop=surface.volume / loop.volume if closed and loop.volume else None,
                volume_to_n1=(
                    surface.volume / reference.volume if closed and reference.volume else None
                ),
                whole=bool(whole),
            )
        )
    return rows


def run(laboratory: Laboratory) -> Outcome:
    """Refine all meshes by all methods."""
    scale, schemes, rows = laboratory.scale, contenders(), []
    chosen = list(meshes(laboratory))[: scale.instances]
    for number, (name, mesh) in enumerate(chosen):
        laboratory.progress(f"whole-meshes: {name}", number, len(chosen))
        levels = min(LEVELS, scale.levels)
        rows += rows_of(name, mesh, levels, schemes, control=crossing_faces(mesh))
    totals = (_total(method, rows) for method in schemes)
    ours = [row for row in rows if row.method == OURS]
    return Outcome(
        (
            table("whole_meshes", "All meshes", Total, totals),
            table("whole_meshes_ours", "Each mesh, PNS", Row, ours),
            table("whole_meshes_each", "Every method", Row, rows),
        ),
        notes=(NOTE,),
    )


def _total(method: str, rows: list[Row]) -> Total:
    these = [row for row in rows if row.method == method]
    return Total(
        method=method,
        whole=sum(row.whole for row in these),
        meshes=len(these),
        flipped=sum(row.flipped for row in these),
        intersecting=sum(row.intersecting for row in these),
    )


EXPERIMENT = Experiment(
    name="whole-meshes",
    title="Primitives and assets stay whole",
    source="Beyond the paper.",
    run=run,
    seconds=60,
    reads=models_and_assets,
)
