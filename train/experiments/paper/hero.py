"""The hero figure: shaded renders after one and four levels."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure as Drawing

from pns_common import Mesh
from train.experiments.harness.experiment import Experiment, Figure, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.harness.render import Camera, shaded_image
from train.experiments.harness.style import SEQUENTIAL, TITLES, panels
from train.experiments.paper.methods import hard_instance, learned_methods, level_by_level
from train.metrics.shape import LevelErrors, level_errors
from train.surfaces.implicit import signed_distance

# End of the shared colour scale, in the patch's units.
LARGEST_ERROR = 0.1

CAMERA = Camera(azimuth=-62.0, elevation=42.0)
NOTES = (
    "Same ridge, camera, light and colour scale (absolute signed distance) in all six panels. The "
    "paper's figure reports a ratio of 1.15 × 10⁴ for its unconstrained network at level four; "
    "ours is another draw of such a network.",
)


@dataclass(frozen=True, slots=True)
class Row:
    """The figures under one panel."""

    method: str = column("Method")
    level: int = column("Level")
    faces: int = column("Faces")
    hausdorff: float = column("Max error", ".4f")
    ratio: float = column("Max ratio", ".4g")
    normal_jump: float = column("Max jump", ".3f")


@dataclass(frozen=True, eq=False)
class Panel:
    """The picture of one panel.

    Attributes:
        name: of the method.
        distance: of each vertex from the ridge, in the patch's units; not signed.
    """

    name: str
    level: int
    mesh: Mesh
    distance: Float[np.ndarray, " V"]
    errors: LevelErrors


def panels_of(laboratory: Laboratory) -> Iterator[Panel]:
    """Yield Loop, PNS and the unconstrained network after the first and the last level."""
    instance, levels = hard_instance(), laboratory.scale.levels
    for name, scheme in learned_methods(laboratory).items():
        steps = level_by_level(instance.mesh, scheme, levels)
        for level, refinement in enumerate(steps, start=1):
            if level in (1, levels):
                mesh = refinement.mesh
                distance = np.abs(signed_distance(instance.surface, mesh.vertices))
                errors = level_errors(instance.surface, refinement, level)
                yield Panel(name, level, mesh, distance, errors)


def run(laboratory: Laboratory) -> Outcome:
    """Render the panels."""
    levels = laboratory.scale.levels
    images: dict[tuple[str, int], np.ndarray] = {}
    errors: dict[tuple[str, int], LevelErrors] = {}
    for panel in panels_of(laboratory):
        image = shaded_image(panel.mesh, panel.distance, LARGEST_ERROR, CAMERA)
        images[panel.name, panel.level] = image
        errors[panel.name, panel.level] = panel.errors
    rows = [
        Row(
            method=TITLES[name],
            level=level,
            faces=shown.figures.faces,
            hausdorff=shown.shape.hausdorff,
            ratio=shown.figures.ratio,
            normal_jump=shown.figures.normal_jump,
        )
        for (name, level), shown in errors.items()
    ]
    figure = Figure(
        "hero",
        "Repeated refinement of a held-out ridge: one step above, four below. Colour is the "
        "distance from the analytic ridge. The unconstrained network fits closely at first; on "
        "its own output it falls apart.",
        lambda: _draw(images, errors, levels),
    )
    return Outcome((table("hero", "What the panels show", Row, rows),), (figure,), NOTES)


def _draw(
    images: dict[tuple[str, int], np.ndarray],
    errors: dict[tuple[str, int], LevelErrors],
    levels: int,
) -> Drawing:
    names = list(dict.fromkeys(name for name, _ in images))
    figure, axes = panels(len(names), height=3.6, rows=2)
    places = [(name, level) for level in (1, levels) for name in names]
    for panel, (name, level) in zip(axes, places, strict=True):
        shown = errors[name, level]
        panel.imshow(images[name, level], interpolation="antialiased")
        panel.set_axis_off()
        panel.set_title(f"{TITLES[name]}, level {level}")
        panel.text(
            0.5,
            -0.02,
            f"ratio {shown.figures.ratio:.3g}   jump {shown.figures.normal_jump:.2f}",
            transform=panel.transAxes,
            ha="center",
            va="top",
            fontsize=7,
        )
    scale = ScalarMappable(Normalize(0, LARGEST_ERROR), SEQUENTIAL)
    figure.colorbar(scale, ax=axes, label="Distance from the surface", shrink=0.7, pad=0.02)
    return figure


EXPERIMENT = Experiment(
    name="hero",
    title="One step and four",
    source="Paper: the first figure.",
    run=run,
    seconds=15,
)
