"""The prior of old vertices beside the kernels: of rings, of curves, and at tips."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from pns_common.fused.kernels.compiled import ROWS
from pns_common.fused.kernels.vertex_prior import add_priors, add_priors_but_at_tips
from pns_common.fused.learned.curves import placed_pushes
from pns_common.fused.learned.surroundings import Surroundings
from pns_common.fused.levels.loop_points import place_vertices
from pns_common.fused.levels.loop_weights import weights_of
from pns_common.rules.scale_free_form import ScaleFreeForm


def priors_at(
    vertices: Int[np.ndarray, " N"], form: ScaleFreeForm, level: Surroundings
) -> Float[np.ndarray, "V 3"]:
    """Return D of some vertices, in rows for all."""
    rings, curves = level.rings, level.curves
    prior = np.empty_like(level.pushes)
    place_vertices(level.pushes, level.mesh, level.blocks, prior)
    of_curves = placed_pushes(curves, level.mesh, rings.valence, level.blocks)
    parts = of_curves, curves.nothing, level.prior_strengths(vertices), vertices, ROWS
    add = add_priors.over(*parts, prior)
    if form.tip_strength:
        weights, measured = weights_of(rings.valence), (rings.means, rings.fields, rings.valence)
        around = level.pushes, *measured, weights.ring, weights.further
        add = add_priors_but_at_tips.over(*parts, *around, form.tip_strength, prior)
    level.blocks.run(len(vertices), add)
    return prior
