"""Real meshes, simplified by several simplifiers to several sizes, refined, and compared."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path

import numpy as np

from pns_common import Mesh
from train.data.dense_meshes import DenseMesh, asset_meshes, cad_meshes
from train.data.simplifiers import SIMPLIFIERS, simplified
from train.experiments.beyond.models import models_and_assets
from train.experiments.harness.contenders import LOOP, contenders
from train.experiments.harness.experiment import Experiment, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.metrics.self_intersection import crossing_faces
from train.metrics.surface_distance import (
    FaceTree,
    SurfaceErrors,
    gain,
    nearest,
    prepared,
    surface_errors,
)
from train.metrics.whole_surface import normal_jump
from train.refining import AnyScheme, refine

# Faces of the coarse mesh, and the levels after which it is measured.
SIZES: Mapping[int, int] = {500: 3, 2000: 3, 5000: 2, 20000: 1}

LARGEST = max(SIZES)
# Of the CAD-like parts that are simplified to the largest size: no file is dense enough.
FINENESS = 2

# The dense mesh has at least so many times the coarse one's faces.
LEAST_REDUCTION = 2

# No method: how far vertices alone can take a mesh of so many faces.
ON_SURFACE = "On the surface"

SAMPLES_A_DRAW = 10
WORSE = 0.0

NOTE = (
    "Each dense mesh is simplified by quadric collapses (fast-simplification, and libigl's), by "
    "collapses of the shortest edge, and by clustering, to each size that is at most half of its "
    "own; a coarse mesh counts where at least 80 % of it is one part of about the right size. It "
    "is refined (three levels, two from 5,000 faces, one from 20,000) and compared with the dense "
    "mesh both ways: distances from 10,000 points evenly by area, the largest also from all "
    "vertices, the angle between normals at these points. A number is the plain mean over meshes "
    "of the improvement over Loop on the same mesh. At 20,000 faces stand the CAD-like parts "
    "alone, made four times as fine: no file is dense enough. *Jump* is the mean over meshes of "
    "the largest angle between neighbouring faces over Loop's; self-intersecting faces are summed "
    "over all meshes. *Flat* refines nothing; *Q1*, *N1* and *NC* are untrained "
    "(train/baselines/controls). *On the surface* is no method: Loop's mesh with each vertex at "
    "the nearest point of the dense mesh, which nobody knows who has the coarse one alone. It says "
    "how much of Loop's error is its vertices' and how much its faces'."
)


@dataclass(frozen=True, slots=True)
class Summary:
    """One method over all coarse meshes of one size."""

    faces: int = column("Faces", "d")
    meshes: int = column("Meshes", "d")
    method: str = column("Method")
    mean_percent: float = column("Mean %", "+.1f")
    p95_percent: float = column("p95 %", "+.1f")
    largest_percent: float = column("Largest %", "+.1f")
    normal_percent: float = column("Normals %", "+.1f")
    jump: float = column("Jump / Loop's", ".2f")
    intersecting: int = column("Self-intersecting faces", "d")
    worse_mean: int = column("Worse in mean", "d")
    worse_normal: int = column("Worse in normals", "d")


@dataclass(frozen=True, slots=True)
class EachRow:
    """One method on one coarse mesh."""

    mesh: str = column("Mesh")
    simplifier: str = column("Simplifier")
    faces: int = column("Faces", "d")
    coarse_faces: int = column("Coarse faces", "d")
    method: str = column("Method")
    mean: float = column("Mean distance", ".3g")
    p95: float = column("95th percentile", ".3g")
    largest: float = column("Largest", ".3g")
    normal: float = column("Normals", ".4f")
    jump: float = column("Jump", ".3f")
    intersecting: int = column("Self-intersecting", "d")


@dataclass(frozen=True, slots=True)
class Coarse:
    """One coarse mesh with what it came from."""

    dense: DenseMesh
    simplifier: str
    faces: int
    mesh: Mesh


@dataclass(frozen=True, slots=True)
class Measured:
    """One method's result on one coarse mesh."""

    coarse: Coarse
    method: str
    errors: SurfaceErrors
    jump: float
    intersecting: int


def coarse_meshes(
    dense: Iterable[DenseMesh], sizes: Iterable[int] = tuple(SIZES)
) -> Iterator[Coarse]:
    """Yield every simplification that counts."""
    for original in dense:
        for faces in sizes:
            if len(original.mesh.faces) < LEAST_REDUCTION * faces:
                continue
            for name, simplifier in SIMPLIFIERS.items():
                mesh = simplified(original.mesh, simplifier, faces)
                if mesh is not None:
                    yield Coarse(original, name, faces, mesh)


