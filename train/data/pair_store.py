"""Training pairs on disk: made once, of real shapes and of the procedural stream."""

import multiprocessing
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import count as count_from_0
from itertools import islice
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from pns_common import Mesh
from pns_common.files import replace_file
from train.data.pairs.drawn import drawn_pair
from train.data.pairs.pair_stream import pair_stream
from train.data.pairs.polygons import in_polygons, polygon_stream
from train.data.pairs.references import Pair, ball_pair
from train.data.shape_library import TRAINING, ListedShape, listed_shapes
from train.data.shape_pairs import shape_pairs

# Points of a procedural surface, at most.
MOST_POINTS = 20_000

# One in so many procedural pairs is drawn with few sides: of triangles, and of polygons.
DRAWN, DRAWN_POLYGONS = 5, 2
# How often a drawn one of triangles is a ball. Quads of balls would round cubes.
BALLS = 0.2


@dataclass(frozen=True, eq=False, slots=True)
class StoredPairs:
    """Coarse meshes of one surface.

    Attributes:
        points, normals: of the surface.
        kinds: of each pair, "kind/simplifier" for real shapes.
        meshes: the coarse meshes.
    """

    points: Float32[np.ndarray, "P 3"]
    normals: Float32[np.ndarray, "P 3"]
    kinds: list[str]
    meshes: list[Mesh]


def make_pairs(
    shapes: Path, folder: Path, procedural: int, seed: int, processes: int, *, polygons: bool
) -> list[Path]:
    """Make the pairs that are not in a folder yet, and return all files of a recipe, in order.

    Args:
        shapes: folder of prepared shapes.
        folder: where pairs are kept.
        procedural: pairs of the procedural stream.
        seed: of all of them.
        processes: at once; the pairs do not depend on it.
        polygons: quads, over Catmull–Clark.

    Raises:
        MeshError: a shape is missing; the message says which.
    """
    folder.mkdir(parents=True, exist_ok=True)
    listed = [(number, shape) for number, shape in enumerate(listed_shapes(TRAINING))]
    # A process for each shape: what MeshLab collapses depends on what it collapsed before.
    fresh = multiprocessing.get_context("forkserver")
    fresh.set_forkserver_preload([__name__])
    with ProcessPoolExecutor(processes, fresh, max_tasks_per_child=1) as pool:
        real = [
            pool.submit(_keep_real, shapes, folder, number, shape, seed, polygons)
            for number, shape in listed
        ]
        drawn = pool.submit(_keep_procedural, folder, procedural, seed, polygons)
        return [path for each in [*real, drawn] for path in each.result()]


def read_pairs(path: Path) -> StoredPairs:
    """Read one file of the folder."""
    with np.load(path) as arrays:
        kinds = arrays["kinds"].tolist()
        meshes = [
            Mesh(arrays[f"vertices_{n}"], (arrays[f"corners_{n}"], arrays[f"offsets_{n}"]))
            for n in range(len(kinds))
        ]
        return StoredPairs(arrays["points"], arrays["normals"], kinds, meshes)


def _keep_real(
    shapes: Path, folder: Path, number: int, shape: ListedShape, seed: int, polygons: bool
) -> list[Path]:
    ending = "-quads" if polygons else ""
    mark = folder / f"{seed}-{shape.name}{ending}.txt"
    if not mark.exists():
        made: list[str] = []
        path = shapes / TRAINING / f"{shape.name}.npz"
        for turn, pairs in enumerate(
            shape_pairs(path, shape.kind, seed * 1000 + number, polygons=polygons)
        ):
            if pairs:
                made.append(f"{seed}-{shape.name}{ending}-{turn}.npz")
                _keep(folder / made[-1], pairs)
        # Last, so that what was interrupted is made again.
        replace_file(mark, "\n".join(made).encode())
    return [folder / name for name in mark.read_text(encoding="utf-8").splitlines()]


def _keep_procedural(folder: Path, count: int, seed: int, polygons: bool) -> list[Path]:
    ending = "quads" if polygons else "stream"
    paths = [folder / f"{seed}-{ending}-{number:05d}.npz" for number in range(count)]
    if not all(path.exists() for path in paths):
        stream = islice(_with_drawn(seed, polygons), count)
        for path, pair in zip(paths, stream, strict=True):
            _keep(path, [pair])
    return paths


def _with_drawn(seed: int, polygons: bool) -> Iterator[Pair]:
    """Yield the stream's pairs, and bodies of revolution and balls in place of some."""
    rng = np.random.default_rng(seed)
    stream = polygon_stream(seed) if polygons else pair_stream(seed)
    often = DRAWN_POLYGONS if polygons else DRAWN
    for number in count_from_0():
        if number % often:
            yield next(stream)
            continue
        if not polygons and rng.random() < BALLS:
            yield ball_pair(rng)
            continue
        pair = drawn_pair(rng)
        yield replace(pair, coarse=in_polygons(pair.coarse, rng)) if polygons else pair


def _keep(path: Path, pairs: Iterable[Pair]) -> None:
    pairs = list(pairs)
    surface = pairs[0].surface
    step = -(-len(surface.points) // MOST_POINTS) if len(pairs) == 1 else 1
    arrays = {
        "points": surface.points[::step].astype(np.float32),
        "normals": surface.normals[::step].astype(np.float32),
        "kinds": np.array([pair.kind for pair in pairs]),
    }
    for number, pair in enumerate(pairs):
        arrays[f"vertices_{number}"] = pair.coarse.vertices
        arrays[f"corners_{number}"] = pair.coarse.corners.astype(np.int32)
        arrays[f"offsets_{number}"] = pair.coarse.offsets.astype(np.int32)
    with path.with_suffix(".tmp").open("wb") as file:
        np.savez(file, **arrays)
    path.with_suffix(".tmp").replace(path)
