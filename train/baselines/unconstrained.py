"""Unconstrained network: an offset from Loop's edge vertex, from raw coordinates, with no bound.

Source: paper, Setup, baselines, and metrics; its inputs and widths are those of the published
weights. It is a control that shows what the envelope is for, and no method to use.
"""

from pns_common.schemes import Scheme
from train.ablations.variants import UNCONSTRAINED, variant_scheme
from train.models.networks import BoundedNet
from train.models.recipes import Recipe


def unconstrained(network: BoundedNet, recipe: Recipe) -> Scheme:
    """Return the scheme of a trained network; its ratios are against the recipe's C h²."""
    return variant_scheme(UNCONSTRAINED, network, recipe)
