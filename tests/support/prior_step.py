"""A step of the default rule whose networks say nothing, on numpy arrays or on tensors."""

from dataclasses import replace

import numpy as np
import torch

from pns_common.connectivity.topology import build_topology
from pns_common.levels.step import level_step
from pns_common.rules.control_level import control_level
from pns_common.schemes import edge_operator, scale_free_form, scale_free_scheme, vertex_operator
from tests.support.networks import SCALE_FREE_CARD, scale_free_model


def prior_step(points, topology, xp, **numbers):
    """Return where the prior alone puts the vertices; ``numbers`` are the form's."""
    form, model = replace(scale_free_form(SCALE_FREE_CARD, 20.0), **numbers), scale_free_model()
    edges, vertices = (
        replace(operator(model), network=lambda rows: xp.zeros_like(rows[:, :3]))
        for operator in (edge_operator, vertex_operator)
    )
    scheme = scale_free_scheme(edges, vertices, form)
    return level_step(control_level(points, topology), scheme).points


def assert_numpy_and_torch_agree(mesh, **numbers):
    topology = build_topology(mesh.faces, len(mesh.vertices))
    ours = prior_step(mesh.vertices, topology, np, **numbers)
    theirs = prior_step(torch.tensor(mesh.vertices), topology, torch, **numbers)
    scale = max(1.0, np.abs(mesh.vertices).max())
    np.testing.assert_allclose(ours, theirs.numpy(), rtol=0, atol=1e-12 * scale)
