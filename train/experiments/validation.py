"""Simplified dense shapes of seven kinds, refined by all methods and compared with the truth."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from jaxtyping import Int
from rich.console import Console

from pns_common import Mesh, Scheme, catmull_clark, load_model, loop, pns
from pns_common import sharp_edges as found_sharp_edges
from pns_common.kernels import directed as kernels
from pns_common.model.card import ModelCard
from pns_common.model.file import COMPANIONS, DEFAULT_MODEL
from pns_common.model.session import Model, networks
from train.baselines.butterfly import modified_butterfly
from train.baselines.controls import flat, n1
from train.baselines.neural_subdivision import neural_subdivision
from train.baselines.pn_triangles import pn_triangles
from train.data.pairs.polygons import REMESHERS
from train.data.sharp_labels import coarse_sharp_edges
from train.data.simplifiers import SIMPLIFIERS
from train.data.validation import Drawn, coarse_mesh, read_shape, validation_meshes
from train.experiments.harness.experiment import column, table
from train.experiments.harness.reproduce import formatted
from train.metrics.self_intersection import crossing_faces
from train.metrics.surface_distance import SurfaceErrors, gain, prepared, surface_errors
from train.metrics.whole_surface import normal_jump
from train.refining import refine

LEVELS, SAMPLES = 2, 5000

LOOP, FLAT, OURS, ZERO = "Loop", "Flat", "PNS", "PNS, networks at zero"
CATMULL_CLARK = "Catmull–Clark"

# Degrees at which PN triangles split normals.
SPLIT = 40.0

ALL = "all"


@dataclass(frozen=True)
class ZeroNetworks:
    """A model whose corrections are all zero; its card and its sharp edges are its own."""

    model: Model

    def __getattr__(self, name: str) -> Any:
        return getattr(self.model, name)

    @property
    def card(self) -> ModelCard:
        """The model's own card."""
        return self.model.card

    @property
    def name(self) -> str:
        """The model's name."""
        return self.model.name

    @property
    def hash(self) -> str:
        """The model's hash."""
        return self.model.hash

    def run(self, given: str, rows: np.ndarray, budget: float = 1.0) -> np.ndarray:
        """Return what a network of directed edges answers, but for its corrections."""
        made = np.array(self.model.run(given, rows, budget))
        if given == networks(self.card)[-1].given:
            made[:, : kernels.SHARPNESS] = 0.0
            made[:, kernels.FACE :] = 0.0
        return made


@dataclass(frozen=True, slots=True)
class Contender:
    """A method, and the edges of a coarse mesh that it takes for sharp, if it takes any.

    Attributes:
        limit: whether its results are put on the base scheme's limit surface.
        cut: whether polygons are cut into triangles for it.
    """

    scheme: Scheme
    sharp: Callable[[Mesh], Int[np.ndarray, "N 2"]] | None = None
    limit: bool = False
    cut: bool = False


def contenders(model: Model) -> dict[str, Contender]:
    """Return all methods by the names of the table, Loop first."""
    ours, zero = pns(model), pns(ZeroNetworks(model))
    return {
        LOOP: Contender(loop(), limit=True),
        FLAT: Contender(flat()),
        "PN triangles, 40°": Contender(
            pn_triangles(SPLIT), partial(found_sharp_edges, angle=SPLIT)
        ),
        "Butterfly": Contender(modified_butterfly()),
        "N1": Contender(n1()),
        "Neural Subdivision": Contender(neural_subdivision()),
        ZERO: Contender(zero, partial(found_sharp_edges, scheme=zero), limit=True),
        OURS: Contender(ours, partial(found_sharp_edges, scheme=ours), limit=True),
    }


def polygon_contenders(model: Model) -> dict[str, Contender]:
    """Return the methods for polygons, Catmull–Clark first."""
    ours, zero = pns(model), pns(ZeroNetworks(model))
    return {
        CATMULL_CLARK: Contender(catmull_clark(), limit=True),
        FLAT: Contender(flat(), cut=True),
        ZERO: Contender(zero, partial(found_sharp_edges, scheme=zero), limit=True),
        OURS: Contender(ours, partial(found_sharp_edges, scheme=ours), limit=True),
    }


@dataclass(frozen=True, slots=True)
class Measured:
    """One method on one coarse mesh.

    Attributes:
        excess: of the largest turn over the truth's largest, degrees.
        found, right, true: edges taken for sharp, those that are, and all that are; None where
            the truth's are not known, or none are taken.
    """

    mesh: str
    kind: str
    simplifier: str
    faces: int
    method: str
    errors: SurfaceErrors
    excess: float
    crossing: int
    found: int | None
    right: int | None
    true: int | None


@dataclass(frozen=True, slots=True)
class Summary:
    """One method over all coarse meshes of one kind, or by one simplifier."""

    kind: str = column("Kind, simplifier")
    meshes: int = column("Meshes", "d")
    method: str = column("Method")
    mean_percent: float = column("Mean %", "+.1f")
    p95_percent: float = column("p95 %", "+.1f")
    largest_percent: float = column("Largest %", "+.1f")
    normal_percent: float = column("Normals %", "+.1f")
    excess: float = column("Excess °", ".1f")
    crossing: float = column("Crossing", ".2f")
    worse_mean: int = column("Worse in mean", "d")
    worse_normal: int = column("Worse in normals", "d")
    precision: float | None = column("Precision", ".2f")
    recall: float | None = column("Recall", ".2f")


