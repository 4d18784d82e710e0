"""Capacity control: is it the network or the envelope that limits the gain?"""

from train.experiments.harness.comparison import LIMIT_NOTE, Comparison, comparison_rows
from train.experiments.harness.experiment import Experiment, Outcome, table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.paper.methods import larger
from train.experiments.paper.paper_values import PUBLISHED_CAPACITY, PUBLISHED_HEADLINE
from train.metrics.card import compare_with_loop
from train.metrics.envelope import envelope_limit
from train.models.recipes import paper


def run(laboratory: Laboratory) -> Outcome:
    """Compare the default network with one of three times its parameters and twice its steps."""
    held_out = laboratory.dataset("ridge-held-out")
    limit = envelope_limit(held_out, paper().budget, paper().gate_sharpness)
    rows, near = [], []
    for title, recipe, published in (
        ("default", paper(), PUBLISHED_HEADLINE),
        ("larger", larger(), PUBLISHED_CAPACITY),
    ):
        network = laboratory.network(recipe)
        count = sum(parameter.numel() for parameter in network.parameters())
        improvements = compare_with_loop(laboratory.scheme(recipe), held_out)
        near.append(improvements["distance_near"])
        name = f"{title}: {count} parameters, {recipe.steps} steps"
        rows += comparison_rows(name, held_out.name, improvements, limit=limit, published=published)
    small, large = near
    overlap = "overlap" if small.low <= large.high and large.low <= small.high else "do not overlap"
    notes = (
        LIMIT_NOTE,
        f"The intervals of the near-feature improvement {overlap}: "
        f"[{small.low:+.2f}, {small.high:+.2f}] and [{large.low:+.2f}, {large.high:+.2f}]. "
        f"The limit is {limit['distance_near'].percent:+.2f} % near the feature and "
        f"{limit['distance'].percent:+.2f} % everywhere, whatever the network.",
    )
    compared = table("capacity", "A network three times as large", Comparison, rows)
    return Outcome((compared,), notes=notes)


EXPERIMENT = Experiment(
    name="capacity",
    title="Capacity control",
    source="Paper: Capacity sweep and budget localisation, last paragraph.",
    run=run,
    seconds=30,
)
