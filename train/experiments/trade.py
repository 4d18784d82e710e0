"""The choice of C and c: gain against the Reif margin, each pair trained for a little while."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
from matplotlib.figure import Figure as Drawing

from pns_common.schemes import loop, pns
from train.certificates.lifted_star import HIGHEST
from train.certificates.subject import subject_of_network
from train.evaluation import compare_with_loop
from train.experiments.experiment import Cell, Column, Experiment, Figure, Outcome, Table
from train.experiments.laboratory import Laboratory
from train.experiments.style import COLOURS, panels, zero_line
from train.level_trainer import fit_through_levels
from train.recipes import Recipe, full
from train.spectrum import follow_lift
from train.torch_model import recipe_model
from train.whole_surface import gain, whole_surface

SETTINGS = (
    (0.8, 1e1),
    (0.8, 1e3),
    (0.8, 1e5),
    (0.25, 1e5),
    (0.5, 1e5),
    (1.5, 1e5),
)
"""C and c: the gate at the chosen budget, then the budget at the chosen gate."""

STEPS = 120
"""Enough to tell the settings apart; the recipe itself takes many times as long."""

VALENCES = (3, 4, 5, 6, 12)
LIFTS = np.linspace(0, HIGHEST, 5)

COLUMNS = (
    Column("budget", "C", "g"),
    Column("gate_sharpness", "c", "g"),
    Column("vertex_gate_sharpness", "Vertex c", ".0f"),
    Column("near_percent", "Near %", "+.1f"),
    Column("global_percent", "All %", "+.1f"),
    Column("hausdorff_percent", "Hausdorff %", "+.1f"),
    Column("whole_percent", "Whole surface %", "+.1f"),
    Column("jump_to_loop", "Jump / Loop's", ".2f"),
    Column("saddle_percent", "Saddle %", "+.1f"),
    *(Column(f"margin_{k}", f"Margin k = {k}", "+.3f") for k in VALENCES),
)
NOTES = (
    f"The recipe `full` with another C and c and {STEPS} steps in place of its own; the vertex "
    "gate's c is √(10 c), so that both gates open at about the same bend. *Near*, *all*, "
    "*Hausdorff* and *saddle* are the published one-step metrics on held-out ridges and saddles, "
    "*whole surface* is the distance of all vertices after four levels. The margin is the signed "
    f"Reif margin of stars lifted by {HIGHEST:g}, a diagnostic.",
    "What the gate lets through decides the gain long before C does. Beside an open edge that "
    "moves, a shut one that does not makes a crease.",
)


def setting(budget: float, sharpness: float, steps: int) -> Recipe:
    """Return the recipe with another envelope, cut short."""
    base = full()
    assert base.vertex is not None
    return replace(
        base,
        name=f"full-C{budget:g}-c{sharpness:g}",
        budget=budget,
        gate_sharpness=sharpness,
        vertex=replace(base.vertex, gate_sharpness=math.sqrt(10 * sharpness)),
        steps=steps,
        polish=None,
    )


def run(laboratory: Laboratory) -> Outcome:
    """Train each setting and measure it."""
    settings = SETTINGS[: laboratory.scale.instances]
    rows = tuple(_row(laboratory, budget, sharpness) for budget, sharpness in settings)
    table = Table("trade", "Choice of C and c", COLUMNS, rows)
    figure = Figure(
        "trade",
        f"Gain after four levels against the Reif margin at lift {HIGHEST:g}, the least over the "
        "valences of the table. Left: c from 10 to 10⁵ at C = 0.8. Right: C from 0.25 to 1.5 at "
        "c = 10⁵.",
        partial(_draw, rows),
    )
    return Outcome((table,), (figure,), NOTES)


def _row(laboratory: Laboratory, budget: float, sharpness: float) -> tuple[Cell, ...]:
    recipe = setting(budget, sharpness, min(STEPS, laboratory.scale.training_steps))

    def on_step(done: int, _: float) -> None:
        laboratory.progress(f"training {recipe.name}", done, recipe.steps)

    network, vertex_network, _ = fit_through_levels(recipe, on_step)
    model = recipe_model(recipe, network, vertex_network)
    scheme, exact = pns(model), subject_of_network(model).exact
    ridges, levels = laboratory.dataset("ridge-held-out"), laboratory.scale.levels
    step = compare_with_loop(scheme, ridges)
    saddle = compare_with_loop(scheme, laboratory.dataset("saddle-held-out"))
    found, reference = (whole_surface(one, ridges, levels) for one in (scheme, loop()))
    valences = VALENCES[: laboratory.scale.instances]
    margins = {k: follow_lift(exact, k, LIFTS)[-1].margin for k in valences}
    return (
        budget,
        sharpness,
        recipe.vertex.gate_sharpness if recipe.vertex else None,
        *(step[metric].percent for metric in ("distance_near", "distance", "hausdorff")),
        gain(found, reference).distance,
        float(found.jump.max() / reference.jump.max()),
        saddle["distance"].percent,
        *(margins.get(k) for k in VALENCES),
    )


def _draw(rows: tuple[tuple[Cell, ...], ...]) -> Drawing:
    figure, (by_gate, by_budget) = panels(2, height=2.6)
    whole = [column.name for column in COLUMNS].index("whole_percent")
    for axes, which, name in ((by_gate, 1, "c"), (by_budget, 0, "C")):
        other = 1 - which
        fixed = 0.8 if other == 0 else 1e5
        chosen = sorted((row for row in rows if row[other] == fixed), key=lambda row: row[which])
        margin = [min(m for m in row[-len(VALENCES) :] if m is not None) for row in chosen]
        axes.plot(margin, [row[whole] for row in chosen], "s-", color=COLOURS["pns"])
        for row, at in zip(chosen, margin, strict=True):
            label = f"{name} = {row[which]:g}"
            axes.annotate(
                label, (at, row[whole]), textcoords="offset points", xytext=(4, 4), fontsize=6
            )
        zero_line(axes)
        axes.axvline(0, color="0.3", linewidth=0.8, linestyle="--")
        axes.set(xlabel="Least Reif margin", ylabel="Whole surface (%)")
        axes.margins(0.2)
    return figure


EXPERIMENT = Experiment(
    name="trade",
    title="The choice of C and c",
    source="Beyond the paper.",
    run=run,
    seconds=900,
)
