"""The decimation test: simplify a dense mesh, refine the coarse one, compare with the dense one.

Source: Liu, Kim, Chaudhuri, Aigerman, Jacobson 2020, Neural Subdivision (the evaluation on
simplified meshes). They simplify at random; here the simplification is fixed.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import fast_simplification
import numpy as np

from pns_common import Mesh
from train.data.dense_meshes import DenseMesh, is_manifold, largest_part
from train.data.simplifiers import AGGRESSIVENESS
from train.metrics.surface_distance import (
    SURFACE_METRICS,
    SurfaceErrors,
    prepared,
    surface_errors,
)
from train.refining import AnyScheme, refine

# About 400 vertices on a closed mesh, as in the source.
COARSE_FACES = 800

# The dense mesh has at least so many times the faces of the coarse one.
LEAST_REDUCTION = 5

# Largest share of the coarse faces that may be cut off as pinched.
LARGEST_CUT = 1 / 20

# From how many per cent on a method counts as worse.
WORSE = 1.0

# How many counts of faces near the target are tried for a manifold.
SEARCH = 9


@dataclass(frozen=True, slots=True)
class Pair:
    """A dense mesh and what was left of it.

    Attributes:
        cut_off: faces of the simplification that were pinched off, and left out.
    """

    dense: DenseMesh
    coarse: Mesh
    cut_off: int


@dataclass(frozen=True, slots=True)
class NotSimplified:
    """A dense mesh of which no simplification was a manifold like itself."""

    dense: DenseMesh


@dataclass(frozen=True, slots=True)
class Row:
    """The errors of one method on one mesh after so many levels."""

    mesh: str
    level: int
    method: str
    errors: SurfaceErrors


@dataclass(frozen=True, slots=True)
class Summary:
    """One method after so many levels, against the reference method on the same meshes.

    Attributes:
        percent: for each metric by how many per cent the error is lower, mean over the meshes.
        by_mesh: the same of the mean distance, for each mesh.
    """

    method: str
    level: int
    percent: Mapping[str, float]
    by_mesh: Mapping[str, float]

    @property
    def worst(self) -> str:
        """The mesh where the mean distance gains least."""
        return min(self.by_mesh, key=self.by_mesh.__getitem__)

    @property
    def worse(self) -> int:
        """Meshes whose mean distance is above the reference's by more than 1 %."""
        return sum(percent < -WORSE for percent in self.by_mesh.values())


def simplify(dense: DenseMesh) -> Pair | NotSimplified:
    """Simplify a dense mesh to `COARSE_FACES`, or to a fifth of its faces if that is less.

    Edge collapses, as fast-simplification does them, may pinch off a few faces that then hang on
    an edge of four: those are cut off. Of the counts nearest to the target, the first is taken that
    gives a manifold of the same Euler characteristic.
    """
    target = min(COARSE_FACES, len(dense.mesh.faces) // LEAST_REDUCTION)
    wanted = euler_characteristic(dense.mesh)
    for tries in range(SEARCH):
        # target, then 2 more, 2 less, 4 more, ...
        count = target + (tries + 1) // 2 * (2 if tries % 2 else -2)
        whole = collapsed(dense.mesh, count)
        coarse = largest_part(whole)
        cut_off = len(whole.faces) - len(coarse.faces)
        alike = is_manifold(coarse) and euler_characteristic(coarse) == wanted
        if alike and cut_off <= LARGEST_CUT * len(whole.faces):
            return Pair(dense, coarse, cut_off)
    return NotSimplified(dense)


def collapsed(mesh: Mesh, faces: int) -> Mesh:
    """Return what quadric edge collapses leave of a mesh at about a number of faces."""
    vertices, triangles = fast_simplification.simplify(
        mesh.vertices.copy(), mesh.faces.copy(), target_count=faces, agg=AGGRESSIVENESS
    )[:2]
    used, number = np.unique(triangles, return_inverse=True)
    return Mesh(vertices[used], number.reshape(-1, 3))


def euler_characteristic(mesh: Mesh) -> int:
    """Return V − E + F, over the vertices in use."""
    ends = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    used = len(np.unique(mesh.faces))
    return used - len(np.unique(ends, axis=0)) + len(mesh.faces)


def compare(
    pairs: Iterable[Pair],
    schemes: Mapping[str, AnyScheme],
    levels: Iterable[int],
    samples: int,
) -> list[Row]:
    """Refine every coarse mesh by every scheme and measure it against its dense mesh."""
    rows, wanted = [], sorted(levels)
    for pair in pairs:
        true = prepared(pair.dense.mesh, samples)
        for method, scheme in schemes.items():
            for level in wanted:
                refined = refine(pair.coarse, scheme, level).mesh
                errors = surface_errors(true, prepared(refined, samples))
                rows.append(Row(pair.dense.name, level, method, errors))
    return rows


def summaries(rows: Iterable[Row], reference: str = "loop") -> list[Summary]:
    """Return one summary for each other method and level, in the order of the rows."""
    errors = {(row.method, row.level, row.mesh): row.errors for row in rows}
    meshes = list(dict.fromkeys(mesh for _, _, mesh in errors))
    summarised = []
    for method, level in dict.fromkeys((method, level) for method, level, _ in errors):
        if method == reference:
            continue
        gains = {
            mesh: gain(errors[reference, level, mesh], errors[method, level, mesh])
            for mesh in meshes
        }
        percent = {
            metric: float(np.mean([gain_of_mesh[metric] for gain_of_mesh in gains.values()]))
            for metric in SURFACE_METRICS
        }
        by_mesh = {mesh: gain_of_mesh["mean"] for mesh, gain_of_mesh in gains.items()}
        summarised.append(Summary(method, level, percent, by_mesh))
    return summarised


def gain(reference: SurfaceErrors, errors: SurfaceErrors) -> dict[str, float]:
    """Return for each metric by how many per cent errors are below the reference's."""
    return {
        metric: 100 * (1 - getattr(errors, metric) / getattr(reference, metric))
        for metric in SURFACE_METRICS
    }
