"""Capacity control: is it the network or the envelope that limits the gain?"""

from train.envelope import envelope_limit
from train.evaluation import compare_with_loop
from train.experiments.comparison import COLUMNS, LIMIT_NOTE, comparison_rows
from train.experiments.experiment import Experiment, Outcome, Table
from train.experiments.laboratory import Laboratory
from train.experiments.paper_values import PUBLISHED_CAPACITY, PUBLISHED_HEADLINE
from train.experiments.recipes import larger
from train.recipes import ridge


def run(laboratory: Laboratory) -> Outcome:
    """Compare the default network with one of three times its parameters and twice its steps."""
    held_out = laboratory.dataset("ridge-held-out")
    limit = envelope_limit(held_out, ridge().budget, ridge().gate_sharpness)
    rows, near = [], []
    for title, recipe, published in (
        ("default", ridge(), PUBLISHED_HEADLINE),
        ("larger", larger(), PUBLISHED_CAPACITY),
    ):
        network = laboratory.network(recipe)
        count = sum(parameter.numel() for parameter in network.parameters())
        found = compare_with_loop(laboratory.scheme(recipe), held_out)
        near.append(found["distance_near"])
        name = f"{title}: {count} parameters, {recipe.steps} steps"
        rows += comparison_rows(name, held_out.name, found, limit=limit, published=published)
    small, large = near
    overlap = "overlap" if small.low <= large.high and large.low <= small.high else "do not overlap"
    notes = (
        LIMIT_NOTE,
        f"The intervals of the near-feature improvement {overlap}: "
        f"[{small.low:+.2f}, {small.high:+.2f}] and [{large.low:+.2f}, {large.high:+.2f}]. "
        f"The limit is {limit['distance_near'].percent:+.2f} % near the feature and "
        f"{limit['distance'].percent:+.2f} % everywhere, whatever the network.",
    )
    table = Table("capacity", "A network three times as large", COLUMNS, tuple(rows))
    return Outcome((table,), notes=notes)


EXPERIMENT = Experiment(
    name="capacity",
    title="Capacity control",
    source="Paper: Capacity sweep and budget localisation, last paragraph.",
    run=run,
    seconds=30,
)
