"""The decimation test: simplified meshes, refined, against the dense ones that they come from."""

from dataclasses import dataclass
from pathlib import Path

from pns_common import loop
from train.baselines.butterfly import modified_butterfly
from train.data.dense_meshes import (
    ASSET,
    CAD,
    CONTROL,
    CONTROL_LEVELS,
    FEWEST_FACES,
    DenseMesh,
    LeftOut,
    asset_meshes,
    cad_meshes,
)
from train.experiments.beyond.decimation_figures import gains_figure, picture_figure, pictured
from train.experiments.beyond.models import bundled_schemes, model_files
from train.experiments.harness.experiment import Cell, Column, Experiment, Outcome, Table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.harness.rows import column, table
from train.experiments.harness.style import TITLES
from train.metrics.decimation import (
    COARSE_FACES,
    LEAST_REDUCTION,
    WORSE,
    NotSimplified,
    Pair,
    Row,
    Summary,
    compare,
    gain,
    simplify,
    summaries,
)
from train.metrics.surface_distance import SurfaceErrors
from train.refining import AnyScheme

LEVELS = (2, 3)
# Sample points on a surface for each draw of the scale.
SAMPLES_A_DRAW = 10

# Lengths in tables are thousandths of the dense mesh's diagonal.
MILLI = 1000.0

NOTES = (
    "The test of Neural Subdivision (Liu et al. 2020). A dense mesh is simplified by quadric edge "
    f"collapses (fast-simplification) to {COARSE_FACES} faces, about 400 vertices as there, "
    f"or to 1/{LEAST_REDUCTION} of its faces if that is less; the coarse mesh is refined, and "
    "the result compared with the dense mesh. Where their collapses are drawn at random, these are "
    "fixed. Each coarse mesh is a manifold with its dense mesh's Euler characteristic; faces that "
    "the collapses pinch off are cut off and counted. Reference length `auto`, each model's own "
    "budget.",
    "Distances run from sample points (even by area, and from all vertices for Hausdorff) to the "
    "nearest point of the other mesh's triangles, both ways, and are given in thousandths of the "
    "dense mesh's bounding-box diagonal; normals are compared at the same points, face by face. "
    "Improvements are relative to Loop on the same mesh, in per cent; a method's number is the "
    f"plain mean over meshes, and a mesh is worse from {WORSE:g} % on.",
    "Simplified vertices lie on or near the dense surface. That favours interpolating schemes in "
    "mean distance: Loop draws every vertex inwards, Modified Butterfly leaves it where it is. "
    "What that costs shows in its Hausdorff distance and normals, wherever the coarse triangles "
    "are long and thin.",
)
ALONE = (
    "**Run on the CAD-like parts alone:** no folder of dense meshes was given (`--assets DIR`).",
)
FROM_FILES = (
    "Of each mesh file in the given folder the largest part counts that hangs together across "
    "edges of two faces, after vertices at one position are joined; it is left out where it is no "
    f"manifold, has fewer than {FEWEST_FACES} faces or lies in a plane. A file called "
    f"`…_control_mesh` holds a control mesh: its dense mesh is {CONTROL_LEVELS} levels of Loop.",
)


@dataclass(frozen=True, slots=True)
class MeshRow:
    """One dense mesh with its coarse one, or why it was left out."""

    mesh: str = column("Mesh")
    kind: str = column("Kind")
    dense_vertices: int | None = column("Dense vertices")
    dense_faces: int | None = column("Dense faces")
    coarse_vertices: int | None = column("Coarse vertices")
    coarse_faces: int | None = column("Coarse faces")
    cut_off: int | None = column("Faces cut off")
    left_out: str | None = column("Left out because")


@dataclass(frozen=True, slots=True)
class SummaryRow:
    """One method after so many levels, over all meshes."""

    method: str = column("Method")
    level: int = column("Level")
    mean_percent: float = column("Mean distance %", "+.1f")
    p95_percent: float = column("95th percentile %", "+.1f")
    hausdorff_percent: float = column("Hausdorff %", "+.1f")
    normal_percent: float = column("Normals %", "+.1f")
    worst_mesh: str = column("Worst mesh")
    worst_percent: float = column("Its mean distance %", "+.1f")
    worse: int = column("Meshes worse than Loop")
    meshes: int = column("Of")


@dataclass(frozen=True, slots=True)
class ErrorRow:
    """One method on one mesh after so many levels."""

    mesh: str = column("Mesh")
    level: int = column("Level")
    method: str = column("Method")
    mean: float = column("Mean distance, 10⁻³", ".4f")
    p95: float = column("95th percentile, 10⁻³", ".4f")
    hausdorff: float = column("Hausdorff, 10⁻³", ".4f")
    normal: float = column("Mean normal error", ".4f")


def methods() -> dict[str, AnyScheme]:
    """Return Loop, Modified Butterfly and PNS with every bundled model, the default last."""
    return {
        TITLES["loop"]: loop(),
        TITLES["butterfly"]: modified_butterfly(),
        **{f"{TITLES['pns']} `{name}`": scheme for name, scheme in bundled_schemes().items()},
    }


