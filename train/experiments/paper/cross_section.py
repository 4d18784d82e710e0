"""The cross-section figure: what each learned method does to the crest of one ridge."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure as Drawing
from trimesh import Trimesh
from trimesh.intersections import mesh_plane

from pns_common import Mesh
from train.experiments.harness.experiment import Experiment, Figure, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.harness.style import COLOURS, TITLES, method_style, panels, zero_line
from train.experiments.paper.methods import PAPER_UNITS, hard_instance, learned_methods, ridge_of
from train.metrics.one_step import NEAR_FEATURE
from train.refining import refine
from train.surfaces.implicit import Ridge, signed_distance


@dataclass(frozen=True, slots=True)
class Row:
    """One method's errors at inserted vertices."""

    method: str = column("Method")
    crest_error: float = column("Largest error near the crest", ".5f")
    shoulder_error: float = column("Largest error beyond it", ".5f")
    near_rmse: float = column("RMSE near", ".5f")
    far_rmse: float = column("RMSE beyond", ".5f")


def section(
    mesh: Mesh, ridge: Ridge, through: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "S 2 2"]:
    """Return the segments (y', z) in which the plane across the crest through a point cuts it."""
    across = np.array([-np.sin(ridge.angle), np.cos(ridge.angle), 0.0])
    along = np.array([np.cos(ridge.angle), np.sin(ridge.angle), 0.0])
    centre = np.array([ridge.centre_x, ridge.centre_y, 0.0])
    solid = Trimesh(mesh.vertices, mesh.faces, process=False)
    segments = np.asarray(mesh_plane(solid, plane_normal=along, plane_origin=through))
    return np.stack([(segments - centre) @ across, segments[..., 2]], axis=-1)


def run(laboratory: Laboratory) -> Outcome:
    """Refine the paper's instance by one step with Loop, PNS and the unconstrained network."""
    instance = hard_instance()
    ridge = ridge_of(instance)
    meshes = {
        name: refine(instance.mesh, scheme, 1, reference_length=PAPER_UNITS).mesh
        for name, scheme in learned_methods(laboratory).items()
    }
    old, rows = len(instance.mesh.vertices), []
    for name, mesh in meshes.items():
        error = np.abs(signed_distance(instance.surface, mesh.vertices[old:]))
        near = instance.surface.feature_distance(mesh.vertices[old:]) < NEAR_FEATURE
        rows.append(
            Row(
                method=TITLES[name],
                crest_error=float(error[near].max()),
                shoulder_error=float(error[~near].max()),
                near_rmse=float(np.sqrt((error[near] ** 2).mean())),
                far_rmse=float(np.sqrt((error[~near] ** 2).mean())),
            )
        )
    # A section between two corrected vertices would show Loop twice.
    moved = np.linalg.norm(meshes["pns"].vertices - meshes["loop"].vertices, axis=1)
    through = meshes["loop"].vertices[moved.argmax()]
    figure = Figure(
        "cross_section",
        f"One step on the held-out ridge a = {ridge.amplitude:.2f}, "
        f"b = {ridge.sharpness:.2f}. Left: the section across the crest, through the "
        "vertex that PNS moves most; middle: its cap; right: signed distance of every inserted "
        "vertex against y'. Grey: near the feature.",
        lambda: _draw(ridge, meshes, old, through),
    )
    errors = table("cross_section", "Errors at inserted vertices", Row, rows)
    return Outcome((errors,), (figure,))


def _draw(
    ridge: Ridge, meshes: dict[str, Mesh], old: int, through: Float[np.ndarray, " 3"]
) -> Drawing:
    figure, (whole, cap, error) = panels(3, height=2.8)
    for axes in (whole, cap):
        _draw_section(axes, ridge, meshes, through)
    whole.set(title="Section", xlabel="y'", ylabel="z", xlim=(-1.1, 1.1))
    top = ridge.amplitude
    cap.set(title="Cap", xlabel="y'", xlim=(-0.32, 0.32), ylim=(0.45 * top, 1.08 * top))
    error.axvspan(-NEAR_FEATURE, NEAR_FEATURE, color="0.93", linewidth=0)
    for name, mesh in meshes.items():
        inserted = mesh.vertices[old:]
        style = method_style(name)
        error.plot(
            ridge.across(inserted),
            signed_distance(ridge, inserted),
            linestyle="none",
            markersize=2.4,
            alpha=0.8,
            **style,
        )
    zero_line(error)
    error.set(title="Signed distance", xlabel="y'", xlim=(-1.1, 1.1))
    handles, labels = whole.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def _draw_section(
    axes: Axes, ridge: Ridge, meshes: dict[str, Mesh], through: Float[np.ndarray, " 3"]
) -> None:
    y = np.linspace(-1.3, 1.3, 500)
    exact = ridge.amplitude * np.exp(-ridge.sharpness * y**2)
    axes.plot(y, exact, color=COLOURS["surface"], linewidth=0.9, label=TITLES["surface"])
    dashes = {"loop": "--", "pns": "-", "unconstrained": "-."}
    for name, mesh in meshes.items():
        lines = LineCollection(
            list(section(mesh, ridge, through)),
            color=COLOURS[name],
            linewidth=1.3,
            linestyle=dashes[name],
            label=TITLES[name],
        )
        axes.add_collection(lines)


EXPERIMENT = Experiment(
    name="cross-section",
    title="Across one ridge",
    source="Paper: the cross-section figure.",
    run=run,
    seconds=3,
)
