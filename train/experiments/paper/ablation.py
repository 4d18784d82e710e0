"""The ablation table: one part of the operator taken out at a time."""

from dataclasses import dataclass

import numpy as np

from pns_common import Mesh, Scheme, loop, pns
from train.data.datasets import Dataset, grid_faces, jittered_grid
from train.experiments.harness.experiment import Experiment, Outcome, column, table
from train.experiments.harness.laboratory import Laboratory
from train.experiments.harness.variants import VARIANTS, variant_recipe, variant_scheme
from train.experiments.paper.methods import PAPER_UNITS, largest_ratio, level_by_level
from train.experiments.paper.paper_values import PUBLISHED_ABLATION
from train.metrics.card import compare_with_loop
from train.models.from_recipe import initial_network
from train.models.recipes import paper
from train.models.torch_model import recipe_model
from train.refining import figures, refine

LEVEL = 3
REMOVED_TITLES = {
    "no-h2": "no h² (one power of h)",
    "no-gate": "no gate",
    "unbounded": "unbounded output",
    "unconstrained": "unconstrained MLP",
}
TITLES = {
    "pns": "PNS (full, trained)",
    "random": "PNS with random θ",
    **REMOVED_TITLES,
}
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
    "only *no gate* and the unconstrained network fit better, in ours all but *no gate* do. Random "
    "θ is one draw of an untrained network; its small gain or loss means nothing.",
)


@dataclass(frozen=True, slots=True)
class Row:
    """One variant of the operator."""

    variant: str = column("Variant")
    ratio_one_step: float = column("Ratio, 1 step", ".4f")
    affine_error: float = column("Affine error", ".1e")
    ratio_level3: float = column("Ratio, 3 steps", ".4f")
    normal_jump_level3: float = column("Jump, 3 steps", ".4f")
    near_percent: float = column("Near fit %", "+.2f")
    published_ratio_one_step: float | None = column("Published ratio 1", ".4f")
    published_affine_error: float | None = column("Published affine", ".1e")
    published_ratio_level3: float | None = column("Published ratio 3", ".4f")
    published_normal_jump: float | None = column("Published jump", ".4f")
    published_near_percent: float | None = column("Published fit %", "+.2f")


@dataclass(frozen=True, slots=True)
class Architecture:
    """Ratio after one step, affine error; ratio and normal jump after several steps."""

    one_step: float
    affine: float
    last: float
    jump: float


def architecture_numbers(scheme: Scheme, held_out: Dataset, levels: int) -> Architecture:
    """Return what an operator's parts protect, of one step and of `levels`."""
    reports = [
        figures(refinement)[0]
        for refinement in level_by_level(held_out.instances[0].mesh, scheme, levels)
    ]
    return Architecture(
        one_step=largest_ratio(scheme, held_out),
        affine=affine_error(scheme),
        last=max(report.ratio for report in reports),
        jump=reports[-1].normal_jump,
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
    for name in TITLES:
        if name not in schemes:
            variant = VARIANTS[name]
            own = variant_recipe(recipe, variant)
            schemes[name] = variant_scheme(variant, laboratory.network(own, variant), own)
    levels = min(LEVEL, laboratory.scale.levels)
    rows = [_row(name, schemes[name], held_out, levels) for name in TITLES]
    return Outcome((table("ablation", "What each part protects", Row, rows),), notes=NOTES)


def _row(name: str, scheme: Scheme, held_out: Dataset, levels: int) -> Row:
    ours = architecture_numbers(scheme, held_out, levels)
    one_step, affine, last, jump, near = PUBLISHED_ABLATION.get(name, (None,) * 5)
    return Row(
        variant=TITLES[name],
        ratio_one_step=ours.one_step,
        affine_error=ours.affine,
        ratio_level3=ours.last,
        normal_jump_level3=ours.jump,
        near_percent=compare_with_loop(scheme, held_out)["distance_near"].percent,
        published_ratio_one_step=one_step,
        published_affine_error=affine,
        published_ratio_level3=last,
        published_normal_jump=jump,
        published_near_percent=near,
    )


EXPERIMENT = Experiment(
    name="ablation",
    title="Architectural ablation",
    source="Paper: the ablation table.",
    run=run,
    seconds=55,
)
