"""Extended iteration: many levels on a small patch, until the faces run out."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure as Drawing

from pns_common import Mesh
from train.data.datasets import Instance
from train.experiments.harness.experiment import Experiment, Figure, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.harness.style import TITLES, method_style, panels
from train.experiments.paper.methods import eight_methods, hard_instance, level_by_level, ridge_of
from train.metrics.shape import DistanceLevel, distance_level

# Vertices along one side of the reduced patch: 32 faces, half a million at level 7.
SIDE = 5

METHODS = ("loop", "butterfly", "pn-triangles", "curvature-adaptive", "pns", "unconstrained")
NOTES = (
    "The patch is the hard ridge of the repeated table on a 5 × 5 grid, its edges twice as long. "
    "Level 7 has 524,288 faces. PNS's ratio falls with the level, as the paper expects: the gate "
    "closes as the mesh gets smoother, and what is left shrinks with h². From level 4 on its "
    "normal jump halves with each level, as Loop's does. Quadric and normal displacement are left "
    "out for time.",
)


@dataclass(frozen=True, slots=True)
class Row:
    """One method after so many levels."""

    method: str = column("Method")
    level: int = column("Level")
    faces: int = column("Faces")
    distance: float = column("RMSE", ".5f")
    hausdorff: float = column("Max error", ".5f")
    normal_jump: float = column("Max jump", ".4f")
    ratio: float = column("Max ratio", ".3g")
    flipped: int = column("Flipped")


def reduced_patch() -> Instance:
    """Return the hard ridge sampled on a 5 × 5 grid without jitter."""
    surface = ridge_of(hard_instance())
    axis = np.linspace(-1, 1, SIDE)
    x, y = (grid.ravel() for grid in np.meshgrid(axis, axis, indexing="ij"))
    plane = np.stack([x, y, np.zeros_like(x)], axis=1)
    i, j = (index.ravel() for index in np.mgrid[: SIDE - 1, : SIDE - 1])
    v00 = i * SIDE + j
    v10, v11, v01 = v00 + SIDE, v00 + SIDE + 1, v00 + 1
    faces = np.concatenate([np.stack([v00, v10, v11], 1), np.stack([v00, v11, v01], 1)])
    vertices = np.stack([x, y, surface.height(plane)], axis=1)
    return Instance(surface, Mesh(vertices, faces))


def run(laboratory: Laboratory) -> Outcome:
    """Refine the reduced patch level by level."""
    instance, methods, by_method = reduced_patch(), eight_methods(laboratory), {}
    for number, name in enumerate(METHODS):
        by_method[name] = []
        steps = level_by_level(instance.mesh, methods[name], laboratory.scale.deepest)
        for level, refinement in enumerate(steps, start=1):
            laboratory.progress(f"extended {TITLES[name]}, level {level}", number, len(METHODS))
            by_method[name].append(distance_level(instance.surface, refinement))
    rows = [
        Row(
            method=TITLES[name],
            level=level,
            faces=errors.faces,
            distance=errors.distance,
            hausdorff=errors.hausdorff,
            normal_jump=errors.jump,
            ratio=errors.ratio,
            flipped=errors.flipped,
        )
        for name in METHODS
        for level, errors in enumerate(by_method[name], start=1)
    ]
    figure = Figure(
        "extended",
        "Seven levels on a reduced patch. Left: the largest angle between neighbouring faces; a "
        "smooth limit halves it with each level. Right: the largest proximity ratio.",
        lambda: _draw(by_method),
    )
    levels = table("extended", "A reduced patch to half a million faces", Row, rows)
    return Outcome((levels,), (figure,), NOTES)


def _draw(by_method: dict[str, list[DistanceLevel]]) -> Drawing:
    figure, (jump, ratio) = panels(2, height=2.8)
    for name, levels in by_method.items():
        depths = range(1, len(levels) + 1)
        jump.plot(depths, [errors.jump for errors in levels], **method_style(name))
        if name != "loop":
            ratio.plot(depths, [errors.ratio for errors in levels], **method_style(name))
    ratio.axhline(1, color="0.3", linewidth=0.8, linestyle="--")
    jump.set(yscale="log", xlabel="Level", title="Max normal jump (rad)")
    ratio.set(yscale="log", xlabel="Level", title="Max proximity ratio")
    handles, labels = jump.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


EXPERIMENT = Experiment(
    name="extended",
    title="Extended iteration",
    source="Beyond the paper, which names it as open (Implementation and scope).",
    run=run,
    seconds=15,
)
