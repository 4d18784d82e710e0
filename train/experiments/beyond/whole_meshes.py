"""Primitives and whole assets, as they are: does refining them break anything?"""

from collections.abc import Iterator, Mapping
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pns_common.errors import MeshError
from pns_common.mesh import Mesh
from pns_common.refine import Refinement, refine
from pns_common.schemes import Scheme
from pns_common.topology import EdgeClass, build_topology
from train.data.dense_meshes import asset_files, read_mesh
from train.data.primitives import PRIMITIVES
from train.experiments.beyond.models import model_files
from train.experiments.harness.contenders import LOOP, OURS, contenders
from train.experiments.harness.experiment import Cell, Column, Experiment, Outcome, Table
from train.experiments.harness.laboratory import Laboratory
from train.metrics.fairness import volume
from train.metrics.self_intersection import self_intersecting

LEVELS = 3
MORE = 1.02
"""Self-intersecting faces that are allowed, over Loop's."""

OVERSHOOT = 1.0
"""Per cent of the diagonal by which a result may leave the joint box."""

VOLUME = 1.1
"""Times N1's volume: the most that is allowed; the least is Loop's."""

REFERENCE = "N1"

COLUMNS = (
    Column("mesh", "Mesh"),
    Column("faces", "Faces", "d"),
    Column("control", "Self-intersecting before", "d"),
    Column("method", "Method"),
    Column("flipped", "Flipped", "d"),
    Column("intersecting", "Self-intersecting", "d"),
    Column("overshoot_percent", "Overshoot %", ".2f"),
    Column("volume_to_loop", "Volume / Loop's", ".3f"),
    Column("volume_to_n1", "Volume / N1's", ".3f"),
    Column("whole", "Whole"),
)
NOTE = (
    f"{LEVELS} levels. *Flipped*: children whose normal opposes that of their counterpart under "
    "Loop, over all levels. *Overshoot*: how far a result leaves the joint bounding box of the "
    "control mesh and N1's result, in per cent of its diagonal. *Whole*: no flip, no more "
    "self-intersecting faces than Loop's and 2 % more, overshoot at most 1 %, and for closed "
    "meshes a volume between Loop's and 1.1 × N1's. *Self-intersecting before*: faces of the "
    "control mesh itself; what stays near such a mesh crosses itself where it does, and only "
    "shrinking away from it, as Loop does, mends that."
)


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


def measured(refined: Refinement) -> Measured:
    """Measure a refinement."""
    mesh = refined.mesh
    return Measured(
        mesh.vertices,
        sum(level["flipped_faces"] for level in refined.report["levels"]),
        int(self_intersecting(mesh).sum()),
        volume(mesh),
    )


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table of each mesh: COLUMNS has the meaning."""

    mesh: str
    faces: int
    control: int
    method: str
    flipped: int
    intersecting: int
    overshoot_percent: float
    volume_to_loop: float | None
    volume_to_n1: float | None
    whole: bool


def rows_of(
    name: str, mesh: Mesh, levels: int, schemes: Mapping[str, Scheme], *, limit: bool = False
) -> list[Row]:
    """Return a row for each method, Loop and N1 among them."""
    surfaces = {
        method: measured(refine(mesh, scheme, levels, threads=1, limit=limit))
        for method, scheme in schemes.items()
    }
    loop, reference = surfaces[LOOP], surfaces[REFERENCE]
    box = np.concatenate([mesh.vertices, reference.points])
    low, high = box.min(axis=0), box.max(axis=0)
    diagonal = float(np.linalg.norm(high - low)) or 1.0
    topology = build_topology(mesh.faces, len(mesh.vertices))
    closed = bool((topology.edge_class == EdgeClass.INTERIOR).all())
    control = int(self_intersecting(mesh).sum())
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
    scale, rows = laboratory.scale, []
    chosen = list(meshes(laboratory))[: scale.instances]
    for number, (name, mesh) in enumerate(chosen):
        laboratory.progress(f"whole-meshes: {name}", number, len(chosen))
        rows += rows_of(name, mesh, min(LEVELS, scale.levels), contenders())
    totals = tuple(_total(method, rows) for method in contenders())
    columns = (
        Column("method", "Method"),
        Column("whole", "Whole", "d"),
        Column("meshes", "Of", "d"),
        Column("flipped", "Flipped", "d"),
        Column("intersecting", "Self-intersecting faces", "d"),
    )
    return Outcome(
        (
            Table("whole_meshes", "All meshes", columns, totals),
            Table("whole_meshes_ours", "Each mesh, PNS", COLUMNS, _those_of(OURS, rows)),
            Table("whole_meshes_each", "Every method", COLUMNS, tuple(map(astuple, rows))),
        ),
        notes=(NOTE,),
    )


def _those_of(method: str, rows: list[Row]) -> tuple[tuple[Cell, ...], ...]:
    return tuple(astuple(row) for row in rows if row.method == method)


def _total(method: str, rows: list[Row]) -> tuple[Cell, ...]:
    these = [row for row in rows if row.method == method]
    return (
        method,
        sum(row.whole for row in these),
        len(these),
        sum(row.flipped for row in these),
        sum(row.intersecting for row in these),
    )


def read_files(laboratory: Laboratory) -> list[Path]:
    """Return the bundled models and all files of the folder."""
    folder = () if laboratory.assets is None else laboratory.assets.rglob("*")
    return [*model_files(laboratory), *(path for path in folder if path.is_file())]


EXPERIMENT = Experiment(
    name="whole-meshes",
    title="Primitives and assets stay whole",
    source="Beyond the paper.",
    run=run,
    seconds=300,
    reads=read_files,
)