def compared(
    coarse: Coarse, schemes: Mapping[str, AnyScheme], deepest: int, samples: int
) -> list[Measured]:
    """Refine a coarse mesh by all schemes, to its size's level or to `deepest`, and measure it."""
    true = prepared(coarse.dense.mesh, samples)
    level = min(SIZES[coarse.faces], deepest)
    refined = {name: refine(coarse.mesh, scheme, level) for name, scheme in schemes.items()}
    meshes = {name: refinement.mesh for name, refinement in refined.items()}
    meshes[ON_SURFACE] = on_surface(meshes[LOOP], true.tree)
    rows = []
    for method, mesh in meshes.items():
        errors = surface_errors(true, prepared(mesh, samples))
        rows.append(Measured(coarse, method, errors, normal_jump(mesh), crossing_faces(mesh)))
    return rows


def on_surface(mesh: Mesh, surface: FaceTree) -> Mesh:
    """Return a mesh with each vertex at the nearest point of a surface."""
    return Mesh(nearest(surface, mesh.vertices).point, mesh.faces)


def summary(measured: list[Measured]) -> list[Summary]:
    """Return one row for each size and method."""
    rows: list[Summary] = []
    for faces, method in dict.fromkeys((row.coarse.faces, row.method) for row in measured):
        these = [row for row in measured if (row.coarse.faces, row.method) == (faces, method)]
        loops = [row for row in measured if (row.coarse.faces, row.method) == (faces, LOOP)]
        pairs = list(zip(loops, these, strict=True))
        gains = [gain(reference.errors, row.errors) for reference, row in pairs]
        rows.append(
            Summary(
                faces=faces,
                meshes=len(these),
                method=method,
                mean_percent=_mean(gains, "mean"),
                p95_percent=_mean(gains, "p95"),
                largest_percent=_mean(gains, "hausdorff"),
                normal_percent=_mean(gains, "normal"),
                jump=float(np.mean([row.jump / reference.jump for reference, row in pairs])),
                intersecting=sum(row.intersecting for row in these),
                worse_mean=sum(percents["mean"] < WORSE for percents in gains),
                worse_normal=sum(percents["normal"] < WORSE for percents in gains),
            )
        )
    return rows


def _mean(gains: list[dict[str, float]], metric: str) -> float:
    return float(np.mean([percents[metric] for percents in gains]))


def _outcome(name: str, title: str, meshes: Iterable[Coarse], laboratory: Laboratory) -> Outcome:
    scale = laboratory.scale
    coarse = list(islice(meshes, scale.instances))
    measured: list[Measured] = []
    for number, mesh in enumerate(coarse):
        laboratory.progress(f"{name}: {mesh.dense.name}", number, len(coarse))
        measured += compared(mesh, contenders(), scale.levels, SAMPLES_A_DRAW * scale.samples)
    return Outcome(
        (
            table(name, title, Summary, summary(measured)),
            table(f"{name}_each", "Each mesh", EachRow, map(_row, measured)),
        ),
        notes=(NOTE,),
    )


def _row(measured: Measured) -> EachRow:
    coarse, errors = measured.coarse, measured.errors
    return EachRow(
        mesh=coarse.dense.title,
        simplifier=coarse.simplifier,
        faces=coarse.faces,
        coarse_faces=len(coarse.mesh.faces),
        method=measured.method,
        mean=errors.mean,
        p95=errors.p95,
        largest=errors.hausdorff,
        normal=errors.normal,
        jump=measured.jump,
        intersecting=measured.intersecting,
    )


def run_test(laboratory: Laboratory) -> Outcome:
    """Measure on the files in the folder itself, and on CAD-like parts."""
    files = () if laboratory.assets is None else dense_files(laboratory.assets)
    meshes = chain(
        coarse_meshes(files),
        coarse_meshes(cad_meshes()),
        coarse_meshes(cad_meshes(FINENESS), [LARGEST]),
    )
    return _outcome("real_meshes", "Simplified meshes (test)", meshes, laboratory)


def run_validation(laboratory: Laboratory) -> Outcome:
    """Measure on the files of the folder `dense` in it, on which everything was chosen."""
    assert laboratory.assets is not None  # needs_assets
    meshes = coarse_meshes(dense_files(laboratory.assets / "dense"))
    return _outcome("real_validation", "Simplified meshes (validation)", meshes, laboratory)


def dense_files(folder: Path) -> Iterator[DenseMesh]:
    """Yield the meshes of a folder that can be simplified."""
    return (mesh for mesh in asset_meshes(folder) if isinstance(mesh, DenseMesh))


TEST = Experiment(
    name="real-meshes",
    title="Real meshes, simplified",
    source="Beyond the paper. The test set: run once, when everything was chosen.",
    run=run_test,
    seconds=300,
    reads=models_and_assets,
)
VALIDATION = Experiment(
    name="real-validation",
    title="Real meshes, simplified: validation",
    source="Beyond the paper. The validation set, on which the default model was chosen.",
    run=run_validation,
    seconds=150,
    needs_assets=True,
    reads=models_and_assets,
)