def run(laboratory: Laboratory) -> Outcome:
    """Simplify all meshes, refine them by all methods, and measure."""
    dense, left_out = collected(laboratory)
    simplified = [simplify(mesh) for mesh in dense]
    pairs = [outcome for outcome in simplified if isinstance(outcome, Pair)]
    left_out += [
        LeftOut(outcome.dense.name, "no simplification was a manifold like it")
        for outcome in simplified
        if isinstance(outcome, NotSimplified)
    ]
    schemes = methods()
    levels = tuple(level for level in LEVELS if level <= laboratory.scale.levels)
    rows: list[Row] = []
    for number, pair in enumerate(pairs):
        laboratory.progress(f"decimation: {pair.dense.name}", number, len(pairs))
        rows += compare([pair], schemes, levels, SAMPLES_A_DRAW * laboratory.scale.samples)
    summarised = summaries(rows, reference=TITLES["loop"])
    shown = (TITLES["loop"], list(schemes)[-1])
    return Outcome(
        tables=(
            table("decimation", "Mean over the meshes", SummaryRow, map(_summary_row, summarised)),
            _mesh_table(rows, list(schemes)),
            table("decimation_meshes", "The meshes", MeshRow, _mesh_rows(pairs, left_out)),
            table("decimation_errors", "All errors", ErrorRow, map(_error_row, rows)),
        ),
        figures=(
            gains_figure([summary for summary in summarised if summary.level == levels[-1]]),
            picture_figure(pictured(pairs), {name: schemes[name] for name in shown}, levels[-1]),
        ),
        notes=(*NOTES, *(ALONE if laboratory.assets is None else FROM_FILES)),
    )


def collected(laboratory: Laboratory) -> tuple[list[DenseMesh], list[LeftOut]]:
    """Return the dense meshes, cut to the scale, and the files that were left out."""
    read = [] if laboratory.assets is None else list(asset_meshes(laboratory.assets))
    dense = [entry for entry in read if isinstance(entry, DenseMesh)] + cad_meshes()
    by_kind = [[mesh for mesh in dense if mesh.kind == kind] for kind in (ASSET, CONTROL, CAD)]
    kept = [mesh for kind in by_kind for mesh in kind[: laboratory.scale.instances]]
    return kept, [entry for entry in read if isinstance(entry, LeftOut)]


def read_files(laboratory: Laboratory) -> list[Path]:
    """Return the bundled models, and the files in the folder of dense meshes."""
    # All files, not meshes alone: a glTF file may keep its arrays in another one.
    folder = () if laboratory.assets is None else laboratory.assets.iterdir()
    return [*model_files(laboratory), *(path for path in folder if path.is_file())]


def _summary_row(summary: Summary) -> SummaryRow:
    return SummaryRow(
        method=summary.method,
        level=summary.level,
        mean_percent=summary.percent["mean"],
        p95_percent=summary.percent["p95"],
        hausdorff_percent=summary.percent["hausdorff"],
        normal_percent=summary.percent["normal"],
        worst_mesh=summary.worst,
        worst_percent=summary.by_mesh[summary.worst],
        worse=summary.worse,
        meshes=len(summary.by_mesh),
    )


def _mesh_table(rows: list[Row], names: list[str]) -> Table:
    """Return mesh by mesh the mean distances: Loop's, and of the others also the improvement."""
    reference, *others = names
    columns = [Column("mesh", "Mesh"), Column("level", "Level")]
    columns.append(Column("loop", reference, ".3f"))
    for name in others:
        key = name.lower().replace(" ", "_").replace("`", "")
        columns += [Column(key, name, ".3f"), Column(f"{key}_percent", "%", "+.1f")]
    places: dict[tuple[str, int], dict[str, SurfaceErrors]] = {}
    for row in rows:
        places.setdefault((row.mesh, row.level), {})[row.method] = row.errors
    cells: list[tuple[Cell, ...]] = []
    for (mesh, level), errors in places.items():
        line: list[Cell] = [mesh, level, MILLI * errors[reference].mean]
        for name in others:
            percent = gain(errors[reference], errors[name])["mean"]
            line += [MILLI * errors[name].mean, percent]
        cells.append(tuple(line))
    title = "Mean distance in 10⁻³ of the diagonal, and improvement over Loop"
    return Table("decimation_by_mesh", title, tuple(columns), tuple(cells))


def _mesh_rows(pairs: list[Pair], left_out: list[LeftOut]) -> list[MeshRow]:
    taken = [
        MeshRow(
            mesh=pair.dense.name,
            kind=pair.dense.kind,
            dense_vertices=len(pair.dense.mesh.vertices),
            dense_faces=len(pair.dense.mesh.faces),
            coarse_vertices=len(pair.coarse.vertices),
            coarse_faces=len(pair.coarse.faces),
            cut_off=pair.cut_off,
            left_out=None,
        )
        for pair in pairs
    ]
    others = [MeshRow(mesh.name, ASSET, *[None] * 5, left_out=mesh.reason) for mesh in left_out]
    return taken + others


def _error_row(row: Row) -> ErrorRow:
    return ErrorRow(
        mesh=row.mesh,
        level=row.level,
        method=row.method,
        mean=MILLI * row.errors.mean,
        p95=MILLI * row.errors.p95,
        hausdorff=MILLI * row.errors.hausdorff,
        normal=row.errors.normal,
    )


EXPERIMENT = Experiment(
    name="decimation",
    title="Simplified meshes",
    source="Beyond the paper: the test of Neural Subdivision (Liu et al. 2020).",
    run=run,
    seconds=60,
    reads=read_files,
)
