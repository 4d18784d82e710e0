"""Meshes to be cut into parts, and the work on them without processes."""

import io
import random

import numpy as np
from rich.console import Console

from pns_common import Mesh
from service.options import Options
from service.scale.large.part import run_part
from service.scale.large.plan import Large
from service.scale.large.run import run_large
from tests.support.meshes import bent, bow_tie, grid, three_pages

LOOP = Options(scheme="loop", levels=2)


def here(tasks):
    """An engine without processes, in any order."""
    tasks = list(tasks)
    random.Random(len(tasks)).shuffle(tasks)
    return ([run_part(task)] for task in tasks)


def arrays(folder, mesh, creases=None, positions="<f8", faces="<i4"):
    folder.mkdir()
    np.save(folder / "positions.npy", mesh.vertices.astype(positions))
    np.save(folder / "faces.npy", mesh.faces.astype(faces))
    if creases is not None:
        np.save(folder / "creases.npy", creases)
    return folder


def refined(source, output, parts, options=LOOP, engine=here, model=None):
    large = Large(source, output, options, 2**31, parts, model)
    report, _ = run_large(large, engine, Console(file=io.StringIO()))
    return report


def contents(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def assert_is(folder, whole):
    points, faces = np.load(folder / "positions.npy"), np.load(folder / "faces.npy")
    assert points.tobytes() == whole.mesh.vertices.tobytes()
    assert (faces == whole.mesh.faces).all()


def many_kinds():
    """Boundaries, pages, bow-ties, duplicates, degenerate and isolated ones, in any order."""
    rng = np.random.default_rng(7)
    points, faces = grid(12, bent)
    points = points + 0.1 * rng.standard_normal(points.shape)  # rough enough to be guarded
    for other_points, other_faces in (bow_tie(), three_pages()):
        faces = np.concatenate([faces, other_faces + len(points)])
        points = np.concatenate([points, other_points])
    faces = np.concatenate([faces, faces[:3], [[0, 1, 1]], rng.integers(0, len(points), (5, 3))])
    points = np.concatenate([points, [[9.0, 9, 9]], points[:1] - 2])
    order = rng.permutation(len(points))
    renumbered = np.empty_like(points)
    renumbered[order] = points
    return Mesh(renumbered, rng.permutation(order[faces]))
