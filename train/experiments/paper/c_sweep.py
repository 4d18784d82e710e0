"""The sweep of the budget C: gain against the size of the envelope."""

from dataclasses import dataclass

from matplotlib.figure import Figure as Drawing

from pns_common import Scheme
from train.data.datasets import Dataset
from train.experiments.harness.comparison import LIMIT_NOTE
from train.experiments.harness.experiment import Experiment, Figure, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.harness.style import COLOURS, panels
from train.experiments.paper.methods import largest_ratio, paper_with_budget
from train.experiments.paper.paper_values import PUBLISHED_C_SWEEP
from train.metrics.card import compare_with_loop
from train.metrics.envelope import envelope_limit

BUDGETS = (0.1, 0.25, 0.5, 1.0)
NOTES = (
    LIMIT_NOTE,
    "**Where this differs from the paper.** Each C has a network of its own, trained by our recipe "
    "`paper`; the published sweep used a recipe whose gain stops at about 22 %. The ceiling itself "
    "keeps rising with C, so the gain's flattening beyond C = 0.5 is the training's, not only the "
    "envelope's.",
)


@dataclass(frozen=True, slots=True)
class Row:
    """The network of one budget."""

    budget: float = column("C", "g")
    near_percent: float = column("Near %", "+.2f")
    near_low: float = column("95 % low", "+.2f")
    near_high: float = column("95 % high", "+.2f")
    near_limit_percent: float = column("Limit %", "+.2f")
    near_share_of_limit: float = column("Used", ".0%")
    global_percent: float = column("All %", "+.2f")
    global_low: float = column("95 % low", "+.2f")
    global_high: float = column("95 % high", "+.2f")
    global_limit_percent: float = column("Limit %", "+.2f")
    global_share_of_limit: float = column("Used", ".0%")
    max_ratio: float = column("Max ratio", ".4f")
    published_near_percent: float = column("Published near %", "+.2f")
    published_global_percent: float = column("Published all %", "+.2f")
    published_max_ratio: float = column("Published ratio", ".4f")


def run(laboratory: Laboratory) -> Outcome:
    """Train one network a budget."""
    held_out = laboratory.dataset("ridge-held-out")
    rows = [_row(laboratory.scheme(paper_with_budget(c)), held_out, c) for c in BUDGETS]
    figure = Figure(
        "c_sweep",
        "Left: improvement in distance over Loop against C; dotted, the envelope's limit; bars are "
        "95 % intervals. Right: the largest proximity ratio, whose cap is 1.",
        lambda: _draw(rows),
    )
    swept = table("c_sweep", "Gain and use of the envelope for each C", Row, rows)
    return Outcome((swept,), (figure,), NOTES)


def _row(scheme: Scheme, held_out: Dataset, budget: float) -> Row:
    improvements = compare_with_loop(scheme, held_out)
    limit = envelope_limit(held_out, budget, paper_with_budget(budget).gate_sharpness)
    near, everywhere = improvements["distance_near"], improvements["distance"]
    near_limit, global_limit = limit["distance_near"].percent, limit["distance"].percent
    published_near, published_global, published_ratio = PUBLISHED_C_SWEEP[str(budget)]
    return Row(
        budget=budget,
        near_percent=near.percent,
        near_low=near.low,
        near_high=near.high,
        near_limit_percent=near_limit,
        near_share_of_limit=near.percent / near_limit,
        global_percent=everywhere.percent,
        global_low=everywhere.low,
        global_high=everywhere.high,
        global_limit_percent=global_limit,
        global_share_of_limit=everywhere.percent / global_limit,
        max_ratio=largest_ratio(scheme, held_out),
        published_near_percent=published_near,
        published_global_percent=published_global,
        published_max_ratio=published_ratio,
    )


def _draw(rows: list[Row]) -> Drawing:
    figure, (gain, ratio) = panels(2, height=2.4)
    budgets = [row.budget for row in rows]
    near = [(row.near_percent, row.near_low, row.near_high, row.near_limit_percent) for row in rows]
    everywhere = [
        (row.global_percent, row.global_low, row.global_high, row.global_limit_percent)
        for row in rows
    ]
    series = (
        ("near the feature", near, "o", COLOURS["pns"]),
        ("all", everywhere, "s", COLOURS["loop"]),
    )
    for shift, (label, gains, marker, colour) in zip((-0.008, 0.008), series, strict=True):
        value, low, high, best = zip(*gains, strict=True)
        below = [v - x for v, x in zip(value, low, strict=True)]
        above = [x - v for v, x in zip(value, high, strict=True)]
        # Side by side, so that neither interval hides the other.
        gain.errorbar(
            [budget + shift for budget in budgets],
            value,
            [below, above],
            marker=marker,
            color=colour,
            capsize=2,
            label=label,
        )
        gain.plot(budgets, best, ":", color=colour, label=f"limit, {label}")
    gain.set(xlabel="Budget C", ylabel="Improvement over Loop (%)", title="Gain", ylim=(0, None))
    gain.legend(loc="upper left", fontsize=6)
    ratio.axhline(1, color="0.3", linewidth=0.8, linestyle="--")
    ratio.plot(budgets, [row.max_ratio for row in rows], marker="o", color=COLOURS["pns"])
    ratio.set(xlabel="Budget C", ylabel="Max proximity ratio", title="Envelope", ylim=(0, 1.1))
    return figure


EXPERIMENT = Experiment(
    name="c-sweep",
    title="Sweep of the budget C",
    source="Paper: the capacity sweep figure.",
    run=run,
    seconds=40,
)
