"""The spent budget: per-edge proximity ratio on one ridge, and the measures it follows."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure as Drawing

from train.connectivity import connect
from train.experiments.harness.experiment import Experiment, Figure, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.harness.style import SEQUENTIAL, panels
from train.experiments.paper.methods import PAPER_UNITS, hard_instance, ridge_of
from train.models.recipes import paper
from train.refining import refine
from train.surfaces.implicit import Ridge

PARALLEL = 0.9
NOTES = (
    "*Ratio / gate* is the sum of ratios over the sum of gates: the share of what the gate lets "
    "through that the network spends. Parallel to the crest means |T · t| > 0.9.",
    "**Where this differs from the paper.** Nothing of substance: the spending follows the gate, "
    "edges parallel to the crest saturate, edges across it do not.",
)


@dataclass(frozen=True, slots=True)
class Row:
    """Interior edges of one kind."""

    edges: str = column("Interior edges")
    count: int = column("Number")
    mean_ratio: float = column("Mean ratio", ".3f")
    max_ratio: float = column("Max ratio", ".3f")
    mean_gate: float = column("Mean gate", ".3f")
    ratio_over_gate: float = column("Ratio / gate", ".3f")


@dataclass(frozen=True, slots=True)
class Spending:
    """Interior edges of a coarse mesh: ends, ratio, gate, distance |y'| and alignment |T · t|."""

    ends: Float[np.ndarray, "I 2 3"]
    ratio: Float[np.ndarray, " I"]
    gate: Float[np.ndarray, " I"]
    distance: Float[np.ndarray, " I"]
    alignment: Float[np.ndarray, " I"]


def run(laboratory: Laboratory) -> Outcome:
    """Refine the paper's instance by one step and look at every edge."""
    surface, spending = ridge_of(hard_instance()), measure(laboratory)
    parallel = spending.alignment > PARALLEL
    groups = {
        "all": np.ones_like(parallel),
        "parallel to the crest, |y'| < 0.3": parallel & (spending.distance < 0.3),
        "parallel to the crest, beyond": parallel & (spending.distance >= 0.3),
        "others": ~parallel,
    }
    rows = []
    for name, chosen in groups.items():
        ratio, gate = spending.ratio[chosen], spending.gate[chosen]
        rows.append(
            Row(
                edges=name,
                count=int(chosen.sum()),
                mean_ratio=float(ratio.mean()),
                max_ratio=float(ratio.max()),
                mean_gate=float(gate.mean()),
                ratio_over_gate=float(ratio.sum() / gate.sum()),
            )
        )
    figures = (
        Figure(
            "budget",
            "Budget localisation on the ridge of the paper's figures. Left: proximity ratio of "
            "each interior edge from above, crest dashed. Right: the same against the distance "
            "from the crest line.",
            lambda: _draw_localisation(surface, spending),
        ),
        Figure(
            "budget_verification",
            "Budget verification. Left: proximity ratio against the gate; the line is ratio = "
            "gate, all that the gate lets through. Right: against the distance from the crest, "
            "coloured by how parallel the edge is to it.",
            lambda: _draw_verification(spending),
        ),
    )
    return Outcome((table("budget", "Who spends the budget", Row, rows),), figures, NOTES)


def measure(laboratory: Laboratory) -> Spending:
    """Return what each interior edge of the instance spends."""
    instance = hard_instance()
    mesh, surface = instance.mesh, ridge_of(instance)
    refined = refine(mesh, laboratory.scheme(paper()), reference_length=PAPER_UNITS)
    level = connect(mesh.faces, len(mesh.vertices))
    rows = level.interior.numpy()
    vertex, ends = len(mesh.vertices) + rows, mesh.vertices[level.edges.numpy()[rows]]
    tangent = ends[:, 1] - ends[:, 0]
    crest = np.array([np.cos(surface.angle), np.sin(surface.angle), 0.0])
    return Spending(
        ends=ends,
        ratio=refined.ratio[vertex],
        gate=refined.gate[vertex],
        distance=surface.feature_distance(ends.mean(axis=1)),
        alignment=np.abs(tangent @ crest) / np.linalg.norm(tangent, axis=1),
    )


def _draw_localisation(surface: Ridge, spending: Spending) -> Drawing:
    figure, (above, scatter) = panels(2, height=2.9)
    order = np.argsort(spending.ratio)
    lines = LineCollection(
        list(spending.ends[order, :, :2]),
        array=spending.ratio[order],
        cmap=SEQUENTIAL,
        linewidth=1.8,
    )
    lines.set_clim(0, 1)
    above.add_collection(lines)
    t = np.array([-1.6, 1.6])
    above.plot(
        surface.centre_x + t * np.cos(surface.angle),
        surface.centre_y + t * np.sin(surface.angle),
        "--",
        color="#0072B2",
        linewidth=1.2,
    )
    above.set(title="From above", xlabel="x", ylabel="y", xlim=(-1.05, 1.05), ylim=(-1.05, 1.05))
    above.set_aspect("equal")
    above.grid(visible=False)
    figure.colorbar(lines, ax=above, label="Proximity ratio")
    scatter.scatter(spending.distance, spending.ratio, s=9, color="#009E73", linewidth=0)
    scatter.set(
        title="Against distance", xlabel="|y'|", ylabel="Proximity ratio", ylim=(-0.03, 1.05)
    )
    return figure


def _draw_verification(spending: Spending) -> Drawing:
    figure, (gate, distance) = panels(2, height=2.7)
    gate.plot([0, 1], [0, 1], color="0.4", linewidth=0.8)
    gate.scatter(spending.gate, spending.ratio, s=9, color="#009E73", linewidth=0)
    gate.set(title="Against the gate", xlabel="Gate γ", ylabel="Proximity ratio")
    points = distance.scatter(
        spending.distance, spending.ratio, s=9, c=spending.alignment, cmap="viridis", linewidth=0
    )
    points.set_clim(0, 1)
    distance.set(title="Against distance", xlabel="|y'|", ylim=(-0.03, 1.05))
    figure.colorbar(points, ax=distance, label="|T · t| with the crest")
    return figure


EXPERIMENT = Experiment(
    name="budget",
    title="Where the budget goes",
    source="Paper: the budget localisation and verification figures.",
    run=run,
    seconds=3,
)
