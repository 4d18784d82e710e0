"""The published one-step metrics and the paired bootstrap that compares two methods.

All errors are taken at the inserted interior edge vertices and nowhere else.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields

import numpy as np
import torch
from jaxtyping import Float
from rich.table import Table

from train.connectivity import Connectivity
from train.surfaces.implicit import Surface, signed_distance
from train.vectors import dot, face_normals, norm, unit

# Vertices whose distance from the feature (|y'| on a ridge) is below this are near it.
NEAR_FEATURE = 0.3

RESAMPLES = 2000


@dataclass(frozen=True, slots=True)
class Errors:
    """Errors of one refined instance; lengths in the surface's units, angles in radians.

    The near-feature errors are NaN where no inserted vertex is near the feature.
    """

    distance_near: float
    distance: float
    hausdorff_near: float
    hausdorff: float
    normal_near: float
    normal: float


METRICS = tuple(field.name for field in fields(Errors))


@dataclass(frozen=True, slots=True)
class Improvement:
    """By how many per cent a method's mean error is below a reference's, with its 95 % interval."""

    reference_mean: float
    method_mean: float
    percent: float
    low: float
    high: float


def one_step_errors(
    surface: Surface,
    coarse: Float[np.ndarray, "V 3"],
    mesh: Connectivity,
    inserted: Float[np.ndarray, "I 3"],
) -> Errors:
    """Measure the inserted vertices of a mesh's interior edges against their surface."""
    distance = np.abs(signed_distance(surface, inserted))
    angle = normal_error(surface, coarse, mesh, inserted)
    near = surface.feature_distance(inserted) < NEAR_FEATURE
    return Errors(
        distance_near=_root_mean_square(distance[near]),
        distance=_root_mean_square(distance),
        hausdorff_near=float(distance[near].max()) if near.any() else float("nan"),
        hausdorff=float(distance.max()),
        normal_near=float(angle[near].mean()) if near.any() else float("nan"),
        normal=float(angle.mean()),
    )


def normal_error(
    surface: Surface,
    coarse: Float[np.ndarray, "V 3"],
    mesh: Connectivity,
    inserted: Float[np.ndarray, "I 3"],
) -> Float[np.ndarray, " I"]:
    """Return the published normal error: the angle (radians) between two directions at each q.

    One is ∇(f / ‖∇f‖) at q; the other is `fan_normal`, which hardly depends on q. So this metric
    sees a correction almost only through the first: read it as a column of the published table,
    not as shading quality.
    """
    fan = unit(fan_normal(coarse, mesh, inserted))
    target = unit(_distance_gradient(surface, inserted))
    return np.arctan2(norm(np.cross(fan, target)), dot(fan, target))


def fan_normal(
    coarse: Float[np.ndarray, "V 3"], mesh: Connectivity, inserted: Float[np.ndarray, "I 3"]
) -> Float[np.ndarray, "I 3"]:
    """Return the sum of the area vectors of (q, a, c), (q, c, b), (q, b, d), (q, d, a).

    Each is first turned to the side of the coarse face that it lies in; the published numbers
    need that where q folds a triangle over. Where none is folded the sum is ± (b − a) × (c − d),
    whatever q is.
    """
    rows = mesh.interior
    a, b, c, d = (coarse[column] for column in mesh.stencil[rows].T.numpy())
    normals = face_normals(coarse, mesh.faces.numpy())
    first, second = (normals[side] for side in mesh.half_edges[rows].T.numpy() // 3)
    triangles = [(a, c, first), (c, b, first), (b, d, second), (d, a, second)]
    fan = np.zeros_like(inserted)
    for start, end, outward in triangles:
        area = np.cross(start - inserted, end - inserted)
        fan += np.where(dot(area, outward)[:, None] < 0, -area, area)
    return fan


def improvement(reference: Float[np.ndarray, " N"], method: Float[np.ndarray, " N"]) -> Improvement:
    """Compare paired errors of N instances by 2000 bootstrap resamples (numpy's generator, seed 0).

    `percent` is the mean over the resamples of 100 (1 − mean method / mean reference), and the
    interval holds their middle 95 %.
    """
    count = len(reference)
    drawn = np.random.default_rng(0).integers(0, count, size=(RESAMPLES, count))
    ratios = 100 * (1 - method[drawn].mean(axis=1) / reference[drawn].mean(axis=1))
    low, high = np.percentile(ratios, [2.5, 97.5])
    return Improvement(
        reference_mean=float(reference.mean()),
        method_mean=float(method.mean()),
        percent=float(ratios.mean()),
        low=float(low),
        high=float(high),
    )


def _distance_gradient(
    surface: Surface, points: Float[np.ndarray, "P 3"]
) -> Float[np.ndarray, "P 3"]:
    """Return ∇(f / ‖∇f‖); it is not parallel to ∇f off the surface."""
    positions = torch.from_numpy(points).clone().requires_grad_()
    (gradient,) = torch.autograd.grad(signed_distance(surface, positions).sum(), positions)
    return gradient.numpy()


def _root_mean_square(values: Float[np.ndarray, " N"]) -> float:
    return float(np.sqrt((values**2).mean())) if len(values) else float("nan")


def improvements_as_data(improvements: Mapping[str, Improvement]) -> dict[str, dict[str, float]]:
    """Return improvements as plain numbers for a model card, rounded beyond what they can mean."""
    return {
        metric: {name: round(value, 6) for name, value in asdict(row).items()}
        for metric, row in improvements.items()
    }


METRIC_TITLES: Mapping[str, str] = {
    "distance_near": "Distance RMSE, near",
    "distance": "Distance RMSE, all",
    "hausdorff_near": "Hausdorff, near",
    "hausdorff": "Hausdorff, all",
    "normal_near": "Normal error, near",
    "normal": "Normal error, all",
    "jump": "Largest normal jump",
}


def improvement_table(title: str, improvements: Mapping[str, Improvement]) -> Table:
    """Return one row a metric: Loop's mean, the method's, and the improvement in per cent.

    Fits a terminal of 80 columns.
    """
    table = Table(title=title, title_justify="left")
    table.add_column("Metric")
    for heading in ("Loop", "PNS", "Improvement", "95 % interval"):
        table.add_column(heading, justify="right")
    for metric, row in improvements.items():
        table.add_row(
            METRIC_TITLES[metric],
            f"{row.reference_mean:.6f}",
            f"{row.method_mean:.6f}",
            f"{row.percent:+.2f} %",
            f"{row.low:+.2f} … {row.high:+.2f}",
        )
    return table
