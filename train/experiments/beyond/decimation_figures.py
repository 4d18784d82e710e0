"""The decimation test's figures: the gain on each mesh, and the meshes coloured by distance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from jaxtyping import Float, UInt8
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure as Drawing

from pns_common import Mesh
from train.data.dense_meshes import CAD
from train.experiments.harness.experiment import Figure
from train.experiments.harness.render import ASPECT, CENTRE, HALF_WIDTH, Camera, shaded_image
from train.experiments.harness.style import COLOURS, MARKERS, SEQUENTIAL, TITLES, panels
from train.metrics.decimation import Pair, Summary
from train.metrics.faces.point_mesh import face_tree, nearest
from train.refining import AnyScheme, refine

ELEVATION = 25.0
# How much of the view a mesh fills, across or upright.
FILLED = 0.95

# End of the colour scale, in thousandths of the diagonal.
LARGEST = 6.0

AZIMUTH = -60.0
# The meshes of the figure, and from which side each shows most.
PICTURED = MappingProxyType(
    {"fuze": AZIMUTH, "penguin": AZIMUTH, "spot": 50.0, "pipe": AZIMUTH, "pulley": AZIMUTH}
)

# How many pictures there are where none of those is in the test.
FALLBACK = 2

# Files have y upwards, as glTF says; the camera has z.
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


@dataclass(frozen=True, eq=False, slots=True)
class View:
    """A mesh from one side.

    Attributes:
        title: of its column.
        row: name of the mesh.
    """

    title: str
    row: str
    image: UInt8[np.ndarray, "H W 3"]


def pictured(pairs: Sequence[Pair]) -> list[Pair]:
    """Return the pairs that the figure shows."""
    return [pair for pair in pairs if pair.dense.title in PICTURED] or list(pairs[:FALLBACK])


def picture_figure(pairs: Sequence[Pair], schemes: Mapping[str, AnyScheme], level: int) -> Figure:
    """Render dense, coarse and refined meshes, the refined ones coloured by distance."""
    views = [view for pair in pairs for view in _views(pair, schemes, level)]
    return Figure(
        "decimation",
        f"Dense, simplified, and refined again by {level} levels. Colour is the distance from the "
        "dense mesh.",
        lambda: _draw_views(views, len(pairs)),
    )


def gains_figure(summarised: Sequence[Summary]) -> Figure:
    """Show each method's gain on each mesh, sorted by the last method's."""
    return Figure(
        "decimation_gains",
        f"Mean distance from the dense mesh after {summarised[-1].level} levels: improvement over "
        "Loop, mesh by mesh. Thin lines: the mean over the meshes.",
        lambda: _draw_gains(summarised),
    )


def _views(pair: Pair, schemes: Mapping[str, AnyScheme], level: int) -> list[View]:
    dense = pair.dense.mesh
    tree, diagonal = face_tree(dense), np.linalg.norm(np.ptp(dense.vertices, axis=0))
    turn = np.eye(3) if pair.dense.kind == CAD else UPRIGHT
    camera = Camera(PICTURED.get(pair.dense.title, AZIMUTH), ELEVATION)
    seen = dense.vertices @ turn.T @ camera.axes().T
    low, high = seen.min(axis=0), seen.max(axis=0)
    half = (high - low)[:2] / 2 / (HALF_WIDTH * np.array([1, ASPECT]))
    middle = (low + high) / 2 @ camera.axes()

    def view(title: str, mesh: Mesh, distance: Float[np.ndarray, " V"]) -> View:
        placed = CENTRE + FILLED / half.max() * (mesh.vertices @ turn.T - middle)
        values = 1000 * distance / diagonal
        image = shaded_image(Mesh(placed, mesh.faces), values, LARGEST, camera)
        return View(title, pair.dense.title, image)

    views = [
        view("dense", dense, np.zeros(len(dense.vertices))),
        view("simplified", pair.coarse, np.zeros(len(pair.coarse.vertices))),
    ]
    for name, scheme in schemes.items():
        refined = refine(pair.coarse, scheme, level).mesh
        distance = nearest(tree, refined.vertices).distance
        views.append(view(name.replace("`", ""), refined, distance))
    return views


def _draw_views(views: Sequence[View], rows: int) -> Drawing:
    columns = len(views) // rows
    figure, axes = panels(columns, height=0.3 + 1.1 * rows, rows=rows)
    for number, (panel, view) in enumerate(zip(axes, views, strict=True)):
        panel.imshow(view.image, interpolation="antialiased")
        panel.set(xticks=[], yticks=[])
        panel.spines[:].set_visible(False)
        if number < columns:
            panel.set_title(view.title)
        if number % columns == 0:
            panel.set_ylabel(view.row)
    scale = ScalarMappable(Normalize(0, LARGEST), SEQUENTIAL)
    label = "Distance, 10⁻³ of the diagonal"
    figure.colorbar(scale, ax=axes, label=label, shrink=0.6, pad=0.02)
    return figure


def _draw_gains(summarised: Sequence[Summary]) -> Drawing:
    last = summarised[-1].by_mesh
    meshes = sorted(last, key=last.__getitem__)
    figure, (axes,) = panels(1, height=0.9 + 0.17 * len(meshes))
    styles = _styles([summary.method for summary in summarised])
    for summary, style in zip(summarised, styles, strict=True):
        percent = [summary.by_mesh[mesh] for mesh in meshes]
        axes.plot(percent, range(len(meshes)), linestyle="", **style)
        axes.axvline(summary.percent["mean"], color=style["color"], linewidth=0.8)
    axes.axvline(0, color="0.3", linewidth=0.7, zorder=1)
    axes.set_yticks(range(len(meshes)), [mesh.partition(".")[0] for mesh in meshes])
    axes.set_xlabel("Improvement over Loop (%)")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _styles(methods: Sequence[str]) -> list[dict[str, object]]:
    """Return colour, marker and label of each method: the last model in the colour of PNS."""
    others = iter(("pn-triangles", "normal-displacement", "curvature-adaptive", "unconstrained"))
    names = {TITLES["butterfly"]: "butterfly", methods[-1]: "pns"}
    styles = []
    for method in methods:
        name = names.get(method) or next(others)
        label = method.replace("`", "")
        styles.append({"color": COLOURS[name], "marker": MARKERS[name], "label": label})
    return styles
