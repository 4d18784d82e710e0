"""The default model, Loop and N1 with highlights: ripples show as wavy reflections."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure as Drawing

from pns_common import Mesh, MeshError
from train.data.dense_meshes import read_mesh
from train.data.primitives import PRIMITIVES
from train.experiments.beyond.models import model_files
from train.experiments.harness.contenders import LOOP, OURS, contenders
from train.experiments.harness.experiment import Experiment, Figure, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.harness.specular import camera, shaded
from train.experiments.harness.style import panels
from train.metrics.shape import bending
from train.refining import refine

LEVELS = 4
SHOWN = (OURS, LOOP, "N1")
ASSETS = {
    "penguin_control_mesh.obj": camera(35, 12, up=1),
    "spot_control_mesh.obj": camera(150, 15, up=1),
    "alien.glb": camera(60, 12, up=1),
}
PLAIN = {"icosphere 80": camera(20, 25), "cube": camera(30, 25)}


@dataclass(frozen=True, slots=True)
class Row:
    """One method on one mesh."""

    mesh: str = column("Mesh")
    method: str = column("Method")
    bending: float = column("∫ (κ₁² + κ₂²) dA", ".1f")


def run(laboratory: Laboratory) -> Outcome:
    """Draw every mesh by each of the three."""
    pictures: dict[tuple[str, str], np.ndarray] = {}
    rows: list[Row] = []
    schemes = contenders()
    for name, mesh, view in list(_meshes(laboratory))[: laboratory.scale.instances]:
        laboratory.progress(f"shading: {name}", len(pictures), 15)
        box = np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
        for method in SHOWN:
            levels = min(LEVELS, laboratory.scale.levels)
            refined = refine(mesh, schemes[method], levels).mesh
            pictures[name, method] = shaded(refined, view, box)
            rows.append(Row(name, method, bending(refined)))
    figure = Figure(
        "shading",
        f"Highlights after {LEVELS} levels: the default model, Loop, and N1. Penguin and Spot are "
        "cages that were authored for Loop.",
        partial(_draw, pictures),
    )
    return Outcome((table("shading", "What is drawn", Row, rows),), (figure,))


def _meshes(laboratory: Laboratory) -> Iterator[tuple[str, Mesh, np.ndarray]]:
    for name, view in ASSETS.items():
        path = None if laboratory.assets is None else laboratory.assets / name
        if path is None or not path.is_file():
            continue
        try:
            yield name.partition(".")[0].removesuffix("_control_mesh"), read_mesh(path), view
        except MeshError:
            continue
    for name, view in PLAIN.items():
        yield name, PRIMITIVES[name](), view


def _draw(pictures: dict[tuple[str, str], np.ndarray]) -> Drawing:
    names = list(dict.fromkeys(name for name, _ in pictures))
    figure, axes = panels(len(SHOWN), height=2.2 * len(names), rows=len(names))
    for panel, ((name, method), picture) in zip(axes, pictures.items(), strict=True):
        panel.imshow(picture, interpolation="antialiased")
        panel.set_axis_off()
        panel.set_title(f"{name}, {method}")
    return figure


def read_files(laboratory: Laboratory) -> list[Path]:
    """Return the bundled models and the files that are drawn."""
    folder = laboratory.assets
    files = [] if folder is None else [folder / name for name in ASSETS]
    return [*model_files(laboratory), *(path for path in files if path.is_file())]


EXPERIMENT = Experiment(
    name="shading",
    title="With highlights",
    source="Beyond the paper.",
    run=run,
    seconds=60,
    reads=read_files,
)