def measured(drawn: Sequence[Drawn], methods: Mapping[str, Contender]) -> list[Measured]:
    """Measure all methods on coarse meshes of one shape."""
    shape = read_shape(drawn[0].path, drawn[0].kind)
    true, turn = prepared(shape.mesh, SAMPLES), normal_jump(shape.mesh)
    rows = []
    for each in drawn:
        coarse = coarse_mesh(shape, each)
        if coarse is None:
            continue
        sharp = None
        if shape.sharp is not None:
            sharp = coarse_sharp_edges(coarse, shape.sharp)
        for name, method in methods.items():
            control = coarse.triangulated() if method.cut else coarse
            mesh = refine(control, method.scheme, LEVELS, limit=method.limit).mesh.triangulated()
            rows.append(
                Measured(
                    shape.name,
                    shape.kind,
                    each.simplifier,
                    coarse.face_count,
                    name,
                    surface_errors(true, prepared(mesh, SAMPLES)),
                    float(np.degrees(max(normal_jump(mesh) - turn, 0.0))),
                    int(crossing_faces(mesh).sum()),
                    *_counted(coarse, method, sharp),
                )
            )
    return rows


def _counted(
    mesh: Mesh, method: Contender, sharp: np.ndarray | None
) -> tuple[int, int, int] | tuple[None, None, None]:
    """Return how many edges are taken for sharp, how many of them are, and how many are at all."""
    if method.sharp is None or sharp is None:
        return None, None, None
    edges, count = mesh.topology().edges.astype(np.int64), len(mesh.vertices)
    found = np.sort(method.sharp(mesh), axis=1)
    taken = np.isin(edges @ [count, 1], found @ [count, 1])
    return int(taken.sum()), int((taken & sharp).sum()), int(sharp.sum())


def summary(measured: Sequence[Measured]) -> list[Summary]:
    """Return one row for each kind and simplifier and method, and for all meshes at the end."""
    rows = []
    kinds = [dict.fromkeys(getattr(row, by) for row in measured) for by in ("kind", "simplifier")]
    for kind in (*kinds[0], *kinds[1], ALL):
        own = [row for row in measured if kind in (row.kind, row.simplifier, ALL)]
        by_method = {
            method: [row for row in own if row.method == method]
            for method in dict.fromkeys(row.method for row in own)
        }
        loops, flats = next(iter(by_method.values())), by_method[FLAT]
        allowed = sum(max(a.crossing, b.crossing) for a, b in zip(loops, flats, strict=True))
        for method, these in by_method.items():
            gains = [gain(a.errors, b.errors) for a, b in zip(loops, these, strict=True)]
            found, right, true = (
                sum(getattr(row, name) or 0 for row in these) for name in ("found", "right", "true")
            )
            rows.append(
                Summary(
                    kind,
                    len(these),
                    method,
                    *(
                        float(np.mean([percents[name] for percents in gains]))
                        for name in ("mean", "p95", "hausdorff", "normal")
                    ),
                    excess=float(np.mean([row.excess for row in these])),
                    crossing=sum(row.crossing for row in these) / max(allowed, 1),
                    worse_mean=sum(percents["mean"] < 0 for percents in gains),
                    worse_normal=sum(percents["normal"] < 0 for percents in gains),
                    precision=right / found if found else None,
                    recall=right / true if true else None,
                )
            )
    return rows


def validate(
    folder: Path,
    model: Path | None,
    most: int | None,
    processes: int = 1,
    *,
    polygons: bool = False,
) -> list[Measured]:
    """Measure all methods on validation meshes; a model file stands for the bundled default.

    With `polygons` shapes are remeshed in quads, and Catmull–Clark is what others improve on.
    """
    makers = REMESHERS if polygons else SIMPLIFIERS
    drawn = sorted(validation_meshes(folder, most, makers), key=lambda each: each.path)
    shapes = [list(group) for _, group in groupby(drawn, key=lambda each: each.path)]
    measure = partial(_of_shape, model=model, polygons=polygons)
    if processes == 1:
        return [row for shape in shapes for row in measure(shape)]
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        return [row for of_shape in pool.map(measure, shapes) for row in of_shape]


def _of_shape(drawn: Sequence[Drawn], model: Path | None, *, polygons: bool) -> list[Measured]:
    default = COMPANIONS[DEFAULT_MODEL] if polygons else None
    loaded = load_model(model or default)
    return measured(drawn, polygon_contenders(loaded) if polygons else contenders(loaded))


def validate_command(
    assets: Annotated[Path, typer.Argument(help="Folder of dense meshes.", exists=True)],
    model: Annotated[Path | None, typer.Option(help="Model file; the default if none.")] = None,
    meshes: Annotated[int | None, typer.Option(help="At most so many meshes.")] = None,
    processes: Annotated[int, typer.Option(min=1, help="Shapes at once.")] = 2,
    polygons: Annotated[
        bool, typer.Option("--polygons", help="Quads over Catmull–Clark, by the model for them.")
    ] = False,
) -> None:
    """Print the validation table of a model."""
    rows = validate(assets, model, meshes, processes, polygons=polygons)
    made = table("validation", "", Summary, summary(rows))
    console = Console(width=200)
    for cells in ([each.heading for each in made.columns], *made.rows):
        texts = [
            cell if isinstance(cell, str) else formatted(cell, each)
            for cell, each in zip(cells, made.columns, strict=True)
        ]
        console.print(f"{texts[0]:22} {texts[2]:22}" + "".join(f"{t[:10]:>11}" for t in texts[3:]))
