"""The ablation table: one part of the operator taken out at a time."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from pns_common.mesh import Mesh
from pns_common.refine import refine
from pns_common.schemes import Scheme, loop, pns
from train.ablations.variants import VARIANTS, variant_recipe, variant_scheme
from train.data.datasets import Dataset
from train.data.grid import grid_faces, jittered_grid
from train.experiments.harness.experiment import Cell, Column, Experiment, Outcome, Table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.paper.methods import PAPER_UNITS, level_by_level
from train.experiments.paper.paper_values import PUBLISHED_ABLATION
from train.metrics.evaluation import compare_with_loop
from train.models.from_recipe import initial_network
from train.models.recipes import paper
from train.models.torch_model import recipe_model

LEVEL = 3
TITLES: Mapping[str, str] = MappingProxyType(
    {
        "pns": "PNS (full, trained)",
        "random": "PNS with random θ",
        "no-h2": "no h² (one power of h)",
        "no-gate": "no gate",
        "unbounded": "unbounded output",
        "unconstrained": "unconstrained MLP",
    }
)
COLUMNS = (
    Column("variant", "Variant"),
    Column("ratio_one_step", "Ratio, 1 step", ".4f"),
    Column("affine_error", "Affine error", ".1e"),
    Column("ratio_level3", "Ratio, 3 steps", ".4f"),
    Column("normal_jump_level3", "Jump, 3 steps", ".4f"),
    Column("near_percent", "Near fit %", "+.2f"),
    Column("published_ratio_one_step", "Published ratio 1", ".4f"),
    Column("published_affine_error", "Published affine", ".1e"),
    Column("published_ratio_level3", "Published ratio 3", ".4f"),
    Column("published_normal_jump", "Published jump", ".4f"),
    Column("published_near_percent", "Published fit %", "+.2f"),
)
NOTES = (
    "One-step ratio: the largest over all held-out ridges. Three steps: the largest of the levels "
    "on the first held-out ridge, with the largest normal jump of level 3. The published weights "
    "give the published numbers under exactly this reading. Affine error: the "
    "largest departure from Loop on one planar jittered patch; which patch was used for the "
    "published column is not known, so only its zeros compare.",
    "**Where this differs from the paper.** The variant called *no h² scaling* keeps one power of "
    "h: only so do the published weights give their published 4.11 and +12.97 %. All variants are "
    "trained by our recipe `paper`, so the fits differ from the published ones. The paper's text "
    "calls the fits of *no h²*, *no gate* and *unbounded* better than PNS; in the published table "
    "and in ours only *no gate* and the unconstrained network fit better. Random θ is one draw of "
    "an untrained network; its small gain or loss means nothing.",
)


def architecture_numbers(scheme: Scheme, held_out: Dataset, levels: int) -> tuple[float, ...]:
    """Return ratio after one step, affine error, ratio and normal jump after `levels` steps."""
    one_step = max(
        refine(instance.mesh, scheme, reference_length=PAPER_UNITS).ratio.max()
        for instance in held_out.instances
    )
    reports = [
        refinement.report["levels"][0]
        for refinement in level_by_level(held_out.instances[0].mesh, scheme, levels)
    ]
    return (
        float(one_step),
        affine_error(scheme),
        max(report["proximity_ratio"]["max"] for report in reports),
        reports[-1]["normal_jump_max"],
    )


def affine_error(scheme: Scheme) -> float:
    """Return the largest departure from Loop on a planar, tilted, jittered patch."""
    x, y = jittered_grid(seed=0, jitter=0.4).double().numpy().T
    mesh = Mesh(np.stack([x, y, 0.3 * x - 0.2 * y], axis=1), grid_faces())
    positions = refine(mesh, scheme, reference_length=PAPER_UNITS).mesh.vertices
    expected = refine(mesh, loop(), reference_length=PAPER_UNITS).mesh.vertices
    return float(np.linalg.norm(positions - expected, axis=1).max())


def run(laboratory: Laboratory) -> Outcome:
    """Train every variant by the same recipe and measure what each has lost."""
    held_out, recipe = laboratory.dataset("ridge-held-out"), paper()
    random = pns(recipe_model(recipe, initial_network(recipe)), recipe.budget)
    schemes = {"pns": laboratory.scheme(recipe), "random": random}
    for name, variant in VARIANTS.items():
        if name not in schemes:
            own = variant_recipe(recipe, variant)
            schemes[name] = variant_scheme(variant, laboratory.network(own, variant), own)
    rows: list[tuple[Cell, ...]] = []
    for name, title in TITLES.items():
        numbers = architecture_numbers(schemes[name], held_out, min(LEVEL, laboratory.scale.levels))
        fit = compare_with_loop(schemes[name], held_out)["distance_near"].percent
        rows.append((title, *numbers, fit, *PUBLISHED_ABLATION[name]))
    table = Table("ablation", "What each part protects", COLUMNS, tuple(rows))
    return Outcome(tables=(table,), notes=NOTES)


EXPERIMENT = Experiment(
    name="ablation",
    title="Architectural ablation",
    source="Paper: the ablation table.",
    run=run,
    seconds=55,
)
